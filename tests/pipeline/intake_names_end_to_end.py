"""The program on label files that name their pictures in other ways, or by the numbers of frames."""

import json
import os

from e2e import latest, run
from e2e.intake import IntakeCase, animal, coco, dlc_rows, drawing

LATIN_1 = os.fsdecode(b"caf\xe9")  # a name that is no UTF-8


class Frames(IntakeCase):
    def draw_frames(self, folder, first, count=4):
        for i in range(count):
            self.write(f"{folder}/frame_{first + i:04}.png", drawing(animal(dx=10 * i)))
        self.write("clip.csv", dlc_rows([(i, animal(dx=10 * i)) for i in range(4)]))
        return {"format": "deeplabcut", "annotations": "clip.csv", "images": folder}

    def test_frames_counted_from_1_are_refused_until_the_first_is_named(self):
        dlc = self.draw_frames("ffmpeg", 1)
        self.build(expect=1, **dlc)
        self.assertIn('the key "first_frame"', self.stderr)
        samples = self.build(first_frame=1, **dlc)
        self.assertEqual(len(samples), 4)
        for sample in samples:
            self.assert_on_dots(sample)

    def test_a_frame_too_many_or_too_few_is_no_reason_to_guess(self):
        for count in (3, 5):
            self.build(expect=1, **self.draw_frames(f"ffmpeg{count}", 1, count))
            self.assertIn('the key "first_frame"', self.stderr)

    def test_frames_with_their_own_numbers(self):
        for sample in self.build(**self.draw_frames("own", 0)):
            self.assert_on_dots(sample)
        dlc = self.draw_frames("few", 0)
        for i in (0, 1):
            (self.folder / f"few/frame_{i:04}.png").unlink()
        samples = self.build(**dlc)
        self.assertEqual(len(samples), 2, "the pictures that are there")
        for sample in samples:
            self.assert_on_dots(sample)


