"""tools/trust_scores.py: statistics by hand, and pools in which it is known which score is worth something."""

import csv
import pathlib
import tempfile
import unittest

import numpy as np

import support  # noqa: F401  sets the path
import trust_scores


class Statistics(unittest.TestCase):
    def test_ranks_of_equal_values_are_shared(self):
        np.testing.assert_array_equal(trust_scores.ranks(np.array([3.0, 1.0, 3.0, 2.0])), [3.5, 1, 3.5, 2])

    def test_rank_correlation(self):
        error = np.array([1.0, 2.0, 3.0, 4.0])
        self.assertEqual(trust_scores.rank_correlation(np.exp(error), error), 1.0)
        self.assertEqual(trust_scores.rank_correlation(-error, error), -1.0)
        self.assertEqual(trust_scores.rank_correlation(np.ones(4), error), 0.0)
        # By hand: 1 - 6 (1 + 1 + 0 + 0) / (4 * 15).
        self.assertAlmostEqual(trust_scores.rank_correlation(np.array([2.0, 1.0, 3.0, 4.0]), error), 0.8)

    def test_auroc(self):
        bad = np.array([True, False, False, True])
        self.assertEqual(trust_scores.auroc(np.array([4.0, 1.0, 2.0, 3.0]), bad), 1.0)
        self.assertEqual(trust_scores.auroc(np.array([1.0, 4.0, 3.0, 2.0]), bad), 0.0)
        self.assertEqual(trust_scores.auroc(np.ones(4), bad), 0.5)
        self.assertEqual(trust_scores.auroc(np.array([4.0, 1.0, 3.0, 2.0]), bad), 0.75)  # 3 of 4 pairs

    def test_the_worst_quarter_is_a_quarter(self):
        self.assertEqual(trust_scores.worst_quarter(np.arange(100.0)).sum(), 25)


class Pools(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = pathlib.Path(scratch.name)

    def write_pool(self, name, seed, count=240):
        """The mirror score and L_proj of the prediction know the error, aux_2d knows it a little, all else is noise."""
        generator = np.random.default_rng(seed)
        error = generator.uniform(50, 150, count)
        folder = self.folder / name
        folder.mkdir()
        columns = [score.column for score in (*trust_scores.SCORES, trust_scores.TRUST)]
        with open(folder / "verdicts.csv", "w", newline="") as verdicts, open(folder / "labels.csv", "w",
                                                                              newline="") as labels:
            rows, truth = csv.DictWriter(verdicts, ["id", "verdict", *columns]), csv.writer(labels)
            rows.writeheader()
            truth.writerow(["id", "verdict", trust_scores.ERROR])
            for i in range(count):
                row = {column: generator.uniform(0.1, 1) for column in columns}
                row |= {"trust_mirror": error[i] * generator.uniform(0.9, 1.1), "trust_mask": "",
                        "initial_error": error[i] * generator.uniform(0.9, 1.1),
                        "trust_aux_2d": error[i] * generator.uniform(0.3, 1.7), "trust": 1 / error[i], "gain": ""}
                rows.writerow({"id": f"a/b/p{i // 2}.png#{i}", "verdict": ("retained", "refined")[i % 2], **row})
                truth.writerow([f"a/b/p{i // 2}.png#{i}", "", error[i]])
            # Neither of these is a label of the network with a truth.
            rows.writerow({"id": "a/b/dropped.png#1", "verdict": "discarded"})
            rows.writerow({"id": "a/b/unmeasured.png#1", "verdict": "retained"})
        return folder

    def test_labels_are_joined(self):
        pool = trust_scores.read_pool(self.write_pool("one", 1))
        self.assertEqual(len(pool.error), 240)
        self.assertEqual(pool.pictures.max() + 1, 120)
        self.assertFalse(pool.is_measured(next(s for s in trust_scores.SCORES if s.column == "trust_mask")))

    def test_the_table_knows_what_is_worth_something(self):
        pools = [trust_scores.read_pool(self.write_pool(str(seed), seed)) for seed in (1, 2)]
        table = trust_scores.table(pools, resamples=100)
        rows = {line.split(" | ")[0].strip("| "): line for line in table.splitlines() if line.startswith("|")}
        value = {name: float(line.split(" | ")[2].split(" ")[0]) for name, line in rows.items()
                 if name.startswith("trust_") and "not measured" not in line}
        self.assertGreater(value["trust_mirror"], 0.95)
        self.assertTrue(0.65 < value["trust_aux_2d"] < 0.95)
        self.assertTrue(0.4 < value["trust_pose_prior"] < 0.6)
        self.assertIn("not measured in every pool", rows["trust_mask"])
        # trust is the error itself here: half of the labels have half the range, a mean of 75 mm.
        half = rows["50%"].split(" | ")
        self.assertAlmostEqual(float(half[2]), 75, delta=3)
        self.assertLess(float(half[3].split("to")[1].rstrip(") |")), 0, "the interval lies below 0")

    def test_the_fit_finds_the_scores_that_know(self):
        pool = trust_scores.read_pool(self.write_pool("one", 1))
        retained, refined = trust_scores.fit([pool], "retained"), trust_scores.fit([pool], "refined")
        self.assertEqual([term[0] for term in retained.terms], ["initial_error"])
        self.assertLess(retained.terms[0][3], -2, "a large error speaks against the label")
        weights = {column: weight for column, _, _, weight in refined.terms}
        self.assertLess(weights["initial_error"], -2)
        self.assertLess(abs(weights["trust_visible"]), 0.7)
        self.assertGreater(refined.bias, 0, "three quarters are good")
        own = pool.kinds == "refined"
        mean = next(term[1] for term in refined.terms if term[0] == "initial_error")
        self.assertAlmostEqual(mean, np.log(pool.columns["initial_error"][own]).mean(), places=9)

    def test_a_label_of_two_pools_counts_once(self):
        pools = [trust_scores.read_pool(self.write_pool(str(seed), seed)) for seed in (1, 2)]
        alone, both = trust_scores.fit(pools[:1], "retained"), trust_scores.fit(pools, "retained")
        self.assertEqual(both.labels, 120)
        self.assertEqual(both.terms, alone.terms)

    def test_a_fit_needs_labels_of_the_kind(self):
        pool = trust_scores.read_pool(self.write_pool("one", 1, count=24))
        with self.assertRaisesRegex(SystemExit, "12 retained labels"):
            trust_scores.fit([pool], "retained")

    def test_a_folder_without_labels_is_refused(self):
        folder = self.write_pool("few", 1, count=3)
        with self.assertRaisesRegex(SystemExit, "3 labels of the network"):
            trust_scores.read_pool(folder)


if __name__ == "__main__":
    unittest.main()
