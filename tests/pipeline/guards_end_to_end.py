"""Guards, profiles and thresholds of single datasets on a small rendered world, by an untrained network.

What the guards measure is computed once more in numpy and PIL, from the shards and the body model.
"""

import json
import pathlib
import xml.etree.ElementTree

import h5py
import numpy as np
from PIL import Image

from e2e import (Case, digests, file_sha256, kept, make_network, read_csv, read_safetensors, read_samples,
                 render_world, run, run_json, verdicts, world_animal3d, world_body, world_superanimal, write_json)

SIDE = 256
LEGS = (7, 11, 17, 21)
# Animal3D's keypoints and their mirror images: eyes, front and back paws, thighs, shoulders, knees, ears, mouth.
PAIRS = ((0, 1), (3, 4), (5, 6), (8, 9), (10, 11), (12, 13), (14, 15), (16, 17), (20, 21), (22, 23))
LOOSE = {"visible_min": 1, "pose_deviation_max": 1e6, "limb_factor_max": 1e6, "left_right_max": 1e9,
         "mask_iou_min": 1e-12}


def axis_angle(rotations):
    """(35, 3, 3) -> (105). No turn here comes near a half turn, where the axis is hard to tell."""
    cosine = (np.trace(rotations, axis1=1, axis2=2) - 1) / 2
    sine_axis = np.stack([rotations[:, 2, 1] - rotations[:, 1, 2], rotations[:, 0, 2] - rotations[:, 2, 0],
                          rotations[:, 1, 0] - rotations[:, 0, 1]], 1) / 2
    sine = np.linalg.norm(sine_axis, axis=1)
    angle = np.arctan2(sine, cosine)
    return (sine_axis * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 1)[:, None]).reshape(-1)


