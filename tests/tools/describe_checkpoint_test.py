"""tools/describe_checkpoint.py: the quantiles, the metadata, and everything else of the file as it was."""

import contextlib
import csv
import io
import json
import pathlib
import tempfile
import unittest

import numpy as np

import support  # noqa: F401  sets the path
import describe_checkpoint
import safetensors_file

WORDS = ["--pictures", "rendered", "--trained-on", "the world"]


class DescribeCheckpoint(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = pathlib.Path(scratch.name)
        self.checkpoint = self.folder / "c.safetensors"
        self.values = np.arange(12, dtype=np.float32).reshape(3, 4)
        safetensors_file.write(str(self.checkpoint), {"a.weight": safetensors_file.from_array(self.values)},
                               {"prima_config": "{}"})

    def write_samples(self, errors):
        with open(self.folder / "samples.csv", "w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["id", "setting", "l_proj"])
            for i, error in enumerate(errors):
                rows.writerow([i, "prediction", error])
                rows.writerow([i, "tta 30", 0.0])
            rows.writerow(["without keypoints", "prediction", ""])

    def describe(self, *more):
        with contextlib.redirect_stdout(io.StringIO()):
            describe_checkpoint.main([str(self.checkpoint), str(self.checkpoint), *WORDS, *more])
        tensors, metadata = safetensors_file.read(str(self.checkpoint))
        self.assertEqual(metadata["prima_config"], "{}")
        np.testing.assert_array_equal(np.frombuffer(b"".join(tensors["a.weight"].chunks()), np.float32),
                                      self.values.ravel())
        return json.loads(metadata["prima_domain"])

    def test_quantiles_of_the_predictions(self):
        self.write_samples([i / 100 for i in range(101)])  # the quantile at share s is s
        described = self.describe("--evaluation", str(self.folder), "--held-out", "its tests")
        self.assertEqual(described["pictures"], "rendered")
        self.assertEqual(described["held_out"], {"what": "its tests", "pictures": 101, "l_proj": {
            "0.05": 0.05, "0.25": 0.25, "0.5": 0.5, "0.75": 0.75, "0.95": 0.95}})

    def test_without_an_evaluation_there_are_no_quantiles(self):
        self.assertEqual(self.describe(), {"pictures": "rendered", "trained_on": "the world"})

    def test_too_few_predictions_are_refused(self):
        self.write_samples([0.1] * 19)
        with self.assertRaisesRegex(SystemExit, "L_proj of 19 predictions"):
            self.describe("--evaluation", str(self.folder), "--held-out", "its tests")


if __name__ == "__main__":
    unittest.main()
