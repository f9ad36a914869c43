"""Completions and the manual page, which are made from the commands themselves."""

import pathlib
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
        self.assertEqual(self.completed("build", "--out", "my"), ["my folder"])

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


class OtherShells(Case):
    """What zsh and fish themselves offer, each asked in its own way. bash is asked above."""

    @classmethod
    def prepare(cls):
        for shell in ("zsh", "fish"):
            (cls.shared / shell).mkdir()
        (cls.shared / "zsh/_quadruped3d").write_text(run("completion", "zsh").stdout)
        (cls.shared / "fish/quadruped3d.fish").write_text(run("completion", "fish").stdout)

    def in_zsh(self, line):
        script = pathlib.Path(__file__).with_name("complete.zsh")
        result = subprocess.run(["zsh", "-f", script, self.shared / "zsh", line], capture_output=True, text=True,
                                check=True, cwd=self.folder, timeout=300)
        self.assertEqual(result.stderr, "")
        return {word.replace("\\ ", " ") for word in result.stdout.splitlines()}

    def in_fish(self, line):
        code = 'source $argv[1]; complete -C $argv[2]'
        result = subprocess.run(["fish", "--no-config", "-c", code, self.shared / "fish/quadruped3d.fish", line],
                                capture_output=True, text=True, check=True, cwd=self.folder, timeout=300,
                                env={"PATH": "/usr/bin:/bin", "HOME": str(self.folder), "TERM": "dumb"})
        self.assertEqual(result.stderr, "")
        return {word.split("\t")[0] for word in result.stdout.splitlines()}

    def setUp(self):
        super().setUp()
        self.shells = {name: ask for name, ask in (("zsh", self.in_zsh), ("fish", self.in_fish)) if shutil.which(name)}
        if not self.shells:
            self.skipTest("neither zsh nor fish is installed")

    def test_commands(self):
        for shell, ask in self.shells.items():
            with self.subTest(shell=shell):
                self.assertEqual(ask("quadruped3d "), {*commands(), "help"})
                self.assertEqual(ask("quadruped3d stat"), {"status"})
                self.assertEqual(ask("quadruped3d evaluate"), {"evaluate", "evaluate-labels"})
                self.assertEqual(ask("quadruped3d help ver"), {"verify"})
                self.assertEqual(ask("quadruped3d config sh"), {"show"})

    def test_options(self):
        for shell, ask in self.shells.items():
            with self.subTest(shell=shell):
                self.assertEqual(ask("quadruped3d build --unt"), {"--until"})
                self.assertEqual(ask("quadruped3d build --out o --json --dry"), {"--dry-run"})
                for command in ("build", "export", "status", "train"):
                    self.assertEqual(ask(f"quadruped3d {command} --"), options_of(command), command)
                self.assertEqual(ask("quadruped3d config show --"), options_of("config", "show"))

    def test_values(self):
        for shell, ask in self.shells.items():
            with self.subTest(shell=shell):
                self.assertEqual(ask("quadruped3d build --until pre"), {"predict"})
                self.assertEqual({word.removeprefix("--until=") for word in ask("quadruped3d build --until=pre")}, {"predict"})
                self.assertEqual(ask("quadruped3d completion "), {"bash", "fish", "zsh"})
                self.assertEqual(ask("quadruped3d export --format p"), {"parquet", "prima"})

    def test_files(self):
        (self.folder / "my_config.json").write_text("{}")
        (self.folder / "my_folder").mkdir()
        for shell, ask in self.shells.items():
            with self.subTest(shell=shell):
                self.assertEqual({word.rstrip("/") for word in ask("quadruped3d build -c my")}, {"my_config.json", "my_folder"})
                self.assertEqual({word.rstrip("/") for word in ask("quadruped3d build --out my")}, {"my_folder"})
                self.assertEqual({word.rstrip("/") for word in ask("quadruped3d verify my")}, {"my_folder"})

    def test_nothing_is_offered_where_anything_may_stand(self):
        for shell, ask in self.shells.items():
            with self.subTest(shell=shell):
                self.assertEqual(ask("quadruped3d build --threads "), set())


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
