"""Runs end-to-end scripts.

    python tests/support/e2e run tests/pipeline/end_to_end.py                      every test of a script
    python tests/support/e2e run tests/pipeline/end_to_end.py EndToEnd.test_init_is_deterministic
    python tests/support/e2e list tests/pipeline/end_to_end.py                     the names of its tests, one a line

`run` takes the program from --program (default build/quadruped3d) and the library of faults from --faults. ctest runs
every test in a process of its own; they share a folder, --folder, that `prepare SCRIPT CASE` fills beforehand.
"""

import argparse
import importlib.util
import os
import pathlib
import sys
import unittest

# The package itself, instead of its folder.
sys.path[0] = str(pathlib.Path(__file__).resolve().parents[1])

ROOT = pathlib.Path(__file__).resolve().parents[3]


def load(script):
    """The module of a script."""
    spec = importlib.util.spec_from_file_location(pathlib.Path(script).stem, script)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def tests_of(suite):
    """The tests of a suite and of the suites in it."""
    for item in suite:
        if isinstance(item, unittest.TestSuite):
            yield from tests_of(item)
        else:
            yield item


def list_tests(module):
    """Prints Case.test for every test. Exits 1 when there is none, or when one could not be loaded."""
    tests = list(tests_of(unittest.defaultTestLoader.loadTestsFromModule(module)))
    for test in tests:
        print(f"{type(test).__name__}.{test._testMethodName}")
    return 0 if tests else 1


def run_tests(module, names):
    """Runs the named tests, or all, and returns the exit code."""
    outcome = unittest.main(module=module, argv=[module.__name__, *names], exit=False, verbosity=2).result
    return 0 if outcome.wasSuccessful() and outcome.testsRun > 0 else 1


def parsed():
    parser = argparse.ArgumentParser(prog="e2e", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("command", choices=("run", "list", "prepare"))
    parser.add_argument("script", type=pathlib.Path)
    parser.add_argument("names", nargs="*", metavar="CASE[.TEST]")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/quadruped3d")
    parser.add_argument("--faults", type=pathlib.Path, default=ROOT / "build/release/tests/faults/libq3d_faults.so")
    parser.add_argument("--folder", type=pathlib.Path, help="folder of one case that several processes share")
    return parser.parse_args()


def main():
    arguments = parsed()
    module = load(arguments.script)
    if arguments.command == "list":
        return list_tests(module)
    for variable, path in (("Q3D_PROGRAM", arguments.program), ("Q3D_FAULTS", arguments.faults)):
        if not path.exists():
            print(f"e2e: {path}: no such file; build it, or say where it is", file=sys.stderr)
            return 2
        os.environ[variable] = str(path.resolve())
    if arguments.command == "prepare":
        getattr(module, arguments.names[0]).prepare_in(arguments.folder)
        return 0
    if arguments.folder:
        os.environ["Q3D_E2E_FOLDER"] = str(arguments.folder)
    return run_tests(module, arguments.names)


sys.exit(main())
