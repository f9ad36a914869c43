#!/usr/bin/env python3
"""Cuts the power of the disk under a program, and lets the program go on with what is left. Needs root.

    .venv/bin/python tests/torture/power_cut.py 100
    .venv/bin/python tests/torture/power_cut.py 20 --seed 7 --jobs train,sample

Every trial runs a job on an empty disk (an ext4 image, see cut_disk.py) and stops it at a random moment, or before a
write, sync, rename or link. Some trials wait until the kernel has written the names. Then the image is copied: with all
that the disk had taken, or without what was in its cache. The copy is mounted, the journal replayed. `latest` must name a
sound dataset or be absent, and the same command must end with the files of an undisturbed run. One cut in four
comes right after success. Then the disk must hold exactly the files that were there, without a second run.

The last line counts, also after Ctrl-C. The exit code is 1 if a trial ended otherwise than it should; 2 if this machine
mounts no images.
"""

import collections
import os
import pathlib
import random
import re
import shutil
import signal
import sys
import tempfile
import time

from cut_disk import OPTIONS, CutDisk, NoDisks
from jobs import Inputs, check_latest, differences, parse, parser_of
from e2e import Fault, digests, run, started  # jobs has told Python where it is

JOBS = ("labels", "network", "calibrate", "train", "merge", "export", "sample")
# The lock's text says who has it, and the caches only make a later run faster.
_NEED_NOT_STAY = re.compile(r"(^|/)(\.lock|digests\.txt|picture_hashes\.txt)$")
# The kernel writes names after one second (commit=1).
_NAMES_ARE_WRITTEN_S = 1.5


def all_files(out):
    return {name: digest for name, digest in digests(out).items() if not _NEED_NOT_STAY.search(name)}


def run_and_cut(job, out, disk, keeps_cache, image, draw):
    """Stops the job, cuts, and kills what is left of it. Returns where; None if it ended before it could be stopped."""
    number = draw.randrange(job.changes) if draw.random() < 0.7 else None
    delay = draw.uniform(0.0, job.seconds)
    waits = draw.random() < 0.5
    fault = None if number is None else Fault(str(out), "change", action="stop", skip=number)
    with started(*job.words(out), fault=fault) as running:
        if number is None:
            time.sleep(delay)
            os.kill(running.pid, signal.SIGSTOP)  # it may have ended; then it is still there to be waited for
        if not running.wait_for_stop():
            if running.wait() != 0:
                raise AssertionError(f"ended with {running.wait()}:\n{running.stderr()}")
            return None
        if waits:
            time.sleep(_NAMES_ARE_WRITTEN_S)
        disk.cut(keeps_cache, image)
    where = f"after {delay:.3f} s" if number is None else f"at change {number}"
    return where + (", with the names written" if waits else "")


def check_unfinished(job, out):
    check_latest(out)
    if (out / "latest").exists():
        run("verify", out / "latest", "--quiet")
    job.check_completes(out)


def check_finished(job, out, before):
    lost = differences(before, all_files(out) if out.exists() else {})
    if lost:
        raise AssertionError(f"lost after success, or back again: {', '.join(lost[:10])}")
    job.check_equal(out)


def trial(job, disk, folder, after_success, draw):
    """Returns where it was cut. Raises AssertionError, with that."""
    options, keeps_cache = draw.choice(OPTIONS), draw.random() < 0.5
    image = folder / "cut.image"
    out = disk.place / job.name
    disk.start_empty(options)
    where = None if after_success else run_and_cut(job, out, disk, keeps_cache, image, draw)
    before = {}
    if where is None:
        job.run(out)
        before = all_files(out)
        disk.cut(keeps_cache, image)
    place = f"{where or 'after success'}, {options}, {'with' if keeps_cache else 'without'} the disk's cache"
    try:
        disk.start_from(image, keeps_cache, options)
        if where is None:
            check_finished(job, out, before)
        else:
            check_unfinished(job, out)
    except AssertionError as error:
        raise AssertionError(f"cut {place}\n{error}") from error
    return place


def cut_all(jobs, disk, folder, cuts, draw):
    """Returns the cuts by job and moment, and how many trials failed."""
    done, failed = collections.Counter(), 0
    for number in range(cuts):
        job = jobs[number % len(jobs)]
        try:
            place = trial(job, disk, folder, draw.random() < 0.25, draw)
            done[f"{job.name} {'after success' if place.startswith('after success') else 'within'}"] += 1
        except AssertionError as error:
            failed += 1
            print(f"{job.name}: {error}", file=sys.stderr, flush=True)
        except KeyboardInterrupt:  # counts what was done
            break
        if failed >= 5:
            break
    return done, failed


def take_own_mounts():
    """Begins this script again with mounts that no other process sees: one that did would keep a disk busy, and they go
    with this script, however it ends."""
    if os.geteuid() == 0 and "Q3D_OWN_MOUNTS" not in os.environ:
        words = ["unshare", "--mount", "--propagation", "private", sys.executable, *sys.argv]
        os.execvpe(words[0], words, {**os.environ, "Q3D_OWN_MOUNTS": "1"})


def parsed():
    parser = parser_of(__doc__, JOBS)
    parser.add_argument("cuts", type=int)
    parser.add_argument("--seed", type=int, default=0)
    return parse(parser)


def main():
    arguments = parsed()
    take_own_mounts()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="q3d_power_cut_")).resolve()
    try:
        with CutDisk(folder / "disks") as disk:
            disk.start_empty(OPTIONS[0])
            inputs = Inputs(folder / "shared")
            jobs = [inputs.job(name) for name in arguments.jobs.split(",")]
            for job in jobs:
                job.measure(disk.place / "undisturbed")
            done, failed = cut_all(jobs, disk, folder, arguments.cuts, random.Random(arguments.seed))
    except NoDisks as error:
        print(f"power_cut: this machine mounts no images of disks ({error}); run it as root, or leave it out "
              "(make torture CUTS=0)", file=sys.stderr)
        return 2
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(", ".join(f"{name} {count}" for name, count in sorted(done.items())))
    total = sum(done.values())
    print(f"{total + failed} power cuts: {total} ended with equal files, {failed} did not")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
