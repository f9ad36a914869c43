"""Shards and datasets as files: every column equals what h5py reads, and what is no shard is refused."""

import json
import pickle
import threading
import unittest

import h5py
import numpy as np

from support import REPOSITORY, Folder, Shards, seal
from quadruped3d import Shard, ShardError, load, read_manifest
from quadruped3d.shards import shard_files

SCHEMA_1, SCHEMA_2 = (REPOSITORY / "tests" / "data" / "shards" / f"schema_{number}.h5" for number in (1, 2))


class Columns(Shards):
    def test_every_column_is_what_h5py_reads(self):
        for path in (self.shards / "jpeg.h5", SCHEMA_1):
            shard = Shard(path)
            with h5py.File(path) as file:
                self.assertEqual(set(shard.columns), {name for name in file if not name.endswith("_offsets")})
                for name, column in shard.columns.items():
                    if column.kind == "bytes":
                        offsets = file[f"{name}_offsets"][:]
                        for row in range(shard.rows):
                            self.assertEqual(shard.picture(row, name),
                                             file[name][offsets[row]:offsets[row + 1]].tobytes())
                        continue
                    expected = file[name].asstr()[:] if column.kind == "text" else file[name][:]
                    np.testing.assert_array_equal(shard.read(name), expected)
                    np.testing.assert_array_equal(shard.read(name, 1, 2), expected[1:3])
                    self.assertEqual(len(shard.read(name, shard.rows)), 0)

    def test_schema_1_stays_readable(self):
        labels = load(SCHEMA_1)
        self.assertEqual(list(labels["species"]), ["żubr", "red fox", "red fox"])
        self.assertEqual(labels["pose"].shape, (3, 35, 3, 3))
        self.assertEqual(Shard(SCHEMA_1).describe()["trans"]["units"], "SMAL units")

    def test_schema_2_stays_readable(self):
        labels = load(SCHEMA_2)
        self.assertEqual(list(labels["species"]), ["żubr", "red fox", "red fox"])
        self.assertTrue(np.isnan(labels["trust"][0]))
        np.testing.assert_array_equal(labels["trust"][1:], [115.0, 215.0])

    def test_wrong_rows_and_names_are_told(self):
        shard = Shard(SCHEMA_1)
        with self.assertRaisesRegex(KeyError, "no column poses"):
            shard.read("poses")
        with self.assertRaisesRegex(KeyError, "use picture"):
            shard.read("crop")
        with self.assertRaisesRegex(KeyError, "use read"):
            shard.picture(0, "pose")
        for first, count in ((0, 4), (-1, 1), (3, 1)):
            with self.assertRaises(IndexError):
                shard.read("pose", first, count)

    def test_reading_changes_no_file_descriptor_of_others(self):
        shard = Shard(self.shards / "png.h5")
        expected = shard.read("keypoints_px")
        copy = pickle.loads(pickle.dumps(shard))
        shard.close()
        np.testing.assert_array_equal(copy.read("keypoints_px"), expected)
        np.testing.assert_array_equal(shard.read("keypoints_px"), expected)

    def test_threads_share_a_shard(self):
        shard = Shard(self.shards / "png.h5")
        expected, wrong = shard.read("pose"), []

        def read():
            for row in range(7):
                if not np.array_equal(shard.read("pose", row, 1)[0], expected[row]):
                    wrong.append(row)

        threads = [threading.Thread(target=read) for _ in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(wrong, [])


class Refusals(Shards):
    def test_other_files(self):
        text = self.folder / "text.h5"
        text.write_text("no shard")
        with self.assertRaisesRegex(ShardError, "not a readable HDF5 file"):
            Shard(text)
        other = self.folder / "other.h5"
        with h5py.File(other, "w") as file:
            file["id"] = [1]
        with self.assertRaisesRegex(ShardError, "not a shard"):
            Shard(other)

    def test_another_schema(self):
        path = self.folder / "later.h5"
        path.write_bytes((self.shards / "png.h5").read_bytes())
        with h5py.File(path, "r+") as file:
            file.attrs.modify("schema", np.bytes_("9"))
        with self.assertRaisesRegex(ShardError, "shard schema '9', but this package reads"):
            Shard(path)

    def test_a_file_that_ends_too_early(self):
        path = self.folder / "short.h5"
        content = (self.shards / "png.h5").read_bytes()
        path.write_bytes(content)
        shard = Shard(path)
        last = max(shard.columns.values(), key=lambda column: column.offset)
        path.write_bytes(content[:last.offset + 1])
        name = next(name for name, column in shard.columns.items() if column == last)
        with self.assertRaisesRegex(ShardError, "ends at byte"):
            shard.read(name) if last.kind != "bytes" else shard.picture(0, name)


class Datasets(Folder):
    def make(self, files, listed):
        folder = self.folder / "out" / "set-0123456789ab"
        (folder / "shards").mkdir(parents=True)
        for name in files:
            (folder / "shards" / name).write_bytes(SCHEMA_1.read_bytes())
        (folder / "dataset.json").write_text(json.dumps(
            {"format": "quadruped3d-dataset", "schema": 1, "name": "set",
             "shards": [{"file": f"shards/{name}"} for name in listed]}))
        (self.folder / "out" / "latest").symlink_to(folder.name)
        return folder

    def test_the_shards_of_a_dataset_are_those_that_it_lists(self):
        folder = self.make(["000000.h5", "000001.h5", "stray.h5"], ["000001.h5", "000000.h5"])
        for source in (folder, self.folder / "out"):
            self.assertEqual([path.name for path in shard_files(source)], ["000001.h5", "000000.h5"])
        self.assertEqual(read_manifest(self.folder / "out")["name"], "set")
        self.assertEqual(len(load(folder, ["id"])["id"]), 6)
        self.assertEqual(len(load([folder, SCHEMA_1], ["id"])["id"]), 9)

    def test_a_manifest_is_compared_with_its_digest(self):
        folder = self.make(["000000.h5"], ["000000.h5"])
        text = seal({"format": "quadruped3d-dataset", "schema": 2, "name": "set", "shards": []})
        (folder / "dataset.json").write_text(text)
        self.assertEqual(read_manifest(folder)["name"], "set")
        self.assertNotIn("digest", read_manifest(folder))
        for at in range(len(text)):
            content = bytearray(text.encode())
            content[at] ^= 1
            (folder / "dataset.json").write_bytes(content)
            with self.assertRaises(ShardError, msg=f"byte {at}"):
                read_manifest(folder)

    def test_a_hostile_manifest_leads_nowhere_else(self):
        folder = self.make(["000000.h5"], ["000000.h5"])
        outside = self.folder / "outside.h5"
        outside.write_bytes((folder / "shards/000000.h5").read_bytes())
        manifest = {"format": "quadruped3d-dataset", "schema": 1, "name": "set"}
        for name in (str(outside), "../outside.h5", "shards/../../outside.h5", "shards/..", "shards/a\0.h5", 7, None):
            (folder / "dataset.json").write_text(json.dumps({**manifest, "shards": [{"file": name}]}))
            with self.assertRaisesRegex(ShardError, "the list of shards names"):
                shard_files(folder)
        for text in ("[" * 100_000, "[" * 100_000 + "]" * 100_000, "7"):
            (folder / "dataset.json").write_text(text)
            with self.assertRaisesRegex(ShardError, "JSON"):
                shard_files(folder)

    def test_a_folder_of_shards_needs_no_manifest(self):
        folder = self.make(["b.h5", "a.h5"], [])
        (folder / "dataset.json").unlink()
        self.assertEqual([path.name for path in shard_files(folder)], ["a.h5", "b.h5"])

    def test_what_holds_no_dataset(self):
        with self.assertRaisesRegex(ShardError, "neither a shard nor a folder"):
            load(self.folder)
        with self.assertRaisesRegex(ShardError, "expected a dataset's folder"):
            read_manifest(self.folder)
        (self.folder / "dataset.json").write_text("{")
        with self.assertRaisesRegex(ShardError, "not readable JSON"):
            read_manifest(self.folder)
        (self.folder / "dataset.json").write_text('{"format": "other"}')
        with self.assertRaisesRegex(ShardError, "format is 'other'"):
            read_manifest(self.folder)


if __name__ == "__main__":
    unittest.main()
