"""Completions and the manual page, which are made from the commands themselves."""

import re
import shutil
import subprocess

from e2e import Case, run

SHELLS = ("bash", "zsh", "fish")
# Macros of man(7) that the page may use.
MACROS = {".TH", ".SH", ".SS", ".PP", ".TP", ".B", ".I", ".nf", ".fi"}


def commands():
    """The commands as --help lists them."""
    return re.findall(r"^  ([a-z][a-z-]*) ", run("--help").stdout.split("Subcommands:")[1], re.MULTILINE)


def options_of(*words):
    """The long options that the help of a command lists."""
    return set(re.findall(r"^  (?:-\w,)?(--[a-z0-9-]+)", run(*words, "--help").stdout, re.MULTILINE))


class Completion(Case):
    @classmethod
    def prepare(cls):
        for shell in SHELLS:
            (cls.shared / shell).write_text(run("completion", shell).stdout)

    def completed(self, *words, cwd=None):
        """What bash offers for the last of the words, which follow the program's name."""
        code = ('source "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _quadruped3d; '
                'printf "%s\\n" "${COMPREPLY[@]}"')
        result = subprocess.run(["bash", "--norc", "-c", code, "bash", self.shared / "bash", "quadruped3d", *words],
                                capture_output=True, text=True, check=True, cwd=cwd or self.folder)
        self.assertEqual(result.stderr, "")
        return result.stdout.split("\n")[:-1]

    def test_commands_of_both_programs(self):
        self.assertEqual(self.completed("stat"), ["status"])
        self.assertEqual(sorted(self.completed("evaluate")), ["evaluate", "evaluate-labels"])
        self.assertEqual(set(self.completed("")), {*commands(), "help"})
        self.assertEqual(self.completed("help", "ver"), ["verify"])
        self.assertEqual(self.completed("config", "sh"), ["show"])

    def test_options(self):
        self.assertEqual(self.completed("build", "--unt"), ["--until"])
        self.assertEqual(self.completed("--config"), [""])
        for command in commands():
            with self.subTest(command=command):
                self.assertEqual(set(self.completed(command, "--")), options_of(command))
        self.assertEqual(set(self.completed("config", "show", "--")), options_of("config", "show"))
        self.assertEqual(self.completed("build", "--out", "o", "--json", "--dry"), ["--dry-run"])

    def test_values(self):
        self.assertEqual(self.completed("build", "--until", "pre"), ["predict"])
        self.assertEqual(self.completed("build", "--until", "=", "sh"), ["shards"])
        self.assertEqual(sorted(self.completed("build", "--until", "=")),
                         ["crops", "fidelity", "ingest", "measure", "predict", "refine", "shards"])
        self.assertEqual(sorted(self.completed("completion", "")), ["bash", "fish", "zsh"])
        self.assertEqual(self.completed("build", "--threads", ""), [""])

    def test_files(self):
        (self.folder / "my config.json").write_text("{}")
        (self.folder / "my folder").mkdir()
        self.assertEqual(sorted(self.completed("build", "-c", "my")), ["my config.json", "my folder"])
        self.assertEqual(self.completed("verify", "my"), ["my folder"])

    def test_every_command_and_option_is_in_every_script(self):
        for shell in SHELLS:
            text = (self.shared / shell).read_text()
            for command in commands():
                for option in options_of(command):
                    name = option.removeprefix("--") if shell == "fish" else option
                    self.assertRegex(text, rf"{re.escape(name)}\b", (shell, command))
                self.assertRegex(text, rf"\b{re.escape(command)}\b", shell)

    def test_the_shells_that_are_here_read_their_scripts(self):
        for shell in SHELLS:
            if shutil.which(shell):
                with self.subTest(shell=shell):
                    subprocess.run([shell, "-n", self.shared / shell], check=True)

    def test_an_unknown_shell_is_wrong_usage(self):
        self.assertIn("bash", run("completion", "tcsh", expect=2).stderr)


class ManualPage(Case):
    @classmethod
    def prepare(cls):
        (cls.shared / "quadruped3d.1").write_text(run("man").stdout)

    @classmethod
    def recall(cls):
        cls.text = (cls.shared / "quadruped3d.1").read_text()

    def test_its_lines_are_text_and_known_macros(self):
        for line in self.text.splitlines():
            if line.startswith("."):
                self.assertIn(line.split()[0], MACROS | {'.\\"'}, line)
            self.assertFalse(line.startswith("'"), line)
        self.assertEqual(self.text.count("\n.nf\n"), self.text.count("\n.fi\n"))
        self.assertEqual(re.findall(r"(?<!\\)-", re.sub(r'^\.\\".*$', "", self.text, flags=re.MULTILINE)), [])

    def test_it_has_every_command_and_option(self):
        text = self.text.replace("\\-", "-")
        sections = dict(re.findall(r"^\.SS ([a-z -]+)\n(.*?)(?=^\.S[SH] )", text, re.MULTILINE | re.DOTALL))
        for command in commands():
            self.assertIn(command, sections)
            entries = set(re.findall(r"--[a-z0-9-]+", " ".join(re.findall(r"^\.TP\n\.B (.*)$", sections[command],
                                                                       re.MULTILINE))))
            self.assertEqual(entries, options_of(command), command)
        self.assertIn("config show", sections)

    def test_it_is_the_same_again(self):
        self.assertEqual(run("man").stdout, self.text)

    def test_groff_formats_it_without_a_warning(self):
        if not shutil.which("groff"):
            self.skipTest("groff is not installed")
        result = subprocess.run(["groff", "-man", "-Tascii", "-ww", self.shared / "quadruped3d.1"], capture_output=True,
                                text=True, check=True)
        self.assertEqual(result.stderr, "")
        page = re.sub(r"\x1b\[\d*m|.\x08", "", result.stdout)
        self.assertIn("SYNOPSIS", page)
        self.assertIn("quadruped3d build --config", page)
