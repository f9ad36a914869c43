#!/usr/bin/env python3
"""Samples a CPU second of python/quadruped3d's Dataset beside WebDataset, MosaicML's MDS and the C++ feed, in one run.

    pip install webdataset mosaicml-streaming        # into an environment with torch and ./python[pictures]
    python bench/readers.py out/latest [--seconds 10] [--rounds 3] [--feed build/release/bench/feed_bench]

It packs the samples of a dataset into WebDataset's tar files and into MDS in a temporary folder: the same encoded crops,
and the labels of each sample as one array. Every reader then gives the same thing, a normalised picture of 256 px and
the labels, in an order of its own kind: Dataset by random numbers, MDS by its shuffled epochs, WebDataset from the
shuffle buffer that its documentation recommends (1,000 samples). Before it measures, it checks that all of them give
equal pictures and labels. The C++ feed gives the same too, and augments every sample; it runs with one thread in a
process of its own.

The readers take turns, and the table has the median of the rounds: compare the rows of one run with each other, and
not with those of another run. "bytes" measures how fast samples come off the disk, without decoding a picture. CPU seconds are those of the whole
process, since other work on the machine changes the wall time.
"""

from __future__ import annotations

import argparse
import io
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterator

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "python"))

import quadruped3d  # noqa: E402
from quadruped3d import geometry, pictures  # noqa: E402

try:
    import streaming
    import webdataset
except ImportError as error:
    sys.exit(f"readers.py: {error}. Run: pip install webdataset mosaicml-streaming")

LABELS = ("keypoints_2d", "keypoints_3d", "rotations", "betas")
Sample = tuple[str, np.ndarray | None, np.ndarray]  # id, picture (None: only bytes were read), labels


def shards_of(dataset: quadruped3d.Dataset) -> Iterator[tuple[int, quadruped3d.Shard, int]]:
    """The number of every sample, its shard and its row there."""
    for number in range(len(dataset)):
        yield number, *dataset._locate(number)


def packed(dataset: quadruped3d.Dataset) -> Iterator[tuple[str, bytes, np.ndarray]]:
    """Every sample as other formats store it: id, encoded crop, and one array: the map of the patch, then the labels."""
    for number, shard, row in shards_of(dataset):
        sample = dataset[number]
        patch = geometry.augmented_patch_from_image(shard.read("patch_box_px", row, 1)[0], 1.0, 0.0, 0.0, 0.0, False)
        affine = geometry.patch_from_stored_crop(patch, shard.read("crop_from_image", row, 1)[0])
        labels = [np.asarray(affine, np.float64).ravel(), *(np.asarray(sample[name], np.float64).ravel() for name in LABELS)]
        yield sample["id"], shard.picture(row), np.concatenate(labels)


def unpacked(name: str, crop: bytes, numbers: np.ndarray, decode: bool) -> Sample:
    affine = numbers[:6].reshape(2, 3)
    picture = pictures.normalise(pictures.cut_patch(crop, affine)) if decode else None
    return name, picture, numbers[6:].astype(np.float32)


def of_dataset(dataset: quadruped3d.Dataset, decode: bool, seed: int) -> Generator[Sample, None, None]:
    order = np.random.default_rng(seed)
    while True:
        for number in order.permutation(len(dataset)).tolist():
            if decode:
                sample = dataset[number]
                yield sample["id"], sample["image"], np.concatenate([np.ravel(sample[name]) for name in LABELS])
            else:
                shard, row = dataset._locate(number)
                shard.picture(row)
                columns = ("keypoints_px", "keypoints_3d", "pose", "betas", "patch_box_px", "crop_from_image")
                yield dataset.id(number), None, np.concatenate([shard.read(name, row, 1).ravel() for name in columns])


def of_webdataset(folder: pathlib.Path, decode: bool, seed: int) -> Generator[Sample, None, None]:
    urls = [str(path) for path in sorted(folder.glob("*.tar"))]
    epoch = 0
    while True:
        epoch += 1
        for sample in webdataset.WebDataset(urls, shardshuffle=False, seed=seed + epoch).shuffle(1000):
            numbers = np.load(io.BytesIO(sample["npy"]))
            yield sample["id"].decode(), *unpacked("", sample["crop"], numbers, decode)[1:]


def of_mds(folder: pathlib.Path, decode: bool, seed: int) -> Generator[Sample, None, None]:
    dataset = streaming.StreamingDataset(local=str(folder), shuffle=True, shuffle_seed=seed, batch_size=1)
    try:
        while True:
            for sample in dataset:
                yield unpacked(sample["id"], sample["crop"], sample["labels"], decode)
    finally:
        if dataset._iterator:  # its threads read ahead, in a folder that is removed at the end
            dataset._iterator.exit()


