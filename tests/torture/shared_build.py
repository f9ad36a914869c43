"""A build on two ranks, as a job: one rank is killed, or all that the launcher started."""

import shutil
import signal
import subprocess
import time

from e2e import LIMIT_S, Fault, Rank, launcher_store, own_store
from jobs import Job, counted_calls, result_of

RANKS = 2
# The time that a launcher waits while the other ranks continue after rank 0 is gone. A dead rank is noticed after 15
# s.
_LAUNCHER_PATIENCE_S = 40
# Exit codes of ranks that lost rank 0, or that the launcher ended.
_MAY_END_WITH = {0, 1, 128 + signal.SIGTERM, -signal.SIGTERM}


class Ranks:
    """The ranks of one start. `faults` are by rank."""

    def __init__(self, words, folder, launcher_has_store, faults=None):
        self.keeps, store = launcher_store() if launcher_has_store else (None, own_store())
        folder.mkdir(exist_ok=True)
        self.all = [Rank(words, rank, RANKS, store, folder / f"rank{rank}.log", (faults or {}).get(rank))
                    for rank in range(RANKS)]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for rank in self.all:
            rank.end()

    def codes(self):
        return [rank.process.poll() for rank in self.all]

    def wait(self):
        """Waits for success of all. Raises AssertionError."""
        codes = [rank.wait() for rank in self.all]
        if any(codes):
            raise AssertionError(f"the ranks ended with {codes}:\n" + "\n".join(rank.stderr() for rank in self.all))


class SharedBuild(Job):
    @classmethod
    def make(cls, scene):
        """In units of two candidates. The expected files are those of one process."""
        config = scene.write_config("fine.json", shards={"unit_size": 2})
        return cls("shared_build",
                   lambda out: ["build", "--config", config, "--config", scene.thresholds, "--out", out, "--quiet"])

    def run(self, out):
        with Ranks(self.words(out), self._logs(out), launcher_has_store=False) as ranks:
            ranks.wait()

    def measure(self, out):
        super().run(out)
        self.expected = result_of(out)
        shutil.rmtree(out)
        count = {rank: Fault(str(out), "change", action="count") for rank in range(RANKS)}
        start = time.monotonic()
        with Ranks(self.words(out), self._logs(out), False, count) as ranks:
            ranks.wait()
            self.seconds = time.monotonic() - start
            self.changes = max(counted_calls(rank.stderr()) for rank in ranks.all)
        self.check_equal(out)
        shutil.rmtree(out)

    def kill_once(self, out, draw):
        """Kills one rank; then the others go on alone, the launcher ends them (SIGTERM), or it is killed with all."""
        victim = draw.randrange(RANKS)
        delay = None if draw.random() < 0.6 else draw.uniform(0.0, self.seconds)
        faults = {}
        if delay is None:
            faults[victim] = Fault(str(out), "change", action="kill", skip=draw.randrange(self.changes))
        launcher_has_store = draw.random() < 0.5
        then = draw.choice(("the other goes on", "the other is ended", "the other is killed"))
        with Ranks(self.words(out), self._logs(out), launcher_has_store, faults) as ranks:
            if not self._kill(ranks, victim, delay):
                ranks.wait()
                return None
            self._end_others(ranks, victim, then)
            how = next((line for line in ranks.all[victim].stderr().splitlines() if line.startswith("faults: kill")),
                       f"after {delay or 0:.3f} s")
            store = "launcher" if launcher_has_store else "rank 0"
            return f"rank {victim} {how}; {then}; the store is of {store}"

    def _kill(self, ranks, victim, delay):
        """Waits until the victim has been killed. False if it ended before."""
        process = ranks.all[victim].process
        try:
            process.wait(delay or LIMIT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        return process.returncode == -signal.SIGKILL

    def _end_others(self, ranks, victim, then):
        others = [rank for rank in ranks.all if rank is not ranks.all[victim]]
        if then == "the other is killed":
            return
        if then == "the other is ended":
            for other in others:
                other.send(signal.SIGTERM)
        for other in others:
            try:
                other.wait(LIMIT_S if victim > 0 else _LAUNCHER_PATIENCE_S)
            except subprocess.TimeoutExpired:
                other.send(signal.SIGTERM)
            code = other.wait()
            must_succeed = then == "the other goes on" and victim > 0
            if code not in ({0} if must_succeed else _MAY_END_WITH):
                raise AssertionError(f"the rank that was left ended with {code}:\n{other.stderr()}")

    def _logs(self, out):
        return out.with_name(out.name + "_logs")
