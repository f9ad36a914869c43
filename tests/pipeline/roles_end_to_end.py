"""The program on datasets that bring their labels: packs, kills, resumes, mixes and breaks them.

Run by ctest as: python roles_end_to_end.py PATH_OF_quadruped3d. Every dataset here is made by the test itself.
"""

import csv
import hashlib
import json
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import h5py
import numpy as np
from PIL import Image

from end_to_end import PROGRAM, PICTURES, UNIT, Scene, digests, draw_pictures, run, write_annotations

FOCAL = 1000 / 256  # crop units


def rotation_matrix(axis_angle):
    """Rodrigues' formula as the exponential series of the cross-product matrix."""
    x, y, z = axis_angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    term = total = np.eye(3)
    for n in range(1, 40):
        term = term @ cross / n
        total = total + term
    return total


def give_bodies(records, seed=17):
    """Bodies before the camera; the labelled 2D keypoints become their exact projections."""
    generator = np.random.default_rng(seed)
    for record in records:
        x, y, w, h = record["bbox"]
        centre, side = np.array([(2 * x + w) // 2, (2 * y + h) // 2]), max(w, h)
        points = generator.uniform(-0.4, 0.4, (26, 3)).astype(np.float32)
        trans = np.array([0.1, -0.2, generator.uniform(4, 8)], np.float32)
        camera = points.astype(float) + trans
        projected = FOCAL * camera[:, :2] / camera[:, 2:]
        visible = np.array(record["keypoint_2d"])[:, 2:]
        record.update(pose=generator.uniform(-1.5, 1.5, 105).tolist(), shape=generator.normal(size=20).tolist(),
                      shape_extra=generator.normal(size=21).tolist(), trans=trans.tolist(),
                      keypoint_3d=points.tolist(),
                      keypoint_2d=np.hstack([projected * side + centre, visible]).tolist())
    return records


class Roles(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.root = pathlib.Path(tempfile.mkdtemp(prefix="q3d_roles_"))
        cls.records = give_bodies(draw_pictures(cls.root / "data", PICTURES))
        write_annotations(cls.root / "data", cls.records)
        cls.summary = cls.build("truth", cls.config("truth"))
        cls.dataset = cls.latest("truth")

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.root)

    @classmethod
    def config(cls, role, name=None, data="data", **changes):
        config = {"name": "packed", "datasets": [{"name": "drawn", "format": "prima", "root": data,
                                                  "annotations": "train.json", "role": role}],
                  "shards": {"unit_size": UNIT}, **changes}
        path = cls.root / f"{name or role}.json"
        path.write_text(json.dumps(config))
        return path

    @classmethod
    def build(cls, out, *configs, expect=0, threads=0):
        layers = [word for config in configs for word in ("--config", config)]
        result = run("build", *layers, "--out", cls.root / out, "--threads", threads, "--json", expect=expect)
        return json.loads(result.stdout) if expect == 0 else result.stderr

    @classmethod
    def latest(cls, out):
        return (cls.root / out / "latest").resolve()

    def rows(self, dataset):
        """Every sample of a dataset: its columns by name."""
        samples = []
        for shard in sorted((dataset / "shards").glob("*.h5")):
            with h5py.File(shard) as file:
                names = [n for n in file if not n.startswith(("crop", "truth_")) or n == "crop_from_image"]
                samples += [{n: file[n][i] for n in names} for i in range(len(file["id"]))]
        return samples

    def verdicts(self, out):
        with open(self.latest(out) / "verdicts.csv", newline="") as file:
            return list(csv.DictReader(file))

    # --- what is packed

    def test_truth_is_the_files_own_body(self):
        s = self.summary
        self.assertEqual((s["candidates"], s["retained"], s["failed"]), (PICTURES, PICTURES, 0))
        self.assertEqual(s["labels"], {"truth": PICTURES, "retained": 0, "refined": 0, "2d_only": 0})
        samples = self.rows(self.dataset)
        self.assertEqual(len(samples), PICTURES)
        for sample, record in zip(samples, self.records):
            self.assertEqual(sample["image_ref"].decode(), record["img_path"])
            self.assertEqual(sample["label_kind"], b"truth")
            self.assertEqual([sample[n] for n in ("has_pose", "has_betas", "has_keypoints_3d")], [1, 1, 1])
            pose = [rotation_matrix(turn) for turn in np.array(record["pose"]).reshape(35, 3)]
            np.testing.assert_allclose(sample["pose"], pose, atol=1e-6)
            np.testing.assert_allclose(sample["betas"], record["shape"] + record["shape_extra"], rtol=1e-6)
            np.testing.assert_array_equal(sample["trans"], np.float32(record["trans"]))
            np.testing.assert_array_equal(sample["keypoints_3d"], np.float32(record["keypoint_3d"]))
            np.testing.assert_allclose(sample["keypoints_px"], np.array(record["keypoint_2d"])[:, :2])
            centre, side = sample["patch_box_px"][:2], sample["patch_box_px"][2]
            np.testing.assert_allclose(sample["projected_2d"], (sample["keypoints_px"] - centre) / side, atol=1e-5)
            self.assertAlmostEqual(sample["camera"][0], 2000 / 256 / record["trans"][2], places=5)
            self.assertLess(sample["final_error"], 1e-5)
            self.assertTrue(np.isnan(sample["initial_error"]))
            self.assertEqual(sample["family"], record["supercategory"])
        described = json.loads(run("inspect", self.dataset, "--json").stdout)
        self.assertIsNone(described["thresholds"])
        self.assertIsNone(described["provenance"]["checkpoint_sha256"])
        self.assertEqual(described["labels"]["truth"], PICTURES)

    def test_2d_only_has_keypoints_and_no_body(self):
        summary = self.build("two_d", self.config("2d_only"))
        self.assertEqual(summary["labels"]["2d_only"], PICTURES)
        for sample, record in zip(self.rows(self.latest("two_d")), self.records):
            self.assertEqual(sample["label_kind"], b"2d_only")
            self.assertEqual([sample[n] for n in ("has_pose", "has_betas", "has_keypoints_3d")], [0, 0, 0])
            np.testing.assert_allclose(sample["keypoints_px"], np.array(record["keypoint_2d"])[:, :2])
            self.assertTrue(np.isnan(sample["projected_2d"]).all() and np.isnan(sample["final_error"]))
        run("verify", self.root / "two_d")

    def test_what_the_file_lacks_is_no_label_and_is_said(self):
        records = [dict(record) for record in self.records[:4]]
        del records[0]["keypoint_3d"]
        del records[1]["trans"]
        del records[2]["shape"], records[2]["shape_extra"]
        shutil.copytree(self.root / "data", self.root / "lacking")
        write_annotations(self.root / "lacking", records)
        self.build("lacks", self.config("truth", "lacking", "lacking"))
        samples = self.rows(self.latest("lacks"))
        flags = [[s[n] for n in ("has_pose", "has_betas", "has_keypoints_3d")] for s in samples]
        self.assertEqual(flags, [[1, 1, 0], [1, 1, 1], [1, 0, 1], [1, 1, 1]])
        projected = [not np.isnan(s["projected_2d"]).any() for s in samples]
        self.assertEqual(projected, [False, False, True, True])
        details = [row["detail"] for row in self.verdicts("lacks")]
        for detail, word in zip(details, ("keypoint_3d", "trans", "shape")):
            self.assertIn(word, detail)
        self.assertEqual(details[3], "")
        run("verify", self.root / "lacks")

    def test_keypoints_that_are_not_the_bodys_are_told_and_can_be_replaced(self):
        # The drawn 3D keypoints are random, so no body has them; one record has none.
        records = [dict(record) for record in self.records[:3]]
        del records[2]["keypoint_3d"]
        shutil.copytree(self.root / "data", self.root / "checked")
        write_annotations(self.root / "checked", records)
        body = self.root / "smal.safetensors"
        run("init", "--size", "tiny", "--out", self.root / "net.safetensors", "--smal-asset", body)
        config = json.loads(self.config("truth", "checked", "checked").read_text())
        config["datasets"][0]["body_model"] = str(body)
        (self.root / "checked.json").write_text(json.dumps(config))
        told = run("build", "--config", self.root / "checked.json", "--out", self.root / "told").stderr
        self.assertIn("0 of 2 agree within 1 mm", told)
        self.assertIn("1 records had none", told)
        rows = self.verdicts("told")
        for row, words in zip(rows, ("mm from that of the file's own body", "mm from", "computed from its body")):
            self.assertIn(words, row["detail"])
        samples = self.rows(self.latest("told"))
        np.testing.assert_array_equal(samples[0]["keypoints_3d"], np.float32(records[0]["keypoint_3d"]))
        self.assertEqual(samples[2]["has_keypoints_3d"], 1)
        config["datasets"][0]["keypoints_3d"] = "body"
        (self.root / "checked.json").write_text(json.dumps(config))
        self.build("told", self.root / "checked.json")
        taken = self.rows(self.latest("told"))
        self.assertTrue(np.abs(taken[0]["keypoints_3d"] - samples[0]["keypoints_3d"]).max() > 0.01)
        np.testing.assert_array_equal(taken[2]["keypoints_3d"], samples[2]["keypoints_3d"])
        run("verify", self.root / "told")

    def test_a_changed_mask_makes_its_unit_anew(self):
        data = self.root / "masked"
        shutil.copytree(self.root / "data", data)
        records = [dict(record, mask_path=f"mask{i}.png") for i, record in enumerate(self.records[:2 * UNIT])]
        write_annotations(data, records)

        def draw_mask(i, right):
            with Image.open(data / records[i]["img_path"]) as picture:
                mask = np.zeros((picture.height, picture.width), np.uint8)
            mask[20:90, 20:right] = 255
            Image.fromarray(mask).save(data / f"mask{i}.png")

        def content():
            self.build("masks", self.config("truth", "masked", "masked"))
            return {path.name: hashlib.sha256(path.read_bytes()).hexdigest()
                    for path in sorted((self.latest("masks") / "shards").glob("*.h5"))}

        for i in range(len(records)):
            draw_mask(i, 100)
        before = content()
        draw_mask(UNIT + 1, 120)
        after = content()
        self.assertEqual([name for name in before if before[name] != after[name]], ["000001.h5"])
        draw_mask(UNIT + 1, 100)
        self.assertEqual(content(), before)

    def test_bad_samples_are_counted_with_their_reasons(self):
        data = self.root / "bad"
        shutil.copytree(self.root / "data", data)
        png = (data / "images/p000.png").read_bytes()
        (data / "images/cut.png").write_bytes(png[: len(png) // 2])
        good = self.records[0]
        cases = [({}, ""), ({"img_path": "images/absent.png"}, "image_missing"),
                 ({"img_path": "images/cut.png"}, "image_truncated"), ({"bbox": None}, "box_missing"),
                 ({"bbox": [1, 1, 0, 0]}, "box_zero_size"), ({"pose": [0.0] * 105}, "pose_missing"),
                 ({"pose": None, "shape": None, "keypoint_3d": None}, "pose_missing"),
                 ({"pose": [0.0] * 104}, "record_malformed")]
        write_annotations(data, [{**good, **changes} for changes, _ in cases])
        summary = self.build("bad_out", self.config("truth", "bad_truth", "bad"))
        rows = self.verdicts("bad_out")
        self.assertEqual([row["reason"].replace("none", "") for row in rows], [reason for _, reason in cases])
        self.assertEqual((summary["retained"], summary["failed"], summary["reasons"]["pose_missing"]), (1, 7, 2))
        run("verify", self.root / "bad_out")
        # Keypoints need no pose.
        summary = self.build("bad_out", self.config("2d_only", "bad_two_d", "bad"))
        self.assertEqual(summary["retained"], 3)

    # --- determinism, resume, checks

    def test_threads_do_not_change_a_byte(self):
        self.build("one", self.root / "truth.json", threads=1)
        self.assertEqual(digests(self.latest("one")), digests(self.dataset))

    def test_a_killed_build_resumes_to_the_same_bytes(self):
        out = self.root / "killed"
        kills = 0
        for attempt in range(40):
            process = subprocess.Popen([PROGRAM, "build", "--config", str(self.root / "truth.json"), "--out",
                                        str(out), "--quiet"], stderr=subprocess.DEVNULL)
            journal = lambda: sum(p.read_text().count("\n") for p in out.glob("stages/*/journal.jsonl"))
            before = journal()
            while process.poll() is None and journal() <= before + attempt % 3:
                time.sleep(0.001)
            if process.poll() is not None:
                break
            process.send_signal(signal.SIGKILL)
            process.wait()
            kills += 1
        self.build("killed", self.root / "truth.json")
        self.assertGreaterEqual(kills, 1)
        self.assertEqual(digests(self.latest("killed")), digests(self.dataset))

    def test_a_second_build_has_nothing_to_do(self):
        self.assertTrue(self.build("truth", self.root / "truth.json")["up_to_date"])

    def test_verify_finds_a_forged_label(self):
        run("verify", self.dataset)
        for column, message in (("pose", "truth_"), ("projected_2d", "projected body"), ("has_pose", "has_pose false")):
            copy = self.root / "forged"
            shutil.copytree(self.dataset, copy)
            shard = copy / "shards/000001.h5"
            shard.chmod(0o644)
            with h5py.File(shard, "r+") as file:
                file[column][2] = file[column][2] * 0
            manifest = json.loads((copy / "dataset.json").read_text())
            manifest["shards"][1]["sha256"] = hashlib.sha256(shard.read_bytes()).hexdigest()
            manifest["shards"][1]["bytes"] = shard.stat().st_size
            listing = "".join(entry["sha256"] + "\n" for entry in manifest["shards"])
            manifest["content_id"] = hashlib.sha256(listing.encode()).hexdigest()
            (copy / "dataset.json").chmod(0o644)
            (copy / "dataset.json").write_text(json.dumps(manifest))
            problems = run("verify", copy, expect=1).stderr
            self.assertIn(message, problems)
            self.assertNotIn("SHA-256", problems)
            shutil.rmtree(copy)

    def test_sheets_show_what_there_is(self):
        """Green discs for annotations; red crosses only where there is a body."""
        self.build("two_d_sheet", self.config("2d_only", "sheet"))
        red = {}
        for out in ("truth", "two_d_sheet"):
            sheet = self.root / f"{out}.png"
            run("inspect", self.root / out, "--sheet", sheet)
            pixels = np.asarray(Image.open(sheet).convert("RGB")).reshape(-1, 3)
            self.assertGreater((pixels == (60, 220, 60)).all(axis=1).sum(), 100, out)
            red[out] = (pixels == (255, 60, 60)).all(axis=1).sum()
        self.assertGreater(red["truth"], 100)
        self.assertEqual(red["two_d_sheet"], 0)

    # --- roles together, and what is refused

    def test_roles_mix_in_one_build(self):
        scene = Scene(self.root / "scene")
        brought = [{"name": name, "format": "prima", "root": str(self.root / "data"), "annotations": "train.json",
                    "role": role} for name, role in (("true", "truth"), ("flat", "2d_only"))]
        own = {"name": "drawn", "format": "prima", "root": "data", "annotations": "train.json"}
        # 24 candidates each and units of 10: two of the units hold two roles.
        mixed = scene.write_config("mixed.json", datasets=[brought[0], own, brought[1]], shards={"unit_size": 10})
        summary = self.build("mixed", mixed, scene.thresholds)
        labels = summary["labels"]
        self.assertEqual((labels["truth"], labels["2d_only"]), (PICTURES, PICTURES))
        self.assertEqual(labels["retained"] + labels["refined"] + summary["discarded"], PICTURES)
        self.assertGreater(labels["retained"], 0)
        run("verify", self.root / "mixed")
        by_kind = {}
        for sample in self.rows(self.latest("mixed")):
            by_kind.setdefault(sample["dataset"], set()).add(sample["label_kind"])
        self.assertEqual(by_kind[b"true"], {b"truth"})
        self.assertEqual(by_kind[b"flat"], {b"2d_only"})
        self.assertLessEqual(by_kind[b"drawn"], {b"retained", b"refined"})
        self.build("mixed_one", mixed, scene.thresholds, threads=1)
        self.assertEqual(digests(self.latest("mixed_one")), digests(self.latest("mixed")))
        # Thresholds are chosen by the pseudo labels alone.
        calibrated = json.loads(run("calibrate", "--config", mixed, "--out", self.root / "mixed_calibration",
                                    "--json").stdout)
        self.assertEqual((calibrated["candidates"], calibrated["judged"]), (3 * PICTURES, PICTURES))

    def test_what_a_role_cannot_have_is_refused(self):
        self.assertIn("2d_only", self.build("no", self.config("truht", "typo"), expect=2))
        self.assertIn("network", self.build("no", self.config("pseudo", "no_network"), expect=2))
        config = json.loads(self.config("truth", "no_bodies").read_text())
        config["datasets"][0]["format"] = "superanimal"
        (self.root / "no_bodies.json").write_text(json.dumps(config))
        self.assertIn("prima", self.build("no", self.root / "no_bodies.json", expect=2))
        refused = run("calibrate", "--config", self.root / "truth.json", "--out", self.root / "no", expect=2)
        self.assertIn("pseudo", refused.stderr)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]], verbosity=1)
