"""Reads datasets of quadruped3d: labels as NumPy or pandas, and samples for training.

    import quadruped3d

    labels = quadruped3d.load("out/latest", ["id", "pose", "betas", "final_error"])
    dataset = quadruped3d.Dataset("out/latest", augment=True)
    sample = dataset[0]

docs/python.md describes the package, docs/shard-format.md every column.
"""

from . import body, geometry
from .body import FAMILIES, JOINTS, KEYPOINTS
from .dataset import Dataset, Draw, FeedOrder, Sample, Shuffle
from .draws import Augmentation, AugmentOptions
from .loading import load
from .shards import Shard, ShardError, read_manifest

__version__ = "0.2.0"

__all__ = [
    "FAMILIES",
    "JOINTS",
    "KEYPOINTS",
    "Augmentation",
    "AugmentOptions",
    "Dataset",
    "Draw",
    "FeedOrder",
    "Sample",
    "Shard",
    "ShardError",
    "Shuffle",
    "body",
    "geometry",
    "load",
    "read_manifest",
]