def write_webdataset(dataset: quadruped3d.Dataset, folder: pathlib.Path) -> None:
    folder.mkdir()
    with webdataset.ShardWriter(str(folder / "%06d.tar"), maxcount=1000, verbose=0) as writer:
        for number, (name, crop, numbers) in enumerate(packed(dataset)):
            stream = io.BytesIO()
            np.save(stream, numbers)
            writer.write({"__key__": f"{number:08}", "id": name.encode(), "crop": crop, "npy": stream.getvalue()})


def write_mds(dataset: quadruped3d.Dataset, folder: pathlib.Path) -> None:
    columns = {"id": "str", "crop": "bytes", "labels": "ndarray:float64"}
    with streaming.MDSWriter(out=str(folder), columns=columns, size_limit=1 << 26) as writer:
        for name, crop, numbers in packed(dataset):
            writer.write({"id": name, "crop": crop, "labels": numbers})


def check_that_they_agree(dataset: quadruped3d.Dataset, readers: dict[str, Callable[..., Generator[Sample, None, None]]]) -> None:
    """Raises AssertionError unless every reader gives the samples of the dataset."""
    expected = {sample["id"]: sample for sample in dataset}
    for name, reader in readers.items():
        source = reader(decode=True, seed=0)
        for _ in range(min(50, len(expected))):
            found, picture, labels = next(source)
            wanted = np.concatenate([np.ravel(expected[found][label]) for label in LABELS])
            np.testing.assert_array_equal(picture, expected[found]["image"], err_msg=f"{name}: {found}")
            np.testing.assert_allclose(labels, wanted, atol=1e-6, err_msg=f"{name}: {found}")
        source.close()


def rate(source: Generator[Sample, None, None], seconds: float) -> float:
    """Samples a CPU second, after the first, which opens files. Closes the source."""
    next(source)
    start, count = time.process_time(), 0
    while (elapsed := time.process_time() - start) < seconds:
        next(source)
        count += 1
    source.close()
    return count / elapsed


def rate_of_feed(program: str, source: pathlib.Path, seconds: float) -> float:
    """Samples a CPU second of one thread of the C++ feed."""
    shards = [source] if source.is_file() else sorted(source.rglob("shards/*.h5"))
    printed = subprocess.run([program, str(seconds), *map(str, shards)], check=True, capture_output=True, text=True).stdout
    return float(re.search(r"1 threads: .*, (\d+) a CPU second", printed)[1])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", help="a dataset's folder, an output folder or a shard")
    parser.add_argument("--seconds", type=float, default=10, help="of each measurement")
    parser.add_argument("--feed", help="feed_bench, to measure the C++ feed too")
    parser.add_argument("--rounds", type=int, default=3, help="measurements of each reader")
    options = parser.parse_args()
    dataset = quadruped3d.Dataset(options.source)
    with tempfile.TemporaryDirectory(prefix="q3d_readers_") as home:
        tars, mds = pathlib.Path(home, "tars"), pathlib.Path(home, "mds")
        write_webdataset(dataset, tars)
        write_mds(dataset, mds)
        readers: dict[str, Callable[..., Generator[Sample, None, None]]] = {
            "quadruped3d.Dataset": lambda decode, seed: of_dataset(dataset, decode, seed),
            "WebDataset": lambda decode, seed: of_webdataset(tars, decode, seed),
            "MDS": lambda decode, seed: of_mds(mds, decode, seed),
        }
        check_that_they_agree(dataset, readers)
        rates: dict[tuple[str, bool], list[float]] = {}
        for round_number in range(options.rounds):
            for decode in (True, False):
                for name, reader in readers.items():
                    found = rate(reader(decode=decode, seed=round_number), options.seconds)
                    rates.setdefault((name, decode), []).append(found)
            if options.feed:
                found = rate_of_feed(options.feed, pathlib.Path(options.source), options.seconds)
                rates.setdefault(("C++ feed, augmented", True), []).append(found)
    print(f"{len(dataset)} samples; samples a CPU second, the median of {options.rounds} rounds (least to most)")
    print(f"{'':22}{'picture and labels':>28}{'bytes':>28}")
    for name in dict.fromkeys(name for name, _ in rates):
        cells = [f"{statistics.median(found):.0f} ({min(found):.0f} to {max(found):.0f})" if found else ""
                 for found in (rates[name, True], rates.get((name, False)))]
        print(f"{name:22}{cells[0]:>28}{cells[1]:>28}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
