"""python run.py NAME: runs the tests of NAME.py for ctest.

Exit codes: 0 all passed, 1 a test failed or was skipped, or a package that the tests need is not installed.
"""

import pathlib
import subprocess
import sys
import unittest

TOOLS = pathlib.Path(__file__).resolve().parents[2] / "tools"


def missing_packages():
    """The names of the packages of tools/requirements-tests.txt that are not installed as they are pinned there."""
    command = [sys.executable, TOOLS / "check_wheels.py", TOOLS / "requirements-tests.txt"]
    return subprocess.run(command, capture_output=True, text=True).stdout.split()


if __name__ == "__main__":
    if missing := missing_packages():
        sys.exit(f"These packages, which the tests need, are absent, incomplete or of another version than the pinned "
                 f"one: {', '.join(missing)}. Run: make test-wheels")
    result = unittest.TextTestRunner(verbosity=2).run(unittest.defaultTestLoader.loadTestsFromName(sys.argv[1]))
    sys.exit(0 if result.wasSuccessful() and result.testsRun > 0 and not result.skipped else 1)
