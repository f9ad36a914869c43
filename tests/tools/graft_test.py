"""tools/graft.py on small files made here."""

import contextlib
import io
import pathlib
import tempfile
import unittest

import numpy as np
import support  # first of ours: it sets the path

import graft
import safetensors_file


def run(*arguments):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = graft.main([str(argument) for argument in arguments])
    return code, out.getvalue(), err.getvalue()


class GraftTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.out = self.folder / "out"

    def write(self, name, metadata=None, **tensors):
        path = self.folder / name
        entries = {key: safetensors_file.from_array(values) for key, values in tensors.items()}
        safetensors_file.write(str(path), entries, metadata or {})
        return path

    def test_only_equal_names_and_shapes_are_taken(self):
        base = self.write("base", {"prima_config": "{}"}, both=np.zeros(3, np.float32),
                          reshaped=np.zeros(4, np.float32), own=np.zeros(2, np.float32))
        donor = self.write("donor", {"prima_config": "other"}, both=np.ones(3, np.float16),
                           reshaped=np.ones(5, np.float32), foreign=np.ones(2, np.float32))
        code, out, err = run(base, donor, self.out)
        self.assertEqual((code, err), (0, ""))
        tensors, metadata = support.read_safetensors(self.out)
        self.assertEqual({name: values.tolist() for name, values in tensors.items()},
                         {"both": [1, 1, 1], "reshaped": [0, 0, 0, 0], "own": [0, 0]})
        self.assertEqual(tensors["both"].dtype, np.float16)
        self.assertEqual(metadata["prima_config"], "{}")
        self.assertTrue(metadata["grafted_from"].startswith("donor, SHA-256 "))
        self.assertIn("1 of 3 tensors", out)
        self.assertIn("own, reshaped", out)
        self.assertIn("foreign, reshaped", out)

    def test_networks_that_share_nothing_are_refused(self):
        code, _, err = run(self.write("base", a=np.zeros(1)), self.write("donor", b=np.zeros(1)), self.out)
        self.assertEqual(code, 1)
        self.assertIn("donor: no parameter", err)
        self.assertFalse(self.out.exists())

    def test_a_file_of_another_kind_is_named(self):
        (self.folder / "text").write_text("no tensors here")
        code, _, err = run(self.folder / "text", self.write("donor", b=np.zeros(1)), self.out)
        self.assertEqual(code, 1)
        self.assertIn("text: not a usable safetensors file", err)


if __name__ == "__main__":
    unittest.main()
