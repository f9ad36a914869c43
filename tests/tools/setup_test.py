"""tools/setup.sh in a folder of its own, with stand-ins for the commands that would change this machine.

PATH holds the stand-ins and the harmless tools that the script uses, nothing else. A stand-in notes how it was called
and does what the test's rules say.
"""

import dataclasses
import os
import pathlib
import pty
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


class PackagesTest(SetupCase):
    def setUp(self):
        super().setUp()
        self.make_whole_venv()

    def test_missing_packages_are_installed_and_nothing_else(self):
        rules = [
            Rule("^dpkg-query", out="ii  cmake\nii  ninja-build", times=3),
            self.installed(*PACKAGES),
            Rule("^apt-get .*-s libhdf5", out="Inst libaec (1 Debian:12 [amd64])\nInst libhdf5-dev (2 Debian [amd64])"),
            Rule("^apt-get .*--print-uris", out="'http://a/b.deb' b.deb 3000000 x\n'http://a/c.deb' c.deb 4000000 y"),
            Rule("^apt-get install", out="Unpacking\n" * 348),
        ]
        code, messages = self.run_setup(rules)
        self.assertEqual(code, 0, messages)
        self.assertEqual(len(messages.splitlines()), 2, messages)
        self.assertIn("packages to install: 1 and 1 that they depend on, 7 MB to download (libhdf5-dev)", messages)
        *_, install = self.called("^apt-get")
        for option in ("-y", "--no-upgrade", "--no-remove", "--no-install-recommends"):
            self.assertIn(f" {option} ", install)
        self.assertEqual(install.split()[-1], "libhdf5-dev")
        self.assertEqual(self.calls[0], "apt-get update -q")
        self.assertEqual(self.called("^python|^sudo|configure"), [])
        self.assertEqual((self.home / "build/setup.log").read_text().count("Unpacking"), 348)

    def test_a_second_run_calls_nothing(self):
        self.assertEqual(self.run_setup([self.installed(*PACKAGES)]), (0, ""))
        self.assertEqual(self.calls, [])

    def test_a_package_that_was_removed_but_left_its_settings_is_missing(self):
        rules = [self.installed("cmake", "ninja-build", others="rc  libhdf5-dev"), Rule("-s libhdf5-dev$", code=100)]
        self.assertEqual(self.run_setup(rules)[0], 1)
        self.assertEqual(self.called("configure"), [])

    def test_apt_that_fails(self):
        missing = self.installed("cmake", "ninja-build")
        unknown = "E: Unable to locate package libhdf5-dev"
        for rules, mentions in (
            ([Rule("^apt-get update", out="E: no route to deb.debian.org", code=100)],
             ("| E: no route to deb.debian.org", "apt-get update", "Check the network")),
            ([Rule("^apt-get install .*-s", out=unknown, code=100)],
             ("apt cannot install these Debian packages: libhdf5-dev", "another name")),
            ([Rule("^apt-get install .*-s"), Rule("--print-uris"),
              Rule("^apt-get install", out="dpkg: error processing archive", code=100)],
             ("| dpkg: error processing archive", "could not install", "run make setup again")),
            ([], ("reported success, but these are not installed: libhdf5-dev",)),
        ):  # fmt: skip
            with self.subTest(mentions=mentions):
                code, messages = self.run_setup([missing, *rules])
                self.assertEqual(code, 1)
                for mention in ("the last lines of build/setup.log", *mentions):
                    self.assertIn(mention, messages)


