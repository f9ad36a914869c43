"""Label files as people have them, for the scripts intake_*_end_to_end.py.

Every picture here is drawn with a coloured dot at each keypoint: blue for the left side, red for the right, yellow
for the middle. A label is right if its point lies on the dot of its side in the crop that the shard stores.
"""

import csv
import io
import json

import numpy as np
from PIL import Image, ImageDraw

from .case import Case
from .datasets import latest, read_byte_column, read_samples, verdicts
from .pictures import write_json
from .program import run

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
