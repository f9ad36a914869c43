"""Names of the numbers in a shard: the 26 keypoints, the 35 joints and the five families of SMAL."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

# In the order of Animal3D. The names at 19 and 25 follow the body's vertices; PRIMA's yaml has them swapped.
KEYPOINTS: tuple[str, ...] = (
    "left_eye",
    "right_eye",
    "chin",
    "left_front_paw",
    "right_front_paw",
    "left_back_paw",
    "right_back_paw",
    "tail_base",
    "left_front_thigh",
    "right_front_thigh",
    "left_back_thigh",
    "right_back_thigh",
    "left_shoulder",
    "right_shoulder",
    "left_front_knee",
    "right_front_knee",
    "left_back_knee",
    "right_back_knee",
    "neck",
    "tail_tip",
    "left_ear",
    "right_ear",
    "left_mouth_corner",
    "right_mouth_corner",
    "nose",
    "tail_mid",
)

# The keypoint on the other side of the animal; one in the middle is its own mirror image.
KEYPOINT_MIRROR: tuple[int, ...] = (
    1, 0, 2, 4, 3, 6, 5, 7, 9, 8, 11, 10, 13, 12, 15, 14, 17, 16, 18, 19, 21, 20, 23, 22, 24, 25,
)

# In the order of the column `pose`. Joint 0 is the root, whose rotation is the body's orientation in the camera's frame.
JOINTS: tuple[str, ...] = (
    "root",
    "spine_1",
    "spine_2",
    "spine_3",
    "spine_4",
    "spine_5",
    "spine_6",
    "left_shoulder",
    "left_elbow",
    "left_carpus",
    "left_fore_foot",
    "right_shoulder",
    "right_elbow",
    "right_carpus",
    "right_fore_foot",
    "neck",
    "head",
    "left_hip",
    "left_stifle",
    "left_hock",
    "left_hind_foot",
    "right_hip",
    "right_stifle",
    "right_hock",
    "right_hind_foot",
    "tail_1",
    "tail_2",
    "tail_3",
    "tail_4",
    "tail_5",
    "tail_6",
    "tail_7",
    "jaw",
    "left_ear",
    "right_ear",
)

# The parent of each joint in the synthetic body; -1 for the root. An imported body brings its own table.
JOINT_PARENTS: tuple[int, ...] = (
    -1, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 6, 11, 12, 13, 6, 15, 0, 17, 18, 19, 0, 21, 22, 23, 0, 25, 26, 27, 28, 29, 30, 16, 16, 16,
)

# By the number in the column `family`, which is -1 for any other animal.
FAMILIES: tuple[str, ...] = ("felidae", "canidae", "equidae", "bovidae", "hippopotamidae")

BETAS = 41


def _mirrored_joints() -> tuple[int, ...]:
    """The four joints of each limb and the ears are pairs; every other joint is its own mirror image."""
    partner = list(range(len(JOINTS)))
    for first in (7, 17):
        for joint in range(first, first + 4):
            partner[joint], partner[joint + 4] = joint + 4, joint
    partner[33], partner[34] = 34, 33
    return tuple(partner)


JOINT_MIRROR: tuple[int, ...] = _mirrored_joints()


def mirror_pose(pose: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """The pose (35, 3, 3) of the mirrored animal in the mirrored picture.

    Left and right of the body are the two sides of its plane z = 0; the picture is mirrored about the camera's plane
    x = 0. This is the program's own, because the official code has no mirror that works.
    """
    across_body = np.array([1.0, 1.0, -1.0], np.float32)
    across_picture = np.array([-1.0, 1.0, 1.0], np.float32)
    mirrored = np.asarray(pose, np.float32)[list(JOINT_MIRROR)]
    left = np.tile(across_body, (len(JOINTS), 1))
    left[0] = across_picture
    return np.asarray(mirrored * left[:, :, None] * across_body, np.float32)


def family_name(family: int) -> str:
    """The family's name by its number in a shard; "none" for -1. Raises ValueError for another number."""
    if family == -1:
        return "none"
    if 0 <= family < len(FAMILIES):
        return FAMILIES[family]
    raise ValueError(f"family: got {family}, expected -1 to {len(FAMILIES) - 1}")


def axis_angle_from_matrix(rotations: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Axis-angle vectors (..., 3), rad, of rotation matrices (..., 3, 3). The angle lies in [0, pi]."""
    r = np.asarray(rotations, np.float64)
    # Twice the quaternion's numbers, in four ways; the one whose divisor is largest loses no digits.
    trace = r[..., 0, 0] + r[..., 1, 1] + r[..., 2, 2]
    candidates = np.stack(
        [
            np.stack(
                [1 + trace, r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], -1
            ),
            np.stack(
                [
                    r[..., 2, 1] - r[..., 1, 2],
                    1 + 2 * r[..., 0, 0] - trace,
                    r[..., 0, 1] + r[..., 1, 0],
                    r[..., 0, 2] + r[..., 2, 0],
                ],
                -1,
            ),
            np.stack(
                [
                    r[..., 0, 2] - r[..., 2, 0],
                    r[..., 0, 1] + r[..., 1, 0],
                    1 + 2 * r[..., 1, 1] - trace,
                    r[..., 1, 2] + r[..., 2, 1],
                ],
                -1,
            ),
            np.stack(
                [
                    r[..., 1, 0] - r[..., 0, 1],
                    r[..., 0, 2] + r[..., 2, 0],
                    r[..., 1, 2] + r[..., 2, 1],
                    1 + 2 * r[..., 2, 2] - trace,
                ],
                -1,
            ),
        ],
        -2,
    )
    best = np.argmax(np.diagonal(candidates, axis1=-2, axis2=-1), axis=-1)
    quaternion = np.take_along_axis(candidates, best[..., None, None], axis=-2)[..., 0, :]
    quaternion /= np.linalg.norm(quaternion, axis=-1, keepdims=True)
    quaternion *= np.where(quaternion[..., :1] < 0, -1.0, 1.0)
    sine = np.linalg.norm(quaternion[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, quaternion[..., :1])
    return np.asarray(quaternion[..., 1:] * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-300), 2.0))
