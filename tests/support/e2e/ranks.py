"""Starts the program as ranks that share a build, as torchrun or srun starts it."""

import contextlib
import datetime
import json
import pathlib
import socket
import subprocess

from .program import LIMIT_S, command, environment, wait_until


def free_port():
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        return server.getsockname()[1]


def own_store():
    """The variables of ranks whose rank 0 holds the store, as under srun."""
    return {"MASTER_PORT": str(free_port())}


def launcher_store():
    """(store, variables) of ranks whose launcher holds the store, as torchrun does, so that it lives on when rank 0 is
    stopped or killed. It ends with the first of the two."""
    from torch.distributed import TCPStore  # here, since listing the tests should not load PyTorch

    store = TCPStore("127.0.0.1", 0, is_master=True, wait_for_workers=False,
                     timeout=datetime.timedelta(seconds=LIMIT_S))
    return store, {"MASTER_PORT": str(store.port), "TORCHELASTIC_USE_AGENT_STORE": "True"}


def ranks_of(launcher):
    """{rank: process id} of the processes that a launcher has started."""
    found = {}
    for child in pathlib.Path(f"/proc/{launcher}/task/{launcher}/children").read_text().split():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # it has ended meanwhile
            variables = pathlib.Path(f"/proc/{child}/environ").read_bytes().split(b"\0")
            found.update({int(variable[len(b"RANK="):]): int(child) for variable in variables
                          if variable.startswith(b"RANK=")})
    return found


class Rank:
    """One rank as a process; a launcher would set these variables."""

    def __init__(self, words, rank, ranks, store, log, fault=None):
        self.log = log
        self.out = log.with_suffix(".out")
        env = {**environment(fault), "RANK": str(rank), "WORLD_SIZE": str(ranks), "LOCAL_RANK": str(rank),
               "LOCAL_WORLD_SIZE": str(ranks), "MASTER_ADDR": "127.0.0.1", **store}
        with open(log, "w") as errors, open(self.out, "w") as output:
            self.process = subprocess.Popen(command(words), env=env, stderr=errors, stdout=output)

    def wait(self, limit_s=LIMIT_S):
        return self.process.wait(limit_s)

    def wait_for_fault(self):
        wait_until(lambda: "faults: " in self.stderr() or self.process.poll() is not None, "the fault")
        if self.process.poll() is not None:
            raise AssertionError(f"ended with {self.process.returncode}:\n{self.stderr()}")

    def send(self, number):
        self.process.send_signal(number)

    def summary(self):
        return json.loads(self.out.read_text())

    def stderr(self):
        return self.log.read_text()

    def end(self):
        self.process.kill()
        self.process.wait()
