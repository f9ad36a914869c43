"""docs/tutorial.md, done: its files are cut out of the page, and its commands are run in their order."""

import json
import pathlib
import subprocess
import sys

import numpy as np
from PIL import Image

from e2e import (Case, kept, latest, pages, program, read_csv, read_safetensors, read_samples, verdicts, write_json)

ROOT = pathlib.Path(__file__).parents[2]
PAGE = ROOT / "docs" / "tutorial.md"
PROGRAMS = {"quadruped3d": [program], "python": [lambda: sys.executable]}


def run_command(words, folder):
    """Runs a line of the page: {words, code, out, err}."""
    command = [part() for part in PROGRAMS[words[0]]] + words[1:]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    return {"words": words, "code": result.returncode, "out": result.stdout, "err": result.stderr}


class Tutorial(Case):
    @classmethod
    def prepare(cls):
        home = cls.shared / "tutorial"
        home.mkdir()
        for name in ("models", "docs"):  # the page's commands are those of somebody in the repository's folder
            (cls.shared / name).symlink_to(ROOT / name)
        for name, text in pages.files(PAGE).items():
            (home / name).write_text(text)
        results = []
        for words in pages.commands(PAGE):
            results.append(run_command(words, cls.shared))
            if results[-1]["code"] != 0:
                break  # the next ones need what this one did not make
        write_json(cls.shared / "results.json", results)

    @classmethod
    def recall(cls):
        cls.home = cls.shared / "tutorial"
        cls.files = pages.files(PAGE)
        cls.results = json.loads((cls.shared / "results.json").read_text())

    def setUp(self):
        super().setUp()
        if len(self.results) < len(pages.commands(PAGE)) or self.results[-1]["code"] != 0:
            self.fail(f"{self.results[-1]['words']} ended with {self.results[-1]['code']}\n{self.results[-1]['err']}")

    def said(self, command, number=0):
        """What a command of the program printed, the `number`th time that the page calls it."""
        result = [result for result in self.results if result["words"][1] == command][number]
        return result["out"] + result["err"]

    def test_the_page_names_its_files_and_shows_its_pictures(self):
        self.assertEqual(set(self.files), {"build.json", "veto.txt", "train.json", "test.json"})
        shown = sorted(path.name for path in (ROOT / "docs/tutorial").iterdir() if path.suffix in (".jpg", ".png", ".svg"))
        text = PAGE.read_text()
        for name in shown:
            self.assertIn(f"](tutorial/{name})", text)
        self.assertGreaterEqual(len(shown), 5)

    def test_the_drafted_topology_needs_no_correction(self):
        draft = json.loads((self.home / "zoo.json").read_text())
        self.assertEqual(len(draft["keypoints"]), 17)
        self.assertEqual(len(draft["flip_pairs"]), 7)
        expected = {"nose": "nose", "left_eye": "eye_l", "right_eye": "eye_r", "left_ear": "ear_l", "right_ear": "ear_r",
                    "tail_base": "tail_base", "left_front_thigh": "elbow_l", "right_front_thigh": "elbow_r",
                    "left_front_knee": "carpus_l", "right_front_knee": "carpus_r", "left_front_paw": "paw_fl",
                    "right_front_paw": "paw_fr", "left_back_knee": "hock_l", "right_back_knee": "hock_r",
                    "left_back_paw": "paw_bl", "right_back_paw": "paw_br"}
        self.assertEqual(draft["animal3d26"], expected)

    def test_every_photograph_has_a_verdict(self):
        rows = verdicts(latest(self.home / "out"))
        photos = [path.name for path in (self.home / "photos").iterdir()]
        self.assertEqual(len(rows), len(json.loads((self.home / "labels.json").read_text())["annotations"]))
        self.assertEqual(len(photos), len(rows))
        self.assertEqual([row["id"] for row in rows if row["verdict"] == "failed"], [])
        self.assertGreater(len(kept(rows)), len(rows) // 4)

    def test_the_veto_removes_the_named_sample_and_no_other(self):
        out = self.home / "out"
        sample, reason = self.files["veto.txt"].strip().split("\t")
        after = {row["id"]: row for row in verdicts(latest(out))}
        versions = [path for path in out.glob("zoo-*") if path.resolve() != latest(out)]
        before = {row["id"]: row for row in verdicts(versions[0])}
        self.assertEqual(len(versions), 1)
        self.assertIn(before[sample]["verdict"], ("retained", "refined"))
        self.assertEqual((after[sample]["verdict"], after[sample]["reason"]), ("discarded", "vetoed"))
        self.assertIn(reason, after[sample]["detail"])
        changed = [name for name in before if before[name]["verdict"] != after[name]["verdict"]]
        self.assertEqual(changed, [sample])
        self.assertIn(sample, self.said("explain"))

    def test_the_shards_hold_the_kept_ones(self):
        dataset = latest(self.home / "out")
        samples = read_samples(dataset, ["id", "pose"])
        self.assertEqual([sample["id"].decode() for sample in samples], [row["id"] for row in kept(verdicts(dataset))])
        self.assertTrue(all(np.isfinite(sample["pose"]).all() for sample in samples))

    def test_training_changes_the_network(self):
        log = [json.loads(line) for line in (self.home / "stage3/log.jsonl").read_text().splitlines()]
        steps = json.loads(self.files["train.json"])["stages"]["3"][0]["steps"]
        self.assertEqual(log[-1]["step"], steps)
        self.assertTrue(np.isfinite([line["loss"] for line in log]).all())
        before, after = (read_safetensors(path) for path in (ROOT / "models/lite.safetensors",
                                                             self.home / "stage3/model.safetensors"))
        moved = [name for name in after if name in before and not np.array_equal(before[name], after[name])]
        self.assertGreater(len(moved), 100)

    def test_both_networks_were_measured_on_the_same_photographs(self):
        before, after = (read_csv(self.home / name / "samples.csv") for name in ("before", "after"))
        self.assertEqual([row["id"] for row in before], [row["id"] for row in after])
        self.assertGreater(len(before), 20)
        self.assertIn("PCK", self.said("compare"))

    def test_the_pictures_are_drawn(self):
        for name in ("topology.png", "near.png", "sheet.png"):
            with Image.open(self.home / name) as picture:
                self.assertGreater(picture.size[0], 500, name)
        self.assertIn("<svg", (self.home / "thresholds.svg").read_text())
        self.assertTrue(list((self.home / "out/report").glob("*/report.html")))
