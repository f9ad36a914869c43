#!/usr/bin/env python3
"""Kills the program at random moments, and at its writes, syncs, renames and links, and lets it go on.

    .venv/bin/python tests/torture/torture.py 1000
    .venv/bin/python tests/torture/torture.py 50 --seed 7 --jobs labels,merge

Every trial starts a job on tiny inputs in an empty folder, kills it one to three times (SIGKILL), runs the same command
once more to its end, and compares every file of its output with those of a run that was never killed. After every kill
`latest` must name a dataset or be absent. After success no temporary file may be left. The last line counts kills and
trials; the exit code is 1 if a trial ended otherwise than it should, and its folder then stays for a look.
"""

import argparse
import collections
import dataclasses
import functools
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
from collections.abc import Callable

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/support"))

from e2e import (Fault, Scene, command, digests, draw_pictures, environment, give_bodies, make_network,  # noqa: E402
                 prima_dataset, run, write_annotations, write_json)

# Files that say when or where, or that only make a later run faster.
_NOT_COMPARED = re.compile(r"(^|/)(\.lock|digests\.txt|picture_hashes\.txt|log\.jsonl|stages/builds/.*\.(json|stamps))$")
# Journals hold one line a unit in the order in which the runs finished them.
_JOURNAL = re.compile(r"(^|/)journal\.jsonl$")
_TEMPORARY = re.compile(r"\.tmp$|\.safetensors\..{6}$|^latest\.tmp$")


@dataclasses.dataclass
class Job:
    """A command that writes into the folder `out`."""

    name: str
    words: Callable[[pathlib.Path], list]
    seconds: float = 0.0  # of an undisturbed run
    changes: int = 0  # writes, syncs, renames and links of an undisturbed run below its folder
    expected: dict = dataclasses.field(default_factory=dict)


def result_of(out):
    """What a run left: the digest of every file that must be equal, and the units in its journals."""
    files = {name: digest for name, digest in digests(out).items()
             if not _NOT_COMPARED.search(name) and not _JOURNAL.search(name)}
    for journal in out.rglob("journal.jsonl"):
        files[str(journal.relative_to(out))] = sorted(set(journal.read_text().splitlines()))
    for link in out.glob("latest"):
        files["latest"] = os.readlink(link)
    return files


class Inputs:
    """The jobs, and their inputs below `shared`; what no job asks for is not made."""

    def __init__(self, shared):
        self.shared = shared

    @functools.cached_property
    def data(self):
        write_annotations(self.shared / "data", give_bodies(draw_pictures(self.shared / "data", 12)))
        return self.shared / "data"

    @functools.cached_property
    def scene(self):
        return Scene.make(self.shared / "scene")

    @functools.cache
    def config(self, role):
        return write_json(self.shared / f"{role}.json", {
            "name": {"truth": "truth", "2d_only": "flat"}[role], "shards": {"unit_size": 3},
            "datasets": [prima_dataset(self.data, role, role=role)]})

    @functools.cache
    def version(self, role):
        run("build", "--config", self.config(role), "--out", self.shared / role)
        return self.shared / role / "latest"

    def labels(self):
        return lambda out: ["build", "--config", self.config("truth"), "--out", out, "--quiet"]

    def network(self):
        return lambda out: ["build", "--config", self.scene.config, "--config", self.scene.thresholds, "--out", out,
                            "--quiet"]

    def calibrate(self):
        return lambda out: ["calibrate", "--config", self.scene.config, "--out", out, "--write", out / "thresholds.json",
                            "--quiet"]

    def train(self):
        files = {"initial": "initial.safetensors", "smal_asset": "smal.safetensors", "priors": "priors.safetensors"}
        paths = {key: str(self.shared / file) for key, file in files.items()}
        make_network(paths["initial"], body=paths["smal_asset"], priors=paths["priors"])
        config = write_json(self.shared / "training.json", {
            "network": {**paths, "device": "cpu", "compute_threads": 1},
            "pools": {"truth": {"shards": [str(self.version("truth"))]}},
            "stages": {"1": [{"name": "only", "pools": ["truth"], "steps": 4, "learning_rate": 1e-3}]},
            "batch": 2, "log_every": 1, "checkpoint_every": 1})
        return lambda out: ["train", "--config", config, "--stage", "1", "--out", out, "--quiet"]

    def leakage(self):
        config = write_json(self.shared / "leakage.json", {
            "datasets": [prima_dataset(self.data, "pool")],
            "leakage": {"test_sets": [prima_dataset(self.data, "test", split="test")]}})
        return lambda out: ["leakage", "--config", config, "--out", out, "--quiet"]

    def merge(self):
        versions = [self.version(role) for role in ("truth", "2d_only")]
        return lambda out: ["merge", *versions, "--out", out, "--name", "both"]

    def export(self):
        return lambda out: ["export", self.version("truth"), "--format", "coco", "--out", out, "--pictures-anyway"]

    def sample(self):
        return lambda out: ["sample", "--out", out, "--share", 0.004, "--pixels", 64, "--quiet"]


