"""What decides the last bits of a label is part of its key: another processor never goes on with these tables."""

import json
import os
import unittest.mock

from e2e import Case, Scene, latest, run


class Arithmetic(Case):
    @classmethod
    def prepare(cls):
        Scene.make(cls.shared)

    def built(self, out, instructions):
        """dataset.json of a build whose LibTorch is told which instruction set to use; "" for the best."""
        scene = Scene(self.shared, self.folder)
        with unittest.mock.patch.dict(os.environ, {"ATEN_CPU_CAPABILITY": instructions} if instructions else {}):
            run(*scene.build_words(out))
        return json.loads((latest(self.folder / out) / "dataset.json").read_text())

    def test_the_instruction_set_is_in_the_key(self):
        best, plain = self.built("out", ""), self.built("out", "default")
        self.assertNotEqual(best["provenance"]["device"], plain["provenance"]["device"])
        for key in ("predict", "refine", "shards"):
            self.assertNotEqual(best["provenance"]["stage_keys"][key], plain["provenance"]["stage_keys"][key])
        self.assertEqual(len(list((self.folder / "out/stages").glob("predict-*"))), 2)

    def test_the_key_is_told_in_words(self):
        device = self.built("out", "default")["provenance"]["device"]
        self.assertRegex(device, r"\Acpu-1, .*, kernels (DEFAULT|NO AVX), (packed matrices, )?LibTorch 2\.\d+\.\d+")
