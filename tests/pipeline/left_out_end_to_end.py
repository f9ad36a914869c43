"""What a user leaves out, and what the program tells of one sample: build --veto and explain, as they are run.

Run by ctest as: python left_out_end_to_end.py PATH_OF_quadruped3d.
"""

import csv
import json
import pathlib
import shutil
import sys
import tempfile
import unittest

import h5py
import numpy as np

import end_to_end
from end_to_end import PICTURES, UNIT, Scene, digests, run


def verdicts(dataset):
    with open(dataset / "verdicts.csv", newline="") as file:
        return list(csv.DictReader(file))


def of(rows, verdict):
    return [row for row in rows if row["verdict"] == verdict]


def square_box(box):
    """Centre and side of the network's crop: floor((2x + w) / 2), max(w, h)."""
    x, y, w, h = box
    return (2 * x + w) // 2, (2 * y + h) // 2, max(w, h)


class LeftOut(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix="q3d_left_out_")
        cls.scene = Scene(cls.folder)
        cls.scene.build("out")
        cls.dataset = cls.scene.latest("out")
        cls.rows = verdicts(cls.dataset)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def explain(self, sample, *more, dataset=None, expect=0):
        return run("explain", dataset or self.scene.root / "out", sample, *more, expect=expect)

    # --- veto

    def test_a_vetoed_sample_is_discarded_and_nothing_else_changes(self):
        chosen = [of(self.rows, "retained")[0], of(self.rows, "refined")[0], of(self.rows, "discarded")[0]]
        veto = self.scene.root / "veto.txt"
        veto.write_text("# seen by eye\n\n" + f"{chosen[0]['id']}\tthe tail is bent\n" +
                        "".join(f"{row['id']}\n" for row in chosen[1:]) + "drawn/train/nothing.png#99\n")
        out = self.scene.root / "out"
        stamps = {p: p.stat().st_mtime_ns for p in out.glob("stages/*/unit-*.h5") if "shards" not in str(p)}
        result = self.scene.build("out", "--json", "--veto", veto)
        self.assertIn("veto.txt: 1 of its 4 ids are no candidate's", result.stderr)
        vetoed = self.scene.latest("out")
        self.assertNotEqual(vetoed, self.dataset)
        after = {row["id"]: row for row in verdicts(vetoed)}
        names = {row["id"] for row in chosen}
        for row in self.rows:
            new = after[row["id"]]
            if row["id"] in names:
                self.assertEqual((new["verdict"], new["reason"]), ("discarded", "vetoed"))
                self.assertEqual(new["initial_error"], row["initial_error"])
                self.assertEqual(new["detail"], "the tail is bent" if row["id"] == chosen[0]["id"] else "by the user")
            else:
                for key in ("verdict", "reason", "initial_error", "final_error", "gain"):
                    self.assertEqual(new[key], row[key])
        # Neither predicted nor adapted anew.
        for path, stamp in stamps.items():
            self.assertEqual(path.stat().st_mtime_ns, stamp)
        manifest = json.loads((vetoed / "dataset.json").read_text())
        self.assertEqual(manifest["counts"]["retained"], len(of(self.rows, "retained")) - 1)
        self.assertEqual(manifest["statistics"]["reasons"]["vetoed"], 3)
        self.assertEqual((manifest["provenance"]["veto"]["ids"], manifest["provenance"]["veto"]["matched"]), (4, 3))
        for shard in (vetoed / "shards").glob("*.h5"):
            with h5py.File(shard) as file:
                self.assertFalse(names & {name.decode() for name in file["id"][:]})
        run("verify", vetoed)
        self.assertIn("veto list: the tail is bent", self.explain(chosen[0]["id"], dataset=vetoed).stdout)
        # Without the list the first dataset is there as it was.
        summary = json.loads(self.scene.build("out", "--json").stdout)
        self.assertTrue(summary["up_to_date"])
        self.assertEqual(self.scene.latest("out"), self.dataset)

    def test_a_veto_in_the_config_is_the_same(self):
        (self.scene.root / "list.txt").write_text(self.rows[0]["id"] + "\n")
        config = self.scene.write_config("with_veto.json", veto="list.txt")
        self.scene.build("config_veto", config=config)
        row = verdicts(self.scene.latest("config_veto"))[0]
        self.assertEqual(row["reason"], "vetoed")

    def test_a_list_that_is_none_is_a_usage_error(self):
        bad = self.scene.root / "bad.txt"
        bad.write_text("drawn/train/a.png#1\nwolf_1.jpg\n")
        self.assertIn("line 2", self.scene.build("bad_veto", "--veto", bad, expect=2).stderr)
        self.scene.build("bad_veto", "--veto", self.scene.root / "nowhere.txt", expect=2)

    # --- explain

    def test_errors_of_keypoints_make_up_the_error(self):
        by_image = {record["img_path"]: record for record in self.scene.records}
        for verdict in ("retained", "refined", "discarded"):
            for row in of(self.rows, verdict):
                story = json.loads(self.explain(row["id"], "--json").stdout)
                record = by_image[story["source"]["picture"]]
                points = [p for p in story["keypoints"] if p["weight"] > 0]
                self.assertEqual(len(points), int(np.sum(np.array(record["keypoint_2d"])[:, 2] > 0)))
                mean = np.mean([p["error_before"] for p in points])
                self.assertAlmostEqual(mean, float(row["initial_error"]), places=6)
                x, y, side = square_box(record["bbox"])
                self.assertEqual((story["crop"]["center_px"], story["crop"]["side_px"]), ([x, y], side))
                if verdict == "refined":
                    self.assertAlmostEqual(story["curve"][0], float(row["initial_error"]), places=12)
                    self.assertEqual(min(story["curve"]), float(row["final_error"]))
                    self.assertAlmostEqual(np.mean([p["error_after"] for p in points]), float(row["final_error"]),
                                           places=6)
                    self.assertEqual(len(story["curve"]), int(row["iterations"]) + 1)

    def test_the_sentence_names_the_number_that_decided(self):
        limits = json.loads(self.scene.thresholds.read_text())["filter"]
        retained = self.explain(of(self.rows, "retained")[0]["id"]).stdout
        self.assertIn(f"lies below tau_low = {limits['tau_low']:.4f}", retained)
        refined = self.explain(of(self.rows, "refined")[0]["id"]).stdout
        self.assertIn("it was adapted", refined)
        self.assertIn("kept.", refined)
        self.assertIn("L_proj by iteration", refined)
        far = [row for row in self.rows if row["reason"] == "error_too_large"][0]
        self.assertIn(f"reaches tau_high = {limits['tau_high']:.4f}", self.explain(far["id"]).stdout)

    def test_a_dataset_away_from_its_stages_tells_what_it_holds(self):
        copy = pathlib.Path(self.folder) / "copy" / "dataset"
        shutil.copytree(self.dataset, copy)
        kept = json.loads(self.explain(of(self.rows, "refined")[0]["id"], "--json", dataset=copy).stdout)
        self.assertIn("predictions", kept["missing"][0])
        points = [p for p in kept["keypoints"] if p["weight"] > 0]
        self.assertAlmostEqual(np.mean([p["error_after"] for p in points]), kept["verdict"]["final_error"], places=6)
        gone = json.loads(self.explain(of(self.rows, "discarded")[0]["id"], "--json", dataset=copy).stdout)
        self.assertNotIn("keypoints", gone)

    def test_an_unknown_id_names_the_nearest(self):
        sample = self.rows[5]["id"]
        result = self.explain(sample.replace("#5", "#6"), expect=1)
        self.assertIn("the nearest is drawn/train/images/p00", result.stderr)
        self.assertIn("Examples", run("explain", "--help").stdout)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]], verbosity=1)
