"""The example as a user runs it, and the package as pip installs it."""

import os
import re
import subprocess
import sys
import unittest

from support import PACKAGE, REPOSITORY, Folder, Shards


class Example(Shards):
    def test_it_trains(self):
        script = PACKAGE / "examples" / "train.py"
        result = subprocess.run([sys.executable, script, self.shards], capture_output=True, text=True,
                                env={**os.environ, "PYTHONPATH": str(PACKAGE)})
        self.assertEqual(result.returncode, 0, result.stderr)
        errors = [float(error) for error in re.findall(r"epoch \d: .* ([0-9.]+) crop sides", result.stdout)]
        self.assertEqual(len(errors), 2)
        self.assertTrue(all(0 < error < 5 for error in errors), errors)


class Version(Folder):
    def test_it_is_the_projects(self):
        project = re.search(r"project\(quadruped3d VERSION ([0-9.]+)", (REPOSITORY / "CMakeLists.txt").read_text())
        import quadruped3d

        self.assertEqual(quadruped3d.__version__, project.group(1))

    def test_numbers_are_read_without_torch_opencv_or_pandas(self):
        program = (
            "import sys\n"
            "for name in ('torch', 'cv2', 'pandas', 'pyarrow', 'PIL'): sys.modules[name] = None\n"
            "import quadruped3d\n"
            f"print(quadruped3d.load({str(REPOSITORY / 'tests/data/shards/schema_1.h5')!r})['pose'].shape)\n"
        )
        result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True,
                                env={**os.environ, "PYTHONPATH": str(PACKAGE)})
        self.assertEqual((result.stdout, result.stderr), ("(3, 35, 3, 3)\n", ""))


if __name__ == "__main__":
    unittest.main()
