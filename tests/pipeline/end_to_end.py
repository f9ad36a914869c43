"""The program as a user runs it: builds, kills, resumes and breaks it on a small set of drawn pictures.

Run by ctest as: python end_to_end.py PATH_OF_quadruped3d. Every dataset here is made by the test itself.
"""

import csv
import hashlib
import io
import json
import pathlib
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest

import h5py
import numpy as np
from PIL import Image

PROGRAM = sys.argv[1] if len(sys.argv) > 1 else "build/quadruped3d"
PICTURES = 24
UNIT = 6


def run(*arguments, expect=0, **options):
    result = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=300, **options)
    if expect is not None and result.returncode != expect:
        raise AssertionError(f"{arguments} ended with {result.returncode}, expected {expect}\n{result.stderr}")
    return result


def draw_pictures(folder, count, seed=5):
    """Noise pictures with a bright block; the annotations point into it."""
    generator = np.random.default_rng(seed)
    records = []
    (folder / "images").mkdir(parents=True, exist_ok=True)
    for i in range(count):
        pixels = generator.integers(0, 255, (150 + i, 200, 3), dtype=np.uint8)
        x, y = int(generator.integers(5, 60)), int(generator.integers(5, 40))
        pixels[y : y + 90, x : x + 110] //= 2
        Image.fromarray(pixels).save(folder / "images" / f"p{i:03}.png")
        keypoints = np.zeros((26, 3))
        keypoints[:, 0] = x + generator.uniform(0, 110, 26)
        keypoints[:, 1] = y + generator.uniform(0, 90, 26)
        keypoints[:, 2] = generator.random(26) < 0.8
        records.append({
            "img_path": f"images/p{i:03}.png", "mask_path": "", "bbox": [x, y, 110, 90],
            "keypoint_2d": keypoints.tolist(), "supercategory": i % 5, "height": 150 + i, "width": 200,
        })
    return records


def write_annotations(folder, records, name="train.json"):
    (folder / name).write_text(json.dumps({"data": records}))


def digests(dataset):
    """SHA-256 of every file of a dataset's folder."""
    return {str(p.relative_to(dataset)): hashlib.sha256(p.read_bytes()).hexdigest()
            for p in sorted(dataset.rglob("*")) if p.is_file()}


class Scene:
    """A dataset, a tiny network and a config in a folder of their own."""

    def __init__(self, root):
        self.root = pathlib.Path(root)
        self.data = self.root / "data"
        self.records = draw_pictures(self.data, PICTURES)
        write_annotations(self.data, self.records)
        run("init", "--size", "tiny", "--seed", 3, "--out", self.root / "tiny.safetensors",
            "--smal-asset", self.root / "smal.safetensors")
        self.config = self.write_config("config.json")
        self.thresholds = self.root / "thresholds.json"
        run("calibrate", "--config", self.config, "--out", self.root / "calibration", "--write", self.thresholds)

    def write_config(self, name, **changes):
        config = {
            "name": "drawn", "version": "1.0.0",
            "datasets": [{"name": "drawn", "format": "prima", "root": "data", "annotations": "train.json",
                          "split": "train"}],
            "network": {"checkpoint": "tiny.safetensors", "smal_asset": "smal.safetensors", "device": "cpu",
                        "batch": 4, "compute_threads": 1},
            "tta": {"learning_rate": 1e-3, "batch": 4},
            "shards": {"unit_size": UNIT},
        }
        for key, value in changes.items():
            config[key] = {**config[key], **value} if isinstance(config.get(key), dict) else value
        path = self.root / name
        path.write_text(json.dumps(config))
        return path

    def build(self, out, *more, config=None, expect=0, **options):
        return run("build", "--config", config or self.config, "--config", self.thresholds, "--out", self.root / out,
                   *more, expect=expect, **options)

    def latest(self, out):
        return (self.root / out / "latest").resolve()


