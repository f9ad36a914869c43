"""`status`, `build --until` and `build --dry-run`: how far builds have come, builds that stop after a stage, and what a
build would do."""

import json
import shlex
import shutil
import signal

from e2e import (PICTURES, UNIT, Fault, Scene, SceneCase, digests, flip_bit, latest, run, run_json, started,
                 units_in_journals, verdicts)

UNITS = PICTURES // UNIT
FOLDERS = ("predict", "refine", "measure", "crops", "shards")


def stages_of(build):
    """The stages of a build in `status --json`, by name."""
    return {stage["stage"]: stage for stage in build["stages"]}


class Status(SceneCase):
    @classmethod
    def prepare(cls):
        Scene.make(cls.shared).build("out")

    def setUp(self):
        super().setUp()
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
                self.assertEqual((manifest["stage"], manifest["key"]), (name, stages[name]["key"]))
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
        plan, = (self.out / "stages/builds").glob("*.json")
        sound = plan.read_text()
        plan.write_text(sound[:100])
        result = run("status", self.out)
        self.assertIn(f"warning: {plan}: damaged", result.stderr)
        self.scene.build("out")
        made, before = json.loads(plan.read_text()), json.loads(sound)
        for document, out in (made, self.out), (before, self.shared / "out"):
            document["command"] = [word.replace(str(out), "OUT") for word in document["command"]]
            self.assertRegex(document.pop("digest"), "^[0-9a-f]{64}$")
        self.assertEqual(made, before)

    def test_made_versions_have_no_stages(self):
        made = run_json("subset", self.shared / "out", "--where", "verdict = retained", "--out", self.out)
        build = self.only_build(self.out)
        self.assertTrue(build["derived"], made)
        self.assertIn("no stages of its own", run("status", self.out).stdout)

    def test_exports_and_the_report_are_listed(self):
        self.copy_of("out")
        coco = self.folder / "exports/coco"
        # Stops before the first picture is there under its name.
        fault = Fault("images/", "rename", "stop")
        words = ("export", self.out, "--format", "coco", "--out", coco, "--pictures-anyway")
        with started(*words, fault=fault) as running:
            self.assertTrue(running.wait_for_stop(), running.stderr())
            running.send(signal.SIGKILL)
            running.wait()
        export, = run_json("status", self.out)["exports"]
        self.assertEqual((export["format"], export["state"], export["folder"]),
                         ("coco", "not finished", "../exports/coco"))
        self.assertFalse((coco / "export.json").exists())
        self.assertIn("not finished ../exports/coco: the same `export` command goes on", run("status", self.out).stdout)
        run(*words)
        self.assertIn("(was complete)", run(*words).stderr)
        done, = run_json("status", self.out)["exports"]
        self.assertEqual((done["state"], done["key"], done["version"]),
                         ("complete", export["key"], latest(self.out).name))
        next((coco / "images").iterdir()).unlink()
        self.assertEqual(run_json("status", self.out)["exports"][0]["state"], "damaged")
        self.assertIn("is gone or differs", run(*words, expect=1).stderr)
        run("report", self.out, "--gallery", 0)
        self.assertTrue(self.only_build(self.out)["report"]["is_there"])

    def test_an_export_below_a_read_only_dataset_is_made_all_the_same(self):
        self.copy_of("out")
        fault = Fault("stages/exports", "open", error="EROFS")
        said = run("export", self.out, "--format", "coco", "--out", self.folder / "coco", fault=fault).stderr
        self.assertIn("`status` will not list this export", said)
        self.assertTrue((self.folder / "coco/export.json").exists())
        self.assertEqual(run_json("status", self.out)["exports"], [])

    def test_a_folder_without_a_build_is_refused(self):
        self.assertIn("expected an output folder", run("status", self.folder, expect=1).stderr)


