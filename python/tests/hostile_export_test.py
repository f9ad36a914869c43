"""Exports that a stranger made, and datasets whose names are HTML, YAML or paths."""

import json
import pathlib
import tempfile
import unittest

import support  # noqa: F401  (first of ours: it sets the path)
from quadruped3d.export import card
from quadruped3d.export.folder import ExportError, ExportFolder

ABOUT = {"export": "parquet", "key": "k"}


class HostileFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.out = pathlib.Path(folder.name) / "out"
        self.out.mkdir()
        (pathlib.Path(folder.name) / "secret").write_text("secret")

    def refused(self, text):
        (self.out / "export.json").write_text(text)
        with self.assertRaisesRegex(ExportError, "export.json"):
            ExportFolder(self.out, ABOUT)

    def test_names_that_lead_elsewhere(self):
        for name in ("../secret", "/etc/hostname", "a/../../secret", "a\0", "..", "", "a\\..\\b", "C:/a", 7, None):
            self.refused(json.dumps({"format": "quadruped3d-export", **ABOUT, "files": [{"file": name, "sha256": "x"}]}))

    def test_manifests_of_another_form(self):
        whole = {"format": "quadruped3d-export", **ABOUT}
        for value in ([], 1, "text", whole, {**whole, "files": 3}, {**whole, "files": [1]}, {**whole, "files": [{}]},
                      {**whole, "files": [{"file": "a"}]}):
            with self.subTest(value=value):
                (self.out / "export.json").write_text(json.dumps(value))
                with self.assertRaises(ExportError):
                    ExportFolder(self.out, ABOUT)
        self.refused("[" * 100_000)
        self.refused("{")


class HostileCard(unittest.TestCase):
    def test_names_are_shown_as_text(self):
        attack = '<img src=x onerror="alert(1)">\n| new row |\u2028---\nlicense: mit'
        counts = {"candidates": 1, "retained": 1, "refined": 0, "discarded": 0, "failed": 0}
        manifest = {
            "name": attack, "version": attack, "toolkit": "0", "profile": "paper", "key": "k", "content_id": "c", "schema": 2,
            "counts": counts, "labels": {"truth": 1}, "thresholds": {},
            "statistics": {name: {attack: counts} for name in ("by_family", "by_species", "by_dataset")},
            "datasets": {attack: {"licence": attack, "source_url": attack, "citation": attack}},
        }
        text = card.card_of(manifest, ["train"], ["id"], False)
        header = text.split("\n---\n")[0]
        self.assertEqual([line for line in header.splitlines() if line.startswith("license:")], ["license: other"])
        self.assertNotIn("<img", text.removeprefix(header))
        self.assertEqual([line for line in text.splitlines() if line.startswith("| new row")], [])


if __name__ == "__main__":
    unittest.main()
