"""The report of a dataset: its numbers once more from verdicts.csv, and its page in a browser, where there is one."""

import collections
import html
import json
import re
import shutil
import subprocess
import unittest

import h5py
import numpy as np

from e2e import PICTURES, Case, Scene, file_sha256, kept, latest, run, run_json, verdicts, write_json

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
HOSTILE = "lion</script><script>document.title='run'</script>"


def report_folder(out):
    return out / "report" / latest(out).name


def dump(page, address=""):
    """(the page's DOM once its scripts have run, what it said on the console)."""
    done = subprocess.run([BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--v=0",
                           "--virtual-time-budget=60000", "--dump-dom", f"file://{page}{address}"],
                          capture_output=True, text=True, timeout=600)
    return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]


def explored(dom, name):
    """A number of the threshold explorer, as (least, most)."""
    text = html.unescape(re.search(rf'id="explored-{name}"[^>]*>([^<]*)<', dom).group(1))
    numbers = [float(word.replace(",", "")) for word in re.findall(r"[\d,.]+", text)]
    return numbers[0], numbers[-1]


class Report(Case):
    @classmethod
    def prepare(cls):
        scene = Scene.make(cls.shared)
        scene.build("out")
        run("report", cls.shared / "out", "--gallery", 2)

    @classmethod
    def recall(cls):
        cls.out = cls.shared / "out"
        cls.dataset = latest(cls.out)
        cls.folder_of_report = report_folder(cls.out)
        cls.numbers = json.loads((cls.folder_of_report / "statistics.json").read_text())
        cls.page = cls.folder_of_report / "report.html"
        cls.rows = verdicts(cls.dataset)
        cls.scene = Scene(cls.shared)

    # --- the numbers

    def test_counts_are_those_of_verdicts_csv(self):
        n = self.numbers
        counts = collections.Counter(row["verdict"] for row in self.rows)
        self.assertEqual(n["counts"]["candidates"], PICTURES)
        for verdict in ("retained", "refined", "discarded", "failed"):
            self.assertEqual(n["counts"][verdict], counts[verdict])
        self.assertEqual({r["reason"]: r["count"] for r in n["reasons"]},
                         {k: v for k, v in collections.Counter(row["reason"] for row in self.rows).items()
                          if k != "none"})
        self.assertEqual([step["count"] for step in n["funnel"]][-1], len(kept(self.rows)))
        families = {f["name"]: f for f in n["groups"]["families"]}
        for family, count in collections.Counter(row["family"] for row in self.rows).items():
            self.assertEqual(families[family]["candidates"], count)
            self.assertEqual(families[family]["kept"], sum(row["family"] == family for row in kept(self.rows)))

    def test_the_histogram_counts_every_judged_error(self):
        errors = [float(row["initial_error"]) for row in self.rows if row["initial_error"]]
        n = self.numbers["errors"]
        self.assertEqual(n["judged"], len(errors))
        binned = sum(sum(counts) for counts in n["counts"].values())
        self.assertEqual(binned + n["beyond"], len(errors))
        edges = np.linspace(n["low"], n["high"], len(n["final_counts"]) + 1)
        expected, _ = np.histogram(errors, edges)
        np.testing.assert_array_equal(np.sum(list(n["counts"].values()), axis=0), expected)

    def test_principal_components_are_numpys(self):
        betas = []
        for path in sorted((self.dataset / "shards").glob("*.h5")):
            with h5py.File(path) as shard:
                betas.append(shard["betas"][:])
        betas = np.concatenate(betas).astype(float)
        shape = self.numbers["shape"]
        self.assertEqual(shape["labels"], len(betas))
        centred = betas - betas.mean(axis=0)
        _, singular, _ = np.linalg.svd(centred, full_matrices=False)
        np.testing.assert_allclose(shape["explained"], (singular**2 / (singular**2).sum())[:2], rtol=1e-3)
        np.testing.assert_allclose(np.linalg.norm(shape["x"]), singular[0], rtol=2e-3)

    def test_equal_datasets_give_equal_files(self):
        run("report", self.out, "--gallery", 2, "--out", self.folder / "again")
        for name in ("statistics.json", "report.html"):
            self.assertEqual(file_sha256(self.folder / "again" / name), file_sha256(self.folder_of_report / name))

    def test_a_report_that_is_there_is_not_made_again(self):
        out = self.folder / "again"
        words = ["report", self.out, "--gallery", 0, "--out", out]
        self.assertFalse(run_json(*words)["up_to_date"])
        self.assertTrue(run_json(*words)["up_to_date"])
        (out / "report.html").write_text("damaged")
        self.assertFalse(run_json(*words)["up_to_date"])
        self.assertGreater((out / "report.html").stat().st_size, 1_000_000)

    def test_a_dataset_that_was_moved_has_a_report(self):
        moved = shutil.copytree(self.dataset, self.folder / "elsewhere" / self.dataset.name)
        stderr = run("report", moved, "--out", self.folder / "r").stderr
        self.assertIn("no meshes", stderr)
        numbers = json.loads((self.folder / "r" / "statistics.json").read_text())
        self.assertEqual(numbers["counts"], self.numbers["counts"])
        self.assertEqual(numbers["shape"]["labels"], self.numbers["shape"]["labels"])
        self.assertTrue(any("gone" in str(note) for note in numbers["notes"]))

    # --- the page

    def test_a_part_of_a_dataset_has_a_report(self):
        """Its shards hold other candidates than the units of the build did."""
        run("subset", self.out, "--where", "verdict = refined", "--out", self.folder, "--name", "part")
        part, = self.folder.glob("part-*")
        run("report", part, "--out", self.folder / "pages", "--gallery", 0)
        numbers = json.loads((self.folder / "pages/statistics.json").read_text())
        visible = [0] * 27
        for path in sorted((part / "shards").glob("*.h5")):
            with h5py.File(path) as shard:
                for weights in shard["keypoints_weight"][:]:
                    visible[int((weights > 0).sum())] += 1
        self.assertEqual(numbers["visible"]["kept"], visible)
        self.assertEqual(sum(visible), sum(row["verdict"] == "refined" for row in self.rows))

    def test_the_page_needs_no_other_file(self):
        text = self.page.read_text()
        head = text[: text.index('id="statistics"')]
        self.assertEqual(re.findall(r'(?:src|href)="(?!data:|#)[^"]*"', head), [])
        self.assertIn("default-src 'none'", head)

    def test_texts_of_the_dataset_cannot_become_markup(self):
        out = self.copy_of("out")
        table = latest(out) / "verdicts.csv"
        table.chmod(0o644)
        hostile = HOSTILE.replace('"', '""')
        lines = table.read_text().splitlines()
        species = lines[0].split(",").index("species")
        rows = [line.split(",") for line in lines[1:]]
        for row in rows:
            row[species] = f'"{hostile}"'
        table.write_text("\n".join([lines[0], *(",".join(row) for row in rows)]) + "\n")
        run("report", out, "--gallery", 1, "--out", self.folder / "r")
        page = (self.folder / "r" / "report.html").read_text()
        self.assertIn("document.title='run'", page, "the text is there, as data")
        self.assertNotIn("<script>document.title", page)
        self.assertNotIn("lion</script>", page)

    @unittest.skipUnless(BROWSER, "no Chromium")
    def test_the_browser_draws_it_without_an_error(self):
        dom, console = dump(self.page)
        self.assertEqual(console, [])
        self.assertIn("data-drawn", dom)
        self.assertGreaterEqual(dom.count("main-svg"), 8)
        self.assertEqual(explored(dom, "kept"), (len(kept(self.rows)),) * 2)
        self.assertIn("Exact", dom)

    @unittest.skipUnless(BROWSER, "no Chromium")
    def test_the_explorer_agrees_with_a_build(self):
        """Other thresholds, explored in the page and built: equal where the page says so, else within its range."""
        limits, errors = self.scene.limits, sorted(float(row["initial_error"]) for row in self.rows)
        middle = (limits["tau_low"] + limits["tau_high"]) / 2
        wider = errors[-3] * 1.0001
        for low, high, delta, exact in ((limits["tau_low"], middle, limits["delta"], True),
                                        (middle, limits["tau_high"], limits["delta"], True),
                                        (limits["tau_low"], limits["tau_high"], 0.02, True),
                                        (limits["tau_low"], wider, limits["delta"], False)):
            dom, _ = dump(self.page, f"#tau_low={low!r}&tau_high={high!r}&delta={delta!r}")
            out = self.copy_of("out") if not (self.folder / "out").exists() else self.folder / "out"
            other = write_json(self.folder / "other.json",
                               {"filter": {"tau_low": low, "tau_high": high, "delta": delta}})
            run("build", "--config", self.scene.config, "--config", other, "--out", out)
            built = len(kept(verdicts(latest(out))))
            least, most = explored(dom, "kept")
            self.assertTrue(least <= built <= most, (low, high, delta, least, built, most))
            self.assertEqual(least == most, exact)
