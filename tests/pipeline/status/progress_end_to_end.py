"""The progress of a build and of `predict`: a bar on a terminal, lines elsewhere."""

import collections
import fcntl
import os
import pty
import re
import signal
import struct
import subprocess
import termios
import threading

from e2e import PICTURES, UNIT, Fault, SceneCase, verdicts
from e2e.program import LIMIT_S, Started, command, environment

UNITS = PICTURES // UNIT
COLUMNS = 200


class OnTerminal(Started):
    """A program in the background whose stderr is a terminal; stderr() gives what it wrote, as it wrote it."""

    def __init__(self, words, env):
        self._master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, COLUMNS, 0, 0))
        self._text = ""
        self.process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=slave, env=env)
        os.close(slave)
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self):
        while True:
            try:
                piece = os.read(self._master, 4096)
            except OSError:  # Linux says so when the last writer is gone
                piece = b""
            if not piece:
                return
            self._text += piece.decode()

    def stderr(self):
        return self._text.replace("\r\n", "\n")

    def wait(self):
        code = self.process.wait(timeout=LIMIT_S)
        self._reader.join(timeout=LIMIT_S)
        return code

    def kill(self):
        self.process.kill()
        self.process.wait()
        self._reader.join(timeout=LIMIT_S)
        os.close(self._master)


class Progress(SceneCase):
    def words(self, *more):
        return command(self.scene.build_words("out", *more))

    def env(self, fault=None, **variables):
        env = {name: value for name, value in environment(fault).items() if name not in ("NO_COLOR", "TERM")}
        return {**env, "TERM": "xterm", **variables}

    def on_terminal(self, **variables):
        """What a whole build writes to a terminal."""
        running = OnTerminal(self.words(), self.env(**variables))
        try:
            self.assertEqual(running.wait(), 0, running.stderr())
            return running.stderr()
        finally:
            running.kill()

    def assert_counts(self, line):
        """The line's counts are those of the dataset."""
        counts = collections.Counter(row["verdict"] for row in verdicts(self.scene.latest("out")))
        told = {name: int(count) for name, count in re.findall(r"(retained|refined|discarded|failed) (\d+)", line)}
        self.assertEqual(told, {name: counts[name] for name in ("retained", "refined", "discarded", "failed")})

    def test_a_bar_on_a_terminal(self):
        said = self.on_terminal()
        bars = [line.split("\n")[0] for line in said.split("\r\033[K") if line.startswith("candidates [")]
        plain = [re.sub(r"\033\[\d+m", "", bar) for bar in bars]
        self.assertRegex(plain[-1], rf"^candidates \[#+\] 100 %  {PICTURES}/{PICTURES}  [0-9.]+/s  ")
        self.assertLess(max(map(len, plain)), COLUMNS)
        self.assertIn("\033[34m", bars[-1])
        self.assert_counts(plain[-1])
        for bar in plain:
            done = int(re.search(rf" (\d+)/{PICTURES}", bar).group(1))
            told = re.findall(r"(?:retained|refined|discarded|failed) (\d+)", bar)
            self.assertEqual(sum(map(int, told)), done, bar)

    def test_no_color_has_a_bar_without_colours(self):
        said = self.on_terminal(NO_COLOR="1")
        self.assertIn("\r\033[Kcandidates [", said)
        self.assertEqual(re.findall(r"\033\[[0-9;]*m", said), [])

    def test_a_dumb_terminal_and_a_pipe_have_lines(self):
        for said in (self.on_terminal(TERM="dumb"),
                     subprocess.run(self.words("--set", "name=piped"), stderr=subprocess.PIPE, text=True, check=True,
                                    env=self.env(), timeout=LIMIT_S).stderr):
            self.assertNotIn("\033", said)
            self.assertNotIn("\r", said)
            line = [line for line in said.splitlines() if line.startswith("candidates: ")][-1]
            self.assertRegex(line, rf"^candidates: {PICTURES} / {PICTURES} \(100 %\), [0-9.]+/s, .*; retained ")
            self.assert_counts(line)

    def test_quiet_shows_none(self):
        result = subprocess.run(self.words("--quiet"), stderr=subprocess.PIPE, text=True, check=True, timeout=LIMIT_S)
        self.assertNotIn("candidates:", result.stderr)

    def test_the_bar_moves_within_a_unit(self):
        """The program stops when it writes its first unit, and has told of a first batch before. Several units are under
        way at once, so it need not be the first unit's."""
        running = OnTerminal(self.words(), self.env(Fault(".h5.", "sync", "stop")))
        try:
            self.assertTrue(running.wait_for_stop(), running.stderr())
            self.assertEqual(list((self.folder / "out").glob("stages/*/unit-*.h5")), [])
            self.assertRegex(running.stderr(), rf"unit \d of {UNITS}: predict 4 of {UNIT}")  # network.batch is 4
            running.send(signal.SIGCONT)
            self.assertEqual(running.wait(), 0, running.stderr())
        finally:
            running.kill()

    def test_the_bar_of_predict_moves_within_a_unit(self):
        """The program stops before a first unit is written, and has told of a first batch of four animals."""
        for more in ([], ["--adapt", 3]):
            words = command(["predict", "--config", self.scene.config, "--out", self.folder / f"out{len(more)}", *more])
            running = OnTerminal(words, self.env(Fault(".h5.", "sync", "stop"), NO_COLOR="1"))
            try:
                self.assertTrue(running.wait_for_stop(), running.stderr())
                self.assertRegex(running.stderr(), rf"animals \[[^\n]* 4/{PICTURES} ", more)
                running.send(signal.SIGCONT)
                self.assertEqual(running.wait(), 0, running.stderr())
                self.assertRegex(running.stderr(), rf"animals \[#+\] 100 %  {PICTURES}/{PICTURES} ")
            finally:
                running.kill()
