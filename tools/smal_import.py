"""Converts the official SMAL pickles (Python 2, with chumpy and scipy objects) to plain safetensors files.

The body model gets the form that smal/tensors/asset.h describes. The shape and pose priors get their names in the official
checkpoint.
"""

from __future__ import annotations

import json
import os
from typing import Callable, Sequence

import numpy as np

import pickled_arrays
import restricted_pickle
import safetensors_file
from prima_names import BETAS, FACES, FAMILIES, JOINTS, KEYPOINTS, VERTICES
from restricted_pickle import BrokenPickle, Record

MAX_FILE_BYTES = 1 << 30  # the SMAL model takes 34 MB as binary numbers and about 90 MB in protocol 0
KEYPOINT_FILE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "keypoint_vertices.json")
BODY_FORMAT = "quadruped3d-smal-1"
PRIORS_FORMAT = "quadruped3d-priors-1"
LICENCE = (
    "SMAL model licence of the Max Planck Institute for Intelligent Systems: non-commercial scientific research only, "
    "no redistribution; https://smal.is.tue.mpg.de/license.html"
)

Say = Callable[[str], None]


def import_body(source: str, target: str, say: Say) -> None:
    """Converts the body model. Throws BrokenPickle and RefusedPickle, whose messages name the file and the field, and
    OSError."""
    table = _Table(source)
    shapedirs = table.numbers("shapedirs", (VERTICES, 3, None))
    if shapedirs.shape[2] < BETAS:
        raise BrokenPickle(f"{source}: shapedirs has {shapedirs.shape[2]} shape directions, expected {BETAS} or more")
    posedirs = table.numbers("posedirs", (VERTICES, 3, 9 * (JOINTS - 1)))
    groups = _keypoint_groups()
    tensors = {
        "v_template": table.numbers("v_template", (VERTICES, 3)),
        "faces": table.indices("f", (FACES, 3), VERTICES),
        "shapedirs": np.ascontiguousarray(shapedirs[:, :, :BETAS]),
        "posedirs": np.ascontiguousarray(posedirs.reshape(3 * VERTICES, -1).T),
        "J_regressor": table.numbers("J_regressor", (JOINTS, VERTICES)),
        "lbs_weights": table.numbers("weights", (VERTICES, JOINTS)),
        "parents": _parents(table),
        "keypoint_vertices": np.concatenate(groups).astype(np.int32),
        "keypoint_offsets": np.cumsum([0] + [len(group) for group in groups], dtype=np.int32),
    }
    for name in ("J_regressor", "lbs_weights"):
        _check_rows_sum_to_one(f"{source}: {name}", tensors[name])
    _write(target, tensors, {"format": BODY_FORMAT, "name": "SMAL"}, [source])
    say(
        f"{target}: {VERTICES} vertices, {FACES} faces, {JOINTS} joints, {BETAS} shape directions"
        f" (of {shapedirs.shape[2]} in the file), {KEYPOINTS} keypoints\n  licence: {LICENCE}"
    )


def import_priors(families_source: str, pose_source: str, target: str, say: Say) -> None:
    """Converts the shape families and the pose prior. Throws as import_body() does.

    As in the official code, each family is stored as a Cholesky factor of its regularised inverse covariance, and the
    pose prior as the factor that its file holds (`pic`).
    """
    families, pose = _Table(families_source), _Table(pose_source)
    means = families.numbers("cluster_means", (FAMILIES, BETAS))
    covariances = families.numbers("cluster_cov", (FAMILIES, BETAS, BETAS), np.float64)
    mean_pose = pose.numbers("mean_pose", (3 * JOINTS,))
    precision = pose.numbers("pic", (3 * JOINTS, 3 * JOINTS), np.float64)
    _check_pose_factor(pose, precision)
    tensors = {
        "shape_prior_loss.betas_prec": _precision_factors(families_source, covariances).astype(np.float32),
        "shape_prior_loss.mean_betas": means,
        "pose_prior_loss.mean_pose": mean_pose,
        "pose_prior_loss.precs": precision.astype(np.float32),
        # The first three numbers are the global orientation, which the prior does not judge.
        "pose_prior_loss.use_index": np.array([0.0] * 3 + [1.0] * (3 * (JOINTS - 1)), np.float32),
    }
    _write(target, tensors, {"format": PRIORS_FORMAT, "name": "SMAL priors"}, [families_source, pose_source])
    say(f"{target}: {FAMILIES} shape families of {BETAS} betas, a pose prior of {JOINTS} parts\n  licence: {LICENCE}")


