"""Crops and cameras: where a point of the photograph lies in the network's crop, and where a 3D point is projected.

Frames (docs/shard-format.md):

    source image    px, origin at the top left of the picture as stored, x right, y down
    stored crop     px of the picture in a shard's column `crop`; `crop_from_image` maps the source image to it
    patch           px of the network's input, 256 square
    crop units      the network's input with side 1, origin at its centre: patch px / 256 - 0.5
    camera          x right, y down, z forward; focal length 1000 px on a patch of 256 px; SMAL units

Affine maps are arrays of shape (2, 3): (x', y') = A (x, y, 1). The crop is the official one (PRIMA's
gen_trans_from_patch_cv), which rounds in float32 on the way; so does this module, to the last bit.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]

PATCH_SIDE_PX = 256
FOCAL_PX = 1000.0
FOCAL = FOCAL_PX / PATCH_SIDE_PX  # in sides of the crop

# The mirror of a patch about the principal point of its camera, px 128.
_MIRROR = np.array([[-1.0, 0.0, PATCH_SIDE_PX], [0.0, 1.0, 0.0]])


def square_box(box_xywh_px: npt.ArrayLike) -> Floats:
    """The network's square crop around a box (left, top, width, height): (centre x, centre y, side), px.

    The centre is floored, as in the official TrainDataset.
    """
    x, y, w, h = (float(value) for value in np.asarray(box_xywh_px, np.float64))
    return np.array([math.floor((2 * x + w) / 2), math.floor((2 * y + h) / 2), max(w, h, 1.0)])


def patch_from_image(patch_box_px: npt.ArrayLike, scale: float = 1.0, rotation_deg: float = 0.0) -> Floats:
    """The map from the source image to the patch of a square box (centre x, centre y, side): (2, 3).

    `scale` > 1 shows more of the surroundings. The box turns by `rotation_deg`, so that the content of the patch
    turns the other way. Raises ValueError if the box has no area.
    """
    centre_x, centre_y, side = (float(value) for value in np.asarray(patch_box_px, np.float64))
    angle = math.pi * rotation_deg / 180.0
    sine, cosine = math.sin(angle), math.cos(angle)
    half = float(np.float32(side * scale * 0.5))
    # The offsets of the middle of the lower edge and of the right edge from the centre.
    offsets = ((0.0, 0.0), (0.0 * cosine - half * sine, 0.0 * sine + half * cosine), (half * cosine, half * sine))
    source = [(_rounded(centre_x + _rounded(x)), _rounded(centre_y + _rounded(y))) for x, y in offsets]
    middle, end = PATCH_SIDE_PX / 2.0, float(PATCH_SIDE_PX)
    return _affine_through(source, [(middle, middle), (middle, end), (end, middle)])


def augmented_patch_from_image(
    patch_box_px: npt.ArrayLike,
    scale: float = 1.0,
    rotation_deg: float = 0.0,
    shift_x: float = 0.0,
    shift_y: float = 0.0,
    mirror: bool = False,
) -> Floats:
    """The map from the source image to an augmented patch: (2, 3).

    The shifts are shares of the box's side, before it is scaled. A mirrored patch is mirrored last.
    """
    centre_x, centre_y, side = (float(value) for value in np.asarray(patch_box_px, np.float64))
    shifted = (centre_x + side * shift_x, centre_y + side * shift_y, side)
    upright = patch_from_image(shifted, scale, rotation_deg)
    return compose(_MIRROR, upright) if mirror else upright


def compose(second: npt.ArrayLike, first: npt.ArrayLike) -> Floats:
    """The map that applies `first` and then `second`: (2, 3)."""
    (a0, a1, a2), (a3, a4, a5) = np.asarray(second, np.float64).tolist()
    (b0, b1, b2), (b3, b4, b5) = np.asarray(first, np.float64).tolist()
    return np.array(
        [
            [a0 * b0 + a1 * b3, a0 * b1 + a1 * b4, a0 * b2 + a1 * b5 + a2],
            [a3 * b0 + a4 * b3, a3 * b1 + a4 * b4, a3 * b2 + a4 * b5 + a5],
        ]
    )


def invert(affine: npt.ArrayLike) -> Floats:
    """The inverse map: (2, 3). Raises ValueError if there is none."""
    (a0, a1, a2), (a3, a4, a5) = np.asarray(affine, np.float64).tolist()
    determinant = a0 * a4 - a1 * a3
    if determinant == 0.0 or not math.isfinite(1.0 / determinant):
        raise ValueError(f"affine map: got determinant {determinant}, expected one that can be inverted")
    scale = 1.0 / determinant
    l0, l1, l3, l4 = a4 * scale, -a1 * scale, -a3 * scale, a0 * scale
    return np.array([[l0, l1, -(l0 * a2 + l1 * a5 + 0.0)], [l3, l4, -(l3 * a2 + l4 * a5 + 0.0)]])


def patch_from_stored_crop(patch_from_image_px: npt.ArrayLike, crop_from_image_px: npt.ArrayLike) -> Floats:
    """The map from a shard's stored crop to the patch: (2, 3)."""
    return compose(patch_from_image_px, invert(crop_from_image_px))