class Until(SceneCase):
    """Builds that stop after a stage."""

    @classmethod
    def prepare(cls):
        Scene.make(cls.shared).build("whole")

    def setUp(self):
        super().setUp()
        self.whole = digests(latest(self.shared / "whole"))
        self.names = list(stages_of(run_json("status", self.shared / "whole")["builds"][0]))

    def next_command(self, result):
        line, = [line for line in result.stderr.splitlines() if line.startswith("next: ")]
        return shlex.split(line[len("next: "):])

    def test_a_build_stops_after_each_stage_and_goes_on_to_the_same_bytes(self):
        for stage in self.names:
            with self.subTest(stage=stage):
                result = self.scene.build(stage, "--until", stage)
                out = self.folder / stage
                self.assertIn(f"stopped after the stage {stage}", result.stderr)
                self.assertFalse((out / "latest").exists())
                self.assertEqual(list(out.glob("*/dataset.json")), [])
                for name in ("predict", "refine", "measure", "shards"):
                    wanted = set(range(UNITS)) if self.names.index(name) <= self.names.index(stage) else set()
                    self.assertEqual(units_in_journals(out, name), wanted, name)
                self.assertEqual(bool(units_in_journals(out, "crops")), stage in ("crops", "shards"))
                self.assertIn(f"{stage} ", result.stderr)
                run(*self.next_command(result)[1:])
                self.assertEqual(digests(latest(out)), self.whole)

    def test_stage_after_stage_in_one_folder(self):
        for stage in self.names:
            summary = json.loads(self.scene.build("out", "--until", stage, "--json").stdout)
            self.assertEqual(summary["stopped_after"], stage)
            done = stages_of(summary["build"])
            for name in self.names[: self.names.index(stage) + 1]:
                self.assertEqual(done[name]["units_missing"], [], (stage, name))
            self.assertFalse(summary["build"]["finished"])
        self.scene.build("out")
        self.assertEqual(digests(self.scene.latest("out")), self.whole)

    def test_a_finished_dataset_is_told_as_such(self):
        self.copy_of("whole")
        result = self.scene.build("whole", "--until", "predict")
        self.assertIn("was up to date", result.stderr)
        self.assertNotIn("stopped after", result.stderr)

    def test_the_command_that_goes_on_has_the_veto(self):
        veto = self.folder / "left out.txt"
        veto.write_text(verdicts(latest(self.shared / "whole"))[0]["id"] + "\tseen by eye\n")
        result = self.scene.build("out", "--until", "refine", "--veto", veto)
        words = self.next_command(result)
        self.assertEqual(words[words.index("--veto") + 1], str(veto))
        run(*words[1:])
        self.assertEqual(verdicts(self.scene.latest("out"))[0]["reason"], "vetoed")

    def test_labels_of_the_annotations_stop_too(self):
        """Without pseudo labels there is nothing to measure, and no network is loaded."""
        config = self.scene.write_config("flat.json", datasets=[
            {"name": "drawn", "format": "prima", "root": str(self.scene.data), "annotations": "train.json",
             "split": "train", "role": "2d_only"}])
        for stage in ("predict", "measure", "crops"):
            self.scene.build("out", "--until", stage, config=config)
            self.assertEqual(units_in_journals(self.folder / "out", "shards"), set())
        self.scene.build("out", config=config)
        self.scene.build("other", config=config)
        self.assertEqual(digests(self.scene.latest("out")), digests(self.scene.latest("other")))

    def test_an_unknown_stage_is_wrong_usage(self):
        said = self.scene.build("out", "--until", "prediction", expect=2).stderr
        self.assertIn("--until", said)
        self.assertIn("predict", said)
        self.assertFalse((self.folder / "out").exists())