class Body:
    """Linear blend skinning as in smplx."""

    def __init__(self, asset):
        self.asset = {name: tensor.astype(float) if tensor.dtype == np.float32 else tensor
                      for name, tensor in asset.items()}

    def shaped(self, betas):
        return self.asset["v_template"] + self.asset["shapedirs"] @ betas

    def joints(self, betas):
        return self.asset["J_regressor"] @ self.shaped(betas)

    def limbs(self, betas):
        joints = self.joints(betas)
        spine = sum(np.linalg.norm(joints[i] - joints[i + 1]) for i in range(6))
        return np.array([np.linalg.norm(joints[first + bone] - joints[first + bone + 1]) / spine
                         for first in LEGS for bone in range(3)])

    def vertices(self, rotations, betas):
        rest, parents = self.joints(betas), self.asset["parents"]
        bent = (rotations[1:] - np.eye(3)).reshape(-1) @ self.asset["posedirs"]
        transforms = np.zeros((35, 4, 4))
        for joint in range(35):
            local = np.eye(4)
            local[:3, :3] = rotations[joint]
            local[:3, 3] = rest[joint] - (rest[parents[joint]] if joint else 0)
            transforms[joint] = transforms[parents[joint]] @ local if joint else local
        for joint in range(35):
            transforms[joint, :3, 3] -= transforms[joint, :3, :3] @ rest[joint]
        skin = np.tensordot(self.asset["lbs_weights"], transforms, 1)
        posed = self.shaped(betas) + bent.reshape(-1, 3)
        return np.einsum("vij,vj->vi", skin[:, :3, :3], posed) + skin[:, :3, 3]

    def silhouette(self, sample):
        points = self.vertices(sample["pose"].astype(float), sample["betas"].astype(float)) + sample["trans"]
        pixels = 1000 * points[:, :2] / points[:, 2:] + SIDE / 2
        picture = np.zeros((SIDE, SIDE), bool)
        for a, b, c in pixels[self.asset["faces"]]:
            first = np.maximum(np.ceil(np.minimum(np.minimum(a, b), c)), 0).astype(int)
            last = np.minimum(np.floor(np.maximum(np.maximum(a, b), c)), SIDE - 1).astype(int)
            if np.any(last < first):
                continue
            x, y = np.meshgrid(np.arange(first[0], last[0] + 1), np.arange(first[1], last[1] + 1))
            sides = [(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in ((a, b), (b, c), (c, a))]
            inside = np.all([side >= 0 for side in sides], 0) | np.all([side <= 0 for side in sides], 0)
            picture[first[1] : last[1] + 1, first[0] : last[0] + 1] |= inside
        return picture


class Guards(Case):
    @classmethod
    def prepare(cls):
        world = cls.shared / "world"
        render_world(world)
        make_network(cls.shared / "tiny.safetensors", seed=4, priors=cls.shared / "priors.safetensors")
        config = write_json(cls.shared / "config.json", {
            "name": "guarded", "datasets": [world_superanimal(world), world_animal3d(world)],
            "network": {"checkpoint": str(cls.shared / "tiny.safetensors"), "smal_asset": str(world_body(world)),
                        "device": "cpu", "compute_threads": 1},
            "tta": {"learning_rate": 1e-3, "iterations_max": 14},
            "filter": {"tau_ceiling": 1.0},  # the network is untrained
            "shards": {"unit_size": 8, "images": "reference"}, "calibrate": {"per_dataset": True}})
        calibrated = run("calibrate", "--config", config, "--out", cls.shared / "out", "--write",
                         cls.shared / "thresholds.json", "--figure", cls.shared / "figure.svg", "--quiet")
        write_json(cls.shared / "calibrated.json", {"stdout": calibrated.stdout, "stderr": calibrated.stderr})
        layers = {"paper": {}, "loose": {"guards": cls.with_priors(LOOSE)}}
        built = {name: run_json("build", "--config", config, "--config", cls.shared / "thresholds.json", "--config",
                                write_json(cls.shared / f"{name}.json", layer), "--out", cls.shared / "out", "--quiet")
                 for name, layer in layers.items()}
        write_json(cls.shared / "datasets.json", {name: summary["dataset"] for name, summary in built.items()})

    @classmethod
    def recall(cls):
        cls.world = cls.shared / "world"
        cls.config = cls.shared / "config.json"
        cls.thresholds = cls.shared / "thresholds.json"
        cls.body = Body(read_safetensors(world_body(cls.world)))
        cls.priors = read_safetensors(cls.shared / "priors.safetensors")

    def setUp(self):
        super().setUp()
        self.out = self.shared / "out"
        built = json.loads((self.shared / "datasets.json").read_text())
        self.datasets = {name: pathlib.Path(folder) for name, folder in built.items()}

    @classmethod
    def with_priors(cls, guards):
        """Guards that take their priors from the untrained network's file."""
        return {**guards, "priors": str(cls.shared / "priors.safetensors")}

    def go_on_in_a_copy(self):
        """Lets this test build on in its own copy of the shared output folder."""
        self.out = self.copy_of("out")
        self.datasets = {name: self.out / folder.name for name, folder in self.datasets.items()}

    def layers(self, layer):
        """Arguments: the config, the thresholds and one layer more."""
        return ["--config", self.config, "--config", self.thresholds, "--config", layer]

    def build(self, name, out=None, threads=0, **layer):
        """The summary of a build with the layer over the config; the dataset's folder becomes self.datasets[name]."""
        path = write_json(self.folder / f"{name}.json", layer)
        summary = run_json("build", *self.layers(path), "--out", out or self.out, "--threads", threads, "--quiet")
        self.datasets[name] = pathlib.Path(summary["dataset"])
        return summary

    def stages(self, stage):
        return sorted(p.name for p in (self.out / "stages").glob(f"{stage}-*"))

    def verdicts(self, name):
        return {row["id"]: row for row in verdicts(self.datasets[name])}

    def labels(self, name):
        """id -> columns of every kept sample."""
        columns = ("id", "pose", "betas", "trans", "projected_2d", "keypoints_px", "keypoints_weight", "patch_box_px")
        return {sample["id"].decode(): sample for sample in read_samples(self.datasets[name], columns)}

    def measures(self, name):
        """id -> measured numbers; the loose build keeps every measured label."""
        key = json.loads((self.datasets[name] / "dataset.json").read_text())["provenance"]["stage_keys"]["measure"]
        ids = list(self.verdicts(name))
        measured = {}
        for unit, path in enumerate(sorted((self.out / "stages" / f"measure-{key[:12]}").glob("*.h5"))):
            with h5py.File(path) as table:
                names = ("visible", "pose_prior", "limbs", "sides", "mask", "mirror", "aux_2d", "aux_3d", "shape_prior")
                for row, sample in enumerate(table["sample"][:]):
                    measured[ids[8 * unit + sample]] = {key: table[f"trust_{key}"][row] for key in names}
        return measured

    # --- what is measured

    def test_measures_are_those_of_the_kept_labels(self):
        labels, measured = self.labels("loose"), self.measures("loose")
        kept_ids = {row["id"] for row in kept(verdicts(self.datasets["paper"]))}
        self.assertEqual(set(measured), kept_ids)
        self.assertGreater(len(kept_ids), 10)
        self.assertLessEqual(set(labels), kept_ids)
        mean_betas = self.priors["shape_prior_loss.mean_betas"].astype(float)
        families = np.array([self.body.limbs(betas) for betas in mean_betas])
        mean, precs, use = (self.priors[f"pose_prior_loss.{name}"].astype(float)
                            for name in ("mean_pose", "precs", "use_index"))
        for sample, label in labels.items():
            numbers = measured[sample]
            self.assertEqual(numbers["visible"], np.sum(label["keypoints_weight"] > 0))
            whitened = ((axis_angle(label["pose"].astype(float)) - mean) @ precs) * use
            self.assertAlmostEqual(numbers["pose_prior"], np.sqrt(np.sum(whitened**2) / np.sum(use)), delta=1e-3)
            limbs = self.body.limbs(label["betas"].astype(float))
            factor = max(np.max(limbs / families.max(0)), np.max(families.min(0) / limbs))
            self.assertAlmostEqual(numbers["limbs"], factor, delta=1e-3)

    def test_left_and_right(self):
        compared = 0
        labels, measured = self.labels("loose"), self.measures("loose")
        for sample, label in labels.items():
            (x, y), side = label["patch_box_px"][:2], label["patch_box_px"][2]
            annotated = (label["keypoints_px"] - [x, y]) / side
            weight, projected = label["keypoints_weight"], label["projected_2d"].astype(float)
            pairs = [pair for pair in PAIRS if min(weight[list(pair)]) > 0]
            if not pairs:
                self.assertTrue(np.isnan(measured[sample]["sides"]))
                continue
            straight = sum(np.abs(projected[k] - annotated[k]).sum() for pair in pairs for k in pair)
            crossed = sum(np.abs(projected[k] - annotated[m]).sum() for a, b in pairs for k, m in ((a, b), (b, a)))
            self.assertAlmostEqual(measured[sample]["sides"] / (straight / crossed), 1, delta=1e-4)
            compared += 1
        self.assertGreater(compared, 5)

    def test_mask_overlap(self):
        with open(self.world / "animal3d" / "test.json") as file:
            masks = {record["img_path"]: record["mask_path"] for record in json.load(file)["data"]}
        compared = []
        labels, measured = self.labels("loose"), self.measures("loose")
        for sample, numbers in measured.items():
            dataset, _, picture = sample.split("#")[0].split("/", 2)
            self.assertEqual(np.isnan(numbers["mask"]), dataset == "superanimal", "that set hides its masks")
            if dataset == "superanimal" or sample not in labels:
                continue
            label = labels[sample]
            (x, y), side = label["patch_box_px"][:2], label["patch_box_px"][2]
            scale = side / SIDE
            mask = Image.open(self.world / "animal3d" / masks[picture]).convert("L").transform(
                (SIDE, SIDE), Image.Transform.AFFINE, (scale, 0, x - side / 2, 0, scale, y - side / 2),
                Image.Resampling.BILINEAR)
            mask, body = np.asarray(mask) >= 128, self.body.silhouette(label)
            compared.append(np.sum(mask & body) / np.sum(mask | body))
            self.assertAlmostEqual(numbers["mask"], compared[-1], delta=0.02)
        self.assertGreater(max(compared), 0.1)

    # --- what is kept

    def test_bounds_decide_by_the_measured_numbers(self):
        self.go_on_in_a_copy()
        measured = self.measures("loose")
        bounds = {"pose_deviation_max": float(np.median([m["pose_prior"] for m in measured.values()])),
                  "visible_min": int(np.median([m["visible"] for m in measured.values()]))}
        summary = self.build("bounded", guards=self.with_priors(LOOSE | bounds))
        paper, bounded = self.verdicts("paper"), self.verdicts("bounded")
        reasons = {"too_few_keypoints": 0, "pose_implausible": 0}
        for sample, row in bounded.items():
            if sample not in measured:
                self.assertEqual(row, paper[sample])
                continue
            expected = ""
            if measured[sample]["visible"] < bounds["visible_min"]:
                expected = "too_few_keypoints"
            elif measured[sample]["pose_prior"] > bounds["pose_deviation_max"]:
                expected = "pose_implausible"
            elif measured[sample]["mask"] < 1e-12:
                expected = "mask_mismatch"
            if expected:
                self.assertEqual((row["verdict"], row["reason"]), ("discarded", expected))
                reasons[expected] = reasons.get(expected, 0) + 1
            else:
                self.assertEqual(row["verdict"], paper[sample]["verdict"])
        self.assertTrue(reasons["too_few_keypoints"] and reasons["pose_implausible"])
        for reason, count in reasons.items():
            self.assertEqual(summary["reasons"].get(reason, 0), count)
        run("verify", self.datasets["bounded"])

    def test_a_changed_bound_makes_shards_alone_anew(self):
        self.go_on_in_a_copy()
        stages = ("predict", "refine", "measure")
        before = {stage: self.stages(stage) for stage in stages}
        files = {stage: digests(self.out / "stages" / before[stage][0]) for stage in stages}
        self.build("other_bound", guards=self.with_priors(LOOSE | {"limb_factor_max": 1.3}))
        self.assertEqual({stage: self.stages(stage) for stage in stages}, before)
        self.assertEqual({stage: digests(self.out / "stages" / before[stage][0]) for stage in stages}, files)
        self.assertNotEqual(self.datasets["other_bound"], self.datasets["loose"])

    def test_strict(self):
        self.go_on_in_a_copy()
        # This network has learnt nothing, so all of its labels are trusted too little.
        strict = {"profile": "strict", "guards": self.with_priors({}), "filter": {"min_trust": 1e-12}}
        summary = self.build("strict", **strict)
        self.assertEqual(len(self.stages("predict")), 1)
        described = json.loads((self.datasets["strict"] / "dataset.json").read_text())
        self.assertEqual(described["profile"], "strict")
        shown = json.loads(run("config", "show").stdout)["profiles"]["strict"]
        self.assertEqual(shown, {"tta": {"refine_retained": True, "pose_prior_weight": 0.003},
                                 "filter": {"min_trust": 0.8}})
        self.assertEqual(described["provenance"]["config"]["profile"], "strict")
        self.assertEqual(described["provenance"]["priors_sha256"], file_sha256(self.shared / "priors.safetensors"))
        rows = self.verdicts("strict").values()
        self.assertEqual(len(kept(rows)), summary["retained"] + summary["refined"])
        self.assertEqual(summary["retained"] + summary["refined"] + summary["discarded"] + summary["failed"], len(rows))
        for row in kept(rows):
            self.assertTrue(float(row["trust"]) >= 1e-12)
            if row["verdict"] == "refined":
                self.assertGreater(int(row["best_iteration"]), 0, "the kept iterate is better")
        run("verify", self.datasets["strict"])
        for out, threads in (("one", 1), ("two", 4)):
            self.build("again", out=self.folder / out, threads=threads, **strict)
            self.assertEqual(digests(self.datasets["again"]), digests(self.datasets["strict"]))

    def test_missing_priors_are_named(self):
        path = write_json(self.folder / "no_priors.json", {"guards": {"pose_deviation_max": 3}})
        stderr = run("build", *self.layers(path), "--out", self.folder / "no_priors", expect=1).stderr
        self.assertIn("guards.priors", stderr)
        self.assertIn("tiny.safetensors: no tensor named", stderr)

    # --- thresholds

    def test_each_dataset_has_its_thresholds(self):
        given = json.loads(self.thresholds.read_text())["filter"]["datasets"]
        self.assertEqual(set(given), {"animal3d", "superanimal"})
        self.assertNotEqual(given["animal3d"]["tau_low"], given["superanimal"]["tau_low"])
        described = json.loads((self.datasets["paper"] / "dataset.json").read_text())
        self.assertEqual(described["thresholds"], given)
        self.assertEqual(described["profile"], "paper")
        for row in self.verdicts("paper").values():
            if not row["initial_error"]:
                continue
            limits = given[row["dataset"]]
            error = float(row["initial_error"])
            self.assertEqual(row["verdict"] == "retained", error < limits["tau_low"])
            self.assertEqual(row["reason"] == "error_too_large", error >= limits["tau_high"])

    def test_a_dataset_without_thresholds_stops_the_build(self):
        given = json.loads(self.thresholds.read_text())
        del given["filter"]["datasets"]["superanimal"]
        path = write_json(self.folder / "half.json", given)
        stderr = run("build", "--config", self.config, "--config", path, "--out", self.folder / "half", expect=2).stderr
        self.assertIn("superanimal has no thresholds", stderr)
        self.assertIn("calibrate", stderr)

    def test_the_calibration_is_drawn_and_printed(self):
        figure = xml.etree.ElementTree.parse(self.shared / "figure.svg").getroot()
        texts = "".join(element.text or "" for element in figure.iter())
        for words in ("animal3d", "superanimal", "tau_low", "tau_high", "yield"):
            self.assertIn(words, texts)
        printed = json.loads((self.shared / "calibrated.json").read_text())
        self.assertEqual(json.loads(printed["stdout"]), json.loads(self.thresholds.read_text()))
        self.assertIn("<- tau_low", printed["stderr"])

    # --- one set of rules against another

    def test_labels_at_equal_yield(self):
        self.go_on_in_a_copy()
        self.build("few", guards=self.with_priors(LOOSE | {"limb_factor_max": float(np.median(
            [m["limbs"] for m in self.measures("loose").values()]))}))
        truth = self.world / "truth" / "superanimal_quadruped_test.json"
        for layer in (self.shared / "paper.json", self.folder / "few.json"):
            run("evaluate-labels", *self.layers(layer), "--out", self.out, "--truth", truth, "--report",
                self.folder / f"{layer.stem}_labels", "--quiet")
        before, after = self.folder / "paper_labels", self.folder / "few_labels"
        comparison = run_json("compare-labels", "--before", before, "--after", after)
        pair = comparison["pairs"][0]
        self.assertLess(pair["kept_after"], pair["kept_before"])
        self.assertEqual(pair["equal_yield"], pair["kept_after"])
        rows_before, rows_after = (kept(read_csv(report / "labels.csv")) for report in (before, after))
        rows_before.sort(key=lambda row: (float(row["label_l_proj"]), row["id"]))
        rows_before = rows_before[: pair["equal_yield"]]
        row = next(r for r in comparison["rows"] if r["group"] == "equal yield" and r["metric"] == "pa_mpvpe_mm")
        self.assertAlmostEqual(row["before"], np.mean([float(r["label_pa_mpvpe_mm"]) for r in rows_before]), places=6)
        self.assertAlmostEqual(row["after"], np.mean([float(r["label_pa_mpvpe_mm"]) for r in rows_after]), places=6)
        self.assertLessEqual(row["low"], row["difference"])
        self.assertLessEqual(row["difference"], row["high"])
        both = next(r for r in comparison["rows"] if r["group"] == "kept by both" and r["metric"] == "pa_mpjpe_mm")
        self.assertEqual((both["low"], both["high"]), (0, 0), "the labels are the same; the choice differs")
        run("compare-labels", "--before", before, "--after", after, after, expect=2)

    def test_the_shown_config_is_the_same_config(self):
        self.go_on_in_a_copy()
        path = self.folder / "shown.json"
        path.write_text(run("config", "show", *self.layers(self.shared / "loose.json")).stdout)
        summary = run_json("build", "--config", path, "--out", self.out, "--quiet")
        self.assertTrue(summary["up_to_date"])
        self.assertEqual(summary["dataset"], str(self.datasets["loose"]))
