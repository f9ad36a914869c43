#!/usr/bin/env python3
"""Flips single bits in, and cuts, the files of a finished output folder, and lets the program meet them.

    .venv/bin/python tests/torture/rot.py 300

Every trial damages one file of a copy: a table of a stage, a shard, a journal, a manifest, verdicts.csv, dataset.json or
the cache of digests. `verify --stages` must find it, unless nothing depends on the damage. Then one of these follows, in
turn: the same build; a build with other stored crops, which uses the stages' tables; `verify --repair`. The version that
it leaves must be equal to one from nothing. The last line counts; the exit code is 1 if a trial ended otherwise.
"""

import argparse
import collections
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/support"))

from e2e import (digests, draw_pictures, give_bodies, latest, prima_dataset, run, write_annotations,  # noqa: E402
                 write_json)

# Damage in these files may go unnoticed: a damaged line of the cache is not used, and a torn last line of a journal
# looks like the result of a kill.
_MAY_PASS_VERIFY = {"digests.txt", "journal.jsonl"}


def damage(path, draw):
    """Flips a bit of the file, or cuts it (one time in five), in place: other hard links of it change too. Returns what
    was done."""
    content = bytearray(path.read_bytes())
    path.chmod(0o644)
    if draw.random() < 0.2:
        size = draw.randrange(len(content))
        os.truncate(path, size)
        return f"cut to {size} of {len(content)} bytes"
    at, bit = draw.randrange(len(content)), draw.randrange(8)
    content[at] ^= 1 << bit
    with open(path, "r+b") as file:
        file.write(content)
    return f"bit {bit} of byte {at} flipped"


def kind_of(path, out):
    """What sort of file it is, for the count."""
    parts = path.relative_to(out).parts
    if parts[0] == "stages":
        return f"{parts[1].split('-')[0]} {'table' if path.suffix == '.h5' else path.name}"
    return "published shard" if path.suffix == ".h5" else path.name


class Rot:
    def __init__(self, folder, draw):
        self.folder, self.draw = folder, draw
        data = folder / "data"
        write_annotations(data, give_bodies(draw_pictures(data, 12)))
        self.configs = {quality: write_json(folder / f"{quality}.json", {
            "name": "rot", "shards": {"unit_size": 3, "jpeg_quality": quality},
            "datasets": [prima_dataset(data, role="truth")]}) for quality in (95, 80)}
        self.expected = {}
        for quality in self.configs:
            self.build(folder / f"clean{quality}", quality)
            self.expected[quality] = digests(latest(folder / f"clean{quality}"))
        self.version = latest(folder / "clean95").name
        self.files = sorted(path.relative_to(folder / "clean95") for path in (folder / "clean95").rglob("*")
                            if path.is_file() and path.name != ".lock" and path.stat().st_size > 0
                            and "latest" not in path.relative_to(folder / "clean95").parts)

    def build(self, out, quality):
        run("build", "--config", self.configs[quality], "--out", out, "--quiet")

    def trial(self, number):
        """Returns (kind of file, whether verify found the damage). Raises AssertionError."""
        out = self.folder / f"trial{number}"
        subprocess.run(["cp", "-a", self.folder / "clean95", out], check=True)
        path = out / self.draw.choice(self.files)
        what = f"{path}: {damage(path, self.draw)}"
        found = run("verify", out, "--stages", "--quiet", expect=None).returncode == 1
        if not found and path.name not in _MAY_PASS_VERIFY and path.suffix != ".stamps":
            raise AssertionError(f"{what}: verify did not find it")
        quality = 95
        if number % 3 == 0:
            self.build(out, 95)
        elif number % 3 == 1:
            quality = 80
            self.build(out, 80)
        else:
            run("verify", out, "--repair", "--config", self.configs[95], "--quiet")
        version = latest(out)
        if digests(version) != self.expected[quality]:
            raise AssertionError(f"{what}: a build then gave other files")
        shutil.rmtree(out)
        return kind_of(path, out), found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trials", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/bin/quadruped3d")
    arguments = parser.parse_args()
    if not arguments.program.exists():
        print(f"rot: {arguments.program}: no such file; build it, or say where it is", file=sys.stderr)
        return 2
    os.environ["Q3D_PROGRAM"] = str(arguments.program.resolve())
    folder = pathlib.Path(tempfile.mkdtemp(prefix="q3d_rot_")).resolve()
    rot = Rot(folder, random.Random(arguments.seed))
    kinds, found, failed = collections.Counter(), 0, 0
    for number in range(arguments.trials):
        try:
            kind, was_found = rot.trial(number)
            kinds[kind] += 1
            found += was_found
        except AssertionError as error:
            failed += 1
            print(error, file=sys.stderr)
    print(", ".join(f"{kind} {count}" for kind, count in sorted(kinds.items())))
    print(f"{arguments.trials} damaged files: verify found {found}, {arguments.trials - failed} ended with equal files, "
          f"{failed} did not")
    if failed:
        return 1
    shutil.rmtree(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
