"""Reads a shard that this program wrote through another library, with nothing but docs/shard-format.md.

usage: read_with_h5py.py WRITER   (WRITER PATH writes the fixture of shard_fixture.h and prints its SHA-256)

Element k of an array column in row r is start + 100 r + k / 8; the starts are those of shard_fixture.h.
"""

import hashlib
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

ROWS = 3

ARRAYS = {  # name: (start, row shape, dtype)
    "box_xywh_px": (1, (4,), "<f8"),
    "keypoints_px": (2, (26, 2), "<f8"),
    "crop_from_image": (3, (2, 3), "<f8"),
    "patch_box_px": (4, (3,), "<f8"),
    "pose": (5, (35, 3, 3), "<f4"),
    "betas": (6, (41,), "<f4"),
    "camera": (7, (3,), "<f4"),
    "trans": (8, (3,), "<f4"),
    "keypoints_3d": (9, (26, 3), "<f4"),
    "projected_2d": (10, (26, 2), "<f4"),
}

TRUTH_ARRAYS = {
    "truth_pose": (11, (35, 3)),
    "truth_betas": (12, (41,)),
    "truth_trans": (13, (3,)),
    "truth_keypoints_3d": (14, (26, 3)),
}

NUMBERS = {  # name: (values, dtype)
    "family": ([-1, 0, 1], "|i1"),
    "annotated_width_px": ([640, 640, 640], "<i4"),
    "annotated_height_px": ([480, 481, 482], "<i4"),
    "image_width_px": ([641, 641, 641], "<i4"),
    "image_height_px": ([481, 482, 483], "<i4"),
    "crop_side_px": ([480, 480, 480], "<i4"),
    "initial_error": ([0.25, 1.25, 2.25], "<f8"),
    "final_error": ([0.125, 1.125, 2.125], "<f8"),
    "gain": ([math.nan, 0.5, 0.5], "<f8"),
    "iterations": ([0, 10, 20], "<i4"),
    "best_iteration": ([0, 7, 14], "<i4"),
    **{name: ([math.nan, 115 + c / 8, 215 + c / 8], "<f8") for c, name in enumerate([
        "trust", "trust_mirror", "trust_aux_2d", "trust_aux_3d", "trust_pose_prior", "trust_shape_prior",
        "trust_limbs", "trust_sides", "trust_mask", "trust_visible"])},
    "has_pose": ([1, 1, 1], "|u1"),
    "has_betas": ([0, 0, 0], "|u1"),
    "has_keypoints_3d": ([0, 1, 0], "|u1"),
    "truth_present": ([0, 1, 0], "|u1"),
    "truth_has_pose": ([0, 0, 0], "|u1"),
    "truth_has_betas": ([0, 1, 0], "|u1"),
    "truth_has_keypoints_3d": ([0, 0, 0], "|u1"),
}

TEXTS = {
    "id": ["world/train/img0.png#0", "world/train/img1.png#1", "world/train/img2.png#2"],
    "dataset": ["world"] * 3,
    "split": ["train"] * 3,
    "source": ["", "sub", "sub"],
    "species": ["żubr", "red fox", "red fox"],
    "image_ref": ["img0.png", "img1.png", "img2.png"],
    "image_sha256": ["a" * 64, "b" * 64, "c" * 64],
    "label_kind": ["retained", "refined", "refined"],
    "verdict": ["retained", "refined", "refined"],
    "reason": ["none"] * 3,
    "detail": [""] * 3,
}

BLOBS = {
    "crop": [b"crop\0", b"crop\xff\0", b"crop\xff\xff\0"],
    "crop_mask": [b"", b"mask", b""],
}

ATTRIBUTES = {
    "format": "quadruped3d-shard",
    "schema": "2",
    "dataset": "quadruped3d",
    "version": "0123456789ab",
    "unit": "42",
    "image_encoding": "png",
}


def expected_array(start, shape, row):
    return start + 100.0 * row + np.arange(math.prod(shape)).reshape(shape) / 8.0


