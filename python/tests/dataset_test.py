"""Dataset and its samplers: numbers, epochs, pickling, workers, and what cannot be read."""

import multiprocessing
import pickle
import unittest

import h5py
import numpy as np

from support import Shards
from quadruped3d import AugmentOptions, Dataset, Draw, ShardError, Shuffle


def images_of(dataset, keys):
    """Runs in another process."""
    return [dataset[key]["image"].tobytes() for key in keys]


class Numbers(Shards):
    def test_samples_of_all_sources_have_one_running_number(self):
        dataset = Dataset([self.shards / "png.h5", self.shards / "single.h5"])
        self.assertEqual((len(dataset), dataset.sizes), (8, [7, 1]))
        self.assertEqual([dataset.id(i) for i in (0, 6, 7, -1)],
                         ["png/train/0", "png/train/6", "single/test/0", "single/test/0"])
        self.assertEqual(dataset[7]["id"], "single/test/0")
        for number in (8, -9):
            with self.assertRaises(IndexError):
                dataset[number]

    def test_it_ends_as_a_sequence_does(self):
        self.assertEqual([sample["id"] for sample in Dataset(self.shards / "png.h5")],
                         [f"png/train/{i}" for i in range(7)])

    def test_augmentation_follows_seed_epoch_and_number(self):
        dataset = Dataset(self.shards / "png.h5", augment=True, seed=3)
        first = [dataset.augmentation(i) for i in range(7)]
        self.assertEqual(len(set(first)), 7)
        dataset.set_epoch(1)
        self.assertFalse(set(first) & {dataset.augmentation(i) for i in range(7)})
        dataset.set_epoch(0)
        self.assertEqual(first, [dataset.augmentation(i) for i in range(7)])
        self.assertNotEqual(first[0], Dataset(self.shards / "png.h5", augment=True, seed=4).augmentation(0))

    def test_options_reach_the_draws(self):
        dataset = Dataset(self.shards / "png.h5", augment=AugmentOptions(scale=0, rotation_rate=0, shift=0, colour=0))
        np.testing.assert_array_equal(dataset[2]["image"], Dataset(self.shards / "png.h5")[2]["image"])

    def test_shuffle_gives_every_sample_once_and_its_seed(self):
        dataset = Dataset(self.shards / "png.h5", augment=True)
        sampler = Shuffle(dataset, seed=8)
        epochs = []
        for epoch in range(3):
            sampler.set_epoch(epoch)
            epochs.append(list(sampler))
            self.assertEqual(sorted(draw.sample for draw in epochs[-1]), list(range(7)))
        self.assertEqual(len({draw.seed for draws in epochs for draw in draws}), 21)
        self.assertNotEqual(*([draw.sample for draw in draws] for draws in epochs[:2]))
        sampler.set_epoch(1)
        self.assertEqual(list(sampler), epochs[1])


class Processes(Shards):
    def test_a_pickled_dataset_reads_the_same(self):
        dataset = Dataset(self.shards / "jpeg.h5", augment=True)
        before = images_of(dataset, range(6))  # opens the file
        self.assertEqual(images_of(pickle.loads(pickle.dumps(dataset)), range(6)), before)

    def test_processes_read_the_same_under_fork_and_spawn(self):
        dataset = Dataset(self.shards / "jpeg.h5", augment=True)
        keys = [Draw(i % 6, i) for i in range(12)]
        expected = images_of(dataset, keys)
        for method in ("fork", "spawn"):
            with self.subTest(method), multiprocessing.get_context(method).Pool(3) as pool:
                jobs = [pool.apply_async(images_of, (dataset, keys)) for _ in range(6)]
                for job in jobs:
                    self.assertEqual(job.get(timeout=300), expected)


class Loader(Shards):
    def batches(self, epochs, **options):
        from torch.utils.data import DataLoader

        dataset = Dataset(self.shards / "jpeg.h5", augment=True)
        sampler = Shuffle(dataset, seed=2)
        loader = DataLoader(dataset, batch_size=2, sampler=sampler, **options)
        for epoch in epochs:
            sampler.set_epoch(epoch)
            yield from loader

    def test_torch_collates_samples(self):
        batch = next(self.batches([0]))
        self.assertEqual({name: tuple(batch[name].shape) for name in batch if name != "id"},
                         {"image": (2, 3, 256, 256), "keypoints_2d": (2, 26, 3), "keypoints_3d": (2, 26, 4),
                          "rotations": (2, 35, 3, 3), "betas": (2, 41), "has_pose": (2,), "has_betas": (2,),
                          "family": (2,), "species": (2,)})
        self.assertEqual(len(batch["id"]), 2)

    def test_workers_change_nothing_also_when_they_live_on(self):
        alone = list(self.batches([0, 1]))
        for options in ({"multiprocessing_context": "fork"}, {"multiprocessing_context": "spawn"},
                        {"multiprocessing_context": "fork", "persistent_workers": True}):
            with self.subTest(options):
                for one, other in zip(alone, self.batches([0, 1], num_workers=2, **options), strict=True):
                    self.assertEqual(one["id"], other["id"])
                    self.assertTrue((one["image"] == other["image"]).all())


class Refusals(Shards):
    def test_shards_without_pictures(self):
        path = self.folder / "reference.h5"
        path.write_bytes((self.shards / "png.h5").read_bytes())
        with h5py.File(path, "r+") as file:
            del file.attrs["image_encoding"]  # a new value of another length
            file.attrs["image_encoding"] = np.bytes_("reference")
        with self.assertRaisesRegex(ShardError, "reference.h5: a shard without pictures"):
            Dataset(path)

    def test_a_damaged_picture_names_its_sample(self):
        path = self.folder / "damaged.h5"
        path.write_bytes((self.shards / "png.h5").read_bytes())
        with h5py.File(path, "r+") as file:
            start = int(file["crop_offsets"][3])
            file["crop"][start:start + 8] = np.zeros(8, np.uint8)
        dataset = Dataset(path)
        dataset[2]
        with self.assertRaisesRegex(ShardError, "damaged.h5: sample png/train/3: its stored crop"):
            dataset[3]

    def test_a_wrong_weight(self):
        with self.assertRaisesRegex(ValueError, "keypoint_weight"):
            Dataset(self.shards / "png.h5", keypoint_weight="v")


if __name__ == "__main__":
    unittest.main()
