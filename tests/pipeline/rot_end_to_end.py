"""Damaged files of finished stages, and errors of the disk: neither may reach a dataset, and neither may stay."""

import errno
import json
import os

import h5py

from e2e import (UNIT, Case, Fault, Scene, SceneCase, digests, draw_pictures, fault_lines, file_sha256, flip_bit, latest,
                 prima_dataset, run, run_json, units_in_journals, verdicts, write_annotations, write_json)


def byte_of_column(path, name):
    """Where in an HDF5 file the middle of a column's numbers lies."""
    with h5py.File(path) as file:
        return file[name].id.get_offset() + file[name].id.get_storage_size() // 2


class DamagedStages(SceneCase):
    """One bit of a stage's file flips after the build. A later build must not take the file: it names it and makes the
    unit anew, so that it ends as if nothing had happened."""

    @classmethod
    def prepare(cls):
        scene = Scene.make(cls.shared)
        scene.build("out")
        for name, changes in (("quality", {"shards": {"jpeg_quality": 80}}), ("version", {"version": "1.0.1"})):
            config = scene.write_config(f"{name}.json", **changes)
            write_json(cls.shared / f"clean_{name}.json", json.loads(
                scene.build(f"clean_{name}", "--json", config=config).stdout))

    def setUp(self):
        super().setUp()
        self.out = self.copy_of("out")

    def units(self, stage):
        """The stage's files in this test's output folder, by unit."""
        return sorted(self.out.glob(f"stages/{stage}-*/unit-*.h5"))

    def expect_made_anew(self, damaged, change):
        """Flips bits, builds with another setting, and compares with a build of that setting from nothing. `damaged`
        maps the file of a unit to the byte."""
        whole = {path: file_sha256(path) for path in damaged}
        for path, offset in damaged.items():
            flip_bit(path, offset)
            self.assertNotEqual(file_sha256(path), whole[path])
        result = self.scene.build("out", "--json", config=self.shared / f"{change}.json")
        clean = json.loads((self.shared / f"clean_{change}.json").read_text())
        self.assertEqual(json.loads(result.stdout)["content_id"], clean["content_id"])
        self.assertEqual(digests(latest(self.out)), digests(latest(self.shared / f"clean_{change}")))
        run("verify", self.out)
        for path in damaged:
            self.expect_told(result, path)
            self.assertEqual(file_sha256(path), whole[path])

    def expect_told(self, result, path):
        """A line on stderr names the file and says that something is made anew."""
        told = [line for line in result.stderr.splitlines() if f"{path.parent.name}/{path.name}" in line]
        self.assertTrue(any("made again" in line for line in told), result.stderr)

    def test_a_refine_table(self):
        first, second, *_ = self.units("refine")
        damaged = {first: byte_of_column(first, "rotations"), second: byte_of_column(second, "curve")}
        self.expect_made_anew(damaged, "quality")

    def test_a_predict_table(self):
        first, second, *_ = self.units("predict")
        damaged = {first: byte_of_column(first, "rotations"), second: byte_of_column(second, "keypoints_2d")}
        self.expect_made_anew(damaged, "quality")

    def test_a_shard(self):
        """Another version has the same shards, so that they are taken from their stage."""
        first, second, *_ = self.units("shards")
        damaged = {first: byte_of_column(first, "pose"), second: byte_of_column(second, "crop")}
        self.expect_made_anew(damaged, "version")

    def test_a_table_that_hdf5_cannot_open(self):
        path = self.units("refine")[-1]
        self.expect_made_anew({path: 0}, "quality")

    def test_a_line_of_a_journal(self):
        """What the line says of its unit is lost, so the unit is made anew."""
        journal, = self.out.glob("stages/refine-*/journal.jsonl")
        flip_bit(journal, journal.read_bytes().index(b"\n") // 2)
        result = self.scene.build("out", "--json", config=self.shared / "quality.json")
        self.expect_told(result, journal)
        self.assertEqual(digests(latest(self.out)), digests(latest(self.shared / "clean_quality")))

    def test_a_whole_table_is_taken_as_it_is(self):
        result = self.scene.build("out", "--json", config=self.shared / "quality.json")
        self.assertNotIn("made again", result.stderr)


class UnreadablePictures(Case):
    """The disk fails while one picture is read. This says nothing about the picture: the build stops and names it,
    and when the disk is well again it ends as if nothing had happened."""

    PICTURE = 4
    NAME = f"p{PICTURE:03}.png"

    @classmethod
    def prepare(cls):
        data = cls.shared / "data"
        write_annotations(data, draw_pictures(data, 2 * UNIT))
        for picture in data.glob("images/*"):
            os.utime(picture, (1e9, 1e9))  # old files; the program does not trust digests of files of this moment
        config = write_json(cls.shared / "config.json", {"name": "flat", "shards": {"unit_size": UNIT},
                                                         "datasets": [prima_dataset(data, role="2d_only")]})
        write_json(cls.shared / "summary.json", run_json("build", "--config", config, "--out", cls.shared / "out"))

    @classmethod
    def recall(cls):
        cls.config = cls.shared / "config.json"
        cls.summary = json.loads((cls.shared / "summary.json").read_text())

    def build(self, out, **options):
        return run("build", "--config", self.config, "--out", out, "--json", **options)

    def expect_stop(self, result, out, error):
        """The build named the picture and the error, and left nothing that holds a verdict on the picture."""
        self.assertEqual(result.returncode, 1, result.stderr)
        told = [line for line in result.stderr.splitlines() if not line.startswith("faults: ")]
        self.assertTrue(any(self.NAME in line and os.strerror(error) in line for line in told), result.stderr)
        self.assertFalse((out / "latest").exists())
        self.assertEqual([*out.rglob("dataset.json"), *out.rglob("verdicts.csv")], [])
        self.assertNotIn(self.PICTURE // UNIT, units_in_journals(out, "predict"))

    def expect_same_result(self, result, out):
        self.assertEqual(json.loads(result.stdout)["content_id"], self.summary["content_id"])
        self.assertEqual(digests(latest(out)), digests(latest(self.shared / "out")))

    def expect_resumable(self, name, *calls):
        """Lets the first, the second, ... call on the picture fail, and all that follow, until no call is left."""
        for call in calls:
            for skip in range(50):
                out = self.folder / f"{call}{skip}"
                result = self.build(out, expect=None, fault=Fault(self.NAME, call, error=name, skip=skip))
                if not fault_lines(result.stderr):
                    break
                with self.subTest(call=call, skip=skip):
                    # The last look at a picture is for the record that nothing has changed; without it, the next
                    # build reads everything again.
                    if result.returncode != 0 or call != "stat":
                        self.expect_stop(result, out, getattr(errno, name))
                    self.expect_same_result(self.build(out), out)
            self.assertGreater(skip, 0, f"the program makes no call of the kind {call} on the picture")
            self.expect_same_result(result, out)

    def test_an_input_output_error(self):
        self.expect_resumable("EIO", "open", "read")

    def test_a_stale_handle_of_a_network_drive(self):
        self.expect_resumable("ESTALE", "open", "read", "stat")

    def test_too_many_open_files(self):
        self.expect_resumable("EMFILE", "open")

    def test_no_memory(self):
        self.expect_resumable("ENOMEM", "open", "read")

    def test_a_picture_that_is_not_there_stays_a_verdict(self):
        data = self.copy_of("data")
        (data / "images" / self.NAME).unlink()
        config = write_json(self.folder / "config.json", {"name": "flat", "shards": {"unit_size": UNIT},
                                                          "datasets": [prima_dataset(data, role="2d_only")]})
        run("build", "--config", config, "--out", self.folder / "out")
        row = verdicts(latest(self.folder / "out"))[self.PICTURE]
        self.assertEqual((row["verdict"], row["reason"]), ("failed", "image_missing"))
