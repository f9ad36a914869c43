"""Exports in Parquet: read back by pandas, datasets and mlcroissant; resumed after a kill; licences."""

import contextlib
import json
import os
import subprocess
import sys
import unittest

import numpy as np

from support import PACKAGE, Shards, check_issues, make_dataset
from quadruped3d import Shard, load

os.environ["HF_HUB_OFFLINE"] = "1"
OPEN = {"licence": "CC-BY-4.0", "source_url": "https://example.org/zoo", "citation": "A. Keeper (2020), \"Zoo | one\""}
CLOSED = {"licence": "", "source_url": "", "citation": ""}


def files_of(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def dense(value):
    """An array of pandas' arrays of arrays; any other value as it is."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        return np.stack([dense(each) for each in value])
    return value


class Exports(Shards):
    def setUp(self):
        super().setUp()
        from quadruped3d.export.parquet import export

        self.export = export
        self.dataset = make_dataset(self.folder / "made", [self.shards / "jpeg.h5", self.shards / "png.h5"],
                                    {"made/train": OPEN})

    def labels(self):
        return load(self.dataset)

    def test_pandas_reads_every_label(self):
        import pandas

        summary = self.export(self.dataset, self.folder / "out", "parquet")
        self.assertEqual((summary["samples"], summary["pictures"]), (13, 0))
        file, = (self.folder / "out" / "data").iterdir()
        self.assertEqual(file.name, "train-00000-of-00001.parquet")
        table, labels = pandas.read_parquet(file), self.labels()
        self.assertEqual(list(table.columns[:4]), ["id", "dataset", "split", "source"])
        self.assertLessEqual(set(labels), set(table.columns))
        self.assertNotIn("image", table.columns)
        for name, expected in labels.items():
            got = np.array([dense(value) for value in table[name]])
            np.testing.assert_array_equal(got.reshape(expected.shape), expected, err_msg=name)

    def test_datasets_loads_the_parquet_files(self):
        from datasets import load_dataset

        self.export(self.dataset, self.folder / "out", "parquet")
        samples = load_dataset("parquet", data_files={"train": str(self.folder / "out" / "data" / "train-*.parquet")},
                               split="train", cache_dir=str(self.folder / "cache"))
        pose = np.array(samples.with_format("numpy")["pose"])
        np.testing.assert_array_equal(pose, self.labels()["pose"])

    def test_datasets_loads_the_folder_with_its_pictures(self):
        from datasets import load_dataset

        from quadruped3d.pictures import decode

        self.export(self.dataset, self.folder / "out", "hf")
        samples = load_dataset(str(self.folder / "out"), split="train", cache_dir=str(self.folder / "cache"))
        self.assertEqual(samples["id"][:], list(self.labels()["id"]))
        png = Shard(self.shards / "png.h5")
        for row in range(png.rows):  # PNG decodes to the same pixels in every library
            np.testing.assert_array_equal(np.asarray(samples[6 + row]["image"]), decode(png.picture(row)))
        self.assertEqual(samples.features["pose"].length, 35)

    def test_croissant_is_valid_and_gives_the_records(self):
        import mlcroissant

        self.export(self.dataset, self.folder / "out", "hf")
        with contextlib.chdir(self.folder / "out"):
            croissant = mlcroissant.Dataset(jsonld="croissant.json")
            check_issues(self, croissant)
            records = list(croissant.records("train"))
        labels = self.labels()
        self.assertEqual([record["train/id"].decode() for record in records], list(labels["id"]))
        pose = next(field for field in croissant.metadata.record_sets[0].fields if field.name == "pose")
        self.assertEqual((pose.is_array, pose.array_shape), (True, "35,3,3"))
        listed = {file.name: file.sha256 for file in croissant.metadata.distribution if hasattr(file, "sha256")}
        manifest = json.loads((self.folder / "out" / "export.json").read_text())
        self.assertEqual({entry["file"]: entry["sha256"] for entry in manifest["files"]
                          if entry["file"].endswith(".parquet")}, listed)

    def test_the_card_has_counts_thresholds_terms_and_limits(self):
        self.export(self.dataset, self.folder / "out", "hf")
        card = (self.folder / "out" / "README.md").read_text()
        self.assertTrue(card.startswith("---\nlicense: cc-by-4.0\n"))
        for part in ("| retained | 13 |", "| jpeg | 0.03 | 0.08 | 0.05 |", "pseudo labels", "@article{yu2026prima",
                     "| made/train | CC-BY-4.0 | https://example.org/zoo | A. Keeper (2020), \"Zoo \\| one\" |"):
            self.assertIn(part, card)

    def test_equal_exports_have_equal_bytes(self):
        for name in ("one", "two"):
            self.export(self.dataset, self.folder / name, "hf")
        self.assertEqual(files_of(self.folder / "one"), files_of(self.folder / "two"))


class Licences(Shards):
    def setUp(self):
        super().setUp()
        from quadruped3d.export.parquet import export

        self.export = export

    def pictures(self, out):
        import pyarrow.parquet

        return [picture is not None for file in sorted((out / "data").iterdir())
                for picture in pyarrow.parquet.read_table(file)["image"].to_pylist()]

    def test_pictures_need_a_stated_licence(self):
        for terms in ({"made/train": CLOSED}, None):  # none stated; schema 1, which cannot state one
            dataset = make_dataset(self.folder / f"{terms is None}", [self.shards / "jpeg.h5"], terms)
            summary = self.export(dataset, self.folder / f"out-{terms is None}", "hf")
            self.assertEqual((summary["pictures"], summary["without_licence"]), (0, ["made/train"]))
            self.assertEqual(self.pictures(self.folder / f"out-{terms is None}"), [False] * 6)
            self.assertIn("| made/train | not stated |", (self.folder / f"out-{terms is None}" / "README.md").read_text())

    def test_unless_they_are_asked_for_anyway(self):
        dataset = make_dataset(self.folder / "made", [self.shards / "jpeg.h5"], {"made/train": CLOSED})
        self.export(dataset, self.folder / "out", "hf", pictures_anyway=True)
        self.assertEqual(self.pictures(self.folder / "out"), [True] * 6)


class Resuming(Shards):
    # Stops at a rename: the file is complete under its temporary name and not yet under its own.
    KILLED = """
import os, signal, sys
renames, replace = 0, os.replace
def stop(*names):
    global renames
    renames += 1
    if renames == int(sys.argv[1]): os.kill(os.getpid(), signal.SIGKILL)
    replace(*names)
os.replace = stop
from quadruped3d.export import parquet
parquet._FILE_BYTES = 1  # a file for every shard
parquet.export(sys.argv[2], sys.argv[3], "hf")
"""

    def run_until(self, renames, dataset, out):
        return subprocess.run([sys.executable, "-c", self.KILLED, str(renames), dataset, out], capture_output=True,
                              text=True, env={**os.environ, "PYTHONPATH": str(PACKAGE)})

    def test_a_killed_export_goes_on_with_the_same_bytes(self):
        dataset = make_dataset(self.folder / "made", [self.shards / "jpeg.h5", self.shards / "png.h5"],
                               {"made/train": OPEN})
        self.assertEqual(self.run_until(0, dataset, self.folder / "whole").returncode, 0)
        whole = files_of(self.folder / "whole")
        self.assertEqual(len(whole), 5)
        for renames in range(1, 6):  # two tables, croissant.json, README.md, export.json
            out = self.folder / f"killed-{renames}"
            self.assertEqual(self.run_until(renames, dataset, out).returncode, -9)
            self.assertFalse((out / "export.json").exists())
            stamps = {path: path.stat().st_mtime_ns for path in (out / "data").glob("*.parquet")}
            self.assertEqual(len(stamps), min(renames - 1, 2))
            self.assertEqual(self.run_until(0, dataset, out).returncode, 0)
            self.assertEqual(files_of(out), whole)
            self.assertEqual({path: path.stat().st_mtime_ns for path in stamps}, stamps)

    def test_a_folder_of_something_else_is_left_alone(self):
        from quadruped3d.export.folder import ExportError
        from quadruped3d.export.parquet import export

        dataset = make_dataset(self.folder / "made", [self.shards / "png.h5"], {"made/train": OPEN})
        (self.folder / "mine").mkdir()
        (self.folder / "mine" / "thesis.txt").write_text("years of work")
        with self.assertRaisesRegex(ExportError, "holds other files"):
            export(dataset, self.folder / "mine", "parquet")
        export(dataset, self.folder / "out", "parquet")
        before = files_of(self.folder / "out")
        export(dataset, self.folder / "out", "parquet")
        self.assertEqual(files_of(self.folder / "out"), before)
        with self.assertRaisesRegex(ExportError, "another export: export is 'parquet', now 'hf'"):
            export(dataset, self.folder / "out", "hf")
        next((self.folder / "out" / "data").iterdir()).write_bytes(b"damaged")
        with self.assertRaisesRegex(ExportError, "differs from"):
            export(dataset, self.folder / "out", "parquet")


class CommandLine(Shards):
    def run_main(self, *words, **options):
        return subprocess.run([sys.executable, "-m", "quadruped3d.export", *map(str, words)], capture_output=True,
                              text=True, env={**os.environ, "PYTHONPATH": str(PACKAGE)}, **options)

    def test_without_pyarrow_it_says_what_to_install(self):
        (self.folder / "pyarrow.py").write_text("raise ImportError('no pyarrow here')")
        result = subprocess.run([sys.executable, "-m", "quadruped3d.export", "parquet", "x", "--out", "y"],
                                capture_output=True, text=True,
                                env={**os.environ, "PYTHONPATH": f"{self.folder}:{PACKAGE}"})
        self.assertEqual(result.returncode, 2)
        self.assertIn("pip install 'quadruped3d[export]'", result.stderr)

    def test_summary_and_notes(self):
        dataset = make_dataset(self.folder / "made", [self.shards / "png.h5"], {"made/train": CLOSED})
        result = self.run_main("hf", dataset, "--out", self.folder / "out", "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        summary = json.loads(result.stdout)
        self.assertEqual((summary["samples"], summary["pictures"], summary["files"]), (7, 0, 3))
        self.assertIn("made/train states no licence", result.stderr)
        result = self.run_main("hf", self.folder, "--out", self.folder / "other")
        self.assertEqual(result.returncode, 1)
        self.assertIn("expected a dataset's folder", result.stderr)


if __name__ == "__main__":
    unittest.main()
