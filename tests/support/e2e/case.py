"""Test cases that share an expensive folder, whether they run in one process or in a process each."""

import os
import pathlib
import shutil
import tempfile
import unittest

from .datasets import copy_folder

# This file says that prepare() has finished.
_READY = "ready"


class Case(unittest.TestCase):
    """Tests that share a folder.

    A subclass fills `cls.shared` in prepare(), which is called once: in ctest by an entry of its own, otherwise by the
    first test. recall() then reads from it what the tests need; it is called once in every process.

    A test writes only into `self.folder`, which is empty when the test begins. So the tests of a case can run side by
    side, in any order, and again. A test that builds on in a shared output folder takes a copy, see copy_of().
    """

    @classmethod
    def prepare(cls):
        """Fills cls.shared."""

    @classmethod
    def recall(cls):
        """Reads what the tests need from cls.shared into attributes of the class."""

    @classmethod
    def setUpClass(cls):
        given = os.environ.get("Q3D_E2E_FOLDER")
        if given:
            cls._open(pathlib.Path(given))
            if not (cls._home / _READY).exists():
                raise AssertionError(f"{cls._home}: not prepared; run the entry `prepare` of this case first")
        else:
            home = tempfile.mkdtemp(prefix="q3d_e2e_")
            cls.addClassCleanup(shutil.rmtree, home)
            cls._open(pathlib.Path(home))
            cls.prepare()
        cls.recall()

    @classmethod
    def prepare_in(cls, home):
        """Calls prepare() for a folder that later processes use; what was there goes."""
        cls._open(pathlib.Path(home))
        shutil.rmtree(cls._home, ignore_errors=True)
        cls.shared.mkdir(parents=True)
        cls.prepare()
        (cls._home / _READY).touch()

    @classmethod
    def _open(cls, home):
        cls._home = home.resolve()
        cls.shared = cls._home / "shared"
        cls.shared.mkdir(exist_ok=True, parents=True)

    def setUp(self):
        self.folder = self._home / self._testMethodName
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir()

    def copy_of(self, name):
        """A copy of a shared folder, in this test's own folder."""
        return copy_folder(self.shared / name, self.folder / name)
