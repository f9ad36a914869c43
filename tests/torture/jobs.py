"""The jobs that torture runs, on tiny inputs, and what of their output must be equal."""

import argparse
import dataclasses
import functools
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/support"))

from e2e import (Fault, Scene, command, digests, draw_pictures, environment, give_bodies, make_network,  # noqa: E402
                 prima_dataset, run, write_annotations, write_json)

# Files that hold times or places, or that only make a later run faster.
_NOT_COMPARED = re.compile(r"(^|/)(\.lock|digests\.txt|picture_hashes\.txt|log\.jsonl|stages/builds/.*\.(json|stamps))$")
# Journals hold one line for each unit, in the order in which the runs finished them.
_JOURNAL = re.compile(r"(^|/)journal\.jsonl$")
_TEMPORARY = re.compile(r"\.tmp$|\.safetensors\..{6}$|^latest\.tmp$")

# The jobs are in the order of the trials. shared_build is that of shared_build.py.
JOBS = ("labels", "network", "calibrate", "train", "evaluate", "leakage", "merge", "export", "sample", "shared_build")


def result_of(out):
    """What a run left: the digest of every file that must be equal, and the units in its journals."""
    files = {name: digest for name, digest in digests(out).items()
             if not _NOT_COMPARED.search(name) and not _JOURNAL.search(name)}
    for journal in out.rglob("journal.jsonl"):
        files[str(journal.relative_to(out))] = sorted(set(journal.read_text().splitlines()))
    for link in out.glob("latest"):
        files["latest"] = os.readlink(link)
    return files


def differences(expected, got):
    names = sorted(set(expected) | set(got))
    return [name for name in names if expected.get(name) != got.get(name)]


def check_latest(out):
    """`latest` is absent or names a dataset, whatever happened."""
    latest = out / "latest"
    if latest.is_symlink() and not (latest / "dataset.json").exists():
        raise AssertionError("`latest` names no dataset")


def check_no_temporaries(out):
    left = [str(path) for path in out.rglob("*") if _TEMPORARY.search(path.name)]
    if left:
        raise AssertionError(f"temporaries are left: {', '.join(left[:10])}")


def counted_calls(said):
    """How many calls a Fault counted in the process that wrote `said` to stderr."""
    return max(map(int, re.findall(r"faults: counted (\d+) calls", said)), default=0)


@dataclasses.dataclass
class Job:
    """A command that writes into the folder `out`."""

    name: str
    words: Callable[[pathlib.Path], list]
    seconds: float = 0.0  # of an undisturbed run
    changes: int = 0  # writes, syncs, renames and links of an undisturbed run below its folder
    expected: dict = dataclasses.field(default_factory=dict)

    def run(self, out):
        """Runs to the end. Raises AssertionError if that is no success."""
        run(*self.words(out))

    def measure(self, out):
        """Runs undisturbed, twice: the files must be equal, and the calls are counted."""
        start = time.monotonic()
        self.run(out)
        self.seconds = time.monotonic() - start
        self.expected = result_of(out)
        shutil.rmtree(out)
        self.changes = counted_calls(run(*self.words(out), fault=Fault(str(out), "change", action="count")).stderr)
        self.check_equal(out)
        shutil.rmtree(out)

    def check_equal(self, out):
        wrong = differences(self.expected, result_of(out))
        if wrong:
            raise AssertionError(f"other files than in an undisturbed run: {', '.join(wrong[:10])}")

    def check_completes(self, out):
        """The same command, undisturbed, ends with the expected files and leaves no temporary file."""
        self.run(out)
        self.check_equal(out)
        check_no_temporaries(out)

    def kill_once(self, out, draw):
        """Starts the job and kills it. Returns where; None if it ended before."""
        fault, delay, where = None, None, ""
        if draw.random() < 0.6 and self.changes:
            fault = Fault(str(out), "change", action="kill", skip=draw.randrange(self.changes))
        else:
            delay = draw.uniform(0.0, self.seconds)
            where = f"after {delay:.3f} s"
        process = subprocess.Popen(command(self.words(out)), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                   text=True, env=environment(fault))
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


class Inputs:
    """The jobs, and their inputs below `shared`; what no job asks for is not made."""

    def __init__(self, shared):
        self.shared = shared
        shared.mkdir(parents=True)

    def job(self, name):
        if name == "shared_build":
            from shared_build import SharedBuild  # here, since that module builds on this one

            return SharedBuild.make(self.scene)
        return Job(name, getattr(self, name)())

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

    def evaluate(self):
        config = write_json(self.shared / "evaluation.json", {
            "datasets": [prima_dataset(self.data, name) for name in ("one", "two", "three")],
            "network": {"checkpoint": str(self.scene.network), "smal_asset": str(self.scene.body), "device": "cpu",
                        "compute_threads": 1}})
        return lambda out: ["evaluate", "--config", config, "--out", out, "--tta", 1, "--quiet"]

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


def parser_of(description, jobs=JOBS):
    """A parser with the options that the scripts on jobs share; `jobs` are the default of --jobs."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", default=",".join(jobs), help="names, separated by commas (default: %(default)s)")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/bin/quadruped3d")
    parser.add_argument("--faults", type=pathlib.Path, default=ROOT / "build/release/tests/faults/libq3d_faults.so")
    return parser


def parse(parser):
    """The arguments. Tells the tests' own package where the program is, and ends with 2 if it is not there."""
    arguments = parser.parse_args()
    for variable, path in (("Q3D_PROGRAM", arguments.program), ("Q3D_FAULTS", arguments.faults)):
        if not path.exists():
            print(f"{sys.argv[0]}: {path}: no such file; build it, or say where it is", file=sys.stderr)
            sys.exit(2)
        os.environ[variable] = str(path.resolve())
    return arguments
