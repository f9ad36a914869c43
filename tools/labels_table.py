#!/usr/bin/env python3
"""Tables of the labels of several pools together, for docs/results.md.

    tools/labels_table.py NAME=POOL,POOL...     how good the labels of the rule NAME are; once for each rule
    tools/labels_table.py --by-error POOL...    what L_proj of a prediction says about its body

POOL is a folder that `quadruped3d evaluate-labels --report POOL` wrote. The rows are means over all candidates of the
pools that belong to a group. AUC is in percent, PA-MPJPE and PA-MPVPE are in mm. A cell is empty if no candidate of the
group has the value.
"""

from __future__ import annotations

import argparse
import csv
import pathlib
import statistics
import sys
from typing import Iterable, Sequence

EDGES = (0.03, 0.04, 0.05, 0.06, 0.075, 0.1, 0.15)  # crop units
METRICS = ("auc", "true_auc", "pa_mpjpe_mm", "pa_mpvpe_mm")
KEPT = ("retained", "refined")
# A group has a name, the bodies that are measured, and the verdicts that belong to it.
GROUPS = (("predictions of the kept", "prediction", KEPT),
          ("kept", "label", KEPT),
          ("of these retained as predicted", "label", ("retained",)),
          ("of these refined", "label", ("refined",)),
          ("discarded (their predictions)", "prediction", ("discarded",)))

Row = dict[str, str]


def read_pools(folders: Iterable[str]) -> list[Row]:
    rows: list[Row] = []
    for folder in folders:
        with open(pathlib.Path(folder) / "labels.csv", newline="") as file:
            rows += csv.DictReader(file)
    return rows


def mean_text(rows: Sequence[Row], column: str) -> str:
    values = [float(row[column]) for row in rows if row[column]]
    return f"{statistics.fmean(values):.1f}" if values else ""


def line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def table_of_groups(rules: Sequence[tuple[str, list[Row]]]) -> str:
    lines = [line(["rule", "group", "candidates", "AUC", "AUC against the true keypoints", "PA-MPJPE", "PA-MPVPE"]),
             "|---|---|---|---|---|---|---|"]
    for name, rows in rules:
        for group, bodies, verdicts in GROUPS:
            members = [row for row in rows if row["verdict"] in verdicts]
            if members:
                lines.append(line([name, group, str(len(members)),
                                   *(mean_text(members, f"{bodies}_{metric}") for metric in METRICS)]))
    return "\n".join(lines)


def bin_of(error: float) -> int:
    return sum(error >= edge for edge in EDGES)


def table_by_error(rows: Sequence[Row]) -> str:
    bins: list[list[Row]] = [[] for _ in range(len(EDGES) + 1)]
    for row in rows:
        if row["prediction_l_proj"]:
            bins[bin_of(float(row["prediction_l_proj"]))].append(row)
    names = [f"below {EDGES[0]}", *(f"{a} to {b}" for a, b in zip(EDGES, EDGES[1:])), f"{EDGES[-1]} and more"]
    return "\n".join([line(["L_proj of the prediction", *names]), "|---" * (len(names) + 1) + "|",
                      line(["pictures", *(str(len(members)) for members in bins)]),
                      line(["AUC", *(mean_text(members, "prediction_auc") for members in bins)]),
                      line(["PA-MPJPE", *(mean_text(members, "prediction_pa_mpjpe_mm") for members in bins)])])


def rule_of(text: str) -> tuple[str, list[Row]]:
    name, separator, folders = text.partition("=")
    if not separator:
        raise argparse.ArgumentTypeError(f"got {text}, expected NAME=POOL,POOL...")
    return name, read_pools(folders.split(","))


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--by-error", action="store_true", help="a row for each range of L_proj")
    parser.add_argument("inputs", nargs="+", metavar="POOL")
    options = parser.parse_args(arguments)
    try:
        if options.by_error:
            print(table_by_error(read_pools(options.inputs)))
        else:
            print(table_of_groups([rule_of(text) for text in options.inputs]))
    except (OSError, argparse.ArgumentTypeError) as error:
        parser.error(str(error))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
