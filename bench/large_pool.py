#!/usr/bin/env python3
"""Makes a pool of many small annotated candidates, and measures builds of it.

    python bench/large_pool.py make FOLDER CANDIDATES      pictures (hard links of a few), annotations, configs
    python bench/large_pool.py measure FOLDER PROGRAM      one line of JSON a run: seconds, peak memory

The pictures are 96 x 72 px JPEG files. A thousand different ones are linked under as many names as there are
candidates, so that a million take little space; every candidate has keypoints of its own. `measure` builds the pool as
`2d_only`, which needs no network, then again with nothing to do, with a veto that removes one candidate, and under
another name, for which every shard is written anew from the stored crops. A candidate's memory is the difference of the
peaks of two pools, divided by the difference of their numbers of candidates.
"""

import json
import os
import pathlib
import resource
import subprocess
import sys
import time

import numpy as np
from PIL import Image

DIFFERENT = 1000
FOLDER_SIZE = 10000  # pictures of one folder
WIDTH, HEIGHT = 96, 72


def draw(folder):
    """Writes the different pictures and returns their paths."""
    generator = np.random.default_rng(1)
    folder.mkdir(parents=True)
    paths = []
    for i in range(DIFFERENT):
        coarse = Image.fromarray(generator.integers(0, 255, (6, 8, 3), dtype=np.uint8))
        path = folder / f"{i:04}.jpg"
        coarse.resize((WIDTH, HEIGHT), Image.Resampling.BICUBIC).save(path, quality=90)
        paths.append(path)
    return paths


def records(data, sources, count):
    """Links the pictures and yields the annotations."""
    generator = np.random.default_rng(2)
    for i in range(count):
        name = f"images/{i // FOLDER_SIZE:04}/{i:07}.jpg"
        if i % FOLDER_SIZE == 0:
            (data / name).parent.mkdir(parents=True)
        os.link(sources[i % len(sources)], data / name)
        points = np.round(generator.uniform((8, 8), (88, 64), (26, 2)), 2)
        visible = generator.random(26) < 0.8
        yield {"img_path": name, "mask_path": "", "bbox": [4, 4, 88, 64], "supercategory": i % 5, "height": HEIGHT,
               "width": WIDTH, "keypoint_2d": [[x, y, int(v)] for (x, y), v in zip(points.tolist(), visible)]}


def make(folder, count):
    data = folder / "data"
    sources = draw(folder / "sources")
    data.mkdir()
    with open(data / "train.json", "w") as file:
        file.write('{"data": [')
        for i, record in enumerate(records(data, sources, count)):
            file.write((",\n" if i else "\n") + json.dumps(record))
        file.write("\n]}\n")
    config = {"name": "large", "datasets": [{"name": "large", "format": "prima", "root": "data",
                                             "annotations": "train.json", "role": "2d_only"}]}
    (folder / "config.json").write_text(json.dumps(config))
    (folder / "veto.json").write_text(json.dumps({**config, "veto": "veto.txt"}))
    (folder / "renamed.json").write_text(json.dumps({**config, "name": "renamed"}))
    (folder / "veto.txt").write_text(f"large/train/images/{count // 2 // FOLDER_SIZE:04}/{count // 2:07}.jpg#{count // 2}\n")


def run(program, folder, what, config):
    """Builds, and prints what it took. The seconds are those of the whole process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.monotonic()
    words = ["/usr/bin/time", "-f", "%M", program, "build", "--config", folder / config, "--out", folder / "out",
             "--quiet", "--json"]
    result = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    seconds = time.monotonic() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if result.returncode != 0:
        sys.exit(f"{what}: {result.stderr}")
    summary = json.loads(result.stdout)
    print(json.dumps({"what": what, "candidates": summary["candidates"], "kept": summary["retained"],
                      "up_to_date": summary["up_to_date"], "seconds": round(seconds, 2),
                      "cpu_seconds": round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 2),
                      "peak_mb": round(int(result.stderr.split()[-1]) / 1024, 1)}), flush=True)


def measure(folder, program):
    run(program, folder, "build", "config.json")
    run(program, folder, "nothing to do", "config.json")
    run(program, folder, "one veto", "veto.json")
    run(program, folder, "nothing to do, other config", "veto.json")
    run(program, folder, "every shard anew", "renamed.json")


if __name__ == "__main__":
    if len(sys.argv) == 4 and sys.argv[1] == "make":
        make(pathlib.Path(sys.argv[2]).resolve(), int(sys.argv[3]))
    elif len(sys.argv) == 4 and sys.argv[1] == "measure":
        measure(pathlib.Path(sys.argv[2]).resolve(), sys.argv[3])
    else:
        sys.exit(__doc__)
