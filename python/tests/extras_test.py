"""What needs a package that the build does not: pandas, mypy."""

import subprocess
import sys
import unittest

import numpy as np

from support import PACKAGE, Shards
from quadruped3d import load


class Table(Shards):
    def test_a_table_has_a_row_for_each_sample(self):
        table = load(self.shards / "jpeg.h5", table=True)
        self.assertEqual(len(table), 6)
        self.assertEqual(list(table.id), [f"jpeg/train/{i}" for i in range(6)])
        arrays = load(self.shards / "jpeg.h5")
        self.assertEqual(set(table.columns), set(arrays))
        np.testing.assert_array_equal(np.stack(table.pose), arrays["pose"])
        self.assertEqual(table.groupby("species").size().sum(), 6)


class Types(unittest.TestCase):
    def test_mypy_has_no_complaint(self):
        result = subprocess.run([sys.executable, "-m", "mypy", "--strict"], cwd=PACKAGE, capture_output=True, text=True)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)


if __name__ == "__main__":
    unittest.main()
