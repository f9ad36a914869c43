"""What a user leaves out, and what the program tells of one sample: build --veto and explain, as they are run."""

import csv
import json
import shutil

import numpy as np
from PIL import Image

from e2e import (Scene, SceneCase, latest, prima_dataset, read_csv, read_samples, run, run_json, smooth_picture, stamps,
                 verdicts, write_annotations, write_json)


def of(rows, verdict):
    return [row for row in rows if row["verdict"] == verdict]


def square_box(box):
    """Centre and side of the network's crop: floor((2x + w) / 2), max(w, h)."""
    x, y, w, h = box
    return (2 * x + w) // 2, (2 * y + h) // 2, max(w, h)


class LeftOut(SceneCase):
    @classmethod
    def prepare(cls):
        Scene.make(cls.shared).build("out")

    @classmethod
    def recall(cls):
        cls.dataset = latest(cls.shared / "out")
        cls.rows = verdicts(cls.dataset)

    def explain(self, sample, *more, dataset=None, expect=0):
        return run("explain", dataset or self.shared / "out", sample, *more, expect=expect)

    # --- veto

    def test_a_vetoed_sample_is_discarded_and_nothing_else_changes(self):
        chosen = [of(self.rows, "retained")[0], of(self.rows, "refined")[0], of(self.rows, "discarded")[0]]
        veto = self.folder / "veto.txt"
        veto.write_text("# seen by eye\n\n" + f"{chosen[0]['id']}\tthe tail is bent\n" +
                        "".join(f"{row['id']}\n" for row in chosen[1:]) + "drawn/train/nothing.png#99\n")
        out = self.copy_of("out")
        first = self.scene.latest("out")
        # What is left out is not measured, so measures depend on the veto as shards do.
        tables = [p for p in out.glob("stages/*/unit-*.h5") if not p.parent.name.startswith(("shards-", "measure-"))]
        before = stamps(tables)
        self.assertTrue(before)
        result = self.scene.build("out", "--json", "--veto", veto)
        self.assertIn("veto.txt: 1 of its 4 ids are no candidate's", result.stderr)
        vetoed = self.scene.latest("out")
        self.assertNotEqual(vetoed, first)
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
        self.assertEqual(stamps(tables), before)
        manifest = json.loads((vetoed / "dataset.json").read_text())
        self.assertEqual(manifest["counts"]["retained"], len(of(self.rows, "retained")) - 1)
        self.assertEqual(manifest["statistics"]["reasons"]["vetoed"], 3)
        self.assertEqual((manifest["provenance"]["veto"]["ids"], manifest["provenance"]["veto"]["matched"]), (4, 3))
        self.assertFalse(names & {sample["id"].decode() for sample in read_samples(vetoed, ["id"])})
        run("verify", vetoed)
        self.assertIn("veto list: the tail is bent", self.explain(chosen[0]["id"], dataset=vetoed).stdout)
        # Without the list the first dataset is there as it was.
        summary = json.loads(self.scene.build("out", "--json").stdout)
        self.assertTrue(summary["up_to_date"])
        self.assertEqual(self.scene.latest("out"), first)

    def test_a_veto_in_the_config_is_the_same(self):
        (self.folder / "list.txt").write_text(self.rows[0]["id"] + "\n")
        config = self.scene.write_config("with_veto.json", veto="list.txt")
        self.scene.build("config_veto", config=config)
        row = verdicts(self.scene.latest("config_veto"))[0]
        self.assertEqual(row["reason"], "vetoed")

    def test_a_list_that_is_none_is_a_usage_error(self):
        bad = self.folder / "bad.txt"
        bad.write_text("drawn/train/a.png#1\nwolf_1.jpg\n")
        self.assertIn("line 2", self.scene.build("bad_veto", "--veto", bad, expect=2).stderr)
        self.scene.build("bad_veto", "--veto", self.folder / "nowhere.txt", expect=2)

    # --- leakage

    def plant(self):
        """A test set that holds pictures of the pool: as they are, under an ImageNet name, resized, recompressed and
        mirrored; and one picture of its own. The pool's pictures 1 and 2 are copies of each other."""
        root = self.folder / "planted"
        images = root / "images"
        images.mkdir(parents=True)
        pictures = [smooth_picture(seed) for seed in range(9)]
        names = [f"p{i}.png" for i in range(8)] + ["n02114367_52_777.png"]
        pictures[2] = pictures[1].resize((150, 120)).transpose(Image.Transpose.FLIP_LEFT_RIGHT)
        for name, picture in zip(names, pictures):
            picture.save(images / name)
        test = {"same.png": None, "n02114367_52.JPEG": smooth_picture(50), "small.jpg": pictures[4].resize((96, 72)),
                "squeezed.jpg": pictures[5], "mirror.png": pictures[6].transpose(Image.Transpose.FLIP_LEFT_RIGHT),
                "all.jpg": pictures[7].resize((210, 150)).transpose(Image.Transpose.FLIP_LEFT_RIGHT),
                "own.png": smooth_picture(60)}
        shutil.copy(images / "p3.png", images / "same.png")
        for name, picture in test.items():
            if picture is not None:
                picture.save(images / name, **({"quality": 30} if not name.endswith("png") else {}))
        record = {"bbox": [4, 4, 60, 50], "keypoint_2d": [[6 + 2 * k, 6 + k, 1] for k in range(26)]}
        write_annotations(root, [{**record, "img_path": f"images/{n}"} for n in names])
        write_annotations(root, [{**record, "img_path": f"images/{n}"} for n in test], "test.json")
        pool = prima_dataset("planted", "pool")
        held_out = prima_dataset("planted", "held", "test.json", "test")
        return self.scene.write_config("planted.json", datasets=[pool], leakage={"test_sets": [held_out]})

    def test_planted_copies_are_found_listed_and_left_out(self):
        config = self.plant()
        out = self.folder / "planted_out"
        summary = run_json("leakage", "--config", config, "--out", out)
        leaks = {row["id"].split("/")[-1].split("#")[0]: row for row in read_csv(out / "leaks.csv")}
        expected = {"p3.png": ("same.png", "same file"), "n02114367_52_777.png": ("n02114367_52.JPEG", "same origin"),
                    "p4.png": ("small.jpg", "looks alike"), "p5.png": ("squeezed.jpg", "looks alike"),
                    "p6.png": ("mirror.png", "looks alike"), "p7.png": ("all.jpg", "looks alike")}
        self.assertEqual(set(leaks), set(expected))
        for name, (test, evidence) in expected.items():
            self.assertIn(f"/{test}#", leaks[name]["test_id"])
            self.assertEqual(leaks[name]["evidence"], evidence)
        self.assertIn("mirrored", leaks["p6.png"]["detail"])
        self.assertIn("mirrored", leaks["p7.png"]["detail"])
        self.assertEqual((summary["leaks"], summary["groups"], summary["pictures_in_groups"]), (6, 1, 2))
        twins = [row["id"].split("/")[-1] for row in read_csv(out / "duplicates.csv")]
        self.assertEqual(twins, ["p1.png#1", "p2.png#2"])
        lists = {name: (out / name).read_bytes() for name in ("leaks.csv", "duplicates.csv", "leakage.json")}
        self.assertEqual((out / "leakage.html").read_text().count("<img "), 6 * 2 + 2)
        # The build leaves out the same, whichever way it is asked.
        self.scene.build("planted_out", config=config)
        dataset = self.scene.latest("planted_out")
        for row in verdicts(dataset):
            name = row["id"].split("/")[-1].split("#")[0]
            if name in expected:
                self.assertEqual((row["verdict"], row["reason"]), ("discarded", "in_test_split"))
                self.assertIn(f"held/test/images/{expected[name][0]}", row["detail"])
            else:
                self.assertNotEqual(row["reason"], "in_test_split")
        manifest = json.loads((dataset / "dataset.json").read_text())
        self.assertEqual(manifest["provenance"]["leakage"]["excluded"], 6)
        self.assertEqual(manifest["provenance"]["leakage"]["test_pictures"], 7)
        self.assertEqual(manifest["provenance"]["leakage"]["pictures_alike_in_pool"], 2)
        for name, content in lists.items():
            self.assertEqual((out / name).read_bytes(), content)
        run("verify", dataset)
        # A damaged or missing cache of hashes changes nothing.
        cache = out / "picture_hashes.txt"
        cache.write_text(cache.read_text()[:-30] + "\nrubbish\n")
        self.assertTrue(json.loads(self.scene.build("planted_out", "--json", config=config).stdout)["up_to_date"])
        cache.unlink()
        self.assertTrue(json.loads(self.scene.build("planted_out", "--json", config=config).stdout)["up_to_date"])

    # --- curation

    def test_a_build_takes_what_curate_chose(self):
        record = self.scene.records[0]
        data = self.folder / "data"
        (data / "images").mkdir(parents=True)
        for split, species in (("train", ["horse"] * 9 + ["wolf"] * 2 + ["skunk"]), ("test", ["wolf", "horse"])):
            names = [f"images/{i:012}_{name}.png" for i, name in enumerate(species)]
            for i, name in enumerate(names):
                smooth_picture(100 + i).save(data / name)
            write_annotations(data, [{**record, "img_path": name} for name in names],
                              f"whole_{split}.json")
        sets = [prima_dataset("data", "whole", f"whole_{split}.json", split) for split in ("train", "test")]
        rule = write_json(self.folder / "rule.json",
                          {"name": "half", "datasets": sets, "pictures": {"train": 6, "test": 2},
                           "species": {"horse": ["horse"], "wolf": ["wolf"]}})
        out = self.folder / "curation"
        summary = run_json("curate", "--config", rule, "--out", out)
        self.assertEqual(summary["verdicts"]["train"], {"chosen": 6, "not_drawn": 5, "species_not_listed": 1,
                                                        "species_unknown": 0})
        self.assertEqual(summary["chosen"], {"horse": {"test": 1, "train": 4}, "wolf": {"test": 1, "train": 2}})
        first = (out / "half.csv").read_bytes()
        run("curate", "--config", rule, "--out", out)
        self.assertEqual((out / "half.csv").read_bytes(), first)
        chosen = {row["picture"] for row in csv.DictReader(first.decode().splitlines())
                  if (row["split"], row["verdict"]) == ("train", "chosen")}
        config = self.scene.write_config("curated.json", datasets=[{**sets[0], "role": "2d_only", "curation": "curation/half.csv"}])
        self.scene.build("curated_out", config=config)
        rows = verdicts(self.scene.latest("curated_out"))
        self.assertEqual({row["id"].split("/", 2)[2].split("#")[0] for row in rows}, chosen)
        broken = out / "broken.csv"
        broken.write_bytes(first.replace(b"_wolf.png,chosen", b"_moon.png,chosen"))
        config = self.scene.write_config("broken.json", datasets=[{**sets[0], "curation": "curation/broken.csv"}])
        self.assertIn("Run `quadruped3d curate` again",
                      self.scene.build("broken_out", config=config, expect=2).stderr)

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
        limits = self.scene.limits
        retained = self.explain(of(self.rows, "retained")[0]["id"]).stdout
        self.assertIn(f"lies below tau_low = {limits['tau_low']:.4f}", retained)
        refined = self.explain(of(self.rows, "refined")[0]["id"]).stdout
        self.assertIn("it was adapted", refined)
        self.assertIn("kept.", refined)
        self.assertIn("L_proj by iteration", refined)
        far = [row for row in self.rows if row["reason"] == "error_too_large"][0]
        self.assertIn(f"reaches tau_high = {limits['tau_high']:.4f}", self.explain(far["id"]).stdout)

    def test_a_dataset_away_from_its_stages_tells_what_it_holds(self):
        copy = self.folder / "copy" / "dataset"
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
