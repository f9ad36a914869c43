#!/usr/bin/env python3
"""Pauses programs for a minute (SIGSTOP), as Ctrl-Z, a batch system or the lid of a laptop does.

    .venv/bin/python tests/torture/pause.py 60

Every case stops a program at a write, sync, rename or link that is drawn at random, and lets it go on SECONDS later:
single programs with their whole process group, a build on two ranks with one rank paused or both. A rank that is paused
for more than 15 s counts as dead, and the other one makes its units; when it wakes, it must do no harm. In the end all
files must be those of a run that was never paused. The cases run side by side, since they sleep for most of their time.
The exit code is 1 if a case ended otherwise than it should, and its folder then stays for a look.
"""

import concurrent.futures
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from jobs import Inputs, check_no_temporaries, differences, parse, parser_of, result_of
from e2e import LIMIT_S, Fault, command, environment, wait_until  # jobs has told Python where it is
from shared_build import RANKS, Ranks

JOBS = ("labels", "network", "calibrate", "train", "shared_build")
# The files of a rank in the middle of a write: its file under a temporary name, and its own journal.
_OF_A_RANK = re.compile(r"journal\.jsonl\.[0-9a-f]+\.\d+$|\.tmp$")


def is_stopped(process):
    """Whether it has stopped, which is seen without being taken from later calls. AssertionError if it ended."""
    state = os.waitid(os.P_PID, process.pid, os.WEXITED | os.WSTOPPED | os.WNOWAIT | os.WNOHANG)
    if state is not None and state.si_code != os.CLD_STOPPED:
        raise AssertionError("it ended before it was to be paused")
    return state is not None


def wait_for_stop(process):
    wait_until(lambda: is_stopped(process), f"process {process.pid} to stop")


def stop_at(out, number):
    return Fault(str(out), "change", action="stop", skip=number)


def pause_group(job, out, seconds, number):
    """A program and what it has started."""
    with open(out.with_name(out.name + ".log"), "w+") as said, subprocess.Popen(
            command(job.words(out)), stdout=subprocess.DEVNULL, stderr=said, start_new_session=True,
            env=environment(stop_at(out, number))) as process:
        wait_for_stop(process)
        os.killpg(process.pid, signal.SIGSTOP)
        time.sleep(seconds)
        os.killpg(process.pid, signal.SIGCONT)
        code = process.wait(LIMIT_S)
        said.seek(0)
        if code != 0:
            raise AssertionError(f"ended with {code}:\n{said.read()}")
    job.check_equal(out)


def check_but_for_the_rank(job, out, when):
    got = {name: content for name, content in result_of(out).items() if not _OF_A_RANK.search(name)}
    wrong = differences(job.expected, got)
    if wrong:
        raise AssertionError(f"other files {when} the rank woke: {', '.join(wrong[:10])}")


def pause_ranks(job, out, seconds, number, paused, launcher_has_store):
    """Returns the exit codes of the ranks."""
    faults = {paused[0]: stop_at(out, number)}
    with Ranks(job.words(out), out.with_name(out.name + "_logs"), launcher_has_store, faults) as ranks:
        wait_for_stop(ranks.all[paused[0]].process)
        for rank in paused[1:]:
            ranks.all[rank].send(signal.SIGSTOP)
        time.sleep(seconds)
        codes = ranks.codes()
        if codes[0] == 0:
            check_but_for_the_rank(job, out, "before")
        for rank in paused:
            ranks.all[rank].send(signal.SIGCONT)
        codes = [rank.wait() for rank in ranks.all]
        # A rank that finds rank 0 gone may say so and end with 1.
        lost = "rank 0 has ended or cannot be reached"
        if codes[0] != 0 or codes[1] not in (0, 1) or (codes[1] == 1 and lost not in ranks.all[1].stderr()):
            raise AssertionError(f"the ranks ended with {codes}:\n" + "\n".join(rank.stderr() for rank in ranks.all))
    check_but_for_the_rank(job, out, "after")
    # The rank's own journal may stay, with lines of units that it has made once more. The next build that opens the
    # stages takes them over; one that is up to date does not.
    job.run(out)
    check_no_temporaries(out)
    check_but_for_the_rank(job, out, "long after")
    return codes


def group_case(job, folder, seconds, draw):
    number = draw.randrange(job.changes)
    return f"{job.name}, paused at change {number}", lambda: pause_group(job, folder / job.name, seconds, number)


def rank_cases(shared, folder, seconds, draw):
    for paused in ([0], [1], list(range(RANKS))):
        for launcher_has_store in (False, True):
            # The pause is in the first half, so that a rank makes so many changes even if the other one is faster.
            number = draw.randrange(shared.changes // 2)
            out = folder / f"ranks_{'_'.join(map(str, paused))}_{launcher_has_store}"
            store = "the launcher" if launcher_has_store else "rank 0"
            yield (f"shared_build, store of {store}, ranks {paused} paused at change {number}",
                   lambda out=out, number=number, paused=paused, has=launcher_has_store: pause_ranks(
                       shared, out, seconds, number, paused, has))


def cases(names, inputs, folder, seconds, draw):
    """(name, function) of every case."""
    for name in names:
        job = inputs.job(name)
        job.measure(folder / "undisturbed")
        if name == "shared_build":
            yield from rank_cases(job, folder, seconds, draw)
        else:
            yield group_case(job, folder, seconds, draw)


def parsed():
    parser = parser_of(__doc__, JOBS)
    parser.add_argument("seconds", type=float)
    parser.add_argument("--seed", type=int, default=0)
    return parse(parser)


def main():
    arguments = parsed()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="q3d_pause_")).resolve()
    all_cases = list(cases(arguments.jobs.split(","), Inputs(folder / "shared"), folder, arguments.seconds,
                           random.Random(arguments.seed)))
    failed = 0
    with concurrent.futures.ThreadPoolExecutor(len(all_cases)) as pool:
        started = [(name, pool.submit(case)) for name, case in all_cases]
        for name, case in started:
            try:
                codes = case.result()
                print(f"{name}: equal files" + (f", exit codes {codes}" if codes else ""), flush=True)
            except AssertionError as error:
                failed += 1
                print(f"{name}: {error}", file=sys.stderr, flush=True)
    print(f"{len(all_cases)} pauses of {arguments.seconds:g} s: {len(all_cases) - failed} ended with equal files, "
          f"{failed} did not")
    if failed:
        return 1
    shutil.rmtree(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
