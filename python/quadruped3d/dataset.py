"""A map-style dataset for training, and samplers: what torch.utils.data.DataLoader asks for, without needing torch.

    dataset = Dataset("out/latest", augment=True, seed=1)
    loader = DataLoader(dataset, batch_size=48, sampler=Shuffle(dataset, seed=1), num_workers=4)

The samples are those of the C++ feed that `train` uses: without augmentation the pictures are equal to the last bit,
and with augmentation so are the draws.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, NamedTuple, TypedDict

import numpy as np
import numpy.typing as npt

from . import body, geometry, pictures
from .draws import Augmentation, AugmentOptions, DrawSequence, SplitMix, draw_augmentation, shuffled
from .shards import Shard, ShardError, Source, as_sources, open_shards


class Sample(TypedDict):
    """One training sample, in the network's units. Flags are 0 or 1; where one is 0, its label is a placeholder."""

    image: npt.NDArray[np.float32]  # (3, 256, 256), normalised
    keypoints_2d: npt.NDArray[np.float32]  # (26, 3): x, y in crop units and a weight
    keypoints_3d: npt.NDArray[np.float32]  # (26, 4): SMAL units, and 1 where they are a label
    rotations: npt.NDArray[np.float32]  # (35, 3, 3); identities where has_pose is 0
    betas: npt.NDArray[np.float32]  # (41,); zeros where has_betas is 0
    has_pose: np.float32
    has_betas: np.float32
    family: np.int64  # -1 for none of the five
    species: np.int64  # index into Dataset.species, -1 for unknown
    id: str


class Draw(NamedTuple):
    """What a sampler asks a dataset for: a sample, and the seed of its augmentation."""

    sample: int
    seed: int


class Dataset:
    """The samples of one or several sources under one running number.

    A sample is asked for by its number, or by a Draw that also says how it is augmented. By its number alone, its
    augmentation follows from the dataset's seed, the epoch (set_epoch) and the number.

    It can be pickled, and used by the workers of a DataLoader under fork and spawn. Workers that live on from epoch to
    epoch (persistent_workers=True) do not hear of set_epoch; with Shuffle or FeedOrder they need not, because these
    send a seed with every number.
    """

    def __init__(
        self,
        sources: Source | Iterable[Source],
        *,
        augment: AugmentOptions | bool = False,
        seed: int = 0,
        keypoint_weight: Literal["label", "raw_v"] = "label",
    ) -> None:
        """`sources`: a dataset's folder, an output folder, a shard, or several of these.

        `keypoint_weight`: what weighs a 2D keypoint. "label" takes 1, or a detector's likelihood; "raw_v" takes the
        annotation's v, as the official code does, where a 2 counts double. Raises ShardError for a source that cannot
        be read or has no pictures, and ValueError for an unknown weight.
        """
        if keypoint_weight not in ("label", "raw_v"):
            raise ValueError(f'keypoint_weight: got {keypoint_weight!r}, expected "label" or "raw_v"')
        self._shards: list[Shard] = []
        self._first = [0]  # running number of each shard's first sample, and the total
        self._sizes: list[int] = []
        for source in as_sources(sources):
            before = self._first[-1]
            for shard in open_shards(source):
                if shard.image_encoding == "reference":
                    raise ShardError(
                        f"{shard.path}: a shard without pictures; training needs one that was built with "
                        '"images": "jpeg" or "png"'
                    )
                self._shards.append(shard)
                self._first.append(self._first[-1] + shard.rows)
            self._sizes.append(self._first[-1] - before)
        named = {str(name) for shard in self._shards for name in shard.read("species")}
        self.species: list[str] = sorted(named - {""}, key=lambda name: name.encode())
        self._species_number = {name: number for number, name in enumerate(self.species)}
        self.augment_options = AugmentOptions() if augment is True else augment or None
        self.seed = seed
        self.epoch = 0
        self._raw_v = keypoint_weight == "raw_v"

    @property
    def sizes(self) -> list[int]:
        """The number of samples of each source."""
        return list(self._sizes)

    def set_epoch(self, epoch: int) -> None:
        """Gives every sample another augmentation, where it is asked for by its number alone."""
        self.epoch = epoch

    def __len__(self) -> int:
        return self._first[-1]

    def id(self, sample: int) -> str:
        """The id of a sample: dataset/split/image#annotation."""
        shard, row = self._locate(sample)
        return str(shard.read("id", row, 1)[0])

    def augmentation(self, key: int | Draw) -> Augmentation:
        """The augmentation that a sample or a Draw has; the one that changes nothing without augmentation."""
        if self.augment_options is None:
            return Augmentation()
        seed = key.seed if isinstance(key, Draw) else SplitMix(self.seed, self.epoch, self._number(key)).next()
        return draw_augmentation(self.augment_options, seed)

    def __getitem__(self, key: int | Draw) -> Sample:
        """Raises IndexError for a number that the dataset lacks, and ShardError that names a damaged sample."""
        number = self._number(key.sample if isinstance(key, Draw) else key)
        augmentation = self.augmentation(key)
        shard, row = self._locate(number)
        patch_from_image = geometry.augmented_patch_from_image(
            shard.read("patch_box_px", row, 1)[0],
            augmentation.scale,
            augmentation.rotation_deg,
            augmentation.shift_x,
            augmentation.shift_y,
            augmentation.mirror,
        )
        patch_from_crop = geometry.patch_from_stored_crop(patch_from_image, shard.read("crop_from_image", row, 1)[0])
        try:
            patch = pictures.cut_patch(shard.picture(row), patch_from_crop)
        except ValueError as error:
            raise ShardError(
                f"{shard.path}: sample {self.id(number)}: its stored crop: {error}; `quadruped3d verify` checks the shards"
            ) from error
        has_pose, has_betas = (bool(shard.read(name, row, 1)[0]) for name in ("has_pose", "has_betas"))
        return {
            "image": pictures.normalise(patch, augmentation.colour),
            "keypoints_2d": self._keypoints_2d(shard, row, patch_from_image, augmentation),
            "keypoints_3d": _keypoints_3d(shard, row, augmentation),
            "rotations": _rotations(shard, row, has_pose, augmentation),
            "betas": shard.read("betas", row, 1)[0] if has_betas else np.zeros(body.BETAS, np.float32),
            "has_pose": np.float32(has_pose),
            "has_betas": np.float32(has_betas),
            "family": np.int64(shard.read("family", row, 1)[0]),
            "species": np.int64(self._species_number.get(str(shard.read("species", row, 1)[0]), -1)),
            "id": str(shard.read("id", row, 1)[0]),
        }

    def _number(self, sample: int) -> int:
        number = int(sample)
        if number < 0:
            number += len(self)
        if not 0 <= number < len(self):
            raise IndexError(f"sample {sample} of {len(self)}")
        return number

    def _locate(self, sample: int) -> tuple[Shard, int]:
        number = self._number(sample)
        at = bisect.bisect_right(self._first, number) - 1
        return self._shards[at], number - self._first[at]

    def _keypoints_2d(
        self, shard: Shard, row: int, patch_from_image: geometry.Floats, augmentation: Augmentation
    ) -> npt.NDArray[np.float32]:
        keypoints = np.empty((len(body.KEYPOINTS), 3), np.float32)
        keypoints[:, :2] = geometry.keypoints_to_crop(shard.read("keypoints_px", row, 1)[0], patch_from_image)
        if self._raw_v:
            keypoints[:, 2] = np.maximum(shard.read("keypoints_v", row, 1)[0], 0)  # a v below 0 would reward errors
        else:
            keypoints[:, 2] = shard.read("keypoints_weight", row, 1)[0]
        return keypoints[list(body.KEYPOINT_MIRROR)] if augmentation.mirror else keypoints