class PictureNames(IntakeCase):
    def test_pictures_lie_beside_their_labels(self):
        for folder, dx in (("walk", 0), ("trot", 30)):
            self.write(f"labeled-data/{folder}/img1.png", drawing(animal(dx=dx)))
            self.write(f"labeled-data/{folder}/CollectedData_Ada.csv", dlc_rows([("img1.png", animal(dx=dx))]))
        for images in ({}, {"images": "labeled-data/walk"}):
            samples = self.build(format="deeplabcut", annotations="labeled-data", **images)
            self.assertEqual(sorted(sample["id"].decode() for sample in samples),
                             ["lab/train/labeled-data/trot/img1.png#0", "lab/train/labeled-data/walk/img1.png#0"])
            for sample in samples:
                self.assert_on_dots(sample)

    def test_a_renamed_folder(self):
        self.write("labeled-data/new/img1.png", drawing(animal(dx=9)))
        self.write("labeled-data/old/img1.png", drawing(animal()))  # what the name says, but of other labels
        self.write("labeled-data/new/CollectedData_Ada.csv",
                   dlc_rows([(("labeled-data", "old", "img1.png"), animal(dx=9))], cells=3))
        sample, = self.build(format="deeplabcut", annotations="labeled-data")
        self.assert_on_dots(sample)

    def test_a_table_of_several_folders_goes_by_its_names(self):
        for folder, dx in (("walk", 0), ("trot", 30)):
            self.write(f"labeled-data/{folder}/img1.png", drawing(animal(dx=dx)))
        self.write("labeled-data/walk/CollectedData_Ada.csv",
                   dlc_rows([(("labeled-data", "walk", "img1.png"), animal()),
                             (("labeled-data", "trot", "img1.png"), animal(dx=30))], cells=3))
        for sample in self.build(format="deeplabcut", annotations="labeled-data"):
            self.assert_on_dots(sample)

    def test_names_of_other_systems(self):
        names = ["https://pictures.example.org/set/a.png?size=full#top", "s3://bucket/set/b.png",
                 "file:///C:/set/images/c.png", "E:\\set\\images\\d.png", "\\\\server\\share\\set\\e.png", "sub\\f.png",
                 "two%20words.png", "/data/local-files/?d=set/images/g.png", "../images/h.png", "/elsewhere/set/i.png"]
        files = ["a.png", "b.png", "c.png", "d.png", "e.png", "sub/f.png", "two words.png", "g.png", "h.png", "i.png"]
        for i, file in enumerate(files):
            self.write(f"images/{file}", drawing(animal(dx=3 * i)))
        self.write("annotations/labels.json", coco([(name, animal(dx=3 * i)) for i, name in enumerate(names)]))
        samples = self.build(annotations="annotations/labels.json")
        self.assertEqual(len(samples), len(names), self.stderr)
        for sample in samples:
            self.assert_on_dots(sample)

    def test_accents_as_macos_writes_them(self):
        composed, decomposed = "H\u00fcndin.png", "Katze\u0301.png"
        self.write("images/Hu\u0308ndin.png", drawing(animal()))
        self.write("images/Katz\u00e9.png", drawing(animal(dx=9)))
        self.write("labels.json", coco([(composed, animal()), (decomposed, animal(dx=9))]))
        samples = self.build()
        self.assertEqual(len(samples), 2, self.stderr)
        for sample in samples:
            self.assert_on_dots(sample)

    def test_other_fields_that_name_the_picture(self):
        for i in range(3):
            self.write(f"images/{i}.png", drawing(animal(dx=i)))
        document = coco([(f"{i}.png", animal(dx=i)) for i in range(3)])
        document["images"][0] = {"id": 0, "path": "/datasets/lab/0.png", "width": 300, "height": 200}
        document["images"][1].update(file_name="renamed.png", coco_url="http://pictures.example.org/1.png")
        document["images"][2].update(file_name="gone/2.jpg", path="/datasets/lab/2.png")
        self.write("labels.json", document)
        samples = self.build()
        self.assertEqual(len(samples), 3, self.stderr)

    def test_nothing_above_the_root_is_read(self):
        self.write("secret.png", drawing(animal()))
        names = ["../secret.png", "..\\secret.png", "%2e%2e/secret.png", "images/../../secret.png", "..%2Fsecret.png",
                 "%2e%2e%5csecret.png", str(self.folder / "secret.png"), "file://" + str(self.folder / "secret.png"),
                 "C:\\..\\secret.png"]
        self.write("data/images/good.png", drawing(animal(dx=1)))
        self.write("data/labels.json", coco([(name, animal()) for name in names] + [("good.png", animal(dx=1))]))
        self.assertEqual(len(self.build(root=str(self.folder / "data"))), 1)
        for reason, _ in self.failures():
            self.assertIn(reason, ("path_escapes_root", "image_missing"))


class BytesThatAreNoUtf8(IntakeCase):
    def test_a_folder_of_labels(self):
        for folder, dx in (("walk", 0), (LATIN_1, 30)):
            self.write(f"labeled-data/{folder}/img1.png", drawing(animal(dx=dx)))
            for scorer in ("Ada", "Adawindows"):
                self.write(f"labeled-data/{folder}/CollectedData_{scorer}.csv", dlc_rows([("img1.png", animal(dx=dx))]))
        sample, = self.build("--quiet", format="deeplabcut", annotations="labeled-data")
        self.assert_on_dots(sample)
        (reason, detail), = self.failures()
        self.assertEqual(reason, "record_malformed")
        self.assertIn("labeled-data/caf\\xe9/img1.png", detail)
        self.assert_noted("labeled-data/caf\\xe9: CollectedData_Ada.csv is read")

    def test_a_working_folder(self):
        self.folder = self.folder / LATIN_1
        self.folder.mkdir()
        self.write("images/a.png", drawing(animal()))
        self.write("labels.json", coco([("a.png", animal())]))
        config = self.config(root=".")
        out = self.folder / "out"
        words = ["build", "--config", config, "--out", out, "--json"]
        summaries = [json.loads(run(*words, errors="backslashreplace").stdout) for _ in range(2)]
        self.assertEqual([summary["candidates"] for summary in summaries], [1, 1])
        self.assertEqual([summary["up_to_date"] for summary in summaries], [False, True])
        self.assertTrue(summaries[0]["dataset"].endswith("caf\\xe9/out/" + latest(out).name))
        run("verify", latest(out), errors="backslashreplace")
        run("status", out, "--json", errors="backslashreplace")
