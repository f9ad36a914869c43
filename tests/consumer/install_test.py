"""The installed program and library: they work from another folder, and other projects can use them.

usage: install_test.py BUILD SOURCE   (a built build folder and the sources)
"""

import hashlib
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import h5py

BUILD, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
SHARD = SOURCE / "tests/fuzz/corpus/shard/schema_1.h5"


def run(*command, **options):
    result = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    if result.returncode != 0:
        raise AssertionError(f"{command}: exit {result.returncode}\n{result.stdout}\n{result.stderr}")
    return result.stdout


def ids_of_shard():
    with h5py.File(SHARD) as shard:
        return [name.decode() for name in shard["id"][:]]


class Installed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="q3d-install-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        run("cmake", "--install", BUILD, "--prefix", cls.folder / "first")
        cls.prefix = cls.folder / "moved"
        (cls.folder / "first").rename(cls.prefix)

    def build_consumer(self, name, *arguments):
        build = self.folder / name
        run("cmake", "-G", "Ninja", "-S", SOURCE / "tests/consumer", "-B", build, *arguments)
        run("cmake", "--build", build, "--target", "shard_reader")
        return run(build / "shard_reader", SHARD).split()

    def test_the_moved_program_runs(self):
        program = self.prefix / "bin/quadruped3d"
        self.assertRegex(run(program, "--version"), r"^quadruped3d \d+\.\d+\.\d+\n$")
        self.assertIn(ids_of_shard()[0], run(program, "inspect", SHARD, "--json"))

    def test_completions_and_the_manual_page_lie_where_shells_and_man_look(self):
        for file, beginning in (("bash-completion/completions/quadruped3d", "# bash completion"),
                                ("zsh/site-functions/_quadruped3d", "#compdef quadruped3d"),
                                ("fish/vendor_completions.d/quadruped3d.fish", "# fish completion"),
                                ("man/man1/quadruped3d.1", ".\\\"")):
            text = (self.prefix / "share" / file).read_text()
            self.assertTrue(text.startswith(beginning), text[:40])
            self.assertIn("evaluate", text)

    def test_the_bill_of_materials_lists_what_is_installed_and_linked(self):
        document = json.loads((self.prefix / "share/quadruped3d/quadruped3d.spdx.json").read_text())
        self.assertEqual((document["spdxVersion"], document["dataLicense"]), ("SPDX-2.3", "CC0-1.0"))
        self.assertEqual(document["SPDXID"], "SPDXRef-DOCUMENT")
        self.assertRegex(document["creationInfo"]["created"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ$")
        elements = {each["SPDXID"]: each for each in (*document["packages"], *document["files"])}
        self.assertEqual(len(elements), len(document["packages"]) + len(document["files"]), "every id is there once")
        for identifier in elements:
            self.assertRegex(identifier, r"^SPDXRef-[A-Za-z0-9.-]+$")
        for relation in document["relationships"]:
            for end in ("spdxElementId", "relatedSpdxElement"):
                self.assertIn(relation[end], {"SPDXRef-DOCUMENT", *elements})
        files = {each["fileName"]: each["checksums"][0]["checksumValue"] for each in document["files"]}
        installed = ["bin/quadruped3d", "libexec/quadruped3d/quadruped3d-network"]
        installed += [str(path.relative_to(self.prefix)) for path in self.prefix.glob("share/quadruped3d/models/*.safetensors")]
        for name in installed:
            self.assertEqual(files["./" + name], hashlib.sha256((self.prefix / name).read_bytes()).hexdigest(), name)
        self.assertIn("./embedded/plotly.min.js", files)
        names = {each["name"]: each for each in document["packages"]}
        pins = dict(re.findall(r"^([\w.-]+)==(\S+)", (SOURCE / "tools/requirements.txt").read_text(), re.M))
        for name, version in pins.items():
            self.assertEqual(names[name]["versionInfo"], version)
            self.assertTrue(names[name]["checksums"])
        for library in ("libhdf5_serial", "libopencv_core", "libtbb", "libcrypto", "libembree"):
            path = re.search(rf"=> (/\S*{library}\S*) ", run("ldd", self.prefix / installed[1]))[1]
            owner = run("dpkg", "-S", pathlib.Path(path).resolve()).split(":")[0]
            self.assertEqual(names[owner]["versionInfo"], run("dpkg-query", "-W", "-f", "${Version}", owner))

    def test_no_program_looks_for_libraries_by_an_absolute_path(self):
        for program in (self.prefix / "bin/quadruped3d", self.prefix / "libexec/quadruped3d/quadruped3d-network"):
            for path in re.findall(r"(?:RUNPATH|RPATH).*\[(.*)\]", run("readelf", "-d", program)):
                for part in path.split(":"):
                    self.assertTrue(part.startswith("$ORIGIN"), f"{program.name}: {path}")

    def test_no_text_file_holds_a_path_of_the_build(self):
        for file in self.prefix.rglob("*"):
            if file.suffix in {".cmake", ".h", ".json", ".md", ".cff"}:
                text = file.read_text()
                for path in (str(BUILD), str(SOURCE), str(self.folder / "first")):
                    self.assertNotIn(path, text, file)

    def test_the_moved_network_program_finds_the_libtorch_that_is_put_beside_it(self):
        torch = self.prefix / "lib/quadruped3d/torch"
        torch.parent.mkdir(parents=True, exist_ok=True)
        cache = (BUILD / "CMakeCache.txt").read_text()
        torch.symlink_to(re.search(r"^LIBTORCH_ROOT:PATH=(.*)$", cache, re.M).group(1))
        out = self.folder / "tiny.safetensors"
        run(self.prefix / "bin/quadruped3d", "init", "--size", "tiny", "--out", out)
        self.assertGreater(out.stat().st_size, 1000)

    def test_a_project_finds_the_package_and_reads_a_shard(self):
        self.assertEqual(self.build_consumer("found", f"-DCMAKE_PREFIX_PATH={self.prefix}"), ids_of_shard())

    def test_a_project_takes_the_sources_as_a_subfolder_and_reads_a_shard(self):
        self.assertEqual(self.build_consumer("subfolder", f"-DQUADRUPED3D_SOURCE={SOURCE}"), ids_of_shard())


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v"])
