#!/usr/bin/env python3
"""Lets single calls of the system fail, each in its turn, and compares what is left.

    .venv/bin/python tests/torture/faults.py
    .venv/bin/python tests/torture/faults.py 25 --jobs labels --kinds write,sync

For each kind of call it counts how many of them a job makes on files of its inputs and outputs. Then, for every one of
them (or every 25th), it runs the job in an empty folder and lets that one call fail, once, with an error that the call
may meet in practice. The job must end with the same files as without a fault, or with exit code 1 and a message that
has the system's words for the error. (2 if the file that cannot be looked at was named on the command line.) `latest` must name a dataset or be absent. Then the same command runs again, without
a fault, and must end with the same files and leave no temporary file behind.

The exit code is 1 if a trial ended otherwise than it should, and its folder then stays for a look.
"""

import errno
import os
import pathlib
import shutil
import sys
import tempfile

from jobs import Inputs, check_latest, counted_calls, parse, parser_of
from e2e import Fault, fault_lines, run  # jobs has told Python where it is

# An error that the call may meet: a broken disk, a full one, a quota, a disk without links or locks.
ERRORS = {"open": "EIO", "read": "EIO", "stat": "EIO", "write": "ENOSPC", "sync": "EIO", "rename": "EIO",
          "link": "EMLINK", "mkdir": "EDQUOT", "close": "EDQUOT", "lock": "ENOLCK"}
JOBS = ("labels", "network", "train", "merge", "export", "leakage", "calibrate")


def trial(job, out, fault):
    """Returns whether the job met the fault and stopped; None if it made no such call. Raises AssertionError."""
    result = run(*job.words(out), expect=None, fault=fault)
    if not fault_lines(result.stderr):
        return None
    check_latest(out)
    if result.returncode == 0:
        job.check_equal(out)
    elif not (result.returncode == 1 and os.strerror(getattr(errno, fault.error)) in result.stderr
              or result.returncode == 2 and fault.call == "stat" and not out.exists()):
        raise AssertionError(f"ended with {result.returncode}:\n{result.stderr}")
    job.check_completes(out)
    return result.returncode != 0


def count_calls(job, out, kind, place):
    counted = run(*job.words(out), fault=Fault(place, kind, "count"))
    shutil.rmtree(out)
    return counted_calls(counted.stderr)


def strike_all(job, folder, kind, stride):
    """Returns how many calls there were, how many trials there were, how many of them stopped, and how many failed."""
    place = folder.name
    calls = count_calls(job, folder / "counted", kind, place)
    tried = stopped = failed = 0
    for skip in range(0, calls, stride):
        out = folder / f"{job.name}_{kind}_{skip}"
        fault = Fault(place, kind, "fail", ERRORS[kind], skip=skip, times=1)
        try:
            ended = trial(job, out, fault)
            tried += ended is not None
            stopped += ended is True
            shutil.rmtree(out, ignore_errors=True)
        except AssertionError as error:
            tried += 1
            failed += 1
            print(f"{job.name}, {kind} number {skip}, {out}: {error}", file=sys.stderr, flush=True)
    return calls, tried, stopped, failed


def parsed():
    parser = parser_of(__doc__, JOBS)
    parser.add_argument("stride", type=int, nargs="?", default=1, help="take every STRIDEth call (default: every one)")
    parser.add_argument("--kinds", default=",".join(ERRORS), help="kinds of calls (default: %(default)s)")
    return parse(parser)


def main():
    arguments = parsed()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="q3d_faults_")).resolve()
    inputs = Inputs(folder / "shared")
    all_tried = all_failed = 0
    for name in arguments.jobs.split(","):
        job = inputs.job(name)
        job.measure(folder / "undisturbed")
        for kind in arguments.kinds.split(","):
            calls, tried, stopped, failed = strike_all(job, folder, kind, arguments.stride)
            print(f"{name}, {kind} ({ERRORS[kind]}): {calls} calls, {tried} tried, {stopped} stopped with a message, "
                  f"{tried - stopped - failed} went on, {failed} went wrong", flush=True)
            all_tried += tried
            all_failed += failed
    print(f"{all_tried} faults: after {all_tried - all_failed} the same command ended with equal files, after "
          f"{all_failed} it did not")
    if all_failed:
        return 1
    shutil.rmtree(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
