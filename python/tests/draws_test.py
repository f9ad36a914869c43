"""Random numbers: the standard's own test values, and orders that depend on seed and position alone."""

import math
import unittest

import numpy as np

from support import PACKAGE  # noqa: F401  (makes the package importable)
from quadruped3d.draws import (AugmentOptions, DrawSequence, MersenneTwister, SplitMix, draw_augmentation, shuffled)


class Generators(unittest.TestCase):
    def test_mersenne_twister_has_the_number_that_the_standard_states(self):
        # C++ [rand.predef]: the 10000th number of a default-constructed mt19937_64.
        engine = MersenneTwister(5489)
        for _ in range(9999):
            engine.next()
        self.assertEqual(engine.next(), 9981545732273789042)

    def test_split_mix_has_its_authors_numbers(self):
        # The first numbers for seed 1234567 (Vigna's splitmix64.c; also in Rosetta Code).
        random = SplitMix(1234567)
        self.assertEqual([random.next() for _ in range(3)],
                         [6457827717110365317, 3203168211198807973, 9817491932198370423])


class Sequences(unittest.TestCase):
    def test_pools_are_drawn_by_the_weight_of_their_samples(self):
        draws = DrawSequence([100, 300, 1000], [1.0, 0.5, 0.15], 7)  # shares 1 : 1.5 : 1.5
        count = 20000
        drawn = [draws.at(position) for position in range(count)]
        for pool, share in enumerate((0.25, 0.375, 0.375)):
            deviation = math.sqrt(count * share * (1 - share))
            self.assertAlmostEqual(sum(draw.pool == pool for draw in drawn), count * share, delta=4 * deviation)
        self.assertEqual({draw.sample for draw in drawn if draw.pool == 0}, set(range(100)))

    def test_what_cannot_be_drawn_is_refused(self):
        for sizes, weights in (([3], [0.0]), ([0], [1.0]), ([3], [-1.0]), ([3], [math.nan])):
            with self.assertRaises(ValueError):
                DrawSequence(sizes, weights, 1)
        with self.assertRaisesRegex(ValueError, "1 pools and 2 weights"):
            DrawSequence([3], [1.0, 1.0], 1)

    def test_a_shuffle_is_a_permutation_that_changes_with_seed_and_epoch(self):
        orders = [shuffled(1000, seed, epoch) for seed in (0, 1) for epoch in (0, 1)]
        for order in orders:
            np.testing.assert_array_equal(np.sort(order), np.arange(1000))
            self.assertLess(abs(np.corrcoef(order, np.arange(1000))[0, 1]), 0.15)
        self.assertEqual(len({tuple(order) for order in orders}), 4)
        np.testing.assert_array_equal(orders[3], shuffled(1000, 1, 1))
        self.assertEqual(len(shuffled(0, 0, 0)), 0)


class Augmentations(unittest.TestCase):
    def test_distributions_are_the_official_ones(self):
        drawn = [draw_augmentation(AugmentOptions(), seed) for seed in range(4000)]
        scale = np.array([one.scale for one in drawn])
        self.assertAlmostEqual(float(scale.mean()), 1.0, delta=0.015)
        self.assertEqual((scale.min(), scale.max()), (0.7, 1.3))  # cut at one deviation
        self.assertAlmostEqual(np.mean(scale == 1.3), 0.1587, delta=0.025)  # the normal's tail beyond one deviation
        turned = np.array([one.rotation_deg for one in drawn])
        self.assertAlmostEqual(np.mean(turned != 0), 0.6, delta=0.03)
        self.assertEqual(np.abs(turned).max(), 60.0)
        colour = np.array([one.colour for one in drawn])
        self.assertGreaterEqual(colour.min(), 0.8)
        self.assertLess(colour.max(), 1.2)
        self.assertAlmostEqual(float(colour.std()), 0.4 / math.sqrt(12), delta=0.005)
        self.assertFalse(any(one.mirror for one in drawn))
        mirrored = [draw_augmentation(AugmentOptions(mirror_rate=0.5), seed).mirror for seed in range(1000)]
        self.assertAlmostEqual(float(np.mean(mirrored)), 0.5, delta=0.06)


if __name__ == "__main__":
    unittest.main()
