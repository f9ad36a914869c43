"""tools/check_wheels.py on a folder of packages made here, and on the environment that runs the tests."""

import contextlib
import importlib.metadata
import io
import pathlib
import re
import tempfile
import unittest
from unittest import mock

import support  # first of ours: it sets the path
import check_wheels
from pip._vendor.packaging.requirements import Requirement  # pip's own reader of requirements

TOOLS = pathlib.Path(support.ROOT, "tools")
LISTS = ("requirements", "requirements-tests")


class CheckWheelsTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.site = pathlib.Path(folder.name)
        patch = mock.patch("sysconfig.get_path", return_value=str(self.site))
        patch.start()
        self.addCleanup(patch.stop)
        self.requirements = self.site / "requirements.txt"
        self.requirements.write_text("# comment\nnvidia-nccl==1.5 \\\n    --hash=sha256:0\ntorch==2.0\n")
        self.install("nvidia_nccl", "1.5")
        self.install("torch", "2.0")

    def install(self, name, version):
        folder = self.site / f"{name}-{version}.dist-info"
        folder.mkdir()
        (self.site / name).mkdir(exist_ok=True)
        (self.site / name / "library.so").write_bytes(b"x" * 1000)
        metadata = f"Metadata-Version: 2.1\nName: {name.replace('_', '-')}\nVersion: {version}\n"
        (folder / "METADATA").write_text(metadata)
        (folder / "RECORD").write_text(
            f"{name}/library.so,sha256=0,1000\n"
            f"{name}/__pycache__/a.cpython-311.pyc,,\n"  # pip lists compiled modules, which may be absent
            f"{folder.name}/METADATA,sha256=0,{len(metadata)}\n"
            f"{folder.name}/RECORD,,\n"
        )

    def check(self, *options):
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            code = check_wheels.main([*options, str(self.requirements)])
        return code, out.getvalue()

    def test_whole_packages(self):
        self.assertEqual(self.check(), (0, ""))
        self.assertEqual(self.check("--forget"), (0, ""))
        self.assertEqual(self.check(), (0, ""))

    def test_half_written_packages_are_named_and_forgotten(self):
        library = self.site / "torch/library.so"
        for damage in (
            library.unlink,
            lambda: library.write_bytes(b"x" * 999),
            (self.site / "torch-2.0.dist-info/RECORD").unlink,
            lambda: (self.site / "torch-2.0.dist-info/RECORD").write_text(""),
        ):
            damage()
            self.assertEqual(self.check(), (1, "torch\n"))
            self.assertTrue((self.site / "torch-2.0.dist-info").exists())
            self.assertEqual(self.check("--forget"), (1, "torch\n"))
            self.assertFalse((self.site / "torch-2.0.dist-info").exists())
            self.assertEqual(self.check("--forget"), (0, ""))
            self.assertEqual(self.check(), (1, "torch\n"))  # absent
            self.install("torch", "2.0")
            self.assertEqual(self.check(), (0, ""))

    def test_another_version_is_not_the_pinned_one(self):
        self.requirements.write_text("torch==2.1\nnvidia-nccl==1.5\n")
        self.assertEqual(self.check(), (1, "torch\n"))
        self.assertEqual(self.check("--forget"), (0, ""))  # pip replaces it by itself

    def test_what_an_interrupted_pip_leaves_aside_is_removed(self):
        (self.site / "~orch").mkdir()
        (self.site / "~orch/library.so").write_bytes(b"x")
        self.assertEqual(self.check("--forget"), (0, ""))
        self.assertFalse((self.site / "~orch").exists())


class RequirementsTest(unittest.TestCase):
    """The lists of wheels against the .in files and against what the installed packages say that they need."""

    @classmethod
    def setUpClass(cls):
        cls.texts = {name: (TOOLS / f"{name}.txt").read_text(encoding="utf-8") for name in LISTS}
        cls.pinned = {name: check_wheels.pins(text) for name, text in cls.texts.items()}
        cls.sources = {name: check_wheels.pins((TOOLS / f"{name}.in").read_text(encoding="utf-8")) for name in LISTS}

    def test_they_pin_what_the_sources_pin(self):
        for name, source in self.sources.items():
            self.assertEqual({package: self.pinned[name][package] for package in source}, source)
        self.assertEqual(self.sources["requirements"]["torch"], "2.11.0")

    def test_no_package_is_in_both(self):
        self.assertEqual(set.intersection(*map(set, self.pinned.values())), set())

    def needed(self, names):
        """The names of these packages and of all that they need here."""
        needed, seen = set(), set()
        waiting = [(name, "") for name in names]
        while waiting:
            name, extra = entry = waiting.pop()
            if entry in seen:
                continue
            seen.add(entry)
            needed.add(name.lower().replace("_", "-"))
            for requirement in map(Requirement, importlib.metadata.requires(name) or []):
                if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
                    waiting += [(requirement.name, wanted) for wanted in ("", *requirement.extras)]
        return needed

    def test_every_package_that_is_needed_is_pinned(self):
        for_build = self.needed(self.sources["requirements"])
        self.assertGreater(len(for_build), 25)  # torch alone needs 27 on Linux
        self.assertEqual(for_build - set(self.pinned["requirements"]), set())
        for_tests = self.needed(self.sources["requirements-tests"])
        self.assertGreater(len(for_tests), 40)
        self.assertEqual(for_tests - for_build - set(self.pinned["requirements-tests"]), set())

    def test_every_python_and_machine_has_its_wheel_with_a_digest(self):
        for name, text in self.texts.items():
            without_wheel = re.findall(r"^--no-binary (\S+)$", text, re.MULTILINE)
            archives = r"((?:#   \S+\.(?:whl|tar\.gz)\n)+)"
            blocks = re.findall(archives + r"(\S+)==\S+((?: \\\n    --hash=sha256:[0-9a-f]{64})+)\n", text)
            self.assertEqual([package for _, package, _ in blocks], list(self.pinned[name]))
            for archives, package, digests in blocks:
                archives = archives.split()[1::2]
                self.assertEqual(len(archives), len(set(digests.split()[1::2])), package)
                if package in without_wheel:
                    self.assertEqual(archives, [f"{package}-{self.pinned[name][package]}.tar.gz"])
                    continue
                for minor in (11, 12):
                    for machine in ("x86_64", "aarch64"):
                        fits = [wheel for wheel in archives if suits(wheel, minor, machine)]
                        self.assertEqual(len(fits), 1, (package, minor, machine))

    def test_only_one_package_is_built_from_its_source(self):
        found = re.findall(r"^--no-binary (\S+)$", "".join(self.texts.values()), re.MULTILINE)
        self.assertEqual(found, ["jsonpath-rw"])


def suits(wheel, minor, machine):
    """True when a wheel, by its name, is for CPython 3.`minor` and this machine."""
    python, abi, platform = wheel.removesuffix(".whl").split("-")[-3:]
    if not (platform == "any" or platform.endswith(machine)):
        return False
    tags = python.split(".")
    if abi == "abi3":  # built for this CPython and all later ones
        return any(int(tag.removeprefix("cp3")) <= minor for tag in tags)
    return bool({"py3", f"py3{minor}", f"cp3{minor}"} & set(tags))


if __name__ == "__main__":
    unittest.main()
