"""`evaluate`, `compare` and `evaluate-labels` on a small rendered world, their numbers once more in numpy.

Predictions are read from a build's shards.
"""

import json
import shutil

import numpy as np
from PIL import Image

from e2e import (Case, copy_folder, digests, latest, make_network, prima_dataset, read_csv, read_samples, render_world, run, run_json,
                 world_animal3d, world_body, world_superanimal, write_json)

SIDE = 256


def number(text):
    return float(text) if text else None


def pck(projected, annotated, weight, normaliser_px, threshold):
    distance = np.linalg.norm(projected - annotated, axis=1) * SIDE
    return 100 * np.sum((distance / normaliser_px < threshold) * weight) / np.sum(weight)


def auc(projected, annotated, weight, normaliser_px):
    thresholds = np.linspace(0, 1, 100)
    curve = [pck(projected, annotated, weight, normaliser_px, t) for t in thresholds]
    return float(np.sum((np.array(curve[1:]) + curve[:-1]) / 2 * np.diff(thresholds)))


def procrustes_error_mm(predicted, truth):
    """Umeyama's least-squares similarity transform."""
    a, b = predicted - predicted.mean(0), truth - truth.mean(0)
    u, s, vt = np.linalg.svd(b.T @ a)
    flip = np.diag([1, 1, np.sign(np.linalg.det(u @ vt))])
    scale = np.sum(s * np.diag(flip)) / np.sum(a**2)
    return 1000 * np.linalg.norm(scale * a @ (u @ flip @ vt).T - b, axis=1).mean()


def mask_area_px(path, centre, side):
    """Area of the mask in the network's crop. PIL's interpolation differs from OpenCV's at the edges."""
    scale = side / SIDE
    x, y = centre[0] - side / 2, centre[1] - side / 2
    mask = Image.open(path).convert("L").transform((SIDE, SIDE), Image.Transform.AFFINE,
                                                   (scale, 0, x, 0, scale, y), Image.Resampling.BILINEAR)
    return np.asarray(mask, float).sum() / 255


def write_config(shared, path, **changes):
    """A config for the untrained network in the folder `shared`."""
    network = {"checkpoint": str(shared / "tiny.safetensors"), "smal_asset": str(world_body(shared / "world")),
               "device": "cpu", "compute_threads": 1}
    if "filter" in changes:
        changes["filter"] = {"tau_ceiling": 100.0, **changes["filter"]}
    return write_json(path, {"network": network, "tta": {"learning_rate": 1e-3}, **changes})


def evaluate(config, out, threads):
    run("evaluate", "--config", config, "--out", out, "--tta", 3, "--visible", 0.5, "--tta-curve", "0,2", "--threads",
        threads)