class _Table:
    """The top-level dict of a pickle. Every field is checked when it is read."""

    def __init__(self, path: str):
        self.path = path
        size = os.stat(path).st_size
        if size > MAX_FILE_BYTES:
            raise BrokenPickle(f"{path}: {size} bytes, expected at most {MAX_FILE_BYTES}")
        with open(path, "rb") as file:
            data = file.read()
        if data.startswith(b"version https://git-lfs") or data.lstrip()[:1] == b"<":
            raise BrokenPickle(f"{path}: is a web page or a Git LFS pointer, not the file itself; download it again")
        root = restricted_pickle.load(data, path)
        self.fields = root.entries if isinstance(root, Record) else root
        if not isinstance(self.fields, dict):
            raise BrokenPickle(f"{path}: holds a {type(root).__name__}, expected a dict")

    def numbers(self, name: str, shape: Sequence, dtype=np.float32) -> np.ndarray:
        """Returns a field as an array of finite numbers of the given shape, in which None accepts any size."""
        values = self._field(name)
        if values.dtype.kind not in "fiu":
            raise BrokenPickle(f"{self.path}: {name} has dtype {values.dtype}, expected numbers")
        matches = values.ndim == len(shape) and all(want in (None, got) for want, got in zip(shape, values.shape))
        if not matches:
            expected = ", ".join("any" if size is None else str(size) for size in shape)
            raise BrokenPickle(f"{self.path}: {name} has the shape {list(values.shape)}, expected [{expected}]")
        with np.errstate(over="ignore"):  # an overflow gives infinity, which is reported below
            values = np.asarray(values, dtype, order="C")
        if not np.isfinite(values).all():
            raise BrokenPickle(f"{self.path}: {name} holds a number that is not finite in {values.dtype}")
        return values

    def indices(self, name: str, shape: Sequence, limit: int) -> np.ndarray:
        values = self.numbers(name, shape, np.float64)  # float64 represents every valid index exactly
        if values.min() < 0 or values.max() >= limit or (values % 1).any():
            found = f"{values.min():g} to {values.max():g}"
            raise BrokenPickle(f"{self.path}: {name} holds {found}, expected whole numbers from 0 to {limit - 1}")
        return values.astype(np.int32)

    def _field(self, name: str) -> np.ndarray:
        if name not in self.fields:
            have = ", ".join(sorted(str(key)[:40] for key in self.fields)[:20])
            raise BrokenPickle(f"{self.path}: no field '{name}'; it has: {have}")
        try:
            return pickled_arrays.matrix(self.fields[name], name)
        except BrokenPickle as error:
            raise BrokenPickle(f"{self.path}: {error}") from None


def _parents(table: _Table) -> np.ndarray:
    """Returns row 0 of the kinematic table. The root's parent is -1, which is 4294967295 in unsigned 32-bit numbers."""
    parents = table.numbers("kintree_table", (2, JOINTS), np.float64)[0]
    parents = np.where(parents == 4294967295, -1, parents)
    before = [0 <= parent < joint and parent % 1 == 0 for joint, parent in enumerate(parents)]
    if parents[0] != -1 or not all(before[1:]):
        joint = 0 if parents[0] != -1 else before.index(False, 1)
        raise BrokenPickle(
            f"{table.path}: kintree_table gives joint {joint} the parent {parents[joint]:g}, expected "
            + ("-1 (or 4294967295) for the root" if joint == 0 else f"one of 0 to {joint - 1}")
        )
    return parents.astype(np.int32)


def _check_rows_sum_to_one(what: str, rows: np.ndarray, tolerance: float = 1e-3) -> None:
    sums = rows.sum(axis=1, dtype=np.float64)
    worst = int(np.abs(sums - 1).argmax())
    if abs(sums[worst] - 1) > tolerance:
        raise BrokenPickle(f"{what}: row {worst} sums to {sums[worst]:.6g}, expected 1")


def _precision_factors(source: str, covariances: np.ndarray) -> np.ndarray:
    """Returns the lower Cholesky factors L with L L^T = (covariance + 1e-5 I)^-1, as in the official ShapePriorLoss."""
    try:
        with np.errstate(all="ignore"):  # what overflows is reported below
            factors = np.linalg.cholesky(np.linalg.inv(covariances + 1e-5 * np.eye(BETAS)))
    except np.linalg.LinAlgError as error:
        raise BrokenPickle(f"{source}: cluster_cov holds a matrix that is not a covariance ({error})") from None
    if not np.isfinite(factors).all():
        raise BrokenPickle(f"{source}: cluster_cov holds a matrix whose inverse is not finite")
    return factors


def _check_pose_factor(pose: _Table, factor: np.ndarray, tolerance: float = 1e-6) -> None:
    """Checks that the factor belongs to the covariance, if the file holds the covariance."""
    if "cov" not in pose.fields:
        return
    covariance = pose.numbers("cov", factor.shape, np.float64)
    with np.errstate(all="ignore"):  # what overflows is not a number, and reported below
        difference = np.abs(factor @ factor.T @ covariance - np.eye(len(factor))).max()
    if not difference <= tolerance:  # also where it is not a number
        raise BrokenPickle(
            f"{pose.path}: pic pic^T cov differs from the identity by {difference:.3g}, so pic does not belong to cov"
        )


def _keypoint_groups() -> list[list[int]]:
    with open(KEYPOINT_FILE, encoding="utf-8") as file:
        return [entry["vertices"] for entry in json.load(file)["keypoints"]]


def _write(target: str, tensors: dict[str, np.ndarray], metadata: dict[str, str], sources: Sequence[str]) -> None:
    entries = {name: safetensors_file.from_array(values) for name, values in tensors.items()}
    metadata |= {"licence": LICENCE, safetensors_file.SOURCE_KEY: safetensors_file.source_names(sources)}
    safetensors_file.write(target, entries, metadata)