def _keypoints_3d(shard: Shard, row: int, augmentation: Augmentation) -> npt.NDArray[np.float32]:
    keypoints = np.zeros((len(body.KEYPOINTS), 4), np.float32)
    if not shard.read("has_keypoints_3d", row, 1)[0]:
        return keypoints
    points = shard.read("keypoints_3d", row, 1)[0]
    angle = -augmentation.rotation_deg * math.pi / 180.0
    cosine, sine = np.float32(math.cos(angle)), np.float32(math.sin(angle))
    keypoints[:, 0] = cosine * points[:, 0] - sine * points[:, 1]
    keypoints[:, 1] = sine * points[:, 0] + cosine * points[:, 1]
    keypoints[:, 2] = points[:, 2]
    keypoints[:, 3] = 1.0
    if augmentation.mirror:
        keypoints[:, 0] *= -1
        keypoints = keypoints[list(body.KEYPOINT_MIRROR)]
    return keypoints


def _rotations(shard: Shard, row: int, has_pose: bool, augmentation: Augmentation) -> npt.NDArray[np.float32]:
    if not has_pose:
        return np.tile(np.eye(3, dtype=np.float32), (len(body.JOINTS), 1, 1))
    rotations: npt.NDArray[np.float32] = shard.read("pose", row, 1)[0]
    angle = -augmentation.rotation_deg * math.pi / 180.0  # the animal turns with the picture
    cosine, sine = math.cos(angle), math.sin(angle)
    x, y = rotations[0, 0].astype(np.float64), rotations[0, 1].astype(np.float64)
    rotations[0, 0] = cosine * x - sine * y
    rotations[0, 1] = sine * x + cosine * y
    return body.mirror_pose(rotations) if augmentation.mirror else rotations


class Shuffle:
    """A sampler: every sample once in an epoch, in an order that depends on seed and epoch alone."""

    def __init__(self, dataset: Dataset, seed: int = 0) -> None:
        self._count = len(dataset)
        self.seed = seed
        self.epoch = 0

    def set_epoch(self, epoch: int) -> None:
        """Another order and other augmentations. Call it before each epoch."""
        self.epoch = epoch

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Draw]:
        for position, sample in enumerate(shuffled(self._count, self.seed, self.epoch).tolist()):
            yield Draw(sample, SplitMix(self.seed, self.epoch, position).next())


class FeedOrder:
    """A sampler: the draws of the program's `train`, with replacement and by the weights of the sources.

    `weights` are those of each sample of a source (the paper's are 1.0, 0.5 and 0.15). Draw number `first` and the
    `count` - 1 after it are given, so that a run can go on where it ended.
    """

    def __init__(
        self, dataset: Dataset, weights: Sequence[float], seed: int, count: int | None = None, first: int = 0
    ) -> None:
        """Raises ValueError if nothing can be drawn, or if there are more or fewer weights than sources."""
        self._draws = DrawSequence(dataset.sizes, weights, seed)
        starts = [0]
        for size in dataset.sizes:
            starts.append(starts[-1] + size)
        self._starts = starts
        self._positions = range(first, first + (len(dataset) if count is None else count))

    def __len__(self) -> int:
        return len(self._positions)

    def __iter__(self) -> Iterator[Draw]:
        for position in self._positions:
            draw = self._draws.at(position)
            yield Draw(self._starts[draw.pool] + draw.sample, draw.seed)