JOBS = ("labels", "network", "calibrate", "train", "leakage", "merge", "export", "sample")


def measure(job, out):
    """Runs a job undisturbed, twice: its files must be equal, and its calls are counted."""
    start = time.monotonic()
    run(*job.words(out))
    job.seconds = time.monotonic() - start
    job.expected = result_of(out)
    shutil.rmtree(out)
    counted = run(*job.words(out), fault=Fault(str(out), "change", action="count"))
    job.changes = max(map(int, re.findall(r"faults: counted (\d+) calls", counted.stderr)))
    if result_of(out) != job.expected:
        raise SystemExit(f"{job.name}: two undisturbed runs differ")
    shutil.rmtree(out)


def kill_once(job, out, draw):
    """Starts the job and kills it. Returns where; None if it ended before."""
    fault, delay, where = None, None, ""
    if draw.random() < 0.6 and job.changes:
        number = draw.randrange(job.changes)
        fault = Fault(str(out), "change", action="kill", skip=number)
    else:
        delay = draw.uniform(0.0, job.seconds)
        where = f"after {delay:.3f} s"
    process = subprocess.Popen(command(job.words(out)), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                               env=environment(fault))
    try:
        said = process.communicate(timeout=delay)[1]
    except subprocess.TimeoutExpired:
        process.kill()
        said = process.communicate()[1]
    if process.returncode == -signal.SIGKILL:
        return where or next(line for line in said.splitlines() if line.startswith("faults: kill"))
    if process.returncode != 0:
        raise AssertionError(f"ended with {process.returncode}:\n{said}")
    return None


def check_latest(out):
    latest = out / "latest"
    if latest.is_symlink() and not (latest / "dataset.json").exists():
        raise AssertionError("`latest` names no dataset")


def differences(expected, got):
    names = sorted(set(expected) | set(got))
    return [name for name in names if expected.get(name) != got.get(name)]


def trial(job, out, draw, most_kills):
    """One to three kills, then a run to the end. Returns where it was killed. Raises AssertionError."""
    places = []
    for _ in range(min(most_kills, draw.choice((1, 1, 2, 3)))):
        place = kill_once(job, out, draw)
        check_latest(out)
        if place:
            places.append(place)
    try:
        run(*job.words(out))
        wrong = differences(job.expected, result_of(out))
        if wrong:
            raise AssertionError(f"other files than without a kill: {', '.join(wrong[:10])}")
        left = [str(path) for path in out.rglob("*") if _TEMPORARY.search(path.name)]
        if left:
            raise AssertionError(f"temporaries are left: {', '.join(left[:10])}")
    except AssertionError as error:
        raise AssertionError(f"killed {'; then '.join(places) or 'never'}\n{error}") from error
    return places


def torture(jobs, folder, kills, draw):
    """Returns the kills by job, and how many trials failed."""
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
            print(f"{job.name}, {out}: {error}", file=sys.stderr)
        number += 1
        if failed >= 5:
            break
    return done, failed, number


def add_program_options(parser):
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/bin/quadruped3d")
    parser.add_argument("--faults", type=pathlib.Path, default=ROOT / "build/release/tests/faults/libq3d_faults.so")


def use_program(arguments):
    """Tells the tests' own package where the program is. False, after a message, if it is not there."""
    for variable, path in (("Q3D_PROGRAM", arguments.program), ("Q3D_FAULTS", arguments.faults)):
        if not path.exists():
            print(f"{sys.argv[0]}: {path}: no such file; build it, or say where it is", file=sys.stderr)
            return False
        os.environ[variable] = str(path.resolve())
    return True


def parsed():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kills", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", default=",".join(JOBS), help="names, separated by commas (default: %(default)s)")
    add_program_options(parser)
    return parser.parse_args()


def main():
    arguments = parsed()
    if not use_program(arguments):
        return 2
    folder = pathlib.Path(tempfile.mkdtemp(prefix="q3d_torture_")).resolve()
    (folder / "shared").mkdir()
    inputs = Inputs(folder / "shared")
    jobs = [Job(name, getattr(inputs, name)()) for name in arguments.jobs.split(",")]
    for job in jobs:
        measure(job, folder / "undisturbed")
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
