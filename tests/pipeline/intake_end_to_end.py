"""The program on label files as people have them: their sizes, frames, names and copies.

Every picture here is drawn with a coloured dot at each keypoint: blue for the left side, red for the right, yellow
for the middle. A label is right if its point lies on the dot of its side in the crop that the shard stores.
"""

import csv
import io
import json
import struct
import zlib

import numpy as np
from PIL import Image, ImageDraw, ImageOps

from e2e import Case, latest, read_byte_column, read_samples, run, verdicts, write_json

NAMES = ["snout", "eye_l", "eye_r", "tail", "paw_fl", "paw_fr", "paw_bl", "paw_br"]
TOPOLOGY = {
    "name": "eight", "keypoints": NAMES,
    "flip_pairs": [["eye_l", "eye_r"], ["paw_fl", "paw_fr"], ["paw_bl", "paw_br"]],
    "animal3d26": {"nose": "snout", "left_eye": "eye_l", "right_eye": "eye_r", "tail_base": "tail",
                   "left_front_paw": "paw_fl", "right_front_paw": "paw_fr", "left_back_paw": "paw_bl",
                   "right_back_paw": "paw_br"}}
PLACES_OF_26 = {"snout": 24, "eye_l": 0, "eye_r": 1, "tail": 7, "paw_fl": 3, "paw_fr": 4, "paw_bl": 5, "paw_br": 6}
COLOURS = {"l": (20, 40, 250), "r": (250, 40, 20), "": (250, 240, 10)}
SIZE = (300, 200)
MIRRORED = {2, 4, 5, 7}


def colour_of(name):
    return COLOURS[name[-1] if name[-1] in "lr" and "_" in name else ""]


def animal(dx=0, dy=0):
    """The points of an animal that looks to the right, by name, in a picture of SIZE."""
    points = [(210, 60), (195, 50), (200, 68), (60, 80), (180, 150), (196, 158), (70, 150), (86, 158)]
    return {name: (x + dx, y + dy) for name, (x, y) in zip(NAMES, points)}


def drawing(*animals, size=SIZE):
    picture = Image.new("RGB", size, (90, 110, 90))
    pen = ImageDraw.Draw(picture)
    for points in animals:
        for name, (x, y) in points.items():
            pen.ellipse((x - 6, y - 6, x + 6, y + 6), fill=colour_of(name))
    return picture


def triples(points, names=NAMES):
    return [value for name in names for value in (*points[name], 2)]


def coco(pictures, size=SIZE, names=NAMES, **image_fields):
    """A COCO document with one annotation for each (file name, points)."""
    return {"images": [{"id": i, "file_name": name, "width": size[0], "height": size[1], **image_fields}
                       for i, (name, _) in enumerate(pictures)],
            "annotations": [{"id": i, "image_id": i, "category_id": 1, "keypoints": triples(points, names)}
                            for i, (_, points) in enumerate(pictures)],
            "categories": [{"id": 1, "name": "dog", "keypoints": names}]}