class EndToEnd(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="q3d_end_to_end_")
        cls.scene = Scene(cls.folder)
        cls.summary = json.loads(cls.scene.build("out", "--json").stdout)
        cls.dataset = cls.scene.latest("out")

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    # --- the main job

    def test_every_candidate_has_one_verdict(self):
        s = self.summary
        self.assertEqual(s["candidates"], PICTURES)
        self.assertEqual(s["retained"] + s["refined"] + s["discarded"] + s["failed"], PICTURES)
        self.assertEqual(s["failed"], 0)
        self.assertEqual(s["shards"], PICTURES // UNIT)
        with open(self.dataset / "verdicts.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len({row["id"] for row in rows}), PICTURES)
        for verdict in ("retained", "refined", "discarded", "failed"):
            self.assertEqual(sum(row["verdict"] == verdict for row in rows), s[verdict])

    def test_calibrated_shares_come_out(self):
        self.assertAlmostEqual(self.summary["retained"] / PICTURES, 5 / 14, delta=1.01 / PICTURES)
        self.assertGreater(self.summary["refined"], 0)

    def test_verdicts_follow_the_rule(self):
        limits = json.loads(self.scene.thresholds.read_text())["filter"]
        with open(self.dataset / "verdicts.csv", newline="") as file:
            for row in csv.DictReader(file):
                error = float(row["initial_error"])
                if row["verdict"] == "retained":
                    self.assertLess(error, limits["tau_low"])
                elif row["verdict"] == "refined":
                    self.assertTrue(limits["tau_low"] <= error < limits["tau_high"])
                    self.assertLessEqual(float(row["final_error"]), error)
                    self.assertTrue(float(row["gain"]) >= limits["delta"]
                                    or float(row["final_error"]) < limits["tau_low"])
                elif row["reason"] == "error_too_large":
                    self.assertGreaterEqual(error, limits["tau_high"])

    def test_h5py_reads_pictures_and_keypoints(self):
        by_image = {record["img_path"]: record for record in self.scene.records}
        seen = 0
        for shard in sorted((self.dataset / "shards").glob("*.h5")):
            with h5py.File(shard) as file:
                for i in range(len(file["id"])):
                    record = by_image[file["image_ref"][i].decode()]
                    np.testing.assert_allclose(file["keypoints_px"][i], np.array(record["keypoint_2d"])[:, :2])
                    start, end = file["crop_offsets"][i : i + 2]
                    jpeg = bytes(file["crop"][start:end])
                    stored = np.asarray(Image.open(io.BytesIO(jpeg)), dtype=float)
                    self.check_crop(stored, file["crop_from_image"][i], record)
                    rotation = file["pose"][i].reshape(35, 3, 3)
                    np.testing.assert_allclose(rotation @ rotation.transpose(0, 2, 1),
                                               np.broadcast_to(np.eye(3), (35, 3, 3)), atol=1e-4)
                    seen += 1
        self.assertEqual(seen, self.summary["retained"] + self.summary["refined"])

    def check_crop(self, stored, affine, record):
        """The stored crop is the picture under its own affine: compare means of a block inside the box."""
        source = np.asarray(Image.open(self.scene.data / record["img_path"]), dtype=float)
        x, y, w, h = record["bbox"]
        affine = np.array(affine).reshape(2, 3)
        corners = (affine @ np.array([[x + 20, x + w - 20], [y + 20, y + h - 20], [1, 1]])).round().astype(int)
        (x0, x1), (y0, y1) = corners
        block = stored[y0:y1, x0:x1].mean(axis=(0, 1))
        expected = source[y + 20 : y + h - 20, x + 20 : x + w - 20].mean(axis=(0, 1))
        np.testing.assert_allclose(block, expected, atol=4.0)

    def test_verify_accepts_and_finds_a_flipped_bit(self):
        run("verify", self.dataset)
        copy = pathlib.Path(self.folder) / "copy"
        shutil.copytree(self.dataset, copy)
        shard = sorted((copy / "shards").glob("*.h5"))[0]
        shard.chmod(0o644)
        content = bytearray(shard.read_bytes())
        content[len(content) // 2] ^= 1
        shard.write_bytes(content)
        self.assertIn("SHA-256", run("verify", copy, expect=1).stderr)
        shutil.rmtree(copy)

    def test_inspect_draws_and_describes(self):
        sheet = pathlib.Path(self.folder) / "sheet.png"
        run("inspect", self.scene.root / "out", "--sheet", sheet)
        with Image.open(sheet) as picture:
            self.assertGreater(picture.size[0], 256)
        described = json.loads(run("inspect", self.dataset, "--json").stdout)
        self.assertEqual(described["counts"]["candidates"], PICTURES)

    # --- determinism and resume

    def test_threads_do_not_change_a_byte(self):
        self.scene.build("two", "--threads", 2)
        self.scene.build("one", "--threads", 1)
        self.assertEqual(digests(self.scene.latest("one")), digests(self.dataset))
        self.assertEqual(digests(self.scene.latest("two")), digests(self.dataset))

    def test_a_killed_build_resumes_to_the_same_bytes(self):
        out = self.scene.root / "killed"
        kills = 0
        for attempt in range(40):
            command = [PROGRAM, "build", "--config", str(self.scene.config), "--config", str(self.scene.thresholds),
                       "--out", str(out), "--quiet"]
            process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
            journal = lambda: sum(p.read_text().count("\n") for p in out.glob("stages/*/journal.jsonl"))
            before = journal()
            while process.poll() is None and journal() <= before + attempt % 2:
                time.sleep(0.002)
            if process.poll() is not None:
                break
            process.send_signal(signal.SIGKILL)
            process.wait()
            kills += 1
            self.assertFalse((out / "latest").exists() and journal() < 3 * PICTURES // UNIT)
        self.scene.build("killed")
        self.assertGreaterEqual(kills, 2)
        self.assertEqual(digests(self.scene.latest("killed")), digests(self.dataset))

    def test_a_second_build_has_nothing_to_do(self):
        before = digests(self.dataset)
        summary = json.loads(self.scene.build("out", "--json").stdout)
        self.assertTrue(summary["up_to_date"])
        self.assertEqual(digests(self.dataset), before)

    def test_a_changed_tau_keeps_the_predictions(self):
        out = self.scene.root / "tau"
        self.scene.build("tau")
        stamps = {p: p.stat().st_mtime_ns for p in out.glob("stages/predict-*/*.h5")}
        first = self.scene.latest("tau")
        limits = json.loads(self.scene.thresholds.read_text())
        limits["filter"]["tau_low"] *= 0.8
        layer = self.scene.root / "tau.json"
        layer.write_text(json.dumps(limits))
        run("build", "--config", self.scene.config, "--config", layer, "--out", out)
        self.assertEqual({p: p.stat().st_mtime_ns for p in out.glob("stages/predict-*/*.h5")}, stamps)
        self.assertNotEqual(self.scene.latest("tau"), first)
        run("verify", first)  # the older version is untouched
        run("verify", out)

    def test_added_photos_make_only_new_units(self):
        out = self.scene.root / "added"
        data = self.scene.root / "data_added"
        shutil.copytree(self.scene.data, data)
        config = self.scene.write_config("added.json", datasets=[
            {"name": "drawn", "format": "prima", "root": "data_added", "annotations": "train.json", "split": "train"}])
        self.scene.build("added", config=config)
        stamps = {p: p.stat().st_mtime_ns for p in out.glob("stages/*/unit-*.h5")}
        more = draw_pictures(data / "more", 3, seed=9)
        for record in more:
            record["img_path"] = "more/" + record["img_path"]
        write_annotations(data, self.scene.records + more)
        self.scene.build("added", config=config)
        after = {p: p.stat().st_mtime_ns for p in out.glob("stages/*/unit-*.h5")}
        self.assertEqual({p: after[p] for p in stamps}, stamps)
        self.assertEqual(len(after), len(stamps) + 3)  # one new unit in predict, refine and shards
        run("verify", out)

    def test_ctrl_c_drops_the_open_unit_and_says_130(self):
        out = self.scene.root / "ctrl_c"
        process = subprocess.Popen([PROGRAM, "build", "--config", str(self.scene.config), "--config",
                                    str(self.scene.thresholds), "--out", str(out)], stderr=subprocess.PIPE, text=True)
        while process.poll() is None and not list(out.glob("stages/predict-*/journal.jsonl")):
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
        start = time.time()
        _, stderr = process.communicate(timeout=30)
        self.assertLess(time.time() - start, 10)
        self.assertEqual(process.returncode, 130, stderr)
        self.assertFalse((out / "latest").exists())
        self.scene.build("ctrl_c")
        self.assertEqual(digests(self.scene.latest("ctrl_c")), digests(self.dataset))

    def test_a_second_builder_is_refused(self):
        out = self.scene.root / "locked"
        first = subprocess.Popen([PROGRAM, "build", "--config", str(self.scene.config), "--config",
                                  str(self.scene.thresholds), "--out", str(out), "--quiet"],
                                 stderr=subprocess.DEVNULL)
        while first.poll() is None and not (out / "stages").exists():
            time.sleep(0.002)
        first.send_signal(signal.SIGSTOP)
        try:
            self.assertIn(str(first.pid), self.scene.build("locked", expect=1).stderr)
        finally:
            first.send_signal(signal.SIGCONT)
            first.wait()
        run("verify", out)

    # --- bad input

    def test_bad_samples_are_counted_and_the_run_goes_on(self):
        data = self.scene.root / "data_bad"
        good = draw_pictures(data, 2, seed=11)
        png = (data / "images/p000.png").read_bytes()
        files = {
            "truncated.png": png[: len(png) // 2],
            "empty.jpg": b"",
            "pointer.png": b"version https://git-lfs.github.com/spec/v1\noid sha256:" + b"0" * 64 + b"\nsize 131\n",
            "text.jpg": b"this is no picture",
        }
        for name, content in files.items():
            (data / "images" / name).write_bytes(content)
        pixels = np.asarray(Image.open(data / "images/p000.png"))
        Image.fromarray(pixels).convert("CMYK").save(data / "images/cmyk.jpg")
        Image.fromarray(pixels).convert("P").save(data / "images/palette.png")
        Image.fromarray(pixels).convert("L").save(data / "images/grey.png")
        Image.fromarray(pixels[..., 0].astype(np.uint16) * 257).save(data / "images/deep.png")
        (data / "images/really_a_png.jpg").write_bytes(png)
        records = list(good)

        def add(name, **changes):
            records.append({**good[0], "img_path": f"images/{name}", **changes})

        expected = {}
        for name, reason in [("truncated.png", "image_truncated"), ("empty.jpg", "image_empty"),
                             ("pointer.png", "image_is_lfs_pointer"), ("text.jpg", "image_not_an_image"),
                             ("absent.png", "image_missing")]:
            add(name)
            expected[name] = reason
        for name in ("cmyk.jpg", "palette.png", "grey.png", "deep.png", "really_a_png.jpg"):
            add(name)
            expected[name] = None
        everywhere = np.array(good[0]["keypoint_2d"])
        invisible, minus_one = everywhere.copy(), everywhere.copy()
        invisible[:, 2] = 0
        minus_one[:] = -1
        for label, reason, changes in [
                ("zero box", "box_zero_size", {"bbox": [10, 10, 0, 0]}),
                ("outside", "box_outside_image", {"bbox": [5000, 10, 50, 50]}),
                ("nan box", "box_not_finite", {"bbox": [10, float("nan"), 50, 50]}),
                ("invisible", "no_visible_keypoints", {"keypoint_2d": invisible.tolist()}),
                ("minus one", "no_visible_keypoints", {"keypoint_2d": minus_one.tolist()}),
                ("short", "keypoints_wrong_length", {"keypoint_2d": good[0]["keypoint_2d"][:20]}),
                ("climbs", "path_escapes_root", {"img_path": "../../../etc/passwd"})]:
            records.append({**good[0], **changes})
            expected[len(records) - 1] = reason
        write_annotations(data, records)
        config = self.scene.write_config("bad.json", datasets=[
            {"name": "bad", "format": "prima", "root": "data_bad", "annotations": "train.json", "split": "train"}])
        summary = json.loads(self.scene.build("bad", "--json", config=config).stdout)
        with open(self.scene.latest("bad") / "verdicts.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), len(records))
        for index, (row, record) in enumerate(zip(rows, records)):
            name = pathlib.Path(record["img_path"]).name
            reason = expected.get(index, expected.get(name))
            if reason is None:
                self.assertNotEqual(row["verdict"], "failed", row)
            else:
                self.assertEqual((row["verdict"], row["reason"]), ("failed", reason), row)
        self.assertEqual(summary["failed"], 12)
        run("verify", self.scene.root / "bad")

    def test_a_broken_annotation_file_stops_the_build_by_name(self):
        data = self.scene.root / "data_cut"
        shutil.copytree(self.scene.data, data)
        config = self.scene.write_config("cut.json", datasets=[
            {"name": "cut", "format": "prima", "root": "data_cut", "annotations": "train.json", "split": "train"}])
        text = (data / "train.json").read_text()
        for broken in (text[: len(text) // 2], "[1, 2]", '{"data": 7}', ""):
            (data / "train.json").write_text(broken)
            self.assertIn("train.json", self.scene.build("cut", config=config, expect=1).stderr)

    def test_a_broken_checkpoint_is_named_tensor_by_tensor(self):
        content = (self.scene.root / "tiny.safetensors").read_bytes()
        length = struct.unpack("<Q", content[:8])[0]
        header = json.loads(content[8 : 8 + length])
        name = next(key for key in sorted(header) if key.endswith("decpose.0.weight"))
        header["smal_head.unheard_of"] = header.pop(name)
        text = json.dumps(header).encode()
        (self.scene.root / "broken.safetensors").write_bytes(struct.pack("<Q", len(text)) + text + content[8 + length :])
        config = self.scene.write_config("broken.json", network={"checkpoint": "broken.safetensors"})
        stderr = self.scene.build("broken", config=config, expect=1).stderr
        self.assertIn("smal_head.unheard_of", stderr)
        self.assertIn("decpose.0.weight", stderr)
        (self.scene.root / "broken.safetensors").write_bytes(content[: len(content) // 2])
        self.assertIn("broken.safetensors", self.scene.build("broken", config=config, expect=1).stderr)

    def test_a_cycle_in_the_kinematic_tree_is_refused(self):
        content = bytearray((self.scene.root / "smal.safetensors").read_bytes())
        length = struct.unpack("<Q", content[:8])[0]
        header = json.loads(content[8 : 8 + length])
        start = 8 + length + header["parents"]["data_offsets"][0]
        content[start + 4 * 3 : start + 4 * 4] = struct.pack("<i", 5)  # joint 3 hangs on joint 5
        (self.scene.root / "cycle.safetensors").write_bytes(content)
        config = self.scene.write_config("cycle.json", network={"smal_asset": "cycle.safetensors"})
        self.assertIn("cycle above joint 3", self.scene.build("cycle", config=config, expect=1).stderr)

    def test_a_full_disk_is_named_and_loses_nothing(self):
        out = self.scene.root / "full"
        self.scene.build("full", config=self.scene.config, expect=1,
                         preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000)))
        self.assertFalse((out / "latest").exists())
        self.assertEqual(list(out.rglob("*.tmp")), [])
        self.scene.build("full")
        self.assertEqual(digests(self.scene.latest("full")), digests(self.dataset))

    def test_usage_errors_exit_2(self):
        run("build", expect=2)
        run("nonsense", expect=2)
        bad = self.scene.write_config("typo.json", tta={"learning_rat": 1})
        self.assertIn("learning_rate", self.scene.build("typo", config=bad, expect=2).stderr)
        result = run("build", "--config", self.scene.config, "--out", self.scene.root / "no_tau", expect=2)
        self.assertIn("calibrate", result.stderr)
        bad = self.scene.write_config("device.json", network={"device": "gpu"})
        self.assertIn("cuda", self.scene.build("device", config=bad, expect=2).stderr)
        run("--help")
        for command in ("build", "calibrate", "verify", "inspect", "init", "sample"):
            self.assertIn("Examples", run(command, "--help").stdout)

    def test_init_is_deterministic(self):
        again = self.scene.root / "again.safetensors"
        run("init", "--size", "tiny", "--seed", 3, "--out", again)
        self.assertEqual(again.read_bytes(), (self.scene.root / "tiny.safetensors").read_bytes())
        run("init", "--size", "tiny", "--seed", 4, "--out", again)
        self.assertNotEqual(again.read_bytes(), (self.scene.root / "tiny.safetensors").read_bytes())


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]], verbosity=1)
