"""tools/setup.sh and the virtual environment with its wheels."""

import re
import unittest

from setup_stand_ins import LIBTORCH, PACKAGES, REQUIREMENTS, TEST_REQUIREMENTS, Rule, SetupCase


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
        none_found = "ERROR: No matching distribution found for torch==2.0"
        for output, advice in (
            ("ERROR: Could not install packages due to an OSError: [Errno 28] No space left on device", "disk is full"),
            ("ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.", "Do not use it"),
            (none_found, "has no such wheel for"),
            ("Failed to establish a new connection: Name or service not known", 'docs/install.md ("Offline")'),
            (f"Failed to establish a new connection: timed out\n{none_found}", 'docs/install.md ("Offline")'),
            (f"SSLError(SSLCertVerificationError(1, '[SSL: CERTIFICATE_VERIFY_FAILED]'\n{none_found}", "PIP_CERT="),
            ("something else", "The whole output is in build/setup.log"),
        ):
            with self.subTest(output=output):
                code, messages = self.run_setup([self.packages, Rule("^python -m pip install", out=output, code=1)])
                self.assertEqual((code, self.stamps()), (1, []))
                for mention in (f"| {output.splitlines()[-1]}", "pip could not install", advice):
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
