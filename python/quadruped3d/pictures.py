"""Decodes stored crops and cuts the network's patch from them, as the C++ feed does.

OpenCV must be a version 4: version 5 warps differently.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .geometry import PATCH_SIDE_PX

IMAGE_MEAN = (0.485, 0.456, 0.406)  # ImageNet's, R, G, B
IMAGE_STD = (0.229, 0.224, 0.225)


def _opencv() -> Any:
    try:
        import cv2
    except ImportError as error:
        raise ImportError("pictures need OpenCV: pip install 'quadruped3d[pictures]'") from error
    if not cv2.__version__.startswith("4."):
        raise ImportError(f"OpenCV is version {cv2.__version__}, expected 4.x: another version warps other pixels")
    return cv2


def decode(encoded: bytes) -> npt.NDArray[np.uint8]:
    """A stored crop as RGB, (side, side, 3). Raises ValueError if the bytes are no picture."""
    return np.ascontiguousarray(_decode_bgr(encoded)[:, :, ::-1])


def decode_mask(encoded: bytes) -> npt.NDArray[np.uint8]:
    """A stored mask, (side, side): 255 inside the animal. Raises ValueError if the bytes are no picture."""
    cv2 = _opencv()
    mask = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_GRAYSCALE) if encoded else None
    if mask is None:
        raise ValueError(f"{len(encoded)} bytes that do not decode as a picture")
    return np.asarray(mask, np.uint8)


def cut_patch(encoded: bytes, patch_from_crop: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """The patch of an encoded stored crop: RGB, (256, 256, 3), black outside. Raises ValueError like decode()."""
    cv2 = _opencv()
    patch = cv2.warpAffine(
        _decode_bgr(encoded),
        np.asarray(patch_from_crop, np.float64),
        (PATCH_SIDE_PX, PATCH_SIDE_PX),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=0,
    )
    return np.asarray(patch[:, :, ::-1], np.uint8)


def normalise(
    patch: npt.NDArray[np.uint8], colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> npt.NDArray[np.float32]:
    """The network's input: (3, side, side), (min(u8 * colour, 255) - 255 mean) / (255 std), in float32."""
    planes = np.empty((3, *patch.shape[:2]), np.float32)
    values = np.arange(256, dtype=np.float32)
    for channel in range(3):
        mean, spread = (np.float32(255.0 * numbers[channel]) for numbers in (IMAGE_MEAN, IMAGE_STD))
        scaled = np.clip(values * np.float32(colour[channel]), np.float32(0.0), np.float32(255.0))
        np.take((scaled - mean) / spread, patch[:, :, channel], out=planes[channel])
    return planes


def _decode_bgr(encoded: bytes) -> npt.NDArray[np.uint8]:
    # The channels stay in OpenCV's order until the patch is cut: a patch is smaller, and OpenCV's own conversion would
    # start its threads, which a process that forks must not have.
    cv2 = _opencv()
    picture = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_COLOR) if encoded else None
    if picture is None:
        raise ValueError(f"{len(encoded)} bytes that do not decode as a picture")
    return np.asarray(picture, np.uint8)
