"""Labels that are worth nothing: noise pictures, the rendered world's network on photographs, and nothing kept."""

import json
import os
import pathlib

from e2e import (Case, Scene, SceneCase, draw_pictures, latest, prima_dataset, render_world, run, run_json,
                 world_animal3d, world_body, write_annotations, write_json)

SHIPPED = pathlib.Path(__file__).parents[3] / "models" / "lite.safetensors"


class Quality(Case):
    """The network that ships, which knows rendered pictures."""

    @classmethod
    def prepare(cls):
        render_world(cls.shared / "world")
        write_annotations(cls.shared / "noise", draw_pictures(cls.shared / "noise", 8))

    def write_config(self, *datasets, **changes):
        return write_json(self.folder / "config.json", {
            "name": "pool", "datasets": list(datasets), "tta": {"learning_rate": 1e-3},
            "network": {"checkpoint": str(SHIPPED), "smal_asset": str(world_body(self.shared / "world")),
                        "device": "cpu"}, **changes})

    def noise(self):
        return prima_dataset(self.shared / "noise")

    def test_noise_does_not_become_a_dataset(self):
        config, thresholds, out = self.write_config(self.noise()), self.folder / "t.json", self.folder / "out"
        refused = run("calibrate", "--config", config, "--out", out, "--write", thresholds, expect=1)
        self.assertIn("above filter.tau_ceiling = 0.1", refused.stderr)
        self.assertFalse(thresholds.exists())
        # Those who insist get thresholds, and the build refuses them again.
        run("calibrate", "--config", config, "--out", out, "--write", thresholds, "--above-ceiling")
        self.assertGreater(json.loads(thresholds.read_text())["filter"]["tau_high"], 0.1)
        layers = ["--config", config, "--config", thresholds, "--out", out]
        refused = run("build", *layers, expect=1)
        self.assertIn("--above-ceiling", refused.stderr)
        self.assertFalse((out / "latest").exists())
        self.assertEqual(list(out.rglob("dataset.json")), [])

    def test_what_is_published_all_the_same_says_why_it_is_bad(self):
        config, out = self.write_config(self.noise(), filter={"tau_low": 0.3, "tau_high": 0.5}), self.folder / "out"
        summary = run_json("build", "--config", config, "--out", out, "--above-ceiling")
        kinds = ["above_ceiling", "outside_domain", "rendered_network", "rendered_body"]
        self.assertEqual([warning["kind"] for warning in summary["warnings"]], kinds)
        document = json.loads((latest(out) / "dataset.json").read_text())
        self.assertEqual([warning["kind"] for warning in document["warnings"]], kinds)
        self.assertEqual({warning["dataset"] for warning in document["warnings"]}, {"drawn"})
        # They are told again when the dataset is up to date.
        again = run("build", "--config", config, "--out", out, "--above-ceiling", "--quiet")
        self.assertIn("warning: ", again.stderr)
        self.assertIn("count as photographs", again.stderr)

    def test_the_rendered_world_under_its_own_network_has_no_warning(self):
        config, out = self.write_config(world_animal3d(self.shared / "world"),
                                        filter={"tau_low": 0.05, "tau_high": 0.1}), self.folder / "out"
        summary = run_json("build", "--config", config, "--out", out)
        self.assertEqual(summary["warnings"], [])
        self.assertIn("of the crop's side", summary["quality"])


class NothingKept(SceneCase):
    @classmethod
    def prepare(cls):
        Scene.make(cls.shared).build("out")

    def test_a_build_without_a_label_leaves_latest_where_it_was(self):
        out = self.copy_of("out")
        before = os.readlink(out / "latest")
        config = self.scene.write_config("nothing.json")
        # The last layer counts: no prediction of the untrained network is that good.
        layer = write_json(self.folder / "layer.json", {"filter": {"tau_low": 1e-6, "tau_high": 2e-6}})
        words = ["build", "--config", config, "--config", layer, "--out", out]
        refused = run(*words, expect=1)
        self.assertIn("no label was kept: of 24 candidates 24 were discarded and 0 failed (error_too_large 24)",
                      refused.stderr)
        self.assertEqual(os.readlink(out / "latest"), before)
        # The verdicts are there to be read, and the same command says the same again.
        folder = next(path for path in out.glob("drawn-*") if path.name != before)
        self.assertEqual(json.loads((folder / "dataset.json").read_text())["counts"]["discarded"], 24)
        self.assertIn("no label was kept", run(*words, expect=1).stderr)
        self.assertEqual(os.readlink(out / "latest"), before)

    def test_candidates_that_all_failed(self):
        data = self.folder / "data"
        write_annotations(data, draw_pictures(data, 3))
        for picture in (data / "images").iterdir():
            picture.unlink()
        config = write_json(self.folder / "config.json", {"name": "gone", "datasets": [
            prima_dataset(data, role="2d_only")]})
        refused = run("build", "--config", config, "--out", self.folder / "gone", expect=1)
        self.assertIn("all 3 candidates failed (image_missing 3)", refused.stderr)
        self.assertFalse((self.folder / "gone" / "latest").is_symlink())
