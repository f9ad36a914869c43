#!/usr/bin/env python3
"""Kills the program at random moments, and at its writes, syncs, renames and links, and lets it go on.

    .venv/bin/python tests/torture/torture.py 1000
    .venv/bin/python tests/torture/torture.py 50 --seed 7 --jobs labels,merge

Every trial starts a job on tiny inputs in an empty folder, kills it one to three times (SIGKILL), runs the same command
once more to its end, and compares every file of its output with those of a run that was never killed. After every kill
`latest` must name a dataset or be absent. After success no temporary file may be left. The job shared_build is a build
on two ranks: one of them is killed, or both. The last line counts kills and trials, also after Ctrl-C; the exit code is 1
if a trial ended otherwise than it should, and its folder then stays for a look.
"""

import collections
import pathlib
import random
import shutil
import sys
import tempfile

from jobs import Inputs, check_latest, parse, parser_of


def trial(job, out, draw, most_kills):
    """One to three kills, then a run to the end. Returns where it was killed. Raises AssertionError."""
    places = []
    try:
        for _ in range(min(most_kills, draw.choice((1, 1, 2, 3)))):
            place = job.kill_once(out, draw)
            check_latest(out)
            if place:
                places.append(place)
        job.check_completes(out)
    except AssertionError as error:
        raise AssertionError(f"killed {'; then '.join(places) or 'never'}\n{error}") from error
    return places


def torture(jobs, folder, kills, draw):
    """Returns the kills by job, how many trials failed, and how many there were."""
    done, failed, number = collections.Counter(), 0, 0
    while sum(done.values()) < kills:
        job = jobs[number % len(jobs)]
        out = folder / f"trial{number}"
        try:
            places = trial(job, out, draw, kills - sum(done.values()))
            done[job.name] += len(places)
            shutil.rmtree(out)
        except AssertionError as error:
            failed += 1
            done[job.name] += 1
            print(f"{job.name}, {out}: {error}", file=sys.stderr, flush=True)
        except KeyboardInterrupt:  # counts what was done
            break
        number += 1
        if failed >= 5:
            break
    return done, failed, number


def parsed():
    parser = parser_of(__doc__)
    parser.add_argument("kills", type=int)
    parser.add_argument("--seed", type=int, default=0)
    return parse(parser)


def main():
    arguments = parsed()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="q3d_torture_")).resolve()
    inputs = Inputs(folder / "shared")
    jobs = [inputs.job(name) for name in arguments.jobs.split(",")]
    for job in jobs:
        job.measure(folder / "undisturbed")
        print(f"{job.name}: {job.seconds:.1f} s, {job.changes} writes, syncs, renames and links", flush=True)
    done, failed, trials = torture(jobs, folder, arguments.kills, random.Random(arguments.seed))
    print(", ".join(f"{name} {count}" for name, count in sorted(done.items())))
    print(f"{sum(done.values())} kills in {trials} trials: {trials - failed} ended with equal files, {failed} did not")
    if failed:
        return 1
    shutil.rmtree(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
