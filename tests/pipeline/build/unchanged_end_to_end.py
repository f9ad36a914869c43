"""A build with nothing to do: it looks at the files' stamps and reads none of them, and any change is found."""

import json
import os
import pathlib
import re
import shutil
import signal
import time

from e2e import Fault, SceneCase, Started, environment, flip_bit, latest, program, verdicts


class Unchanged(SceneCase):
    def setUp(self):
        super().setUp()
        # Its own pictures, since tests change them.
        shutil.copytree(self.shared / "data", self.folder / "data")
        self.scene.data = self.folder / "data"
        self.veto = self.folder / "veto.txt"
        self.veto.write_text("")
        self.config = self.scene.write_config("own.json", veto=str(self.veto))
        self.make_old()
        self.first = self.build()
        self.assertFalse(self.first["up_to_date"])

    def make_old(self):
        """Lets the clock go on, since a file that was changed just before a build is not taken for unchanged."""
        time.sleep(0.2)

    def build(self, fault=None):
        result = self.scene.build("out", "--json", config=self.config, fault=fault)
        self.stderr = result.stderr
        return json.loads(result.stdout)

    def opened(self, path):
        """How many files whose path contains `path` a build opens that finds nothing to do."""
        self.assertTrue(self.build(Fault(path, "open", "count"))["up_to_date"], self.stderr)
        return int(re.search(r"faults: counted (\d+) calls", self.stderr)[1])

    def test_nothing_is_read(self):
        for path in ("data/images/", "data/train.json", "/shards/", "verdicts.csv", "/stages/shards-"):
            self.assertEqual(self.opened(path), 0, path)
        again = self.build()
        for key in ("candidates", "content_id", "dataset", "notes", "warnings", "retained", "refined", "shards"):
            self.assertEqual(again[key], self.first[key], key)
        self.assertEqual(latest(self.folder / "out"), self.folder / "out" / again["dataset"])

    def test_without_the_record_all_is_read_and_the_record_comes_back(self):
        for record in (self.folder / "out/stages/builds").glob("*.stamps"):
            content = bytearray(record.read_bytes())
            content[-5] ^= 1
            record.write_bytes(content)
        self.assertGreater(self.opened("/shards/"), 0)
        self.assertEqual(self.opened("/shards/"), 0)

    def test_a_flipped_bit_with_the_old_time_is_found(self):
        for file in ("shards/000001.h5", "verdicts.csv", "dataset.json"):
            path = self.folder / "out" / self.first["dataset"] / file
            before = path.stat()
            sound = path.read_bytes()
            flip_bit(path, 1000)
            os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
            self.assertEqual(path.stat().st_size, before.st_size)
            self.assertFalse(self.build()["up_to_date"], file)
            self.assertEqual(path.read_bytes(), sound, file)
            self.assertTrue(self.build()["up_to_date"], file)

    def test_a_copied_folder_has_stamps_of_its_own(self):
        shutil.copytree(self.folder / "out", self.folder / "copy", symlinks=True)
        path = latest(self.folder / "copy") / "shards/000001.h5"
        sound = path.read_bytes()
        flip_bit(path, 1000)
        self.make_old()
        again = json.loads(self.scene.build("copy", "--json", config=self.config).stdout)
        self.assertFalse(again["up_to_date"])
        self.assertEqual(path.read_bytes(), sound)

    def test_a_file_beside_the_shards_or_the_pictures_is_looked_at(self):
        (self.scene.data / "images/notes.txt").write_text("nothing of the dataset")
        self.assertGreater(self.opened("data/images/"), 0)
        self.make_old()
        self.opened("data/images/")  # keeps the stamps
        self.assertEqual(self.opened("data/images/"), 0)

    def test_a_program_that_is_replaced_while_it_works_leaves_no_record(self):
        """Else the new program would take the work of the old one for its own."""
        own = self.folder / "bin"
        shutil.copytree(pathlib.Path(program()).parent, own)
        words = [str(own / "quadruped3d"), *map(str, self.scene.build_words("replaced", config=self.config))]
        running = Started(words, environment(Fault("dataset.json", "rename", "stop")))
        self.addCleanup(running.kill)
        self.assertTrue(running.wait_for_stop(), running.stderr())
        for file in list(own.iterdir()):
            shutil.copy(file, own / "new")
            os.replace(own / "new", file)
        running.send(signal.SIGCONT)
        self.assertEqual(running.wait(), 0, running.stderr())
        self.assertEqual(list((self.folder / "replaced/stages/builds").glob("*.stamps")), [])
        self.assertNotEqual(list((self.folder / "out/stages/builds").glob("*.stamps")), [], "as a build leaves one")

    def test_changes_of_inputs_are_found(self):
        changes = {
            "a veto": lambda: self.veto.write_text(verdicts(latest(self.folder / "out"))[3]["id"] + "\n"),
            "a picture that goes": lambda: (self.scene.data / "images/p004.png").unlink(),
            "a picture that comes back": lambda: shutil.copy(self.shared / "data/images/p004.png",
                                                             self.scene.data / "images/p004.png"),
            "an annotation": self.move_a_keypoint,
        }
        for what, change in changes.items():
            change()
            self.assertFalse(self.build()["up_to_date"] and what != "a picture that comes back", what)
            rows = verdicts(latest(self.folder / "out"))
            missing = [row["reason"] for row in rows].count("image_missing")
            self.assertEqual(missing, 1 if what == "a picture that goes" else 0, what)
            self.make_old()

    def move_a_keypoint(self):
        file = self.scene.data / "train.json"
        annotations = json.loads(file.read_text())
        annotations["data"][0]["keypoint_2d"][0][0] += 1.0
        file.write_text(json.dumps(annotations))
