"""docs/own-labels.md, done: its files are cut out of the page, its commands are run, and the shards are read."""

import csv
import io
import json
import pathlib

import numpy as np
from PIL import Image

from e2e import Case, pages, read_samples, run, verdicts, write_json

PAGE = pathlib.Path(__file__).parents[2] / "docs" / "own-labels.md"
# Animal3D's order.
NAMES = """left_eye right_eye chin left_front_paw right_front_paw left_back_paw right_back_paw tail_base
left_front_thigh right_front_thigh left_back_thigh right_back_thigh left_shoulder right_shoulder left_front_knee
right_front_knee left_back_knee right_back_knee neck tail_tip left_ear right_ear left_mouth_corner
right_mouth_corner nose tail_mid""".split()


class OwnLabels(Case):
    @classmethod
    def prepare(cls):
        goats = cls.shared / "goats"
        for name, content in pages.files(PAGE).items():
            (goats / name).parent.mkdir(parents=True, exist_ok=True)
            (goats / name).write_text(content)
        generator = np.random.default_rng(3)
        for name in ("labeled-data/walk/img0001.png", "labeled-data/walk/img0002.png", "frames/field.png"):
            (goats / name).parent.mkdir(parents=True, exist_ok=True)
            Image.fromarray(generator.integers(0, 255, (150, 200, 3), dtype=np.uint8)).save(goats / name)
        results = [run(*words[1:], cwd=cls.shared) for words in pages.commands(PAGE)]
        write_json(cls.shared / "exit_codes.json", [result.returncode for result in results])

    @classmethod
    def recall(cls):
        cls.files = pages.files(PAGE)
        cls.dataset = cls.shared / "out" / "latest"
        cls.samples = {sample["id"].decode(): sample for sample in read_samples(cls.dataset)}

    def test_the_page_has_its_files(self):
        self.assertEqual(set(self.files), {"labeled-data/walk/CollectedData_Ada.csv", "field.json", "goats.json",
                                           "build.json"})
        self.assertEqual(json.loads((self.shared / "exit_codes.json").read_text()), [0, 0, 0, 0])

    def test_the_draft_of_the_topology_is_the_page_s(self):
        draft = json.loads((self.shared / "goats" / "draft.json").read_text())
        page = json.loads(self.files["goats.json"])
        for key in ("keypoints", "flip_pairs", "animal3d26"):
            self.assertEqual(draft[key], page[key])
        with Image.open(self.shared / "sheet.png") as sheet:
            self.assertTrue(2 * 560 <= sheet.width < 3 * 560, sheet.size)  # two goats side by side

    def test_every_animal_is_kept(self):
        self.assertEqual(list(self.samples), [
            "walk/train/labeled-data/walk/img0001.png#0", "walk/train/labeled-data/walk/img0002.png#0",
            "field/train/field.png#7", "field/train/field.png#8"])
        for row in verdicts(self.dataset):
            self.assertEqual((row["verdict"], row["species"], row["family"]), ("retained", "goat", "bovidae"))

    def test_points_are_the_files_own(self):
        topology = json.loads(self.files["goats.json"])
        header, names, _, *frames = csv.reader(io.StringIO(self.files["labeled-data/walk/CollectedData_Ada.csv"]))
        rows = {}
        for frame in frames:
            values = [float(cell) if cell else None for cell in frame[3:]]
            points = dict(zip(names[3::2], zip(values[::2], values[1::2])))
            rows[f"walk/train/{'/'.join(frame[:3])}#0"] = {
                name: None if point[0] is None else (*point, 1.0) for name, point in points.items()}
        coco = json.loads(self.files["field.json"])
        for annotation in coco["annotations"]:
            triples = np.reshape(annotation["keypoints"], (-1, 3)).tolist()
            rows[f"field/train/field.png#{annotation['id']}"] = dict(zip(coco["categories"][0]["keypoints"], triples))
        self.assertEqual(set(rows), set(self.samples))
        for sample, points in rows.items():
            places = self.samples[sample]["keypoints_px"]
            v = self.samples[sample]["keypoints_v"]
            weights = self.samples[sample]["keypoints_weight"]
            for k, name in enumerate(NAMES):
                point = points[topology["animal3d26"][name]] if name in topology["animal3d26"] else None
                if point is None:
                    self.assertEqual((v[k], weights[k]), (0, 0), (sample, name))
                    continue
                np.testing.assert_allclose((*places[k], v[k]), point, rtol=1e-6)
                expected = point[2] if point[2] >= 0.6 else 0.0
                self.assertAlmostEqual(float(weights[k]), expected, places=6, msg=f"{sample} {name}")

    def test_boxes_lie_around_the_points(self):
        # x 30 to 150, y 48 to 122; 120 is the longer side, so 12 px on every side.
        np.testing.assert_allclose(self.samples["walk/train/labeled-data/walk/img0001.png#0"]["box_xywh_px"],
                                   [18, 36, 144, 98])
