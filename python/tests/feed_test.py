"""Dataset against the C++ feed, on the same shards: pixels to the last bit without augmentation, labels to 1e-6, draws
exactly."""

import dataclasses
import unittest

import numpy as np

from support import Shards, feed_batch
from quadruped3d import AugmentOptions, Dataset, Draw, FeedOrder

# The feed decodes the part of a stored crop that an augmented patch covers. Its map to the patch starts at that part's
# corner and is rounded there, so a few numbers differ by one level of 255 (1 / 255 / 0.224, times a colour factor of 1.2).
ONE_LEVEL = 0.0212
FEW = 1e-4

LABELS = ("keypoints_2d", "keypoints_3d", "rotations", "betas", "has_pose", "has_betas")


class AgainstTheFeed(Shards):
    def compare(self, pools, weights, seed=1, first=0, count=12, augment=None, raw_v=False):
        """Compares the draws, and every sample drawn; returns both sides' samples."""
        paths = [[self.shards / f"{name}.h5" for name in pool] for pool in pools]
        batch = feed_batch(self.folder, paths, weights, seed, first, count, augment and dataclasses.asdict(augment),
                           raw_v)
        self.assertTrue(all(len(pool) == 1 for pool in paths), "one source a pool")
        dataset = Dataset([path for pool in paths for path in pool], augment=augment or False,
                          keypoint_weight="raw_v" if raw_v else "label")
        draws = list(FeedOrder(dataset, weights, seed, count, first))
        self.assertEqual(dataset.species, batch["names"])
        samples = [dataset[draw] for draw in draws]
        for slot, (draw, sample) in enumerate(zip(draws, samples, strict=True)):
            expected = batch["draws"][slot]
            self.assertEqual(draw.seed, expected["seed"])
            drawn = dataclasses.asdict(dataset.augmentation(draw))
            self.assertEqual({**drawn, "colour": list(drawn["colour"])},
                             {name: expected[name] for name in drawn})
            self.assertEqual(sample["id"], batch["ids"][slot])
            self.compare_pictures(sample["image"], batch["image"][slot], is_exact=augment is None)
            for name in LABELS:
                np.testing.assert_allclose(sample[name], batch[name][slot], rtol=0, atol=1e-6, err_msg=name)
            self.assertEqual(sample["family"], batch["family"][slot])
            self.assertEqual(sample["species"], batch["species"][slot])
        return samples, batch

    def compare_pictures(self, picture, expected, is_exact):
        if is_exact:
            np.testing.assert_array_equal(picture, expected)
            return
        np.testing.assert_allclose(picture, expected, rtol=0, atol=ONE_LEVEL)
        self.assertLess(np.mean(picture != expected), FEW)

    def test_without_augmentation(self):
        for name in ("png", "jpeg"):
            samples, _ = self.compare([[name]], [1.0], count=16)
            self.assertEqual({float(sample["has_pose"]) for sample in samples}, {0.0, 1.0})
            self.assertGreater(len({sample["id"] for sample in samples}), 3)

    def test_with_the_official_augmentation(self):
        samples, batch = self.compare([["jpeg"]], [1.0], seed=11, count=24, augment=AugmentOptions())
        self.assertTrue(any(draw["rotation_deg"] != 0 for draw in batch["draws"]))
        self.assertGreater(len({sample["image"].tobytes() for sample in samples}), 20)

    def test_with_mirrored_pictures(self):
        _, batch = self.compare([["png"]], [1.0], seed=5, count=16, augment=AugmentOptions(mirror_rate=0.5))
        self.assertEqual({draw["mirror"] for draw in batch["draws"]}, {True, False})

    def test_several_pools_by_weight_from_any_position(self):
        samples, _ = self.compare([["png"], ["jpeg"], ["single"]], [1.0, 0.5, 4.0], seed=2**63 + 5, first=123456,
                                  count=24)
        self.assertEqual({sample["id"].split("/")[0] for sample in samples}, {"png", "jpeg", "single"})

    def test_raw_visibility_as_the_weight(self):
        samples, _ = self.compare([["jpeg"]], [1.0], raw_v=True)
        self.assertEqual({float(w) for sample in samples for w in sample["keypoints_2d"][:, 2]}, {0.0, 1.0, 2.0})

    def test_a_sample_by_its_number_is_the_same_as_in_the_feed(self):
        dataset = Dataset(self.shards / "jpeg.h5")
        batch = feed_batch(self.folder, [[self.shards / "jpeg.h5"]], count=12)
        for slot, draw in enumerate(batch["draws"]):
            np.testing.assert_array_equal(dataset[draw["sample"]]["image"], batch["image"][slot])
            np.testing.assert_array_equal(dataset[Draw(draw["sample"], 99)]["image"], batch["image"][slot])


if __name__ == "__main__":
    unittest.main()
