"""The command line as people meet it: misspelt words, help, single keys of a config, lines to paste."""

import json
import shlex
import subprocess

from e2e import Case, draw_pictures, prima_dataset, run, write_annotations, write_json


class CommandLine(Case):
    @classmethod
    def prepare(cls):
        """A finished dataset in a folder whose name a shell would part."""
        root = cls.shared / "my data"
        write_annotations(root, draw_pictures(root, 3))
        write_json(cls.shared / "my build.json", {"name": "drawn", "datasets": [prima_dataset(root, role="2d_only")]})
        result = run("build", "--config", cls.shared / "my build.json", "--out", cls.shared / "my out")
        (cls.shared / "said.txt").write_text(result.stderr)

    def said(self, *words):
        return run(*words, expect=2).stderr

    def test_misspelt_commands_name_the_nearest_and_list_all(self):
        said = self.said("biuld", "--config", "x.json")
        self.assertIn('unknown command "biuld"; did you mean "build"?', said)
        self.assertIn("calibrate", said)
        self.assertIn('did you mean "inspect"?', self.said("inspects"))
        self.assertIn('unknown command "shw"; did you mean "show"?', self.said("config", "shw"))
        self.assertIn("The commands are build, calibrate", self.said("frobnicate"))

    def test_misspelt_options_name_the_nearest_and_list_all(self):
        for words in (["build", "--confg", "x.json", "--out", "o"], ["verify", "--jsn", "."],
                      ["config", "show", "--cnfig=x.json"]):
            with self.subTest(words=words):
                said = self.said(*words)
                self.assertIn("unknown option", said)
                self.assertIn("did you mean", said)
                self.assertIn("The options are --help, ", said)
        self.assertIn('unknown option "--confg"; did you mean "--config"?', self.said("build", "--confg=x", "--out", "o"))

    def test_words_that_nobody_expects_are_named(self):
        self.assertIn('unexpected word "more"', self.said("verify", ".", "more"))

    def test_help_of_a_command(self):
        for command in ("build", "verify", "topology"):
            self.assertEqual(run("help", command).stdout, run(command, "--help").stdout)
        self.assertIn("Examples:", run("help", "leakage").stdout)
        self.assertEqual(run("help", "config", "show").stdout, run("config", "show", "--help").stdout)
        self.assertEqual(run("help").stdout, run("--help").stdout)
        self.assertIn('did you mean "build"?', self.said("help", "biuld"))

    def test_lines_to_paste_run_as_they_are(self):
        said = (self.shared / "said.txt").read_text()
        lines = said[said.index("next: ") + len("next: "):].splitlines()
        lines = [line.strip() for line in lines if line.strip()]
        self.assertEqual(len(lines), 2)
        page = run("inspect", self.shared / "my out").stdout
        lines += [line.strip() for line in page[page.index("What to do next"):].splitlines()[1:] if line.strip()]
        self.assertEqual(len(lines), 6)
        for line in lines:
            with self.subTest(line=line):
                result = subprocess.run(["sh", "-c", line], cwd=self.folder, capture_output=True, text=True)
                self.assertEqual(result.returncode, 0, result.stderr)
        self.assertTrue((self.folder / "sheet.png").exists())

    def test_counts_of_one(self):
        self.assertIn("1 shard in ", (self.shared / "said.txt").read_text())
        self.assertIn("1 shard, 3 samples, 3 pictures read", run("verify", self.shared / "my out").stderr)

    def test_explain_finds_a_candidate_by_a_part_of_its_id(self):
        story = json.loads(run("explain", self.shared / "my out", "p001", "--json").stdout)
        self.assertEqual(story["id"], "drawn/train/images/p001.png#1")
        several = run("explain", self.shared / "my out", "images/p0", expect=1).stderr
        for i in range(3):
            self.assertIn(f"drawn/train/images/p00{i}.png#{i}", several)
        self.assertIn("the nearest is", run("explain", self.shared / "my out", "q001", expect=1).stderr)

    def shown(self, *words):
        return json.loads(run("config", "show", "--config", self.shared / "my build.json", *words).stdout)

    def test_single_keys_of_a_config(self):
        config = self.shown("--set", "tta.learning_rate=0.5", "--set", "name=other", "--set",
                            "datasets.drawn.split=test", "--set", "shards.unit_size=2")
        self.assertEqual(config["tta"]["learning_rate"], 0.5)
        self.assertEqual(config["name"], "other")
        self.assertEqual(config["datasets"][0]["split"], "test")
        self.assertEqual(config["shards"]["unit_size"], 2)
        wrong = run("config", "show", "--config", self.shared / "my build.json", "--set", "tta.lerning_rate=1", expect=2)
        self.assertIn('unknown key "lerning_rate"; did you mean "learning_rate"?', wrong.stderr)
        run("build", "--config", self.shared / "my build.json", "--set", "name=second", "--out", self.folder / "out")
        self.assertTrue(list((self.folder / "out").glob("second-*")))

    def test_device_is_short_for_the_key_of_the_config(self):
        network = ["--set", "network.checkpoint=a.safetensors", "--set", "network.smal_asset=b.safetensors"]
        for device in ("cuda:1", "cuda:0,cuda:1"):
            self.assertEqual(self.shown(*network, "--device", device)["network"]["device"], device)

    def test_leakage_needs_no_network(self):
        root = self.shared / "my data"
        test_set = {**prima_dataset(root, name="test", split="test")}
        write_json(self.folder / "pool.json", {"datasets": [prima_dataset(root)], "leakage": {"test_sets": [test_set]}})
        result = run("leakage", "--config", self.folder / "pool.json", "--out", self.folder / "out")
        self.assertIn("candidates whose picture is in a test set: 3", result.stderr)
        line = next(line for line in result.stderr.splitlines() if line.startswith("next: "))
        words = shlex.split(line[len("next: "):])
        self.assertEqual(words[1:], ["build", "--config", str(self.folder / "pool.json"), "--out", str(self.folder / "out")])

    def test_built_in_topologies_are_listed_and_shown(self):
        listed = run("topology", "--list").stdout
        for name in ("ap10k", "horse10", "badja", "stanfordextra"):
            self.assertIn(f"\n{name} ", "\n" + listed)
        self.assertEqual(json.loads(run("topology", "--show", "ap10k").stdout)["name"], "ap10k17")
        self.assertIn('did you mean "ap10k"?', self.said("topology", "--show", "ap1k"))
        self.assertIn("give --from FILE", self.said("topology"))

    def test_a_topology_goes_by_name_from_any_folder(self):
        names = json.loads(run("topology", "--show", "ap10k").stdout)["keypoints"]
        points = [value for i in range(len(names)) for value in (20 + i, 30 + i, 2)]
        root = self.shared / "my data"
        write_json(self.folder / "labels.json",
                   {"images": [{"id": 1, "file_name": "images/p000.png"}],
                    "categories": [{"id": 1, "name": "dog", "keypoints": names}],
                    "annotations": [{"id": 1, "image_id": 1, "category_id": 1, "keypoints": points}]})
        write_json(self.folder / "build.json",
                   {"datasets": [{"name": "a", "format": "coco", "root": str(root), "role": "2d_only",
                                  "annotations": str(self.folder / "labels.json"), "images": ".", "topology": "ap10k"}]})
        summary = run("build", "--config", self.folder / "build.json", "--out", self.folder / "out", "--json")
        self.assertEqual(json.loads(summary.stdout)["retained"], 1)
        write_json(self.folder / "wrong.json",
                   {"datasets": [{"name": "a", "format": "coco", "root": str(root), "role": "2d_only",
                                  "annotations": str(self.folder / "labels.json"), "images": ".", "topology": "ap10"}]})
        wrong = run("build", "--config", self.folder / "wrong.json", "--out", self.folder / "out", expect=1)
        self.assertIn("no built-in topology of this name", wrong.stderr)
