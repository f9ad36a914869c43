"""Stored crops are encoded once, and what earlier builds left in the output folder changes no byte of a dataset."""

import json
import pathlib
import shutil

from e2e import Fault, Scene, SceneCase, digests, kept, kill_and_resume, run, run_json, verdicts, write_json


def kept_ids(dataset):
    return {row["id"] for row in kept(verdicts(dataset))}


def rows_in_crops(out):
    """Rows of the newest table of each unit in the crops stage, summed."""
    rows = {}
    for journal in out.glob("stages/crops-*/journal.jsonl"):
        for line in journal.read_text().splitlines():
            entry = json.loads(line.split("\t")[0])
            rows[journal, entry["unit"]] = entry["rows"]
    return sum(rows.values())


class Crops(SceneCase):
    @classmethod
    def prepare(cls):
        scene = Scene.make(cls.shared)
        # Layers of thresholds that keep different candidates, and a fresh build with each.
        for name, low, high in (("narrow", 0.7, 0.9), ("middle", 1.0, 1.0), ("wide", 1.1, 1.3)):
            limits = json.loads(scene.thresholds.read_text())
            limits["filter"]["tau_low"] *= low
            limits["filter"]["tau_high"] *= high
            layer = write_json(cls.shared / f"{name}.json", limits)
            run("build", "--config", scene.config, "--config", layer, "--out", cls.shared / f"fresh_{name}")

    def setUp(self):
        super().setUp()
        self.fresh = {name: (self.shared / f"fresh_{name}" / "latest").resolve()
                      for name in ("narrow", "middle", "wide")}

    def words(self, out, layer, *more, config=None):
        return ["build", "--config", config or self.scene.config, "--config", self.shared / f"{layer}.json", "--out",
                self.folder / out, *more]

    def build(self, out, layer, *more, **options):
        """The dataset's folder and the number of crops that this build encoded."""
        summary = run_json(*self.words(out, layer, *more, **options))
        return pathlib.Path(summary["dataset"]), summary["crops_encoded"]

    def test_only_kept_candidates_are_encoded(self):
        dataset, encoded = self.build("out", "middle")
        self.assertEqual(encoded, len(kept_ids(dataset)))
        self.assertEqual(rows_in_crops(self.folder / "out"), encoded)

    def test_another_tau_encodes_what_it_adds_and_equals_a_fresh_build(self):
        ever, total = set(), 0
        for layer in ("narrow", "wide", "middle"):
            dataset, encoded = self.build("out", layer)
            self.assertEqual(encoded, len(kept_ids(dataset) - ever), layer)
            self.assertEqual(digests(dataset), digests(self.fresh[layer]), layer)
            ever |= kept_ids(dataset)
            total += encoded
            run("verify", dataset)
        self.assertEqual(total, len(ever), "each crop was encoded once")
        self.assertEqual(rows_in_crops(self.folder / "out"), total)
        self.assertGreater(total, len(kept_ids(self.fresh["narrow"])), "the layers keep different candidates")

    def test_a_lifted_veto_encodes_the_vetoed_alone(self):
        everyone = kept_ids(self.fresh["middle"])
        veto = self.folder / "veto.txt"
        veto.write_text("\n".join(sorted(everyone)[:2]) + "\n")
        _, encoded = self.build("out", "middle", "--veto", veto)
        self.assertEqual(encoded, len(everyone) - 2)
        lifted, encoded = self.build("out", "middle")
        self.assertEqual(encoded, 2)
        self.assertEqual(digests(lifted), digests(self.fresh["middle"]))

    def test_another_network_setting_keeps_the_crops(self):
        self.build("out", "wide")
        config = self.scene.write_config("batch.json", network={"batch": 3})
        dataset, encoded = self.build("out", "wide", config=config)
        self.assertEqual(encoded, len(kept_ids(dataset) - kept_ids(self.fresh["wide"])))
        self.assertEqual(digests(dataset), digests(self.build("other", "wide", config=config)[0]))

    def test_another_quality_encodes_anew(self):
        self.build("out", "middle")
        config = self.scene.write_config("quality.json", shards={"jpeg_quality": 40})
        dataset, encoded = self.build("out", "middle", config=config)
        self.assertEqual(encoded, len(kept_ids(dataset)))

    def test_references_have_crops_without_bytes(self):
        config = self.scene.write_config("reference.json", shards={"images": "reference"})
        dataset, encoded = self.build("out", "middle", config=config)
        self.assertEqual(encoded, len(kept_ids(dataset)))
        run("verify", dataset)

    def test_a_build_that_is_killed_while_it_adds_crops_resumes_to_the_same_bytes(self):
        self.build("out", "narrow")
        self.assertGreaterEqual(kill_and_resume(*self.words("out", "wide", "--quiet")), 2)
        dataset, _ = self.build("out", "wide")
        self.assertEqual(digests(dataset), digests(self.fresh["wide"]))

    def test_a_table_that_the_journal_does_not_know_is_made_again(self):
        """As a kill between the table's new name and the journal's line leaves it."""
        self.build("out", "narrow")
        journal, = (self.folder / "out").glob("stages/crops-*/journal.jsonl")
        older = journal.read_text()
        self.build("out", "wide")
        self.assertGreater(len(journal.read_text()), len(older))
        journal.write_text(older)
        dataset, encoded = self.build("out", "middle")
        self.assertGreater(encoded, 0)
        self.assertEqual(digests(dataset), digests(self.fresh["middle"]))

    def test_a_picture_that_is_gone_stops_the_build_by_name(self):
        """It could be read when it was predicted, and its crop was not encoded then."""
        data = self.folder / "data"
        shutil.copytree(self.scene.data, data)
        config = self.scene.write_config("moved.json", datasets=[{
            "name": "drawn", "format": "prima", "root": str(data), "annotations": "train.json", "split": "train"}])
        self.build("out", "narrow", config=config)
        added = sorted(kept_ids(self.fresh["wide"]) - kept_ids(self.fresh["narrow"]))[0]
        picture = added.split("/")[-1].split("#")[0]
        result = run(*self.words("out", "wide", config=config), expect=1, fault=Fault(picture, "read", "fail", "EIO"))
        self.assertIn(picture, result.stderr)
