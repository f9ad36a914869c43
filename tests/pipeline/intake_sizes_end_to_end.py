"""The program on pictures whose size or orientation is not that of their label file."""

import io
import struct
import zlib

import numpy as np
from PIL import Image, ImageDraw, ImageOps

from e2e import latest, run, write_json
from e2e.intake import PLACES_OF_26, SIZE, TOPOLOGY, IntakeCase, animal, coco, drawing, samples_with_pictures


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

    def test_corrections_of_a_record_without_keypoints_lie_on_the_turned_picture(self):
        self.draw_phone_picture("images/a.jpg", drawing(animal()), 6)
        document = coco([("a.jpg", animal())])
        document["annotations"][0].update(bbox=[40, 30, 190, 145], keypoints=[0] * 24)
        self.write("labels.json", document)
        names = {ours: theirs for theirs, ours in TOPOLOGY["animal3d26"].items()}
        self.write("corrections.tsv", "".join(f"lab/train/a.jpg#0\t{names[point]}\t{x}\t{y}\t2\n"
                                              for point, (x, y) in animal().items()))
        sample, = self.build("--corrections", self.folder / "corrections.tsv", orientation="exif")
        self.assert_on_dots(sample)

    def test_a_stretched_picture_is_refused_even_if_it_may_be_scaled(self):
        self.write("images/a.png", drawing(animal()).resize((150, 150)))
        self.write("images/b.png", drawing(animal()))
        self.write("labels.json", coco([("a.png", animal()), ("b.png", animal())]))
        self.assertEqual(len(self.build(resized="scale")), 1)
        (reason, detail), = self.failures()
        self.assertEqual(reason, "size_mismatch")
        self.assertIn("another picture", detail)

    def test_sizes_that_nobody_knows(self):
        sizes = ((0, 0), (None, None), ("300", "200"), (-1, -1), ("", ""), (300.0, 200))
        for i in range(len(sizes)):
            self.write(f"images/{i}.png", drawing(animal(dx=i)))
        document = coco([(f"{i}.png", animal(dx=i)) for i in range(len(sizes))])
        for image, (width, height) in zip(document["images"], sizes):
            image.update(width=width, height=height)
        self.write("labels.json", document)
        self.assertEqual(len(self.build()), 6, self.stderr)
