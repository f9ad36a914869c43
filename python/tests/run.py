"""python run.py NAME: runs the tests of NAME.py for ctest.

Exit codes: 0 all passed, 1 a test failed, 77 the others passed and some were skipped since a package is not installed
(tools/requirements-extra.txt).
"""

import sys
import unittest

SKIPPED = 77

if __name__ == "__main__":
    result = unittest.TextTestRunner(verbosity=2).run(unittest.defaultTestLoader.loadTestsFromName(sys.argv[1]))
    if not result.wasSuccessful() or result.testsRun == 0:
        sys.exit(1)
    sys.exit(SKIPPED if result.skipped else 0)
