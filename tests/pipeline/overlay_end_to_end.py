"""Meshes over photographs. The rendered world knows where its animals are: its masks and cameras are the measure."""

import json
import os
import struct

import numpy as np
from PIL import Image, ImageDraw

from e2e import (Case, latest, make_network, read_safetensors, read_samples, render_world, run, run_json, verdicts,
                 world_animal3d, world_body, world_superanimal, write_json)

SIDE = 300  # px of a panel
CONTEXT = 1.2  # crops that a panel shows
GAP = 4  # px between panels
# Masks leave out what stands before an animal, and the outline of an animal of 60 px is a tenth of its pixels.
MIN_IOU, MEDIAN_IOU = 0.7, 0.85


def age(folder):
    """Makes all files an hour old: a build remembers where a file lies only if nobody has just written it."""
    for path in folder.rglob("*"):
        if path.is_file():
            os.utime(path, (path.stat().st_atime, path.stat().st_mtime - 3600))


def read_obj(path):
    """(vertices, faces from 0, the camera's numbers) of an OBJ file."""
    lines = path.read_text().splitlines()
    numbers = {words[1]: [float(w) for w in words[2:]] for words in (line.split() for line in lines)
               if words[0] == "#" and words[1] in ("focal_px", "principal_point_px", "crop_side_px")}
    vertices = np.array([[float(w) for w in line.split()[1:]] for line in lines if line.startswith("v ")])
    faces = np.array([[int(w) - 1 for w in line.split()[1:]] for line in lines if line.startswith("f ")])
    return vertices, faces, numbers


def project(vertices, camera):
    """Pixels of the photograph, by the camera that the OBJ file states."""
    focal, (cx, cy) = camera["focal_px"][0], camera["principal_point_px"]
    return np.stack([cx - focal * vertices[:, 0] / vertices[:, 2], cy + focal * vertices[:, 1] / vertices[:, 2]], 1)


def iou(a, b):
    return (a & b).sum() / (a | b).sum()


def panel_of(picture, index):
    x = index * (SIDE + GAP)
    return np.asarray(picture.crop((x, 0, x + SIDE, SIDE))).astype(int)


def in_panel(picture, box, resample):
    """The part of a photograph that a panel shows, as the panel shows it."""
    x, y, w, h = box
    cx, cy, side = (2 * x + w) // 2, (2 * y + h) // 2, max(w, h)
    scale = side * CONTEXT / SIDE
    return picture.transform((SIDE, SIDE), Image.Transform.AFFINE,
                             (scale, 0, cx - scale * SIDE / 2, 0, scale, cy - scale * SIDE / 2), resample)