class UpgradeTest(SetupCase):
    def setUp(self):
        super().setUp()
        self.make_whole_venv()
        self.rules = [Rule("^dpkg-query", out="ii  cmake\nii  ninja-build", times=3), self.installed(*PACKAGES)]

    def test_without_a_terminal_only_what_is_needed_is_upgraded_and_named(self):
        rules = [*self.rules, Rule("^apt-get .*-s libhdf5-dev$", out=UPGRADE)]
        code, messages = self.run_setup(rules)
        self.assertEqual(code, 0, messages)
        self.assertIn("  libcurl4 7.1-1 -> 7.1-2\n", messages)
        self.assertIn("no terminal to ask at", messages)

    def test_an_upgrade_can_be_refused(self):
        rules = [*self.rules, Rule("^apt-get .*-s libhdf5-dev$", out=UPGRADE)]
        code, messages = self.run_setup(rules, "--no-upgrades")
        self.assertEqual(code, 1)
        self.assertIn("  libcurl4 7.1-1 -> 7.1-2\n", messages)
        self.assertIn("make setup ALLOW_UPGRADES=1", messages)
        self.assertEqual(self.called("^apt-get install(?!.* -s )"), [])

    def test_consent_by_option(self):
        rules = [*self.rules, Rule("^apt-get .*-s libhdf5-dev$", out=UPGRADE)]
        code, messages = self.run_setup(rules, "--allow-upgrades")
        self.assertEqual(code, 0, messages)
        self.assertIn("  libcurl4 7.1-1 -> 7.1-2\n", messages)
        self.assertEqual(len(self.called("^apt-get install.* libhdf5-dev$")), 3)  # simulated, sizes, done

    def test_consent_at_the_terminal(self):
        for answer, expected in (("yes", 0), ("y", 0), ("n", 1), ("", 1)):
            with self.subTest(answer=answer):
                ours, theirs = pty.openpty()
                os.write(ours, answer.encode() + b"\n")
                rules = [*self.rules, Rule("^apt-get .*-s libhdf5-dev$", out=UPGRADE)]
                code, _ = self.run_setup(rules, stdin=theirs)
                os.close(ours)
                os.close(theirs)
                self.assertEqual(code, expected)

    def test_the_version_that_fits_the_installed_library_is_preferred(self):
        madison = " libcurl4-openssl-dev | 7.1-2 | http://x security\n libcurl4-openssl-dev | 7.1-1 | http://x main"
        fits = "Inst libcurl4-openssl-dev (7.1-1 Debian:12 [amd64])\nInst libhdf5-dev (1.10 Debian:12 [amd64])"
        rules = [
            *self.rules,
            Rule("^apt-get .*-s libhdf5-dev$", out=UPGRADE),
            Rule("^apt-get .*-s libhdf5-dev libcurl4-openssl-dev=7.1-1$", out=fits),
            Rule("^apt-cache madison libcurl4-openssl-dev$", out=madison),
        ]
        code, messages = self.run_setup(rules)
        self.assertEqual(code, 0, messages)
        self.assertNotIn("upgrade", messages)
        self.assertTrue(self.calls[-1].endswith(" libhdf5-dev libcurl4-openssl-dev=7.1-1"), self.calls[-1])

    def test_versions_that_do_not_fit_together_are_not_forced(self):
        rules = [
            *self.rules,
            Rule("^apt-get .*-s libhdf5-dev$", out=UPGRADE),
            Rule("^apt-get .*-s libhdf5-dev libcurl4-openssl-dev=7.1-1$", code=100),
            Rule("^apt-cache madison", out=" libcurl4-openssl-dev | 7.1-1 | http://x main"),
        ]
        code, messages = self.run_setup(rules, "--no-upgrades")
        self.assertEqual(code, 1)
        self.assertIn("libcurl4 7.1-1 -> 7.1-2", messages)