def dlc_rows(rows, scorer="Ada", names=NAMES, cells=1):
    """DeepLabCut's CSV of (name, points); a name has `cells` cells."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["scorer", *[""] * (cells - 1), *[scorer] * (2 * len(names))])
    writer.writerow(["bodyparts", *[""] * (cells - 1), *[name for name in names for _ in "xy"]])
    writer.writerow(["coords", *[""] * (cells - 1), *["x", "y"] * len(names)])
    for name, points in rows:
        writer.writerow([*(name if cells > 1 else [name]), *[v for n in names for v in points[n]]])
    return text.getvalue()


def samples_with_pictures(dataset):
    """Every sample with its stored crop and mask, as encoded."""
    samples = read_samples(dataset)
    for name in ("crop", "crop_mask"):
        for sample, value in zip(samples, read_byte_column(dataset, name)):
            sample[name] = value
    return samples


class IntakeCase(Case):
    def write(self, name, content):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, Image.Image):
            content.save(path)
        elif isinstance(content, bytes):
            path.write_bytes(content)
        else:
            path.write_text(content if isinstance(content, str) else json.dumps(content))
        return path

    def config(self, **dataset):
        self.write("topology.json", TOPOLOGY)
        whole = {"name": "lab", "root": str(self.folder), "topology": "topology.json", "role": "2d_only",
                 "format": "coco", "annotations": "labels.json", **dataset}
        return write_json(self.folder / "build.json", {"name": "intake", "datasets": [whole]})

    def build(self, *options, expect=0, **dataset):
        """Builds, and returns the samples, the verdicts and all that was said."""
        config = self.config(**dataset)
        out = self.folder / "out" / str(len(list(self.folder.glob("out/*"))))
        result = run("build", "--config", config, "--out", out, "--threads", 1, "--json", *options, expect=None)
        if expect == 0:
            self.assertEqual(result.returncode, 0, result.stderr)
        else:
            self.assertIn(result.returncode, (1, 2), result.stderr)
        self.stderr = result.stderr
        self.summary = json.loads(result.stdout) if result.stdout.strip() else {}
        self.dataset = latest(out) if (out / "latest").exists() else None
        self.document = json.loads((self.dataset / "dataset.json").read_text()) if self.dataset else {}
        return samples_with_pictures(self.dataset) if self.dataset else []

    def failures(self):
        return [(row["reason"], row["detail"]) for row in verdicts(self.dataset) if row["verdict"] == "failed"]

    def assert_on_dots(self, sample, least=len(NAMES)):
        crop = np.asarray(Image.open(io.BytesIO(sample["crop"])).convert("RGB"), float)
        affine = np.asarray(sample["crop_from_image"], float)
        seen = 0
        for name, place in PLACES_OF_26.items():
            if sample["keypoints_weight"][place] <= 0:
                continue
            x, y = affine[:, :2] @ np.asarray(sample["keypoints_px"][place], float) + affine[:, 2]
            patch = crop[round(y) - 1:round(y) + 2, round(x) - 1:round(x) + 2].mean((0, 1))
            self.assertLess(np.linalg.norm(patch - colour_of(name)), 90, f"{sample['id']} {name}")
            seen += 1
        self.assertGreaterEqual(seen, least)

    def assert_noted(self, text):
        """A note stands on the screen, in --json and in dataset.json."""
        self.assertIn(text, self.stderr)
        for document in (self.summary, self.document):
            self.assertTrue(any(text in note["text"] for note in document["notes"]), document.get("notes"))


def exif_block(orientation):
    """A minimal EXIF block, big endian, whose only tag is the orientation."""
    return b"MM\0*" + struct.pack(">IHHHIHHI", 8, 1, 0x0112, 3, 1, orientation, 0, 0)


def turned_back(picture, orientation):
    """The pixels that a viewer turns into `picture`."""
    back = {2: Image.Transpose.FLIP_LEFT_RIGHT, 3: Image.Transpose.ROTATE_180, 4: Image.Transpose.FLIP_TOP_BOTTOM,
            5: Image.Transpose.TRANSPOSE, 6: Image.Transpose.ROTATE_90, 7: Image.Transpose.TRANSVERSE,
            8: Image.Transpose.ROTATE_270}
    return picture.transpose(back[orientation])


class Sizes(IntakeCase):
    def draw_phone_picture(self, name, picture, orientation):
        stored = turned_back(picture, orientation)
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        exif = Image.Exif()
        exif[0x0112] = orientation
        stored.save(path, exif=exif, **({"quality": 95} if name.endswith("jpg") else {}))
        np.testing.assert_array_equal(  # the drawing does what it says, by another library
            np.asarray(ImageOps.exif_transpose(Image.open(path)).convert("RGB")).shape[:2], picture.size[::-1])

    def test_pictures_are_turned_by_every_exif_orientation(self):
        pictures = []
        for ending in ("jpg", "png"):
            for orientation in range(2, 9):
                points = animal(dx=orientation)
                self.draw_phone_picture(f"images/{ending}_{orientation}.{ending}", drawing(points), orientation)
                pictures.append((f"{ending}_{orientation}.{ending}", points))
        self.write("labels.json", coco(pictures))
        samples = self.build(orientation="exif")
        self.assertEqual(len(samples), 14)
        for sample, (_, points) in zip(samples, pictures):
            self.assert_on_dots(sample)
            self.assertEqual((sample["image_width_px"], sample["image_height_px"]), SIZE)
            np.testing.assert_allclose(sample["keypoints_px"][24], points["snout"])
            orientation = sample["id"].decode().split("_")[1][0]
            self.assertIn(f"turned by its EXIF orientation, {orientation}", sample["detail"].decode())

    def test_exchanged_sizes_are_refused_and_name_the_key(self):
        for orientation in (5, 6, 7, 8):
            self.draw_phone_picture(f"images/{orientation}.jpg", drawing(animal()), orientation)
        self.write("labels.json", coco([(f"{o}.jpg", animal()) for o in (5, 6, 7, 8)]))
        self.write("images/plain.png", drawing(animal()))
        document = coco([(f"{o}.jpg", animal()) for o in (5, 6, 7, 8)] + [("plain.png", animal(dy=3))])
        self.write("labels.json", document)
        self.assertEqual(len(self.build()), 1)
        self.assertEqual([reason for reason, _ in self.failures()], ["size_mismatch"] * 4)
        for _, detail in self.failures():
            self.assertIn("300 x 200", detail)
            self.assertIn("200 x 300", detail)
            self.assertIn("EXIF orientation", detail)
            self.assertIn('"orientation": "exif"', detail)

    def test_an_orientation_that_sizes_do_not_show_is_noted(self):
        for orientation in (2, 3, 4):
            self.draw_phone_picture(f"images/{orientation}.jpg", drawing(animal()), orientation)
        stored = [(f"{o}.jpg", {n: (SIZE[0] - 1 - x if o in (2, 3) else x, SIZE[1] - 1 - y if o in (3, 4) else y)
                                for n, (x, y) in animal().items()}) for o in (2, 3, 4)]
        self.write("labels.json", coco(stored))
        samples = self.build("--quiet")
        self.assertEqual(len(samples), 3)
        for sample in samples:
            self.assert_on_dots(sample)
        self.assert_noted("has an EXIF orientation that turns it")
        self.assert_noted(": 3 records, first lab/train/2.jpg#0")

    def test_a_tool_that_states_the_stored_size_of_a_turned_picture(self):
        """Label Studio shows the picture as EXIF turns it, and writes the size of the stored pixels."""
        self.draw_phone_picture("images/a.jpg", drawing(animal()), 6)
        self.write("labels.json", coco([("a.jpg", animal())], size=SIZE[::-1]))
        samples = self.build(orientation="exif")
        self.assert_on_dots(samples[0])
        self.assert_noted("the stated size is that of the stored pixels")

    def test_damaged_exif_is_none(self):
        jpeg = io.BytesIO()
        drawing(animal()).save(jpeg, "JPEG", quality=95)
        for i, block in enumerate((b"MM\0*\0\0\0", exif_block(9), exif_block(0), b"II" + exif_block(6)[2:],
                                   b"MM\0*" + struct.pack(">IH", 8, 60000))):
            segment = b"Exif\0\0" + block
            app1 = b"\xff\xe1" + struct.pack(">H", len(segment) + 2) + segment
            self.write(f"images/{i}.jpg", jpeg.getvalue()[:2] + app1 + jpeg.getvalue()[2:])
        self.write("labels.json", coco([(f"{i}.jpg", animal(dx=i)) for i in range(5)]))
        self.assertEqual(len(self.build("--quiet")), 5)
        self.assertNotIn("EXIF", self.stderr)

    def test_exif_in_a_png_behind_other_chunks(self):
        png = io.BytesIO()
        turned_back(drawing(animal()), 8).save(png, "PNG")
        data = png.getvalue()

        def chunk(kind, body):
            return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

        at = 8 + 25  # the signature and IHDR
        self.write("images/a.png", data[:at] + chunk(b"tEXt", b"Comment\0" + b"x" * 5000) +
                   chunk(b"eXIf", exif_block(8)) + data[at:])
        self.write("labels.json", coco([("a.png", animal())]))
        self.assert_on_dots(self.build(orientation="exif")[0])

    def test_masks_are_turned_and_scaled_with_the_picture(self):
        mask = Image.new("L", SIZE, 0)
        ImageDraw.Draw(mask).rectangle((50, 40, 220, 165), fill=255)
        self.draw_phone_picture("images/a.jpg", drawing(animal()), 6)
        self.draw_phone_picture("images/b.jpg", drawing(animal(dx=2)), 6)
        self.write("images/c.png", drawing(animal(dx=4)).resize((150, 100), Image.Resampling.BOX))
        self.write("masks/upright.png", mask)
        self.write("masks/stored.png", turned_back(mask, 6))
        records = []
        for picture, name, shift in (("a.jpg", "upright", 0), ("b.jpg", "stored", 2), ("c.png", "upright", 4)):
            rows = [[0, 0, 0] for _ in range(26)]
            for point, place in PLACES_OF_26.items():
                rows[place] = [*animal(dx=shift)[point], 2]
            records.append({"img_path": f"images/{picture}", "mask_path": f"masks/{name}.png", "width": SIZE[0],
                            "height": SIZE[1], "bbox": [50 + shift, 40, 170, 125], "keypoint_2d": rows})
        self.write("labels.json", {"data": records})
        self.config()
        whole = {"name": "lab", "root": str(self.folder), "role": "2d_only", "format": "prima",
                 "annotations": "labels.json", "orientation": "exif", "resized": "scale"}
        config = write_json(self.folder / "prima.json", {"name": "intake", "datasets": [whole]})
        run("build", "--config", config, "--out", self.folder / "masks_out")
        samples = samples_with_pictures(latest(self.folder / "masks_out"))
        self.assertEqual(len(samples), 3)
        for sample in samples:
            self.assert_on_dots(sample)
            cut = np.asarray(Image.open(io.BytesIO(sample["crop_mask"])))
            affine = np.asarray(sample["crop_from_image"], float)
            factor = 0.5 if b"c.png" in sample["id"] else 1.0
            for (x, y), inside in (((60, 50), True), ((210, 155), True), ((30, 100), False), ((240, 100), False)):
                u, v = affine[:, :2] @ (np.array((x, y)) * factor) + affine[:, 2]
                self.assertEqual(bool(cut[round(v), round(u)] > 127), inside, (sample["id"], x, y))

    def test_resized_pictures(self):
        for i, factor in enumerate((0.5, 0.75, 2.0)):
            size = tuple(round(side * factor) for side in SIZE)
            self.write(f"images/{i}.png", drawing(animal(dx=i)).resize(size, Image.Resampling.BOX))
        self.write("images/good.png", drawing(animal()))
        self.write("labels.json", coco([(f"{i}.png", animal(dx=i)) for i in range(3)] + [("good.png", animal())]))
        self.assertEqual(len(self.build()), 1)
        self.assertEqual([reason for reason, _ in self.failures()], ["size_mismatch"] * 3)
        self.assertIn("300 x 200 px in the annotation file and 150 x 100 px in the picture", self.failures()[0][1])
        self.assertIn('"resized": "scale"', self.failures()[0][1])
        samples = self.build("--quiet", resized="scale")
        self.assertEqual(len(samples), 4)
        for sample in samples:
            self.assert_on_dots(sample)
        self.assert_noted("the labels are scaled with it: 3 records")

    def test_a_stretched_picture_is_refused_even_if_it_may_be_scaled(self):
        self.write("images/a.png", drawing(animal()).resize((150, 150)))
        self.write("images/b.png", drawing(animal()))
        self.write("labels.json", coco([("a.png", animal()), ("b.png", animal())]))
        self.assertEqual(len(self.build(resized="scale")), 1)
        (reason, detail), = self.failures()
        self.assertEqual(reason, "size_mismatch")
        self.assertIn("another picture", detail)

    def test_sizes_that_nobody_knows(self):
        for i, (width, height) in enumerate(((0, 0), (None, None), ("300", "200"), (-1, -1), ("", ""), (300.0, 200))):
            self.write(f"images/{i}.png", drawing(animal(dx=i)))
            document = coco([(f"{i}.png", animal(dx=i)) for i in range(i + 1)])
        for image, (width, height) in zip(document["images"], ((0, 0), (None, None), ("300", "200"), (-1, -1),
                                                               ("", ""), (300.0, 200))):
            image.update(width=width, height=height)
        self.write("labels.json", document)
        self.assertEqual(len(self.build()), 6, self.stderr)

    def test_labels_that_cannot_be_meant(self):
        width, height = SIZE
        fractions = {n: (x / width, y / height) for n, (x, y) in animal().items()}
        away = {n: (x + 900, y) for n, (x, y) in animal().items()}
        minus = {n: (-1, -1) for n in NAMES}
        some_minus = {**animal(), "snout": (-1, -1), "eye_l": (0, 0)}
        for i in range(6):
            self.write(f"images/{i}.png", drawing(animal(dx=i)))
        document = coco([("0.png", fractions), ("1.png", away), ("2.png", minus), ("3.png", animal(dx=3)),
                         ("4.png", animal(dx=4)), ("5.png", some_minus)])
        boxes = [[50, 40, 170, 125], None, None, [0.2, 0.25, 0.55, 0.6], [100, 100, 3, 4], None]
        for annotation, box in zip(document["annotations"], boxes):
            if box:
                annotation["bbox"] = box
        self.write("labels.json", document)
        sample, = self.build("--quiet")
        self.assertEqual([reason for reason, _ in self.failures()], [
            "not_in_pixels", "box_outside_image", "no_visible_keypoints", "not_in_pixels", "box_too_small"])
        self.assertIn("between 0 and 1", self.failures()[0][1])
        self.assertEqual((sample["keypoints_weight"][24], sample["keypoints_weight"][0]), (0, 0))
        self.assert_noted("where tools put points that nobody set, get weight 0: 2 records")

    def test_points_beside_their_box(self):
        self.write("images/a.png", drawing(animal()))
        document = coco([("a.png", animal()), ("a.png", animal())])
        document["annotations"][0]["bbox"] = [230, 150, 60, 40]
        document["annotations"][1]["bbox"] = [50, 60, 170, 105]  # the eyes lie a little outside
        self.write("labels.json", document)
        self.assertEqual(len(self.build()), 1)
        self.assertEqual([reason for reason, _ in self.failures()], ["keypoints_outside"])


class Copies(IntakeCase):
    def test_the_same_animal_is_counted_once(self):
        self.write("images/a.png", drawing(animal(), animal(dx=20, dy=20)))
        self.write("images/copy.png", (self.folder / "images/a.png").read_bytes())
        rounded = {n: (x + 0.3, y - 0.4) for n, (x, y) in animal().items()}
        self.write("labels.json", coco([("a.png", animal()), ("a.png", animal(dx=20, dy=20)), ("copy.png", rounded),
                                        ("a.png", animal())]))
        self.assertEqual(len(self.build("--quiet")), 2)
        self.assertEqual(self.failures(), [("duplicate", "it is that of lab/train/a.png#0")] * 2)
        self.assert_noted("which is counted once: 2, first lab/train/copy.png#2")

    def test_labels_of_two_scorers(self):
        self.write("labeled-data/walk/img1.png", drawing(animal()))
        rows = [(("labeled-data", "walk", "img1.png"), animal())]
        for scorer in ("Ada", "Bo"):
            self.write(f"labeled-data/walk/CollectedData_{scorer}.csv", dlc_rows(rows, scorer, cells=3))
        dlc = {"format": "deeplabcut", "annotations": "labeled-data", "species": "dog"}
        self.build(expect=1, **dlc)
        self.assertIn("CollectedData_Ada.csv, CollectedData_Bo.csv", self.stderr)
        self.assertIn("config.yaml", self.stderr)
        self.write("config.yaml", "Task: walk\nscorer: Bo  # the second\n")
        self.assertEqual(len(self.build("--quiet", **dlc)), 1)
        self.assert_noted("CollectedData_Bo.csv is read, and CollectedData_Ada.csv beside it is left out")

    def test_backups_of_deeplabcut(self):
        rows = [(("labeled-data", "walk", "img1.png"), animal())]
        self.write("labeled-data/walk/img1.png", drawing(animal()))
        for name in ("Ada", "Adasingleanimal", "Adawindows"):
            self.write(f"labeled-data/walk/CollectedData_{name}.csv", dlc_rows(rows, cells=3))
        self.assertEqual(len(self.build("--quiet", format="deeplabcut", annotations="labeled-data")), 1)
        self.assert_noted("CollectedData_Adasingleanimal.csv, CollectedData_Adawindows.csv beside it is left out")


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


class Keypoints(IntakeCase):
    def test_keypoints_that_came_and_went(self):
        fewer = [name for name in NAMES if name not in ("paw_bl", "paw_br")]
        more = [*NAMES, "belly"]
        for i, (folder, names) in enumerate((("one", NAMES), ("two", fewer), ("three", more))):
            points = {**animal(dx=5 * i), "belly": (120, 120)}
            self.write(f"labeled-data/{folder}/img.png", drawing(animal(dx=5 * i)))
            self.write(f"labeled-data/{folder}/CollectedData_Ada.csv",
                       dlc_rows([(("labeled-data", folder, "img.png"), points)], names=names, cells=3))
        samples = self.build("--quiet", format="deeplabcut", annotations="labeled-data")
        self.assertEqual(len(samples), 3)
        for sample in samples:
            lacks = b"/two/" in sample["id"]
            self.assert_on_dots(sample, 6 if lacks else 8)
            self.assertEqual(sample["keypoints_v"][5], 0 if lacks else 1)
        self.assert_noted("keypoints of the topology eight that the file lacks, which get weight 0: 2 of 8 "
                          "(paw_bl, paw_br): 1 file, first labeled-data/two/CollectedData_Ada.csv")
        self.assert_noted("keypoints of the file that the topology eight lacks, which are left out: 1 of 9 (belly)")

    def test_names_of_another_spelling_are_refused_and_listed(self):
        names = [f"kp-{name}" for name in NAMES]
        self.write("images/a.png", drawing(animal()))
        points = {f"kp-{name}": place for name, place in animal().items()}
        self.write("labels.json", coco([("a.png", points)], names=names))
        self.build(expect=1)
        for name in ("kp-snout", "kp-paw_br", "eye_l"):
            self.assertIn(name, self.stderr)

    def test_categories(self):
        self.write("images/a.png", drawing(animal(), animal(dx=20, dy=20)))
        document = coco([("a.png", animal()), ("a.png", animal(dx=20, dy=20))])
        document["categories"].append({"id": 2, "name": "cat", "keypoints": ["whisker", "claw"]})
        document["annotations"][1].update(category_id=2, keypoints=[1, 1, 2, 2, 2, 2])
        self.write("labels.json", document)
        self.build(expect=1)
        self.assertIn("whisker", self.stderr)
        self.assertIn('the key "categories"', self.stderr)
        sample, = self.build(categories=["dog"])
        self.assert_on_dots(sample)
        self.build(expect=1, categories=["hound"])
        self.assertIn('"hound"', self.stderr)
        self.assertIn("dog, cat", self.stderr)

    def test_one_side(self):
        left = [name for name in NAMES if not name.endswith("r")]
        one_sided = {"name": "left", "keypoints": left, "flip_pairs": [],
                     "animal3d26": {place: name for place, name in TOPOLOGY["animal3d26"].items() if name in left}}
        self.write("left.json", one_sided)
        self.write("images/a.png", drawing(animal()))
        self.write("labels.json", coco([("a.png", animal())], names=left))
        sample, = self.build(topology="left.json")
        self.assert_on_dots(sample, 5)
        for name in ("eye_r", "paw_fr", "paw_br"):
            self.assertEqual(sample["keypoints_weight"][PLACES_OF_26[name]], 0)


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