class Overlays(Case):
    @classmethod
    def prepare(cls):
        world = cls.shared / "world"
        render_world(world)
        make_network(cls.shared / "tiny.safetensors", seed=3)
        age(cls.shared)
        network = {"checkpoint": str(cls.shared / "tiny.safetensors"), "smal_asset": str(world_body(world)),
                   "device": "cpu", "batch": 4, "compute_threads": 1}
        config = write_json(cls.shared / "config.json", {
            "name": "seen", "version": "1.0.0",
            "datasets": [{**world_animal3d(world), "role": "truth"}, world_superanimal(world)],
            "network": network, "tta": {"learning_rate": 1e-3, "batch": 4}, "shards": {"unit_size": 16},
            "filter": {"tau_ceiling": 1.0}})  # the network is untrained
        run("calibrate", "--config", config, "--out", cls.shared / "out", "--write", cls.shared / "thresholds.json")
        run("build", "--config", config, "--config", cls.shared / "thresholds.json", "--out", cls.shared / "out")

    @classmethod
    def recall(cls):
        cls.world = cls.shared / "world"
        cls.out = cls.shared / "out"
        cls.rows = verdicts(latest(cls.out))
        records = json.loads((cls.world / "animal3d/test.json").read_text())["data"]
        cls.truth = [row["id"] for row in cls.rows if row["dataset"] == "animal3d"]
        cls.records = {f"animal3d/test/{record['img_path']}": record for record in records}

    def record(self, sample_id):
        """The world's own record of a sample."""
        return self.records[sample_id[:sample_id.rindex("#")]]

    def draw(self, *words):
        """{id: stem} of what `overlay` drew into this test's folder."""
        drawn = run_json("overlay", self.out, *words, "--out", self.folder)
        return {each["id"]: each["stem"] for each in drawn}

    def mask(self, record):
        return Image.open(self.world / "animal3d" / record["mask_path"]).convert("L")

    # --- the true body lies over the animal

    def test_the_drawn_truth_covers_the_animal(self):
        drawn = self.draw(*self.truth, "--plain", "--panels", "photo,label")
        self.assertEqual(set(drawn), set(self.truth))
        shares = []
        for sample_id, stem in drawn.items():
            record = self.record(sample_id)
            picture = Image.open(self.folder / f"{stem}.png")
            mesh = np.abs(panel_of(picture, 0) - panel_of(picture, 1)).max(axis=2) > 0
            animal = np.asarray(in_panel(self.mask(record), record["bbox"], Image.Resampling.NEAREST)) > 127
            shares.append(iou(mesh, animal))
            self.assertGreater(shares[-1], MIN_IOU, sample_id)
        self.assertGreater(np.median(shares), MEDIAN_IOU)

    def test_the_obj_file_covers_the_animal_in_the_photograph(self):
        drawn = self.draw(*self.truth, "--obj")
        shares = []
        for sample_id, stem in drawn.items():
            record = self.record(sample_id)
            mask = self.mask(record)
            vertices, faces, camera = read_obj(self.folder / f"{stem}.obj")
            self.assertEqual((len(vertices), len(faces)), (3889, 7774))
            points = project(vertices, camera)
            body = Image.new("L", mask.size)
            draw = ImageDraw.Draw(body)
            for face in faces:
                draw.polygon([tuple(points[corner]) for corner in face], fill=255)
            shares.append(iou(np.asarray(body) > 127, np.asarray(mask) > 127))
            self.assertGreater(shares[-1], MIN_IOU, sample_id)
        self.assertGreater(np.median(shares), MEDIAN_IOU)

    def test_keypoints_of_the_written_mesh_are_the_projected_ones(self):
        asset = read_safetensors(world_body(self.world))
        groups = np.split(asset["keypoint_vertices"], asset["keypoint_offsets"][1:-1])
        drawn = self.draw("superanimal", "--verdict", "retained,refined", "--obj")
        samples = {sample["id"].decode(): sample for sample in read_samples(latest(self.out))}
        self.assertGreater(len(drawn), 3)
        for sample_id, stem in drawn.items():
            sample = samples[sample_id]
            vertices, _, camera = read_obj(self.folder / f"{stem}.obj")
            cx, cy, side = sample["patch_box_px"]
            keypoints = np.array([vertices[group].mean(axis=0) for group in groups])
            in_crop = (project(keypoints, camera) - [cx, cy]) / side
            np.testing.assert_allclose(in_crop, sample["projected_2d"], atol=1e-4, err_msg=sample_id)

    # --- what is drawn

    def test_the_photo_panel_is_the_photograph(self):
        stem, = self.draw(self.truth[0], "--plain", "--panels", "photo").values()
        record = self.record(self.truth[0])
        drawn = np.asarray(Image.open(self.folder / f"{stem}.png")).astype(int)
        photo = Image.open(self.world / "animal3d" / record["img_path"]).convert("RGB")
        expected = np.asarray(in_panel(photo, record["bbox"], Image.Resampling.BILINEAR)).astype(int)
        inner = slice(40, -40)
        self.assertLess(np.abs(drawn - expected)[inner, inner].mean(), 6.0)

    def test_every_verdict_can_be_drawn(self):
        for verdict in {row["verdict"] for row in self.rows}:
            drawn = self.draw("--verdict", verdict, "--count", 2)
            self.assertGreater(len(drawn), 0, verdict)
            for stem in drawn.values():
                self.assertGreater(Image.open(self.folder / f"{stem}.png").size[0], 5 * SIDE)

    def test_discarded_candidates_show_their_photo_and_prediction(self):
        gone = next(row["id"] for row in self.rows if row["reason"] == "error_too_large")
        stem, = self.draw(gone, "--plain", "--panels", "photo,prediction,label").values()
        picture = Image.open(self.folder / f"{stem}.png")
        photo, prediction, label = (panel_of(picture, i) for i in range(3))
        self.assertGreater(photo.std(), 5, "a photograph, not a grey panel")
        self.assertGreater((np.abs(photo - prediction).max(axis=2) > 0).mean(), 0.01)
        self.assertTrue((np.abs(label - [226, 226, 224]).max(axis=2) == 0).mean() > 0.8, "there is no label")

    def test_worst_and_near_threshold_choose_by_the_numbers(self):
        kept = [row for row in self.rows if row["verdict"] in ("retained", "refined") and row["final_error"]]
        worst = sorted(kept, key=lambda row: -float(row["final_error"]))[:4]
        self.assertEqual(list(self.draw("--worst", 4)), [row["id"] for row in worst])
        limits = json.loads((self.shared / "thresholds.json").read_text())["filter"]
        judged = [row for row in self.rows if row["dataset"] == "superanimal" and row["initial_error"]]
        nearest = sorted(judged, key=lambda row: min(abs(float(row["initial_error"]) - limits["tau_low"]),
                                                     abs(float(row["initial_error"]) - limits["tau_high"])))[:5]
        self.assertEqual(list(self.draw("--near-threshold", 5)), [row["id"] for row in nearest])

    def test_a_sheet_holds_all_and_inspect_draws_one_with_meshes(self):
        run("overlay", self.out, "--best", 4, "--panels", "label", "--plain", "--columns", 4, "--sheet",
            self.folder / "row.png")
        self.assertGreater(Image.open(self.folder / "row.png").size[0], 4 * SIDE)
        stderr = run("inspect", self.out, "--sheet", self.folder / "sheet.png", "--count", 12).stderr
        self.assertNotIn("without meshes", stderr)
        self.assertGreater(Image.open(self.folder / "sheet.png").size[0], 6 * 256)
        bare = run("inspect", next((latest(self.out) / "shards").glob("*.h5")), "--sheet", self.folder / "shard.png")
        self.assertNotIn("without meshes", bare.stderr)

    # --- files that moved

    def test_moved_pictures_are_said_and_the_config_finds_them(self):
        gone = next(row["id"] for row in self.rows if row["reason"] == "error_too_large")
        out = self.copy_of("out")
        (out / "digests.txt").unlink()
        words = ["overlay", out, gone, "--plain", "--panels", "photo", "--out", self.folder / "drawn"]
        self.assertIn("--body", run(*words, expect=1).stderr)
        run(*words, "--body", world_body(self.world))
        grey, = (self.folder / "drawn").glob("*.png")
        self.assertLess(np.asarray(Image.open(grey)).std(), 40)
        run(*words, "--config", self.shared / "config.json")
        self.assertGreater(len(np.unique(np.asarray(Image.open(grey)))), 100)

    def test_another_body_model_is_refused(self):
        other = self.folder / "other.safetensors"
        content = bytearray(world_body(self.world).read_bytes())
        content[-1] ^= 1
        other.write_bytes(content)
        stderr = run("overlay", self.out, self.truth[0], "--body", other, "--out", self.folder / "x", expect=2).stderr
        self.assertIn("not the body model", stderr)

    def test_wrong_words_are_usage_errors(self):
        for words in (["--panels", "nose", "--out", self.folder], ["--verdict", "kept", "--out", self.folder],
                      ["--obj", "--sheet", self.folder / "s.png"], []):
            run("overlay", self.out, *words, expect=2)
        run("overlay", self.out, "no-such-candidate", "--out", self.folder, expect=1)

    def test_the_binary_gltf_holds_the_same_body(self):
        stem, = self.draw(self.truth[0], "--obj", "--glb").values()
        content = (self.folder / f"{stem}.glb").read_bytes()
        magic, version, length, json_length = struct.unpack("<4sIII", content[:16])
        self.assertEqual((magic, version, length), (b"glTF", 2, len(content)))
        document = json.loads(content[20 : 20 + json_length])
        numbers = np.frombuffer(content, np.float32, 3 * document["accessors"][0]["count"], 20 + json_length + 8)
        vertices, _, camera = read_obj(self.folder / f"{stem}.obj")
        np.testing.assert_allclose(numbers.reshape(-1, 3), vertices, atol=1e-6)
        self.assertEqual(document["asset"]["extras"]["focal_px"], camera["focal_px"][0])
