"""Runs the program: to its end, in the background, and with faults at exact points (tests/faults/faults.c)."""

import contextlib
import dataclasses
import json
import os
import re
import signal
import subprocess
import tempfile
import time

# Nothing here takes minutes. The limit only ends a test whose program hangs, also on a machine that is busy with
# other work, so no test depends on how fast the program is.
LIMIT_S = 900


def program():
    """Absolute path of quadruped3d. The command line of this package sets it."""
    return os.environ["Q3D_PROGRAM"]


def command(arguments):
    return [program(), *map(str, arguments)]


def run(*arguments, expect=0, fault=None, **options):
    """Runs the program to its end and returns its subprocess.CompletedProcess, with the output as text.

    Raises AssertionError, with the program's stderr, when the exit code is not `expect`; None accepts every code.
    `fault` is a Fault; `options` go to subprocess.run.
    """
    result = subprocess.run(command(arguments), capture_output=True, text=True, timeout=LIMIT_S,
                            env=environment(fault), **options)
    if expect is not None and result.returncode != expect:
        raise AssertionError(f"{arguments} ended with {result.returncode}, expected {expect}\n{result.stderr}")
    return result


def run_json(*arguments, **options):
    """run() with --json, and what it printed."""
    return json.loads(run(*arguments, "--json", **options).stdout)


@dataclasses.dataclass(frozen=True)
class Fault:
    """What tests/faults/faults.c does to calls of kind `call` ("open", "read", "stat", "sync", "write", "rename",
    "link", "lock", "mkdir", "close", or "change": any of sync, write, rename and link) on files whose path contains
    `path`, or ends with it if it ends in "$", after `skip` of these passed: "fail" with the errno `error` (`times`
    times, or always), "stop" once, "hang", "kill", or only "count" them."""

    path: str
    call: str
    action: str = "fail"
    error: str = "EIO"
    skip: int = 0
    times: int = -1


def environment(fault=None):
    """The environment for the program, with the fault in it."""
    if fault is None:
        return dict(os.environ)
    return {**os.environ, "LD_PRELOAD": os.environ["Q3D_FAULTS"], "Q3D_FAULT_PATH": fault.path,
            "Q3D_FAULT_CALL": fault.call, "Q3D_FAULT_ACTION": fault.action, "Q3D_FAULT_ERRNO": fault.error,
            "Q3D_FAULT_SKIP": str(fault.skip), "Q3D_FAULT_TIMES": str(fault.times),
            # The address sanitizer requires to be the first library, but it also works as the second one.
            "ASAN_OPTIONS": ":".join(filter(None, (os.environ.get("ASAN_OPTIONS"), "verify_asan_link_order=0")))}


def fault_lines(stderr):
    """The announcements of faults that were reached."""
    return [line for line in stderr.splitlines() if line.startswith("faults: ") and " at " in line]


def alarm_seconds(stderr):
    """After how many seconds the program asked the kernel to wake it; needs a Fault."""
    return [int(seconds) for seconds in re.findall(r"^faults: alarm after (\d+) s$", stderr, re.MULTILINE)]


def wait_until(condition, what, limit_s=LIMIT_S):
    """Returns the first true value of condition(). Raises AssertionError, naming `what`, when none comes in time."""
    deadline = time.monotonic() + limit_s
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > deadline:
            raise AssertionError(f"waited {limit_s} s for {what}")
        time.sleep(0.005)


class Started:
    """A program in the background."""

    def __init__(self, words, env):
        self._stderr = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=self._stderr, env=env)

    @property
    def pid(self):
        return self.process.pid

    def stderr(self):
        """What it wrote to stderr so far."""
        self._stderr.seek(0)
        return self._stderr.read()

    def send(self, number):
        self.process.send_signal(number)

    def wait_for_stop(self):
        """Waits until the process has stopped itself: True. False when it ended instead."""

        def state():
            return os.waitid(os.P_PID, self.pid, os.WEXITED | os.WSTOPPED | os.WNOWAIT | os.WNOHANG)

        return wait_until(state, f"process {self.pid} to stop or end").si_code == os.CLD_STOPPED

    def wait_for_line(self, text):
        """Waits until a line on stderr contains the text."""

        def line():
            if text not in self.stderr() and self.process.poll() is not None:
                raise AssertionError(f"ended with {self.process.returncode} without {text!r}:\n{self.stderr()}")
            return text in self.stderr()

        wait_until(line, f"{text!r} on stderr")

    def wait(self):
        """Waits for the end and returns the exit code."""
        return self.process.wait(timeout=LIMIT_S)

    def kill(self):
        self.process.kill()
        self.process.wait()
        self._stderr.close()


@contextlib.contextmanager
def started(*arguments, fault=None):
    """The program in the background, as a Started; killed when the block is left."""
    running = Started(command(arguments), environment(fault))
    try:
        yield running
    finally:
        running.kill()


# Where kill_and_resume() kills. A finished unit adds a line to a stage's journal; before that its file is written
# under a temporary name. Every run comes at least one line further than the one before it.
_KILL_POINTS = (Fault("journal.jsonl", "sync", "stop", skip=0),  # the first new line is written, not yet synced
                Fault("journal.jsonl", "sync", "stop", skip=1),
                Fault(".h5.", "sync", "stop", skip=1))  # the second new file is written, not yet renamed


def kill_and_resume(*arguments, after_kill=None):
    """Starts the program again and again and kills it (SIGKILL) at points between two units, until a run comes to its
    end. Calls after_kill() after every kill and returns the number of kills."""
    for kills in range(100):
        with started(*arguments, fault=_KILL_POINTS[kills % len(_KILL_POINTS)]) as running:
            if not running.wait_for_stop():
                code = running.wait()
                if code != 0:
                    raise AssertionError(f"{arguments} ended with {code} when resumed\n{running.stderr()}")
                return kills
            running.send(signal.SIGKILL)
            running.wait()
        if after_kill:
            after_kill()
    raise AssertionError(f"{arguments}: no end after 100 kills, so a resumed run does not come further")
