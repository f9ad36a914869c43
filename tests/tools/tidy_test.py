"""tools/tidy.sh on a small repository, with a stand-in for clang-tidy that finds the word BAD."""

import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

TOOLS = pathlib.Path(__file__).resolve().parents[2] / "tools"

STAND_IN = """#!/usr/bin/env python3
import json, pathlib, sys
root = pathlib.Path(ROOT)
if "--version" in sys.argv:
    print("stand-in 14")
    sys.exit(0)
source = pathlib.Path(sys.argv[-1])
database = json.loads(pathlib.Path(sys.argv[sys.argv.index("-p") + 1], "compile_commands.json").read_text())
command = next(entry["arguments"] for entry in database if entry["file"] == str(source))
with (root / "calls.txt").open("a") as calls:
    calls.write(source.name + " " + " ".join(command) + chr(10))
files = [source] + [root / line.split('"')[1] for line in source.read_text().splitlines() if line.startswith("#include")]
found = False
for file in files:
    for number, line in enumerate(file.read_text().splitlines(), 1):
        if "BAD" in line:
            found = True
            print(f"{file}:{number}:1: error: this is bad [a-check,-warnings-as-errors]")
            print(line)
print("27449 warnings generated.", file=sys.stderr)
sys.exit(1 if found else 0)
"""


class Tidy(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.root = pathlib.Path(scratch.name).resolve() / "clone"
        (self.root / "tools").mkdir(parents=True)
        for name in ("tidy.sh", "tidy.py"):
            shutil.copy(TOOLS / name, self.root / "tools" / name)
        self.program = self.root / "clang-tidy"
        self.program.write_text(STAND_IN.replace("ROOT", repr(str(self.root)), 1))
        self.program.chmod(0o755)
        self.write(".clang-tidy", "Checks: -*\n")
        self.write(".gitignore", "/build/\n/calls.txt\n/cache/\n")
        self.write("a/x.h", "int x();\n")
        self.write("a/x.cpp", '#include "a/x.h"\nint x() { return 1; }\n')
        self.write("a/y.cpp", '#include "a/x.h"\nint y() { return x(); }\n')
        flags = ["-Werror", "-fno-tree-slp-vectorize", f"-I{self.root}/build/release/include/q3d_a", "-Winvalid-pch",
                 "-include", "/somewhere/cmake_pch.hxx", "-std=c++20"]
        self.write("build/release/compile_commands.json", json.dumps([
            {"directory": str(self.root / "build/release"), "file": str(self.root / "a" / name),
             "command": " ".join(["/usr/bin/ccache", "/usr/bin/c++", *flags, "-c", str(self.root / "a" / name)])}
            for name in ("x.cpp", "y.cpp", "z.cpp")] + [
            {"directory": str(self.root), "file": str(self.root / "a/c.c"), "command": "/usr/bin/cc -c a/c.c"}]))
        self.git("init", "--quiet", "--initial-branch=main")
        self.commit()

    def write(self, name, text):
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def git(self, *arguments):
        subprocess.run(["git", "-c", "user.name=t", "-c", "user.email=t@example.org", *arguments], cwd=self.root,
                       check=True, capture_output=True)

    def commit(self):
        self.git("add", "--all")
        self.git("commit", "--quiet", "--message", "x")

    def tidy(self, *arguments):
        """Exit code, what was printed, and the names of the sources that clang-tidy was run on."""
        (self.root / "calls.txt").write_text("")
        environment = {**os.environ, "CLANG_TIDY": str(self.program), "XDG_CACHE_HOME": str(self.root / "cache")}
        environment.pop("BUILD", None)
        done = subprocess.run([str(self.root / "tools/tidy.sh"), *arguments], cwd=self.root, env=environment,
                              capture_output=True, text=True)
        self.calls = (self.root / "calls.txt").read_text().splitlines()
        return done.returncode, done.stdout, sorted(call.split()[0] for call in self.calls)

    def test_a_finding_in_a_header_is_printed_once(self):
        self.write("a/x.h", "int x();  // BAD\n")
        code, printed, sources = self.tidy("--all")
        self.assertEqual((code, sources), (1, ["x.cpp", "y.cpp"]))
        self.assertEqual(printed, "a/x.h:1:1: error: this is bad [a-check,-warnings-as-errors]\nint x();  // BAD\n")

    def test_only_what_changed_is_checked(self):
        self.write("a/y.cpp", '#include "a/x.h"\nint y() { return 2; }\n')
        self.assertEqual(self.tidy("HEAD"), (0, "", ["y.cpp"]))
        self.commit()
        self.write("a/y.cpp", '#include "a/x.h"\nint y() { return 3; }\n')
        self.assertEqual(self.tidy("HEAD~1")[2], ["y.cpp"])
        self.assertEqual(self.tidy("a/x.cpp")[2], ["x.cpp"])

    def test_the_default_base_is_the_merge_base_with_origin_main(self):
        self.git("update-ref", "refs/remotes/origin/main", "HEAD")
        self.write("a/y.cpp", '#include "a/x.h"\nint y() { return 2; }\n')
        self.commit()
        self.write("README.md", "text\n")
        self.commit()
        self.assertEqual(self.tidy()[2], ["y.cpp"])
        self.git("update-ref", "refs/remotes/origin/main", "HEAD")
        self.assertEqual(self.tidy()[2], [])  # HEAD~1 changed the page alone

    def test_a_changed_header_is_checked_through_the_source_beside_it(self):
        self.write("a/x.h", "int x(); // changed\n")
        self.assertEqual(self.tidy("HEAD")[2], ["x.cpp"])

    def test_a_file_that_was_only_moved_is_left_out(self):
        self.git("mv", "a/y.cpp", "a/z.cpp")
        self.commit()
        self.assertEqual(self.tidy("HEAD~1"), (0, "", []))

    def test_what_was_clean_is_not_checked_again_until_a_header_changes(self):
        self.assertEqual(self.tidy("--all")[2], ["x.cpp", "y.cpp"])
        self.assertEqual(self.tidy("--all"), (0, "", []))
        self.write("a/x.h", "int x(); // BAD\n")
        self.assertEqual(self.tidy("--all")[2], ["x.cpp", "y.cpp"])
        self.assertEqual(self.tidy("--all")[2], ["x.cpp", "y.cpp"])  # findings are not remembered
        self.write("a/x.h", "int x();\n")
        self.write(".clang-tidy", "Checks: '*'\n")
        self.assertEqual(self.tidy("--all")[2], ["x.cpp", "y.cpp"])

    def test_clang_gets_no_flag_that_only_gcc_knows(self):
        self.tidy("a/x.cpp")
        words = self.calls[0].split()[1:]
        self.assertEqual(words[:2], ["/usr/bin/c++", f"-I{self.root}"])
        self.assertEqual(words[2:], ["-std=c++20", "-c", str(self.root / "a/x.cpp")])

    def test_wrong_calls_are_told(self):
        self.assertEqual(self.tidy("nothing")[0], 2)
        (self.root / "build/release/compile_commands.json").unlink()
        self.assertEqual(self.tidy("--all")[0], 2)

    def test_a_crash_is_no_clean_source(self):
        self.program.write_text("#!/bin/sh\n[ \"$1\" = --version ] && exit 0\nexit 139\n")
        self.assertEqual(self.tidy("a/x.cpp")[0], 1)


if __name__ == "__main__":
    unittest.main()
