"""Runs tools/setup.sh in a folder of its own, with stand-ins for the commands that would change this machine.

PATH holds the stand-ins and the harmless tools that the script uses, nothing else. A stand-in notes how it was called
and does what the test's rules say.
"""

import dataclasses
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import tempfile
import unittest

import support  # first of ours: it sets the path

STAND_INS = "apt-cache apt-get dpkg dpkg-query id python3 sleep sudo".split()
HARMLESS = "awk bash comm cp cut date dirname env grep head mkdir readlink rm sed sha256sum sort tail touch uname wc"
HARMLESS = HARMLESS.split()
PACKAGES = ["cmake", "libhdf5-dev", "ninja-build"]
REQUIREMENTS = """# CPython 3.11, 3.12 on Linux (aarch64, x86_64)
numpy==2.0 \\
    --hash=sha256:00
torch==2.0 \\
    --hash=sha256:01
"""
TEST_REQUIREMENTS = REQUIREMENTS.replace("numpy", "pandas").replace("torch", "pyarrow")
LIBTORCH = ".venv/lib/python3.11/site-packages/torch/lib/libtorch_cpu.so"
UPGRADE = """Inst libcurl4 [7.1-1] (7.1-2 Debian-Security:12 [amd64])
Inst libcurl4-openssl-dev (7.1-2 Debian-Security:12 [amd64])
Inst libhdf5-dev (1.10 Debian:12 [amd64])
Conf libhdf5-dev (1.10 Debian:12 [amd64])"""
LOCKED = "E: Could not get lock /var/lib/dpkg/lock-frontend. It is held by process 4711 (unattended-upgr)"

STAND_IN = r"""#!/usr/bin/env bash
call="${0##*/} $*"
echo "$call" >>HOME/calls
for rule in HOME/rules/*; do
  times=$(<"$rule/times")
  if [ "$times" -gt 0 ] && [[ $call =~ $(<"$rule/call") ]]; then
    echo $((times - 1)) >"$rule/times"
    . "$rule/action"
    exit "$(<"$rule/code")"
  fi
done
"""


@dataclasses.dataclass
class Rule:
    """What a stand-in does the first `times` times that it is called with words that match `call`."""

    call: str  # a POSIX regular expression
    out: str = ""
    code: int = 0
    times: int = 1000
    writes: dict = dataclasses.field(default_factory=dict)  # path -> text
    removes: str = ""

    def save(self, folder):
        """Writes the form that the stand-ins read."""
        folder.mkdir(parents=True)
        action = ["mkdir -p '%s'; cp '%s' '%s'" % (os.path.dirname(path), folder / f"file{i}", path)
                  for i, path in enumerate(self.writes)]  # fmt: skip
        action += [f"rm '{self.removes}'"] if self.removes else []
        action += [f"printf '%s\\n' {shlex.quote(self.out)}"] if self.out else []
        for i, text in enumerate(self.writes.values()):
            (folder / f"file{i}").write_text(text)
            (folder / f"file{i}").chmod(0o755)
        for name, value in (("call", self.call), ("code", self.code), ("times", self.times)):
            (folder / name).write_text(str(value))
        (folder / "action").write_text("\n".join(action) + "\n")


class SetupCase(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.home = pathlib.Path(folder.name)
        (self.home / "bin").mkdir()
        (self.home / "dpkg" / "updates").mkdir(parents=True)
        (self.home / "tools").mkdir()
        for name in HARMLESS:
            (self.home / "bin" / name).symlink_to(shutil.which(name))
        self.stand_in = STAND_IN.replace("HOME", str(self.home))
        for name in STAND_INS:
            self.write(f"bin/{name}", self.stand_in)
        shutil.copy(os.path.join(support.ROOT, "tools", "setup.sh"), self.home / "tools")
        self.write("tools/debian-packages.txt", "\n".join(PACKAGES) + "\n")
        self.write("tools/requirements.txt", REQUIREMENTS)
        self.write("tools/requirements-tests.txt", TEST_REQUIREMENTS)
        self.python = [
            Rule("^python3 -c", out="3.11"),
            Rule("^python3 -m venv .venv$", writes={".venv/bin/python": self.stand_in}),
            Rule("^python -m pip install", writes={LIBTORCH: ""}),
            Rule("^python tools/check_wheels.py tools/requirements.txt$", out="numpy\ntorch", code=1, times=1),
        ]

    def write(self, path, text):
        path = self.home / path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        path.chmod(0o755)

    def installed(self, *names, others=""):
        """The rule for dpkg-query that names installed packages."""
        return Rule("^dpkg-query", out="\n".join(f"ii  {name}" for name in names) + "\n" + others)

    def run_setup(self, rules, *options, user="0", stdin=subprocess.DEVNULL):
        """(exit code, messages). Afterwards self.calls has the calls of stand-ins, without the questions to dpkg-query
        and id."""
        rules = [*rules, Rule("^id -u$", out=user), *self.python]
        shutil.rmtree(self.home / "rules", ignore_errors=True)
        for i, rule in enumerate(rules):
            rule.save(self.home / "rules" / f"{i:02}")
        (self.home / "calls").write_text("")
        environment = {"PATH": str(self.home / "bin"), "DPKG_ADMINDIR": str(self.home / "dpkg")}
        environment |= {"SETUP_LOCK_WAIT_S": "20", "SETUP_LOCK_POLL_S": "5"}
        result = subprocess.run(
            ["bash", self.home / "tools" / "setup.sh", *options],
            env=environment, stdin=stdin, capture_output=True, text=True,
        )  # fmt: skip
        calls = (self.home / "calls").read_text().splitlines()
        self.calls = [call for call in calls if not re.match("dpkg-query|id ", call)]
        self.assertEqual(result.stdout, "")
        return result.returncode, result.stderr

    def called(self, pattern):
        return [call for call in self.calls if re.search(pattern, call)]

    def make_whole_venv(self):
        self.assertEqual(self.run_setup([self.installed(*PACKAGES)])[0], 0)
