"""`quadruped3d export --format prima` and `coco`, read back by other readers than the program's own."""

import contextlib
import io
import json
import os
import subprocess
import sys
import unittest

import numpy as np
from PIL import Image

from support import PACKAGE, Shards, check_issues, make_dataset
from quadruped3d import KEYPOINTS, Shard, body, geometry, load

TERMS = {"zoo/train": {"licence": "CC-BY-4.0", "source_url": "https://example.org/zoo", "citation": "A zoo"}}


class Program(Shards):
    def setUp(self):
        super().setUp()
        self.dataset = make_dataset(self.folder / "made-000000000000", [self.shards / "body.h5"], TERMS)
        self.labels = load(self.dataset)

    def run_program(self, *words, expect=0):
        result = subprocess.run([os.environ["Q3D_PROGRAM"], *map(str, words)], capture_output=True, text=True,
                                env={**os.environ, "PYTHONPATH": str(PACKAGE)})
        self.assertEqual(result.returncode, expect, result.stderr)
        return result

    def export(self, kind, *more):
        self.run_program("export", self.dataset, "--format", kind, "--out", self.folder / kind, *more)
        return self.folder / kind


def official_sample(root, record):
    """What the official TrainDataset takes from a record, written anew from its description: without augmentation."""
    image = np.array(Image.open(root / record["img_path"]).convert("RGB"))
    mask = np.array(Image.open(root / record["mask_path"]).convert("L"))
    if mask.shape != image.shape[:2]:
        raise AssertionError("picture and mask are joined, so they must have one size")
    x, y, w, h = record["bbox"]
    keypoints = np.array(record["keypoint_2d"], np.float32)
    betas = np.array(record["shape"] + record["shape_extra"], np.float32) if "shape" in record else np.zeros(41)
    return {
        "image": image, "mask": mask, "centre": ((x * 2 + w) // 2, (y * 2 + h) // 2), "side": max(w, h),
        "keypoints": keypoints, "betas": betas, "family": int(record["supercategory"]),
        "pose": np.array(record.get("pose", np.zeros(105)), np.float32),
        "trans": np.array(record.get("trans", np.zeros(3)), np.float32),
        "keypoints_3d": np.array(record["keypoint_3d"], np.float32) if "keypoint_3d" in record else None,
    }


class Prima(Program):
    def test_the_official_reader_finds_every_field(self):
        root = self.export("prima") / "zoo"
        data = json.loads((root / "train.json").read_text())["data"]
        labels = self.labels
        self.assertEqual([record["id"] for record in data], list(labels["id"]))
        for row, record in enumerate(data):
            sample = official_sample(root, record)
            np.testing.assert_array_equal(sample["betas"], labels["betas"][row])
            np.testing.assert_array_equal(sample["trans"], labels["trans"][row])
            np.testing.assert_array_equal(sample["keypoints_3d"], labels["keypoints_3d"][row])
            np.testing.assert_allclose(sample["pose"].reshape(35, 3), body.axis_angle_from_matrix(labels["pose"][row]),
                                       atol=1e-6)
            self.assertEqual(sample["family"], labels["family"][row])
            visible = labels["keypoints_weight"][row] > 0
            np.testing.assert_array_equal(sample["keypoints"][:, 2],
                                          np.where(visible, labels["keypoints_v"][row], 0))
            self.assertEqual(sample["centre"], tuple(np.round(sample["centre"])))
            # L_proj of the official crop: keypoints relative to the box's floored centre, body projected with f = 1000.
            annotated = (sample["keypoints"][:, :2].astype(float) - sample["centre"]) / sample["side"]
            projected = geometry.project(sample["keypoints_3d"], sample["trans"])
            error = geometry.projection_error(projected, annotated, sample["keypoints"][:, 2])
            self.assertAlmostEqual(float(error), labels["final_error"][row], delta=1e-6)
            self.assertEqual((record["height"], record["width"]), sample["image"].shape[:2])

    def test_pictures_and_masks_are_the_shards(self):
        root = self.export("prima") / "zoo"
        data = json.loads((root / "train.json").read_text())["data"]
        shard = Shard(self.shards / "body.h5")
        kinds = set()
        for row, record in enumerate(data):
            mask = np.array(Image.open(root / record["mask_path"]))
            kinds.add("none" if "none_" in record["mask_path"] else "own")
            self.assertEqual(bool(mask.any()), bool(shard.picture(row, "crop_mask")))
            if self.labels["crop_from_image"][row][0, 0] == 1:
                self.assertEqual((root / record["img_path"]).read_bytes(), shard.picture(row))
        self.assertEqual(kinds, {"none", "own"})

    def test_croissant_is_valid_and_gives_the_records(self):
        check_croissant(self, self.export("prima"), "zoo-train", "id", [name.encode() for name in self.labels["id"]])


class Coco(Program):
    def test_pycocotools_reads_it(self):
        from pycocotools.coco import COCO

        folder = self.export("coco")
        with contextlib.redirect_stdout(io.StringIO()):
            coco = COCO(str(folder / "annotations.json"))
        self.assertEqual(len(coco.getImgIds()), 6)
        for row, annotation in enumerate(coco.loadAnns(coco.getAnnIds())):
            image, = coco.loadImgs([annotation["image_id"]])
            category, = coco.loadCats([annotation["category_id"]])
            self.assertEqual(category["name"], self.labels["species"][row])
            self.assertEqual(category["keypoints"], list(KEYPOINTS))
            self.assertEqual((folder / "images" / image["file_name"]).read_bytes(),
                             Shard(self.shards / "body.h5").picture(row))
            points = np.array(annotation["keypoints"]).reshape(26, 3)
            visible = self.labels["keypoints_weight"][row] > 0
            self.assertEqual(annotation["num_keypoints"], visible.sum())
            np.testing.assert_array_equal(points[:, 2], np.where(visible, self.labels["keypoints_v"][row], 0))
            expected = geometry.map_points(self.labels["crop_from_image"][row], self.labels["keypoints_px"][row])
            np.testing.assert_allclose(points[visible, :2], expected[visible], atol=1e-9)
            self.assertEqual(image["quadruped3d"]["id"], self.labels["id"][row])

    def test_corrections_come_back(self):
        from pycocotools.coco import COCO

        folder = self.export("coco")
        with contextlib.redirect_stdout(io.StringIO()):
            coco = COCO(str(folder / "annotations.json"))
        first, second = coco.getAnnIds()[:2]
        coco.anns[first]["keypoints"][3 * 6] += 2.0  # right_back_paw
        removed = coco.anns[second]
        corrected = {**coco.dataset, "annotations": [a for a in coco.dataset["annotations"] if a is not removed]}
        (self.folder / "corrected.json").write_text(json.dumps(corrected))
        self.run_program("corrections", folder, self.folder / "corrected.json", "--out", self.folder / "changes")
        lines = [line.split("\t") for line in (self.folder / "changes" / "corrections.tsv").read_text().splitlines()
                 if not line.startswith("#")]
        self.assertEqual([line[:2] for line in lines], [[self.labels["id"][0], "right_back_paw"]])
        factor = self.labels["crop_from_image"][0][0, 0]
        x, y = (float(number) for number in lines[0][2:4])
        np.testing.assert_allclose([x, y], self.labels["keypoints_px"][0][6] + [2.0 / factor, 0.0], atol=1e-9)
        veto = (self.folder / "changes" / "veto.txt").read_text()
        self.assertIn(f"{self.labels['id'][1]}\t", veto)

    def test_croissant_is_valid(self):
        check_croissant(self, self.export("coco"), "annotations", "id", list(range(1, 7)))


class ParquetByTheProgram(Program):
    def test_without_the_package_it_ends_with_2_and_says_how_to_install_it(self):
        result = self.run_program("export", self.dataset, "--format", "parquet", "--out", self.folder / "x", "--python",
                                  "/nowhere/python3", expect=2)
        self.assertIn("pip install './python[export]'", result.stderr)
        self.assertFalse((self.folder / "x").exists())

    def test_the_program_calls_the_package(self):
        import pyarrow.parquet

        result = self.run_program("export", self.dataset, "--format", "hf", "--out", self.folder / "hf", "--python",
                                  sys.executable, "--json")
        self.assertEqual(json.loads(result.stdout)["pictures"], 6)
        table = pyarrow.parquet.read_table(next((self.folder / "hf" / "data").glob("*.parquet")))
        self.assertEqual(table["id"].to_pylist(), list(self.labels["id"]))


def check_croissant(case, folder, record_set, field, expected):
    import mlcroissant

    with contextlib.chdir(folder):
        dataset = mlcroissant.Dataset(jsonld="croissant.json")
        check_issues(case, dataset)
        records = list(dataset.records(record_set))
    case.assertEqual([record[f"{record_set}/{field}"] for record in records], expected)


if __name__ == "__main__":
    unittest.main()
