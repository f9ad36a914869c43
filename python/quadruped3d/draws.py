"""Which sample is drawn when, and with which augmentation: the same draws as the program's `train` makes.

A draw depends on a seed and a position alone. So workers, restarts and epochs never change one, and the draws of the
C++ feed can be repeated here: `DrawSequence` is its pipeline/feed/draw_sequence, `draw_augmentation` its
loaders/pictures/augment.
"""

from __future__ import annotations

import bisect
import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

_MASK = (1 << 64) - 1
_STEP = 0x9E3779B97F4A7C15  # of SplitMix64


def _scramble(z: int) -> int:
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return z ^ (z >> 31)


def _unit(bits: int) -> float:
    """A number in [0, 1) of 53 random bits."""
    return (bits >> 11) * 2.0**-53


class SplitMix:
    """SplitMix64, with a stream of its own for every key."""

    def __init__(self, seed: int, *key: int) -> None:
        self._state = seed & _MASK
        for part in key:
            self._state = _scramble(self._state ^ ((part + _STEP) & _MASK))

    def next(self) -> int:
        self._state = (self._state + _STEP) & _MASK
        return _scramble(self._state)

    def uniform(self) -> float:
        return _unit(self.next())


class MersenneTwister:
    """The 64-bit Mersenne Twister (MT19937-64) as C++'s std::mt19937_64 seeds it.

    NumPy has the 32-bit one alone. The state is turned number by number, because an augmentation takes a dozen.
    """

    _SIZE, _MIDDLE = 312, 156

    def __init__(self, seed: int) -> None:
        state = [seed & _MASK]
        for i in range(1, self._SIZE):
            state.append((6364136223846793005 * (state[-1] ^ (state[-1] >> 62)) + i) & _MASK)
        self._state = state
        self._at = 0

    def next(self) -> int:
        state, i = self._state, self._at
        joined = (state[i] & 0xFFFFFFFF80000000) | (state[(i + 1) % self._SIZE] & 0x7FFFFFFF)
        turn = 0xB5026F5AA96619E9 if joined & 1 else 0
        x = state[i] = state[(i + self._MIDDLE) % self._SIZE] ^ (joined >> 1) ^ turn
        self._at = (i + 1) % self._SIZE
        x ^= (x >> 29) & 0x5555555555555555
        x ^= (x << 17) & 0x71D67FFFEDA60000
        x ^= (x << 37) & 0xFFF7EEE000000000
        return x ^ (x >> 43)

    def uniform(self) -> float:
        return _unit(self.next())


@dataclasses.dataclass(frozen=True)
class AugmentOptions:
    """How strongly pictures are augmented; the official configuration's values."""

    scale: float = 0.3  # box side times 1 +- this
    rotation_deg: float = 30.0  # standard deviation, cut at two of them
    rotation_rate: float = 0.6  # share of samples that are rotated
    shift: float = 0.02  # share of the box side, for each axis
    colour: float = 0.2  # each channel times 1 +- this
    mirror_rate: float = 0.0  # share of samples that are mirrored; the official code has no working mirror


@dataclasses.dataclass(frozen=True)
class Augmentation:
    """One drawn augmentation; the default changes nothing."""

    scale: float = 1.0  # > 1 shows more of the surroundings
    rotation_deg: float = 0.0  # of the box; the patch's content turns the other way
    shift_x: float = 0.0  # as a share of the unscaled box side
    shift_y: float = 0.0
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)  # R, G, B
    mirror: bool = False


def draw_augmentation(options: AugmentOptions, seed: int) -> Augmentation:
    """Draws from the official distributions: normal numbers cut at +-1 (rotation: +-2), and uniform colour."""
    engine = MersenneTwister(seed)

    def cut_normal(limit: float) -> float:  # Box-Muller; 1 - u keeps the logarithm finite
        radius = math.sqrt(-2.0 * math.log(1.0 - engine.uniform()))
        return min(max(radius * math.cos(2.0 * math.pi * engine.uniform()), -limit), limit)

    shift_x = cut_normal(1.0) * options.shift
    shift_y = cut_normal(1.0) * options.shift
    scale = 1.0 + cut_normal(1.0) * options.scale
    rotation_deg = 0.0
    if engine.uniform() < options.rotation_rate:
        rotation_deg = cut_normal(2.0) * options.rotation_deg
    red, green, blue = (1.0 + (2.0 * engine.uniform() - 1.0) * options.colour for _ in range(3))
    mirror = options.mirror_rate > 0.0 and engine.uniform() < options.mirror_rate
    return Augmentation(scale, rotation_deg, shift_x, shift_y, (red, green, blue), mirror)


class PoolDraw(NamedTuple):
    """One draw of a DrawSequence."""

    pool: int
    sample: int  # within the pool
    seed: int  # for the sample's augmentation


class DrawSequence:
    """Weighted sampling with replacement over pools: `train`'s order of samples.

    `weights` are those of each sample of a pool, as in the official WeightedRandomSampler. Raises ValueError if
    nothing can be drawn.
    """

    def __init__(self, sizes: Sequence[int], weights: Sequence[float], seed: int) -> None:
        if len(sizes) != len(weights):
            raise ValueError(f"{len(sizes)} pools and {len(weights)} weights")
        if any(size < 0 or not math.isfinite(weight) or weight < 0 for size, weight in zip(sizes, weights)):
            raise ValueError("a pool's weight must be a finite number of at least 0")
        total = 0.0
        for size, weight in zip(sizes, weights):
            total += weight * size
        if total <= 0.0:
            raise ValueError("the pools hold no sample with a weight above 0")
        self._sizes = list(sizes)
        self._seed = seed
        self._ends: list[float] = []  # upper end of each pool's part of [0, 1)
        running = 0.0
        for size, weight in zip(sizes, weights):
            running += weight * size
            self._ends.append(running / total)

    def at(self, position: int) -> PoolDraw:
        """The draw of a position, from 0."""
        random = SplitMix(self._seed, position)
        pool = bisect.bisect_right(self._ends, random.uniform())
        size = self._sizes[pool]
        sample = min(int(random.uniform() * size), size - 1)
        return PoolDraw(pool, sample, random.next())


def shuffled(count: int, seed: int, epoch: int) -> npt.NDArray[np.int64]:
    """A permutation of 0 .. count - 1 that depends on seed and epoch alone, on every machine and NumPy version."""
    base = SplitMix(seed, epoch).next()
    with np.errstate(over="ignore"):
        z = np.arange(1, count + 1, dtype=np.uint64) * np.uint64(_STEP) + np.uint64(base)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
    return np.argsort(z, kind="stable").astype(np.int64)
