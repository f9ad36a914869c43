"""The program on datasets that bring their labels: packs, kills, resumes, mixes and breaks them."""

import hashlib
import json
import shutil

import h5py
import numpy as np
from PIL import Image

from e2e import (PICTURES, UNIT, Case, Scene, digests, draw_pictures, file_sha256, give_bodies, kill_and_resume,
                 latest, make_network, prima_dataset, read_samples, run, run_json, seal_json, verdicts,
                 write_annotations, write_json)

ORANGE, YELLOW = (240, 159, 0), (240, 228, 66)  # pipeline/report/lettering.h


def rotation_matrix(axis_angle):
    """Rodrigues' formula as the exponential series of the cross-product matrix."""
    x, y, z = axis_angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    term = total = np.eye(3)
    for n in range(1, 40):
        term = term @ cross / n
        total = total + term
    return total


def write_config(folder, role, name=None, data="data"):
    """A config for the datasets in the folder `data`, written into `folder`."""
    return write_json(folder / f"{name or role}.json", {
        "name": "packed", "datasets": [prima_dataset(data, role=role)], "shards": {"unit_size": UNIT}})


class Roles(Case):
    @classmethod
    def prepare(cls):
        write_annotations(cls.shared / "data", give_bodies(draw_pictures(cls.shared / "data", PICTURES)))
        config = write_config(cls.shared, "truth")
        write_json(cls.shared / "summary.json", run_json("build", "--config", config, "--out", cls.shared / "truth"))

    @classmethod
    def recall(cls):
        cls.data = cls.shared / "data"
        cls.records = json.loads((cls.data / "train.json").read_text())["data"]
        cls.truth_config = cls.shared / "truth.json"
        cls.summary = json.loads((cls.shared / "summary.json").read_text())
        cls.dataset = latest(cls.shared / "truth")

    def config(self, role, name=None, data=None):
        """A config in this test's folder."""
        return write_config(self.folder, role, name, data or str(self.data))

    def build(self, out, *configs, expect=0, threads=0):
        """The summary of a build into folder/out, or its stderr where it must fail."""
        layers = [word for config in configs for word in ("--config", config)]
        result = run("build", *layers, "--out", self.folder / out, "--threads", threads, "--json", expect=expect)
        return json.loads(result.stdout) if expect == 0 else result.stderr

    def latest(self, out):
        return latest(self.folder / out)

    def copy_of_data(self, name, records):
        """A copy of the pictures in this test's folder, with other annotations."""
        data = shutil.copytree(self.data, self.folder / name)
        write_annotations(data, records)
        return data

    # --- what is packed

    def test_truth_is_the_files_own_body(self):
        s = self.summary
        self.assertEqual((s["candidates"], s["retained"], s["failed"]), (PICTURES, PICTURES, 0))
        self.assertEqual(s["labels"], {"truth": PICTURES, "retained": 0, "refined": 0, "2d_only": 0})
        samples = read_samples(self.dataset)
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
        described = run_json("inspect", self.dataset)
        self.assertIsNone(described["thresholds"])
        self.assertIsNone(described["provenance"]["checkpoint_sha256"])
        self.assertEqual(described["labels"]["truth"], PICTURES)

    def test_2d_only_has_keypoints_and_no_body(self):
        summary = self.build("two_d", self.config("2d_only"))
        self.assertEqual(summary["labels"]["2d_only"], PICTURES)
        for sample, record in zip(read_samples(self.latest("two_d")), self.records):
            self.assertEqual(sample["label_kind"], b"2d_only")
            self.assertEqual([sample[n] for n in ("has_pose", "has_betas", "has_keypoints_3d")], [0, 0, 0])
            np.testing.assert_allclose(sample["keypoints_px"], np.array(record["keypoint_2d"])[:, :2])
            self.assertTrue(np.isnan(sample["projected_2d"]).all() and np.isnan(sample["final_error"]))
        run("verify", self.folder / "two_d")

    def test_what_the_file_lacks_is_no_label_and_is_said(self):
        records = [dict(record) for record in self.records[:4]]
        del records[0]["keypoint_3d"]
        del records[1]["trans"]
        del records[2]["shape"], records[2]["shape_extra"]
        self.copy_of_data("lacking", records)
        self.build("lacks", self.config("truth", "lacking", "lacking"))
        samples = read_samples(self.latest("lacks"))
        flags = [[s[n] for n in ("has_pose", "has_betas", "has_keypoints_3d")] for s in samples]
        self.assertEqual(flags, [[1, 1, 0], [1, 1, 1], [1, 0, 1], [1, 1, 1]])
        projected = [not np.isnan(s["projected_2d"]).any() for s in samples]
        self.assertEqual(projected, [False, False, True, True])
        details = [row["detail"] for row in verdicts(self.latest("lacks"))]
        for detail, word in zip(details, ("keypoint_3d", "trans", "shape")):
            self.assertIn(word, detail)
        self.assertEqual(details[3], "")
        run("verify", self.folder / "lacks")

    def test_keypoints_that_are_not_the_bodys_are_told_and_can_be_replaced(self):
        # The drawn 3D keypoints are random, so no body has them; one record has none.
        records = [dict(record) for record in self.records[:3]]
        del records[2]["keypoint_3d"]
        self.copy_of_data("checked", records)
        body = self.folder / "smal.safetensors"
        make_network(self.folder / "net.safetensors", body=body)
        config = json.loads(self.config("truth", "checked", "checked").read_text())
        config["datasets"][0]["body_model"] = str(body)
        write_json(self.folder / "checked.json", config)
        told = run("build", "--config", self.folder / "checked.json", "--out", self.folder / "told").stderr
        self.assertIn("0 of 2 agree within 1 mm", told)
        self.assertIn("1 records had none", told)
        rows = verdicts(self.latest("told"))
        for row, words in zip(rows, ("mm from that of the file's own body", "mm from", "computed from its body")):
            self.assertIn(words, row["detail"])
        samples = read_samples(self.latest("told"))
        np.testing.assert_array_equal(samples[0]["keypoints_3d"], np.float32(records[0]["keypoint_3d"]))
        self.assertEqual(samples[2]["has_keypoints_3d"], 1)
        config["datasets"][0]["keypoints_3d"] = "body"
        write_json(self.folder / "checked.json", config)
        self.build("told", self.folder / "checked.json")
        taken = read_samples(self.latest("told"))
        self.assertTrue(np.abs(taken[0]["keypoints_3d"] - samples[0]["keypoints_3d"]).max() > 0.01)
        np.testing.assert_array_equal(taken[2]["keypoints_3d"], samples[2]["keypoints_3d"])
        run("verify", self.folder / "told")

    def test_a_changed_mask_makes_its_unit_anew(self):
        records = [dict(record, mask_path=f"mask{i}.png") for i, record in enumerate(self.records[:2 * UNIT])]
        data = self.copy_of_data("masked", records)

        def draw_mask(i, right):
            with Image.open(data / records[i]["img_path"]) as picture:
                mask = np.zeros((picture.height, picture.width), np.uint8)
            mask[20:90, 20:right] = 255
            Image.fromarray(mask).save(data / f"mask{i}.png")

        def content():
            self.build("masks", self.config("truth", "masked", "masked"))
            return digests(self.latest("masks") / "shards")

        for i in range(len(records)):
            draw_mask(i, 100)
        before = content()
        draw_mask(UNIT + 1, 120)
        after = content()
        self.assertEqual([name for name in before if before[name] != after[name]], ["000001.h5"])
        draw_mask(UNIT + 1, 100)
        self.assertEqual(content(), before)

    def test_bad_samples_are_counted_with_their_reasons(self):
        data = shutil.copytree(self.data, self.folder / "bad")
        png = (data / "images/p000.png").read_bytes()
        (data / "images/cut.png").write_bytes(png[: len(png) // 2])
        good = self.records[0]

        def moved(shift):  # other points, so that the record is no duplicate of the first
            return [[x + shift, y, v] for x, y, v in good["keypoint_2d"]]

        cases = [({}, ""), ({"img_path": "images/absent.png"}, "image_missing"),
                 ({"img_path": "images/cut.png"}, "image_truncated"), ({"bbox": 7}, "record_malformed"),
                 ({"bbox": [1, 1, 0, 9]}, "box_zero_size"), ({"pose": [0.0] * 105, "keypoint_2d": moved(2)}, "pose_missing"),
                 ({"pose": None, "shape": None, "keypoint_3d": None, "keypoint_2d": moved(4)}, "pose_missing"),
                 ({"pose": [0.0] * 104}, "record_malformed")]
        write_annotations(data, [{**good, **changes} for changes, _ in cases])
        summary = self.build("bad_out", self.config("truth", "bad_truth", "bad"))
        rows = verdicts(self.latest("bad_out"))
        self.assertEqual([row["reason"].replace("none", "") for row in rows], [reason for _, reason in cases])
        self.assertEqual((summary["retained"], summary["failed"], summary["reasons"]["pose_missing"]), (1, 7, 2))
        run("verify", self.folder / "bad_out")
        # Keypoints need no pose.
        summary = self.build("bad_out", self.config("2d_only", "bad_two_d", "bad"))
        self.assertEqual(summary["retained"], 3)

    # --- determinism, resume, checks

    def test_threads_do_not_change_a_byte(self):
        self.build("one", self.truth_config, threads=1)
        self.assertEqual(digests(self.latest("one")), digests(self.dataset))

    def test_a_killed_build_resumes_to_the_same_bytes(self):
        kills = kill_and_resume("build", "--config", self.truth_config, "--out", self.folder / "killed", "--quiet")
        self.build("killed", self.truth_config)
        self.assertGreaterEqual(kills, 1)
        self.assertEqual(digests(self.latest("killed")), digests(self.dataset))

    def test_a_second_build_has_nothing_to_do(self):
        self.copy_of("truth")
        self.assertTrue(self.build("truth", self.truth_config)["up_to_date"])

    def test_verify_finds_a_forged_label(self):
        run("verify", self.dataset)
        for column, message in (("pose", "truth_"), ("projected_2d", "projected body"), ("has_pose", "has_pose false")):
            copy = self.folder / "forged"
            shutil.copytree(self.dataset, copy)
            shard = copy / "shards/000001.h5"
            shard.chmod(0o644)
            with h5py.File(shard, "r+") as file:
                file[column][2] = file[column][2] * 0
            manifest = json.loads((copy / "dataset.json").read_text())
            manifest["shards"][1]["sha256"] = file_sha256(shard)
            manifest["shards"][1]["bytes"] = shard.stat().st_size
            listing = "".join(entry["sha256"] + "\n" for entry in manifest["shards"])
            manifest["content_id"] = hashlib.sha256(listing.encode()).hexdigest()
            (copy / "dataset.json").chmod(0o644)
            (copy / "dataset.json").write_text(seal_json(manifest))
            problems = run("verify", copy, expect=1).stderr
            self.assertIn(message, problems)
            self.assertNotIn("SHA-256", problems)
            shutil.rmtree(copy)

    def test_sheets_show_what_there_is(self):
        """Blue and orange for annotations; yellow crosses only where there is a body, and in the legend."""
        self.build("two_d_sheet", self.config("2d_only", "sheet"))
        yellow = {}
        for out, folder in (("truth", self.shared), ("two_d_sheet", self.folder)):
            sheet = self.folder / f"{out}.png"
            run("inspect", folder / out, "--sheet", sheet)
            pixels = np.asarray(Image.open(sheet).convert("RGB")).reshape(-1, 3)
            self.assertGreater((pixels == ORANGE).all(axis=1).sum(), 100, out)
            yellow[out] = (pixels == YELLOW).all(axis=1).sum()
        self.assertGreater(yellow["truth"], yellow["two_d_sheet"] + 100)

    # --- roles together, and what is refused

    def test_roles_mix_in_one_build(self):
        scene = Scene.make(self.folder / "scene")
        brought = [prima_dataset(self.data, name, role=role) for name, role in (("true", "truth"), ("flat", "2d_only"))]
        own = prima_dataset(scene.data)
        # 24 candidates each and units of 10: two of the units hold two roles.
        mixed = scene.write_config("mixed.json", datasets=[brought[0], own, brought[1]], shards={"unit_size": 10})
        summary = self.build("mixed", mixed, scene.thresholds)
        labels = summary["labels"]
        self.assertEqual((labels["truth"], labels["2d_only"]), (PICTURES, PICTURES))
        self.assertEqual(labels["retained"] + labels["refined"] + summary["discarded"], PICTURES)
        self.assertGreater(labels["retained"], 0)
        run("verify", self.folder / "mixed")
        by_kind = {}
        for sample in read_samples(self.latest("mixed")):
            by_kind.setdefault(sample["dataset"], set()).add(sample["label_kind"])
        self.assertEqual(by_kind[b"true"], {b"truth"})
        self.assertEqual(by_kind[b"flat"], {b"2d_only"})
        self.assertLessEqual(by_kind[b"drawn"], {b"retained", b"refined"})
        self.build("mixed_one", mixed, scene.thresholds, threads=1)
        self.assertEqual(digests(self.latest("mixed_one")), digests(self.latest("mixed")))
        # Thresholds are chosen by the pseudo labels alone.
        calibrated = run_json("calibrate", "--config", mixed, "--out", self.folder / "mixed_calibration")
        self.assertEqual((calibrated["candidates"], calibrated["judged"]), (3 * PICTURES, PICTURES))

    def test_what_a_role_cannot_have_is_refused(self):
        self.assertIn("2d_only", self.build("no", self.config("truht", "typo"), expect=2))
        self.assertIn("network", self.build("no", self.config("pseudo", "no_network"), expect=2))
        config = json.loads(self.config("truth", "no_bodies").read_text())
        config["datasets"][0]["format"] = "superanimal"
        write_json(self.folder / "no_bodies.json", config)
        self.assertIn("prima", self.build("no", self.folder / "no_bodies.json", expect=2))
        refused = run("calibrate", "--config", self.truth_config, "--out", self.folder / "no", expect=2)
        self.assertIn("pseudo", refused.stderr)