class RootTest(SetupCase):
    def setUp(self):
        super().setUp()
        self.make_whole_venv()

    def test_without_sudo_the_commands_are_shown(self):
        (self.home / "bin/sudo").unlink()
        code, messages = self.run_setup([self.installed("cmake")], user="1000")
        self.assertEqual(code, 1)
        self.assertIn("cannot install them: libhdf5-dev ninja-build", messages)
        command = "apt-get update && apt-get install --no-install-recommends --no-upgrade libhdf5-dev ninja-build"
        self.assertIn(command, messages)
        self.assertEqual(self.calls, [])

    def test_sudo_that_refuses(self):
        code, messages = self.run_setup([self.installed("cmake"), Rule("^sudo", code=1)], user="1000")
        self.assertEqual((code, self.calls), (1, ["sudo -n true"]))
        self.assertIn("Ask an administrator", messages)

    def test_sudo_that_works(self):
        rules = [Rule("^dpkg-query", out="ii  cmake\nii  ninja-build", times=3), self.installed(*PACKAGES)]
        self.assertEqual(self.run_setup(rules, user="1000")[0], 0)
        changes = self.called("^sudo env")
        self.assertEqual(len(changes), 2)
        self.assertIn("apt-get update", changes[0])
        self.assertIn("apt-get install", changes[1])

    def test_python_only_leaves_the_packages_alone(self):
        self.assertEqual(self.run_setup([self.installed()], "--python-only", user="1000"), (0, ""))
        self.assertEqual(self.calls, [])

    def test_wrong_usage(self):
        code, messages = self.run_setup([], "--python")
        self.assertEqual(code, 2)
        self.assertIn("usage", messages)

    def test_a_system_without_dpkg(self):
        (self.home / "bin/dpkg-query").unlink()
        code, messages = self.run_setup([])
        self.assertEqual((code, self.calls), (0, []))
        self.assertIn("not a Debian system", messages)


class InterruptedTest(SetupCase):
    def setUp(self):
        super().setUp()
        self.make_whole_venv()

    def test_packages_that_are_half_installed_are_finished(self):
        for state in ("iF", "iU", "iH", "iW", "it"):
            with self.subTest(state=state):
                half = Rule("^dpkg-query", out=f"ii  cmake\nii  ninja-build\n{state}  libhdf5-dev", times=2)
                code, messages = self.run_setup([half, self.installed(*PACKAGES)])
                self.assertEqual((code, self.calls), (0, ["dpkg --configure -a"]), messages)
                self.assertIn("interrupted", messages)

    def test_a_journal_that_was_not_merged(self):
        self.write("dpkg/updates/0001", "")
        journal = str(self.home / "dpkg/updates/0001")
        rules = [
            Rule("^dpkg-query", out="ii  cmake\nii  ninja-build", times=2),
            self.installed(*PACKAGES),
            Rule("^dpkg --configure -a", removes=journal),
        ]
        self.assertEqual(self.run_setup(rules)[0], 0)
        self.assertEqual(self.calls[0], "dpkg --configure -a")

    def test_packages_that_lack_others(self):
        half = Rule("^dpkg-query", out="ii  cmake\nii  ninja-build\niU  libhdf5-dev", times=2)
        rules = [half, self.installed(*PACKAGES), Rule("^dpkg --configure", code=1)]
        self.assertEqual(self.run_setup(rules)[0], 0)
        self.assertEqual(len(self.calls), 2)
        self.assertRegex(self.calls[1], "^apt-get install .*--no-remove .*--fix-broken$")
        half = self.installed("cmake", "ninja-build", others="iU  libhdf5-dev")
        rules = [half, Rule("^dpkg --configure", code=1), Rule("--fix-broken", out="E: unmet", code=100)]
        code, messages = self.run_setup(rules)
        self.assertEqual(code, 1)
        self.assertIn("| E: unmet", messages)
        self.assertIn("Repair it by hand", messages)


class LockTest(SetupCase):
    def setUp(self):
        super().setUp()
        self.make_whole_venv()

    def test_it_waits_for_another_apt(self):
        rules = [
            Rule("^dpkg-query", out="ii  cmake\nii  ninja-build", times=3),
            self.installed(*PACKAGES),
            Rule("^apt-get update", out="E: Unable to lock directory\n" + LOCKED, code=100, times=2),
        ]
        code, messages = self.run_setup(rules)
        self.assertEqual(code, 0, messages)
        self.assertEqual(len(self.called("^sleep 5$")), 2)
        waiting = "another program is using apt or dpkg (process 4711 (unattended-upgr)); waiting for it, up to 20 s"
        self.assertEqual(messages.count(waiting), 1)

    def test_it_does_not_wait_for_ever(self):
        rules = [self.installed("cmake", "ninja-build"), Rule("^apt-get update", out=LOCKED, code=100)]
        code, messages = self.run_setup(rules)
        self.assertEqual((code, len(self.called("^sleep 5$"))), (1, 4))
        self.assertIn("in use by another program for 20 s (process 4711 (unattended-upgr))", messages)


