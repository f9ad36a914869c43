"""tools/setup.sh and the packages of Debian."""

import os
import pty
import unittest

from setup_stand_ins import LOCKED, PACKAGES, UPGRADE, Rule, SetupCase


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


if __name__ == "__main__":
    unittest.main()