def map_points(affine: npt.ArrayLike, points: npt.ArrayLike) -> Floats:
    """Applies a map to points of shape (..., 2)."""
    matrix = np.asarray(affine, np.float64)
    at = np.asarray(points, np.float64)
    x, y = at[..., 0], at[..., 1]
    return np.stack(
        [matrix[i, 0] * x + matrix[i, 1] * y + matrix[i, 2] for i in range(2)],
        axis=-1,
    )


def keypoints_to_crop(keypoints_px: npt.ArrayLike, patch_from_image_px: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Keypoints of the source image, (..., 2) px, in crop units, as float32.

    The patch's pixels are rounded to float32 and then mapped to [-0.5, 0.5] in float32, as the official code does.
    """
    patch_px = map_points(patch_from_image_px, keypoints_px).astype(np.float32)
    return (patch_px / np.float32(PATCH_SIDE_PX) - np.float32(0.5)).astype(np.float32)


def crop_to_image(points: npt.ArrayLike, patch_box_px: npt.ArrayLike) -> Floats:
    """Points in crop units, (..., 2), in px of the source image; for the crop without augmentation."""
    centre_x, centre_y, side = np.asarray(patch_box_px, np.float64)
    return np.asarray(np.asarray(points, np.float64) * side + np.array([centre_x, centre_y]))


def translation_from_camera(camera: npt.ArrayLike) -> Floats:
    """The translation of a body, (..., 3) in SMAL units, of weak-perspective cameras (s, tx, ty)."""
    values = np.asarray(camera, np.float64)
    depth = 2.0 * FOCAL / values[..., 0]
    return np.stack([values[..., 1], values[..., 2], depth], axis=-1)


def project(points_3d: npt.ArrayLike, trans: npt.ArrayLike) -> Floats:
    """Projects 3D points of bodies, (..., N, 3) in SMAL units before `trans` (..., 3) is added: (..., N, 2).

    The result is in crop units. Points behind the camera have no meaning, and points in its plane give infinities.
    """
    at = np.asarray(points_3d, np.float64) + np.asarray(trans, np.float64)[..., None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(FOCAL * at[..., :2] / at[..., 2:])


def projection_error(projected: npt.ArrayLike, annotated: npt.ArrayLike, weight: npt.ArrayLike) -> Floats:
    """L_proj in crop units: the mean of |projected - annotated| over visible keypoints and both coordinates.

    projected and annotated: (..., 26, 2) in crop units; weight: (..., 26), visible means > 0. NaN without any.
    """
    visible = np.asarray(weight) > 0
    distance = np.abs(np.asarray(projected, np.float64) - np.asarray(annotated, np.float64)).sum(axis=-1)
    total = np.where(visible, distance, 0.0).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(total / (2.0 * visible.sum(axis=-1)))


def _rounded(value: float) -> float:
    """To float32 and back."""
    return float(np.float32(value))


def _affine_through(source: list[tuple[float, float]], target: list[tuple[float, float]]) -> Floats:
    """The map that takes three points to three points.

    It solves the 6 x 6 system with the pivots and the order of operations of OpenCV 4's getAffineTransform: the last
    bit of the map decides which of two neighbouring pixels a warp takes.
    """
    rows = []
    for (x, y), (target_x, target_y) in zip(source, target, strict=True):
        rows.append([x, y, 1.0, 0.0, 0.0, 0.0, target_x])
        rows.append([0.0, 0.0, 0.0, x, y, 1.0, target_y])
    size = len(rows)
    for column in range(size):
        pivot = column
        for row in range(column + 1, size):
            if abs(rows[row][column]) > abs(rows[pivot][column]):
                pivot = row
        if abs(rows[pivot][column]) < 100 * np.finfo(np.float64).eps:
            raise ValueError(f"a box without area: its points are {source}")
        rows[column], rows[pivot] = rows[pivot], rows[column]
        factor = -1.0 / rows[column][column]
        for row in range(column + 1, size):
            alpha = rows[row][column] * factor
            if alpha != 0.0:
                for k in range(column + 1, size + 1):
                    rows[row][k] += alpha * rows[column][k]
    solution = [0.0] * size
    for row in reversed(range(size)):
        rest = rows[row][size]
        for k in range(row + 1, size):
            rest -= rows[row][k] * solution[k]
        solution[row] = rest / rows[row][row]
    return np.array(solution).reshape(2, 3)
