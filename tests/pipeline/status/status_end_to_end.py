"""`status`, `build --until` and `build --dry-run`: how far builds have come, builds that stop after a stage, and what a
build would do."""

import json
import shlex
import shutil

from e2e import (PICTURES, UNIT, Case, Fault, Scene, digests, flip_bit, latest, run, run_json, started, units_in_journals,
                 verdicts)

UNITS = PICTURES // UNIT
FOLDERS = ("predict", "refine", "measure", "crops", "shards")


def stages_of(build):
    """The stages of a build in `status --json`, by name."""
    return {stage["stage"]: stage for stage in build["stages"]}


class Status(Case):
    @classmethod
    def prepare(cls):
        Scene.make(cls.shared).build("out")

    def setUp(self):
        super().setUp()
        self.scene = Scene(self.shared, self.folder)
        self.out = self.folder / "out"

    def only_build(self, out):
        build, = run_json("status", out)["builds"]
        return build

    def test_a_finished_build(self):
        out = self.shared / "out"
        dataset = latest(out)
        build = self.only_build(out)
        self.assertEqual(build["version"], dataset.name)
        self.assertEqual(build["key"], json.loads((dataset / "dataset.json").read_text())["key"])
        self.assertTrue(build["finished"] and build["latest"] and build["has_plan"])
        self.assertEqual((build["candidates"], build["units"]), (PICTURES, UNITS))
        stages = stages_of(build)
        self.assertEqual(list(stages), ["ingest", "predict", "fidelity", "refine", "measure", "crops", "shards"])
        for name in FOLDERS:
            with self.subTest(stage=name):
                manifest = json.loads((out / stages[name]["manifest"]).read_text())
                self.assertEqual(manifest, {"stage": name, "key": stages[name]["key"]})
                self.assertEqual(stages[name]["units_missing"], [])
                self.assertEqual(stages[name]["units_finished"] + stages[name]["units_not_needed"], UNITS)
        self.assertEqual(build["dataset"], {"manifest": f"{dataset.name}/dataset.json", "is_there": True})
        self.assertFalse(build["report"]["is_there"])
        text = run("status", out).stdout
        self.assertIn(f"{dataset.name} (latest): {PICTURES} candidates in {UNITS} units, finished", text)
        self.assertIn(f"{stages['shards']['key'][:12]}     {UNITS} of {UNITS}  {stages['shards']['manifest']}\n", text)

    def test_a_killed_build_tells_what_is_missing_and_how_it_goes_on(self):
        # Stops when the second shard has its line in the journal; the units behind it are in flight.
        fault = Fault("shards-", "sync", "stop", skip=6)
        with started(*self.scene.build_words("out", "--quiet"), fault=fault) as running:
            self.assertTrue(running.wait_for_stop(), running.stderr())
            while_it_runs = self.only_build(self.out)
        build = self.only_build(self.out)
        self.assertFalse(build["finished"])
        self.assertEqual(build["stages"], while_it_runs["stages"])
        stages = stages_of(build)
        for name in FOLDERS:
            done = units_in_journals(self.out, name)
            missing = set(range(UNITS)) - done
            if name == "crops":  # a unit with a shard needs no table of crops any more
                missing -= units_in_journals(self.out, "shards")
            self.assertEqual(stages[name]["units_missing"], sorted(missing), name)
        self.assertTrue(0 < stages["shards"]["units_finished"] < UNITS)
        text = run("status", self.out).stdout
        self.assertRegex(text, r"shards .* units? .* (is|are) missing")
        line = text[text.index("started: ") + len("started: "):].splitlines()[0]
        words = shlex.split(line)
        run(*words[1:])
        self.assertTrue(self.only_build(self.out)["finished"])
        self.assertEqual(digests(latest(self.out)), digests(latest(self.shared / "out")))

    def test_a_file_that_is_gone_or_cut_is_missing(self):
        self.copy_of("out")
        stages = stages_of(self.only_build(self.out))
        folder = (self.out / stages["refine"]["manifest"]).parent
        (folder / "unit-000001.h5").unlink()
        (folder / "unit-000003.h5").write_bytes(b"short")
        refine = stages_of(self.only_build(self.out))["refine"]
        self.assertEqual((refine["units_missing"], refine["units_damaged"]), ([1, 3], [1, 3]))
        self.assertIn("units 1 and 3 are missing; of these, units 1 and 3 are damaged", run("status", self.out).stdout)

    def test_changed_pictures_make_another_build_of_which_units_are_missing(self):
        """The plans are told apart by the units' inputs, although the stages' folders are the same."""
        self.copy_of("out")
        data = self.folder / "data"
        shutil.copytree(self.scene.data, data)
        records = json.loads((data / "train.json").read_text())
        records["data"][0]["bbox"][2] -= 1
        (data / "train.json").write_text(json.dumps(records))
        config = self.scene.write_config("changed.json", datasets=[
            {"name": "drawn", "format": "prima", "root": str(data), "annotations": "train.json", "split": "train"}])
        self.scene.build("out", config=config)
        builds = {build["version"]: build for build in run_json("status", self.out)["builds"]}
        self.assertEqual(len(builds), 2)
        new = builds[latest(self.out).name]
        old = builds[latest(self.shared / "out").name]
        self.assertEqual(stages_of(new)["predict"]["units_missing"], [])
        self.assertEqual(stages_of(old)["predict"]["units_missing"], [0])
        self.assertTrue(old["finished"] and not old["latest"])

    def test_a_version_without_a_plan_and_what_calibrate_left(self):
        shutil.copytree(self.shared / "out", self.out, symlinks=True)
        shutil.rmtree(self.out / "stages/builds")
        build = self.only_build(self.out)
        self.assertFalse(build["has_plan"])
        self.assertEqual(stages_of(build)["predict"]["units_finished"], UNITS)
        self.assertIn("It has no plan", run("status", self.out).stdout)
        found = run_json("status", self.shared / "calibration")
        self.assertEqual(found["builds"], [])
        self.assertEqual([stage["units"] for stage in found["other_stages"]], [UNITS])

    def test_a_damaged_plan_is_told_and_written_again(self):
        self.copy_of("out")
        plan, = (self.out / "stages/builds").iterdir()
        sound = plan.read_text()
        plan.write_text(sound[:100])
        result = run("status", self.out)
        self.assertIn(f"warning: {plan}: damaged", result.stderr)
        self.scene.build("out")
        self.assertEqual(plan.read_text().replace(str(self.out), ""), sound.replace(str(self.shared / "out"), ""))

    def test_made_versions_have_no_stages(self):
        made = run_json("subset", self.shared / "out", "--where", "verdict = retained", "--out", self.out)
        build = self.only_build(self.out)
        self.assertTrue(build["derived"], made)
        self.assertIn("no stages of its own", run("status", self.out).stdout)

    def test_a_folder_without_a_build_is_refused(self):
        self.assertIn("expected an output folder", run("status", self.folder, expect=1).stderr)