class DryRun(SceneCase):
    """What a build would make, against what it then makes."""

    @classmethod
    def prepare(cls):
        Scene.make(cls.shared).build("out")

    def setUp(self):
        super().setUp()
        self.out = self.folder / "out"

    def forecast(self, *more, **options):
        """The dry run's stages by name and all it says. It changes no file and makes none."""
        before = self.state()
        document = json.loads(self.scene.build("out", "--dry-run", "--json", *more, **options).stdout)
        text = self.scene.build("out", "--dry-run", *more, **options).stdout
        self.assertEqual(self.state(), before)
        for stage in document["stages"]:
            for why in stage["why"]:
                self.assertIn(why, text)
        return {stage["stage"]: stage for stage in document["stages"]}, document

    def state(self):
        return {path: (path.lstat().st_mtime_ns, path.lstat().st_ino) for path in sorted(self.out.rglob("*"))}

    def made_by_a_build(self, *more, **options):
        """How many units of each stage the build adds to the journals, beside those that were there."""
        def lines():
            return {path: path.read_text().count("\n") for path in self.out.glob("stages/*/journal.jsonl")}

        before = lines()
        self.scene.build("out", *more, **options)
        made = dict.fromkeys(FOLDERS, 0)
        for path, count in lines().items():
            made[path.parent.name.split("-")[0]] += count - before.get(path, 0)
        return made

    def assert_as_forecast(self, stages, made):
        for name in FOLDERS:
            if name == "crops":  # only units of which a candidate is kept get a table
                self.assertLessEqual(made[name], stages[name]["units_made"])
            else:
                self.assertEqual(made[name], stages[name]["units_made"], name)

    def test_an_empty_folder(self):
        stages, document = self.forecast()
        self.assertFalse(self.out.exists())
        self.assertFalse(document["up_to_date"])
        for name in FOLDERS:
            self.assertEqual((stages[name]["units_reused"], stages[name]["units_made"]), (0, UNITS))
            self.assertEqual(stages[name]["why"], ["no build in this folder has made the stage"])
        self.assert_as_forecast(stages, self.made_by_a_build())
        self.assertEqual(latest(self.out).name, document["version"])

    def test_a_finished_build(self):
        self.copy_of("out")
        stages, document = self.forecast()
        self.assertTrue(document["up_to_date"])
        for name in FOLDERS:
            self.assertEqual((stages[name]["units_made"], stages[name]["why"]), (0, []))
        self.assertIn("a build would make nothing", self.scene.build("out", "--dry-run").stdout)

    def test_another_threshold(self):
        self.copy_of("out")
        low = self.scene.limits["tau_low"]
        stages, document = self.forecast("--set", f"filter.tau_low={low / 2}")
        self.assertEqual(stages["predict"]["units_reused"], UNITS)
        self.assertEqual(stages["crops"]["units_made"] + stages["crops"]["units_reused"], UNITS)
        why, = stages["refine"]["why"]
        before = latest(self.shared / "out").name
        self.assertTrue(why.startswith(f"its key differs from that of {before}: tau_low: "), why)
        self.assertIn(f" -> {low / 2}"[:12], why)
        self.assertIn("the stage refine before it is another", stages["measure"]["why"][0])
        self.assert_as_forecast(stages, self.made_by_a_build("--set", f"filter.tau_low={low / 2}"))
        self.assertEqual(latest(self.out).name, document["version"])

    def test_another_quality_of_the_crops(self):
        self.copy_of("out")
        stages, _ = self.forecast("--set", "shards.jpeg_quality=40")
        for name in ("predict", "refine", "measure"):
            self.assertEqual(stages[name]["units_made"], 0)
        for name in ("crops", "shards"):
            self.assertIn("jpeg_quality: 95 -> 40", stages[name]["why"][0])
        self.assert_as_forecast(stages, self.made_by_a_build("--set", "shards.jpeg_quality=40"))

    def test_damage_and_what_is_not_made_yet(self):
        self.scene.build("out", "--until", "refine")
        folder, = self.out.glob("stages/refine-*")
        flip_bit(folder / "unit-000002.h5")
        (folder / "unit-000003.h5").unlink()
        stages, _ = self.forecast()
        self.assertEqual(stages["refine"]["why"], ["2 units whose file is gone or damaged"])
        self.assertEqual(stages["shards"]["units_made"], UNITS)
        self.assert_as_forecast(stages, self.made_by_a_build())

    def test_a_veto_makes_one_unit_anew(self):
        self.copy_of("out")
        veto = self.folder / "veto.txt"
        veto.write_text(verdicts(latest(self.out))[UNIT]["id"] + "\n")
        stages, _ = self.forecast("--veto", veto)
        self.assertEqual(stages["predict"]["units_made"], 0)
        self.assertEqual(stages["shards"]["units_made"], 1)
        self.assertEqual(stages["shards"]["why"], ["1 unit with other pictures, labels or exclusions than before"])
        self.assert_as_forecast(stages, self.made_by_a_build("--veto", veto))

    def test_the_search_for_leaks_leaves_nothing(self):
        test_set = {"name": "test", "format": "prima", "root": str(self.scene.data), "annotations": "train.json",
                    "split": "test"}
        config = self.scene.write_config("leaks.json", leakage={"test_sets": [test_set]})
        self.forecast(config=config)
        self.assertFalse(self.out.exists())

    def test_a_dry_run_has_no_stage_to_stop_after(self):
        self.scene.build("out", "--dry-run", "--until", "predict", expect=2)