def check_attributes(shard):
    assert shard.attrs["rows"] == ROWS
    for name, value in ATTRIBUTES.items():
        assert shard.attrs[name].decode() == value, (name, shard.attrs[name])
    assert set(shard.attrs) == set(ATTRIBUTES) | {"rows", "columns", "keypoint_names", "datasets"}
    names = json.loads(shard.attrs["keypoint_names"])
    assert len(names) == 26 and names[0] == "left_eye" and names[19] == "tail_tip" and names[25] == "tail_mid", names
    assert json.loads(shard.attrs["datasets"]) == {
        "wild/test": {"licence": "", "source_url": "", "citation": ""},
        "world/train": {"licence": "CC0-1.0", "source_url": "https://example.org/world",
                        "citation": 'The "world" of 2026'},
    }


def check_numbers(shard):
    for name, (start, shape, dtype) in ARRAYS.items():
        assert shard[name].dtype == np.dtype(dtype), name
        expected = np.stack([expected_array(start, shape, row) for row in range(ROWS)])
        np.testing.assert_array_equal(shard[name][:], expected, err_msg=name)
    for name, (start, shape) in TRUTH_ARRAYS.items():
        assert shard[name].dtype == np.dtype("<f4"), name
        expected = np.zeros((ROWS, *shape))
        expected[1] = expected_array(start, shape, 1)
        np.testing.assert_array_equal(shard[name][:], expected, err_msg=name)
    for name, (values, dtype) in NUMBERS.items():
        assert shard[name].dtype == np.dtype(dtype), name
        np.testing.assert_array_equal(shard[name][:], values, err_msg=name)
    even = np.arange(26) % 2 == 0
    for name, odd_even in {"keypoints_v": (2, -1), "keypoints_weight": (1, 0)}.items():
        assert shard[name].dtype == np.dtype("<f4"), name
        np.testing.assert_array_equal(shard[name][:], np.tile(np.where(even, odd_even[1], odd_even[0]), (ROWS, 1)))


def check_texts_and_blobs(shard):
    for name, values in TEXTS.items():
        assert h5py.check_string_dtype(shard[name].dtype).encoding == "utf-8", name
        assert list(shard[name].asstr()[:]) == values, (name, shard[name][:])
    for name, values in BLOBS.items():
        offsets = shard[name + "_offsets"][:]
        assert offsets.dtype == np.dtype("<i8")
        got = [shard[name][a:b].tobytes() for a, b in zip(offsets[:-1], offsets[1:])]
        assert got == values, (name, got)


def check_description(shard):
    described = json.loads(shard.attrs["columns"])
    blobs = {name for name, about in described.items() if about["dtype"] == "bytes"}
    assert set(shard) == set(described) | {name + "_offsets" for name in blobs}
    for name, about in described.items():
        assert about["meaning"], name
        if about["dtype"] == "bytes":
            continue
        assert about["shape"] == "(rows" + "".join(f", {n}" for n in shard[name].shape[1:]) + ")", name
        assert about["dtype"] == ("text" if shard[name].dtype.kind == "S" else str(shard[name].dtype)), name
    tested = set(ARRAYS) | set(TRUTH_ARRAYS) | set(NUMBERS) | set(TEXTS) | set(BLOBS)
    assert set(described) == tested | {"keypoints_v", "keypoints_weight"}


def main():
    writer = sys.argv[1]
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / "a.h5", Path(folder) / "b.h5"]
        digests = [subprocess.run([writer, path], check=True, capture_output=True, text=True).stdout for path in paths]
        assert digests[0] == digests[1], "two processes wrote different bytes"
        assert digests[0] == hashlib.sha256(paths[0].read_bytes()).hexdigest()
        with h5py.File(paths[0], "r") as shard:
            check_attributes(shard)
            check_numbers(shard)
            check_texts_and_blobs(shard)
            check_description(shard)


main()