class Evaluation(Case):
    @classmethod
    def prepare(cls):
        world = cls.shared / "world"
        render_world(world)
        make_network(cls.shared / "tiny.safetensors", seed=4)
        hidden = {"truth": str(world / "truth" / "superanimal_quadruped_test.json"), "masks": str(world)}
        config = write_config(cls.shared, cls.shared / "evaluation.json",
                              datasets=[world_superanimal(world, **hidden), world_animal3d(world)])
        evaluate(config, cls.shared / "evaluation", threads=1)

    @classmethod
    def recall(cls):
        cls.world = cls.shared / "world"
        cls.superanimal = world_superanimal(cls.world)
        cls.truth_file = cls.world / "truth" / "superanimal_quadruped_test.json"
        cls.truth = json.loads(cls.truth_file.read_text())["pictures"]
        cls.config = cls.shared / "evaluation.json"
        cls.out = cls.shared / "evaluation"
        cls.samples = read_csv(cls.out / "samples.csv")

    def write_config(self, file_name, **changes):
        return write_config(self.shared, self.folder / file_name, **changes)

    @classmethod
    def predictions(cls):
        return {row["id"]: row for row in cls.samples if row["setting"] == "prediction"}

    def build_pool(self, name, tau_low, tau_high):
        config = self.write_config(f"{name}.json", name=name, datasets=[self.superanimal],
                                   filter={"tau_low": tau_low, "tau_high": tau_high, "delta": 0.0})
        run("build", "--config", config, "--out", self.folder / name, "--quiet")
        return config, self.folder / name

    @staticmethod
    def labels(out):
        """id -> the columns of every kept sample."""
        columns = ["id", "image_ref", "patch_box_px", "keypoints_px", "keypoints_weight", "projected_2d",
                   "keypoints_3d"]
        return {sample["id"].decode(): sample for sample in read_samples(latest(out), columns)}

    def measured(self, label):
        """2D metrics at the mask's area give or take 3 %, L_proj, PA-MPJPE."""
        truth = self.truth[label["image_ref"].decode().rstrip("\0")]
        centre, side = label["patch_box_px"][:2], label["patch_box_px"][2]
        annotated, weight = (label["keypoints_px"] - centre) / side, label["keypoints_weight"]
        projected = label["projected_2d"].astype(float)
        normaliser = np.sqrt(mask_area_px(self.world / truth["mask_path"], centre, side))
        bounds = [normaliser * np.sqrt(factor) for factor in (0.97, 1.03)]
        return {
            "auc": [auc(projected, annotated, weight, bound) for bound in bounds],
            "pck_0.10": [pck(projected, annotated, weight, bound, 0.10) for bound in bounds],
            "pck_0.15": [pck(projected, annotated, weight, bound, 0.15) for bound in bounds],
            "l_proj": np.abs(projected - annotated)[weight > 0].mean(),
            "pa_mpjpe_mm": procrustes_error_mm(label["keypoints_3d"].astype(float), np.array(truth["keypoint_3d"])),
        }

    def expect_measured(self, row, label, prefix=""):
        expected = self.measured(label)
        for key in ("auc", "pck_0.10", "pck_0.15"):
            low, high = expected[key]
            self.assertLessEqual(low - 1e-3, number(row[prefix + key]), (row["id"], key))
            self.assertGreaterEqual(high + 1e-3, number(row[prefix + key]), (row["id"], key))
        self.assertAlmostEqual(number(row[prefix + "l_proj"]), expected["l_proj"], delta=1e-5)
        self.assertAlmostEqual(number(row[prefix + "pa_mpjpe_mm"]), expected["pa_mpjpe_mm"], delta=0.05)

    def test_predictions_measure_the_same_in_numpy(self):
        _, out = self.build_pool("everything", 10, 20)
        labels, rows = self.labels(out), self.predictions()
        self.assertGreaterEqual(len(labels), 12)
        for sample, label in labels.items():
            self.expect_measured(rows[sample], label)
            self.assertEqual(rows[sample]["normaliser"], "mask")
            self.assertEqual(rows[sample]["species"], self.truth[label["image_ref"].decode()]["species"])

    def test_tables_are_the_means_of_the_samples(self):
        document = json.loads((self.out / "evaluation.json").read_text())
        self.assertEqual(len(document["settings"]), 5)
        for row in document["tables"]["datasets"]:
            for key in ("auc", "pck_0.10", "l_proj", "pa_mpjpe_mm", "pa_mpvpe_mm"):
                values = [number(s[key]) for s in self.samples
                          if s["dataset"] == row["dataset"] and s["setting"] == row["setting"] and s[key]]
                self.assertEqual(row["samples_of_mean"][key], len(values))
                self.assertAlmostEqual(row[key], np.mean(values), places=9)
        adapted = {s["name"] for s in document["settings"] if s["uses_test_keypoints"]}
        self.assertEqual(adapted, {"TTA 3", "TTA 3 with 50 % of the keypoints", "iterate 2"})

    def test_iterate_zero_is_the_prediction(self):
        zero = {row["id"]: row for row in self.samples if row["setting"] == "iterate 0"}
        for sample, row in self.predictions().items():
            if row["left_out"]:
                continue
            self.assertAlmostEqual(number(row["pa_mpvpe_mm"]), number(zero[sample]["pa_mpvpe_mm"]), delta=0.05)

    def test_adaptation_brings_keypoints_closer(self):
        def error(setting):
            return np.mean([number(s["l_proj"]) for s in self.samples if s["setting"] == setting and s["l_proj"]])
        self.assertLess(error("TTA 3"), 0.95 * error("prediction"))
        self.assertLess(error("TTA 3"), error("TTA 3 with 50 % of the keypoints"))

    def test_threads_change_no_byte(self):
        again = self.folder / "again"
        evaluate(self.config, again, threads=4)
        for name in ("evaluation.json", "samples.csv", "tables.csv"):
            self.assertEqual((again / name).read_bytes(), (self.out / name).read_bytes(), name)

    def test_a_missing_picture_is_left_out_and_listed(self):
        broken = self.folder / "broken"
        shutil.copytree(self.world / "animal3d", broken)
        record = json.loads((broken / "test.json").read_text())["data"][2]
        (broken / record["img_path"]).unlink()
        config = self.write_config("broken.json", datasets=[prima_dataset("broken", "animal3d", "test.json", "test")])
        result = run("evaluate", "--config", config, "--out", self.folder / "broken_out", "--json")
        left_out = json.loads(result.stdout)["datasets"][0]["left_out"]
        self.assertEqual(left_out["reasons"], {"image_missing": 1})
        self.assertIn(record["img_path"], left_out["list"][0]["id"])
        self.assertIn("1 image_missing", result.stderr)

    def test_a_limit_takes_samples_from_the_whole_file(self):
        run("evaluate", "--config", self.config, "--out", self.folder / "few", "--limit", 4)
        few = [row["id"] for row in read_csv(self.folder / "few" / "samples.csv") if row["dataset"] == "animal3d/test"]
        every = [row["id"] for row in self.predictions().values() if row["dataset"] == "animal3d/test"]
        self.assertEqual(few, [every[i * len(every) // 4] for i in range(4)])

    def test_comparisons(self):
        same = run_json("compare", "--before", self.out, "--after", self.out)
        self.assertEqual({row["finding"] for row in same["rows"]}, {"no difference shown"})
        adapted = run_json("compare", "--before", self.out, "--after", self.out, "--before-setting", "prediction",
                           "--after-setting", "TTA 3")
        row = next(r for r in adapted["rows"] if r["metric"] == "l_proj" and r["dataset"] == "superanimal/test")
        self.assertEqual(row["finding"], "better")
        self.assertLess(row["high"], 0)
        result = run("compare", "--before", self.out, "--after", self.out, "--before-setting", "prediction",
                     "--after-setting", "TTA 4", expect=2)
        self.assertIn("TTA 3", result.stderr)

    def test_labels_against_their_truth(self):
        errors = sorted(number(row["l_proj"]) for row in self.predictions().values()
                        if row["dataset"] == "superanimal/test" and row["l_proj"])
        config, out = self.build_pool("pool", errors[len(errors) // 3], errors[2 * len(errors) // 3])
        arguments = ["evaluate-labels", "--config", config, "--out", out, "--truth", self.truth_file, "--masks",
                     self.world, "--report", self.folder / "report"]
        run(*arguments)
        rows = {row["id"]: row for row in read_csv(self.folder / "report" / "labels.csv")}
        labels = self.labels(out)
        self.assertEqual({row["verdict"] for row in rows.values()}, {"retained", "refined", "discarded"})
        self.assertEqual({i for i, row in rows.items() if row["label_l_proj"]}, set(labels))
        for sample, label in labels.items():
            self.expect_measured(rows[sample], label, "label_")
        predictions = self.predictions()
        for sample, row in rows.items():
            self.assertAlmostEqual(number(row["prediction_pa_mpvpe_mm"]),
                                   number(predictions[sample]["pa_mpvpe_mm"]), delta=0.05)
        document = json.loads((self.folder / "report" / "labels.json").read_text())
        means = {(row["group"], row["bodies"]): row for row in document["rows"]}
        discarded = [number(row["prediction_pa_mpjpe_mm"]) for row in rows.values() if row["verdict"] == "discarded"]
        self.assertAlmostEqual(means["discarded", "prediction"]["against_annotated"]["pa_mpjpe_mm"],
                               np.mean(discarded), places=6)
        self.assertEqual(means["pool", "prediction"]["samples"], len(rows))

    def test_labels_are_read_from_the_build_alone(self):
        source = copy_folder(self.world / "superanimal_quadruped", self.folder / "source")
        errors = sorted(number(row["l_proj"]) for row in self.predictions().values()
                        if row["dataset"] == "superanimal/test" and row["l_proj"])
        config = self.write_config("alone.json", name="alone", datasets=[{**self.superanimal, "root": str(source)}],
                                   filter={"tau_low": errors[len(errors) // 2], "tau_high": errors[-2], "delta": 0.0})
        out, report = self.folder / "alone", self.folder / "report"
        arguments = ["evaluate-labels", "--config", config, "--out", out, "--truth", self.truth_file, "--masks",
                     self.world, "--report", report]
        run("build", "--config", config, "--out", out, "--quiet")
        run(*arguments)
        before = digests(report)
        # A build with a veto list is another dataset, although it has the same predictions and is the newest.
        veto = self.folder / "veto.txt"
        veto.write_text(next(row["id"] for row in read_csv(report / "labels.csv") if row["label_l_proj"]) + "\n")
        run("build", "--config", config, "--out", out, "--veto", veto, "--quiet")
        run(*arguments)
        self.assertEqual(digests(report), before)
        # Truth and masks are given, so neither the annotation file nor a picture is read.
        shutil.rmtree(source)
        run(*arguments)
        self.assertEqual(digests(report), before)
        # Without them the annotation file is needed, and it is gone.
        self.assertNotEqual(run(*arguments[:5], expect=None).returncode, 0)

    def test_predictions_that_were_made_anew_are_refused(self):
        source = copy_folder(self.world / "superanimal_quadruped", self.folder / "source")
        config = self.write_config("anew.json", name="anew", datasets=[{**self.superanimal, "root": str(source)}],
                                   filter={"tau_low": 0.1, "tau_high": 0.2})
        out = self.folder / "anew"
        run("build", "--config", config, "--out", out, "--quiet")
        older = latest(out)
        names = sorted({row["id"].split("/")[-1].split("#")[0] for row in read_csv(older / "verdicts.csv")})
        chosen, other = (next(source.rglob(name)) for name in names[:2])
        chosen.write_bytes(other.read_bytes())  # other pixels under an old name
        run("build", "--config", config, "--out", out, "--quiet")
        self.assertNotEqual(latest(out), older)
        shutil.rmtree(latest(out))
        result = run("evaluate-labels", "--config", config, "--out", out, "--truth", self.truth_file, expect=1)
        self.assertIn("made anew for other candidates or pictures", result.stderr)

    def test_labels_need_a_finished_build(self):
        config = self.write_config("unbuilt.json", name="unbuilt", datasets=[self.superanimal],
                                   filter={"tau_low": 0.1, "tau_high": 0.2})
        out = self.folder / "unbuilt"
        out.mkdir()
        result = run("evaluate-labels", "--config", config, "--out", out, "--truth", self.truth_file, expect=1)
        self.assertIn("run `build`", result.stderr)
        self.assertFalse((out / "stages").exists())
