"""tools/check_wheels.py on a folder of packages made here, and on the environment that runs the tests."""

import contextlib
import importlib.metadata
import io
import os
import pathlib
import re
import tempfile
import unittest
from unittest import mock

import support  # first of ours: it sets the path
import check_wheels
from pip._vendor.packaging.requirements import Requirement  # pip's own reader of requirements

REQUIREMENTS = os.path.join(support.ROOT, "tools", "requirements.txt")


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
    """tools/requirements.txt against requirements.in and against what the installed packages say that they need."""

    @classmethod
    def setUpClass(cls):
        with open(REQUIREMENTS, encoding="utf-8") as file:
            cls.text = file.read()
        cls.pinned = check_wheels.pins(cls.text)

    def test_it_pins_what_the_source_pins(self):
        with open(REQUIREMENTS.replace(".txt", ".in"), encoding="utf-8") as file:
            source = check_wheels.pins(file.read())
        self.assertEqual({name: self.pinned[name] for name in source}, source)
        self.assertEqual(source["torch"], "2.11.0")

    def test_every_package_that_is_needed_is_pinned(self):
        needed, seen = set(), set()
        waiting = [(name, "") for name in ("torch", "numpy", "h5py", "pillow")]
        while waiting:
            name, extra = entry = waiting.pop()
            if entry in seen:
                continue
            seen.add(entry)
            needed.add(name.lower().replace("_", "-"))
            for requirement in map(Requirement, importlib.metadata.requires(name) or []):
                if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
                    waiting += [(requirement.name, wanted) for wanted in ("", *requirement.extras)]
        self.assertGreater(len(needed), 25)  # torch alone needs 27 on Linux
        self.assertEqual(needed - set(self.pinned), set())

    def test_every_python_and_machine_has_its_wheel_with_a_digest(self):
        blocks = re.findall(r"((?:#   \S+\.whl\n)+)(\S+)==\S+((?: \\\n    --hash=sha256:[0-9a-f]{64})+)\n", self.text)
        self.assertEqual([name for _, name, _ in blocks], list(self.pinned))
        for wheels, name, digests in blocks:
            wheels = wheels.split()[1::2]
            self.assertEqual(len(wheels), len(set(digests.split()[1::2])), name)
            for tag in ("cp311", "cp312"):
                for machine in ("x86_64", "aarch64"):
                    fits = [w for w in wheels if re.search(f"-({tag}|py3|py2.py3)-.*({machine}|any).whl$", w)]
                    self.assertEqual(len(fits), 1, (name, tag, machine))


if __name__ == "__main__":
    unittest.main()
