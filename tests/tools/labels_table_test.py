"""tools/labels_table.py: the means of groups over several pools, and the ranges of L_proj."""

import contextlib
import csv
import io
import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools"))

import labels_table

COLUMNS = ["verdict", "prediction_l_proj", *(f"{bodies}_{metric}" for bodies in ("prediction", "label")
                                             for metric in labels_table.METRICS)]


def candidate(verdict, l_proj, prediction, label=()):
    """The numbers are AUC, AUC against the true keypoints, PA-MPJPE and PA-MPVPE."""
    return dict(zip(COLUMNS, [verdict, l_proj, *prediction, *label], strict=False))


class LabelsTable(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = pathlib.Path(scratch.name)
        self.one = self.pool("one", [candidate("retained", 0.02, (90, 91, 60, 50), (90, 91, 60, 50)),
                                     candidate("refined", 0.05, (80, 81, 100, 90), (95, 93, 70, 65))])
        self.two = self.pool("two", [candidate("refined", 0.04, (70, 71, 120, 110), (97, 95, 80, "")),
                                     candidate("discarded", 0.3, (40, 41, 200, 180)),
                                     candidate("failed", "", ("", "", "", ""))])

    def pool(self, name, rows):
        folder = self.folder / name
        folder.mkdir()
        with open(folder / "labels.csv", "w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, restval="")
            writer.writeheader()
            writer.writerows(rows)
        return str(folder)

    def printed(self, *arguments):
        output = io.StringIO()
        with contextlib.redirect_stdout(output):
            labels_table.main(arguments)
        return output.getvalue().splitlines()

    def test_groups_are_means_over_all_candidates_of_the_pools(self):
        self.assertEqual(self.printed(f"paper={self.one},{self.two}")[2:], [
            "| paper | predictions of the kept | 3 | 80.0 | 81.0 | 93.3 | 83.3 |",
            "| paper | kept | 3 | 94.0 | 93.0 | 70.0 | 57.5 |",  # one PA-MPVPE is unknown
            "| paper | of these retained as predicted | 1 | 90.0 | 91.0 | 60.0 | 50.0 |",
            "| paper | of these refined | 2 | 96.0 | 94.0 | 75.0 | 65.0 |",
            "| paper | discarded (their predictions) | 1 | 40.0 | 41.0 | 200.0 | 180.0 |"])

    def test_a_group_without_a_candidate_has_no_row(self):
        self.assertEqual([line.split(" | ")[1] for line in self.printed(f"a={self.one}")[2:]],
                         ["predictions of the kept", "kept", "of these retained as predicted", "of these refined"])

    def test_a_range_of_l_proj_holds_its_lower_end(self):
        printed = self.printed("--by-error", self.one, self.two)
        self.assertEqual(printed[2], "| pictures | 1 | 0 | 1 | 1 | 0 | 0 | 0 | 1 |")
        self.assertEqual(printed[3], "| AUC | 90.0 |  | 70.0 | 80.0 |  |  |  | 40.0 |")

    def test_a_rule_without_a_name_is_wrong_usage(self):
        message = io.StringIO()
        with self.assertRaises(SystemExit) as end, contextlib.redirect_stderr(message):
            labels_table.main([self.one])
        self.assertEqual(end.exception.code, 2)
        self.assertIn("expected NAME=POOL", message.getvalue())


if __name__ == "__main__":
    unittest.main()