class VenvTest(SetupCase):
    def setUp(self):
        super().setUp()
        self.packages = self.installed(*PACKAGES)

    def stamps(self):
        return [path.name for path in (self.home / ".venv").glob("installed-*")]

    def test_from_nothing(self):
        code, messages = self.run_setup([self.packages])
        self.assertEqual(code, 0, messages)
        self.assertEqual(len(messages.splitlines()), 2, messages)
        self.assertIn("installing 2 of 2 Python wheels, LibTorch among them, into .venv", messages)
        (install,) = self.called("pip install")
        self.assertIn("--require-hashes -r tools/requirements.txt", install)
        self.assertIn("--only-binary :all:", install)
        self.assertEqual(len(self.stamps()), 1)

    def test_other_requirements_are_installed_into_the_same_environment(self):
        self.run_setup([self.packages])
        before = self.stamps()
        self.write("tools/requirements.txt", REQUIREMENTS.replace("2.0", "2.1"))
        self.assertEqual(self.run_setup([self.packages])[0], 0)
        self.assertEqual((self.called("-m venv"), len(self.called("pip install"))), ([], 1))
        self.assertEqual((len(self.stamps()), self.stamps() == before), (1, False))

    def test_what_only_the_tests_need_follows_what_the_build_needs(self):
        rule = Rule("^python tools/check_wheels.py tools/requirements-tests.txt$", out="pandas\npyarrow", code=1, times=1)
        code, messages = self.run_setup([self.packages, rule], "--tests")
        self.assertEqual(code, 0, messages)
        self.assertIn("installing 2 of 2 Python wheels for the tests into .venv", messages)
        build, tests = self.called("pip install")
        self.assertIn("--require-hashes -r tools/requirements.txt", build)
        self.assertIn("--require-hashes --no-build-isolation --use-pep517 -r tools/requirements-tests.txt", tests)
        self.assertEqual(len(self.stamps()), 2)
        self.assertEqual(self.run_setup([self.packages], "--tests"), (0, ""))  # all is there
        self.assertEqual(self.calls, [])

    def test_other_wheels_for_the_tests_leave_those_of_the_build_alone(self):
        self.run_setup([self.packages], "--tests")
        self.write("tools/requirements-tests.txt", TEST_REQUIREMENTS.replace("2.0", "2.1"))
        rule = Rule("^python tools/check_wheels.py tools/requirements-tests.txt$", out="pandas", code=1, times=1)
        self.assertEqual(self.run_setup([self.packages, rule], "--tests")[0], 0)
        (install,) = self.called("pip install")
        self.assertIn("-r tools/requirements-tests.txt", install)
        self.assertEqual(len(self.stamps()), 2)

    def test_without_the_option_nothing_is_installed_for_the_tests(self):
        self.assertEqual(self.run_setup([self.packages])[0], 0)
        self.assertEqual(self.called("requirements-tests"), [])

    def test_an_environment_without_pip_is_made_anew(self):
        self.write(".venv/bin/python", self.stand_in)
        self.write(".venv/old", "")
        code, messages = self.run_setup([self.packages, Rule("^python -m pip --version", code=1)])
        self.assertEqual(code, 0, messages)
        self.assertIn(".venv is not whole", messages)
        self.assertFalse((self.home / ".venv/old").exists())
        self.assertEqual(len(self.called("-m venv")), 1)

    def test_an_environment_of_a_python_that_is_gone_is_made_anew(self):
        self.run_setup([self.packages])
        (self.home / ".venv/bin/python").unlink()
        (self.home / ".venv/bin/python").symlink_to("/nowhere/python3.9")
        self.assertEqual(self.run_setup([self.packages])[0], 0)
        self.assertEqual(len(self.called("-m venv")), 1)

    def test_a_linked_environment_is_never_removed(self):
        self.write("elsewhere/precious", "")
        (self.home / ".venv").symlink_to(self.home / "elsewhere")
        code, messages = self.run_setup([self.packages])
        self.assertEqual(code, 1)
        self.assertIn(".venv is a link to", messages)
        self.assertTrue((self.home / "elsewhere/precious").exists())

    def test_torch_that_vanished_is_installed_again(self):
        self.run_setup([self.packages])
        (self.home / LIBTORCH).unlink()
        self.assertEqual(self.run_setup([self.packages])[0], 0)
        self.assertEqual(len(self.called("pip install")), 1)

    def test_a_half_written_package_is_forgotten_before_pip_runs(self):
        rule = Rule("^python tools/check_wheels.py --forget tools/requirements.txt$", out="numpy\ntorch", code=1)
        code, messages = self.run_setup([self.packages, rule])
        self.assertEqual(code, 0, messages)
        self.assertIn("only half there and are installed anew: numpy, torch", messages)
        steps = [i for i, call in enumerate(self.calls) if re.search("check_wheels|pip install", call)]
        self.assertIn("--forget", self.calls[steps[0]])
        self.assertIn("pip install", self.calls[steps[2]])
        self.assertIn("check_wheels.py tools/requirements.txt", self.calls[steps[3]])

    def test_only_what_is_missing_is_announced(self):
        self.python.insert(0, Rule("^python tools/check_wheels.py tools/req", out="numpy", code=1, times=1))
        self.assertIn("installing 1 of 2 Python wheels into .venv: numpy\n", self.run_setup([self.packages])[1])

    def test_nothing_is_installed_where_all_is_there(self):
        self.write(LIBTORCH, "")
        self.write(".venv/bin/python", self.stand_in)
        self.python.pop()  # the rule by which packages are missing
        self.assertEqual(self.run_setup([self.packages])[0], 0)
        self.assertEqual(self.called("pip install"), [])
        self.assertEqual(len(self.stamps()), 1)

    def test_a_package_that_stays_half_written_is_no_success(self):
        rule = Rule("^python tools/check_wheels.py tools/requirements.txt$", out="numpy\ntorch", code=1)
        code, messages = self.run_setup([self.packages, rule])
        self.assertEqual((code, self.stamps()), (1, []))
        self.assertIn(".venv lacks files of these packages: numpy, torch\n", messages)

    def test_pip_that_fails(self):
        for output, advice in (
            ("ERROR: Could not install packages due to an OSError: [Errno 28] No space left on device", "disk is full"),
            ("ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.", "Do not use it"),
            ("ERROR: No matching distribution found for torch==2.0", "has no such wheel for"),
            ("Failed to establish a new connection: Name or service not known", 'docs/install.md ("Offline")'),
            ("something else", "The whole output is in build/setup.log"),
        ):
            with self.subTest(output=output):
                code, messages = self.run_setup([self.packages, Rule("^python -m pip install", out=output, code=1)])
                self.assertEqual((code, self.stamps()), (1, []))
                for mention in (f"| {output}", "pip could not install", advice):
                    self.assertIn(mention, messages)
        self.assertEqual(self.run_setup([self.packages])[0], 0)  # the next run goes on
        self.assertEqual(self.called("-m venv"), [])

    def test_a_python_without_pinned_wheels(self):
        self.python.insert(0, Rule("^python3 -c", out="3.1"))  # not to be taken for the beginning of 3.11
        code, messages = self.run_setup([self.packages])
        self.assertEqual((code, self.called("venv")), (1, []))
        self.assertIn("is version 3.1, for which tools/requirements.txt pins no wheels (CPython 3.11, 3.12", messages)

    def test_a_python_that_cannot_make_environments(self):
        self.python.insert(0, Rule("-m venv", out="ensurepip is not available", code=1))
        code, messages = self.run_setup([self.packages])
        self.assertEqual(code, 1)
        self.assertIn("| ensurepip is not available", messages)
        self.assertIn("python3-venv", messages)


if __name__ == "__main__":
    unittest.main()
