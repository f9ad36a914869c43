#!/usr/bin/env python3
"""Says how well each trust score finds bad labels, on pools whose truth is known, and fits the combined score.

    tools/trust_scores.py POOL...          a table: each score against the true error of the labels
    tools/trust_scores.py --fit POOL...    the weights of the combined score, as filters/trust.cpp holds them: those of
                                           retained and those of refined labels. A label is good if its error is at most
                                           what three quarters of the first pool's labels reach

POOL is a folder with labels.csv (of `quadruped3d evaluate-labels --report POOL`) and verdicts.csv (of the build that it
measured). Labels of the network with a true body count; others are left out.

Of each score the table has the rank correlation with PA-MPJPE (Spearman), and the area under the ROC curve (AUROC) of
finding the worst quarter of each pool: 0.5 is chance, 1 finds all of them first. Both are computed in each pool and
averaged over pools. The interval holds 95 % of 2,000 bootstrap resamples of the pictures of every pool. `against L_proj`
is the difference of the AUROC to that of L_proj alone, on the same resamples. The second table cuts the pools to a share
of their labels by the combined score and by L_proj, and compares the mean error of what stays.
"""

from __future__ import annotations

import argparse
import csv
import pathlib
import sys
from dataclasses import dataclass
from typing import Callable, Sequence

import numpy as np

ERROR = "label_pa_mpjpe_mm"
WORST = 0.25
RESAMPLES = 2000
YIELDS = (0.9, 0.75, 0.5)


@dataclass(frozen=True)
class Score:
    name: str
    column: str
    bad_is: int  # 1: a large score speaks against the label; -1: a small one
    is_log: bool = False  # its logarithm has no long tail


L_PROJ = Score("L_proj of the label", "final_error", 1, True)
SCORES = (
    L_PROJ,
    Score("L_proj of the prediction", "initial_error", 1, True),
    Score("gain", "gain", -1),
    Score("trust_mirror", "trust_mirror", 1, True),
    Score("trust_aux_2d", "trust_aux_2d", 1, True),
    Score("trust_aux_3d", "trust_aux_3d", 1, True),
    Score("trust_pose_prior", "trust_pose_prior", 1),
    Score("trust_shape_prior", "trust_shape_prior", 1),
    Score("trust_limbs", "trust_limbs", 1, True),
    Score("trust_sides", "trust_sides", 1, True),
    Score("trust_mask", "trust_mask", -1),
    Score("trust_visible", "trust_visible", -1),
)
TRUST = Score("trust", "trust", -1)
# The terms of the combined score, for each kind of label. For a refined label, L_proj of the prediction is more
# informative than that of the label, which adaptation makes small even if the body is wrong. For a retained label, no
# other score improved on L_proj in cross-validation.
FITTED = {"retained": ("initial_error",),
          "refined": ("initial_error", "trust_aux_2d", "gain", "trust_visible")}


@dataclass
class Pool:
    pictures: np.ndarray  # of each label, as numbers
    error: np.ndarray  # PA-MPJPE in mm
    names: list[str]  # ids
    kinds: np.ndarray  # "retained" or "refined"
    columns: dict[str, np.ndarray]

    def values(self, score: Score) -> np.ndarray:
        """The score's numbers, large = bad. What was not measured counts as the median."""
        values = self.columns[score.column]
        if score.is_log:
            values = np.log(np.maximum(values, 1e-6))
        known = np.isfinite(values)
        if not known.any():
            return np.zeros(len(values))
        return score.bad_is * np.where(known, values, np.median(values[known]))

    def is_measured(self, score: Score) -> bool:
        return bool(np.isfinite(self.columns[score.column]).any())


def number(text: str) -> float:
    return float(text) if text else float("nan")


def read_rows(path: pathlib.Path) -> dict[str, dict[str, str]]:
    with open(path, newline="") as file:
        return {row["id"]: row for row in csv.DictReader(file)}


def read_pool(folder: pathlib.Path) -> Pool:
    """Throws SystemExit that names the folder if it has no label to measure."""
    truth, verdicts = read_rows(folder / "labels.csv"), read_rows(folder / "verdicts.csv")
    kept = [name for name, row in verdicts.items()
            if row["verdict"] in ("retained", "refined") and row["trust_visible"] and truth.get(name, {}).get(ERROR)]
    if len(kept) < 8:
        raise SystemExit(f"{folder}: {len(kept)} labels of the network with a true body, expected 8 or more")
    columns = {score.column: np.array([number(verdicts[name][score.column]) for name in kept])
               for score in (*SCORES, TRUST)}
    # Retained labels were not adapted, so they have no gain.
    columns["gain"] = np.where(np.isfinite(columns["gain"]), columns["gain"], 0.0)
    names = [name.rsplit("#", 1)[0] for name in kept]
    return Pool(np.unique(names, return_inverse=True)[1], np.array([number(truth[name][ERROR]) for name in kept]), kept,
                np.array([verdicts[name]["verdict"] for name in kept]), columns)


def ranks(values: np.ndarray) -> np.ndarray:
    """Ranks from 1; equal values share the mean of their ranks."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(counts) - (counts - 1) / 2)[inverse]


def rank_correlation(score: np.ndarray, error: np.ndarray) -> float:
    """Spearman's; 0 where one of them does not vary."""
    a, b = ranks(score) - (len(score) + 1) / 2, ranks(error) - (len(error) + 1) / 2
    scale = np.sqrt(np.sum(a * a) * np.sum(b * b))
    return float(np.sum(a * b) / scale) if scale > 0 else 0.0


def worst_quarter(error: np.ndarray) -> np.ndarray:
    return error > np.quantile(error, 1 - WORST)


def auroc(score: np.ndarray, bad: np.ndarray) -> float:
    """The share of pairs of a bad and a good label in which the bad one has the larger score; ties count half."""
    count = int(bad.sum())
    if count in (0, len(bad)):
        return 0.5
    above = ranks(score)[bad].sum() - count * (count + 1) / 2
    return float(above / (count * (len(bad) - count)))


def mean_over(pools: Sequence[Pool], draws: Sequence[np.ndarray], measure: Callable[[Pool, np.ndarray], float]) -> float:
    return float(np.mean([measure(pool, draw) for pool, draw in zip(pools, draws)]))


def draws_of(pools: Sequence[Pool], resamples: int, seed: int) -> list[list[np.ndarray]]:
    """Per resample and pool the drawn labels: pictures with replacement, each with all its labels."""
    generator = np.random.default_rng(seed)
    members = [[np.flatnonzero(pool.pictures == k) for k in range(pool.pictures.max() + 1)] for pool in pools]
    return [[np.concatenate([own[k] for k in generator.integers(0, len(own), len(own))]) for own in members]
            for _ in range(resamples)]


def interval(pools: Sequence[Pool], draws: Sequence[Sequence[np.ndarray]],
             measure: Callable[[Pool, np.ndarray], float]) -> tuple[float, float, float]:
    """The measure on the pools as they are, and the ends of its 95 % interval."""
    whole = [np.arange(len(pool.error)) for pool in pools]
    resampled = [mean_over(pools, draw, measure) for draw in draws]
    return mean_over(pools, whole, measure), *np.quantile(resampled, [0.025, 0.975])


def auroc_of(score: Score) -> Callable[[Pool, np.ndarray], float]:
    return lambda pool, draw: auroc(pool.values(score)[draw], worst_quarter(pool.error[draw]))


def difference_of(score: Score) -> Callable[[Pool, np.ndarray], float]:
    own, base = auroc_of(score), auroc_of(L_PROJ)
    return lambda pool, draw: own(pool, draw) - base(pool, draw)


def kept_error(score: Score, share: float, pool: Pool, draw: np.ndarray) -> float:
    """The mean error of the share of the labels that the score trusts most."""
    count = max(1, round(share * len(draw)))
    order = np.argsort(pool.values(score)[draw], kind="stable")
    return float(np.mean(pool.error[draw][order[:count]]))


def text_of(values: tuple[float, float, float], decimals: int = 2, sign: str = "") -> str:
    return "{0:{f}} ({1:{f}} to {2:{f}})".format(*values, f=f"{sign}.{decimals}f")


def table(pools: Sequence[Pool], resamples: int = RESAMPLES, seed: int = 0) -> str:
    draws = draws_of(pools, resamples, seed)
    labels = sum(len(pool.error) for pool in pools)
    lines = [f"{len(pools)} pools, {labels} labels, PA-MPJPE {np.mean([p.error.mean() for p in pools]):.1f} mm", "",
             "| score | rank correlation | AUROC of the worst quarter | against L_proj |", "|---|---|---|---|"]
    for score in (*SCORES, TRUST):
        if not all(pool.is_measured(score) for pool in pools):
            lines.append(f"| {score.name} | not measured in every pool | | |")
            continue
        correlation = interval(pools, draws, lambda pool, draw: rank_correlation(pool.values(score)[draw],
                                                                                 pool.error[draw]))
        lines.append("| {} | {} | {} | {} |".format(
            score.name, text_of(correlation), text_of(interval(pools, draws, auroc_of(score))),
            "" if score is L_PROJ else text_of(interval(pools, draws, difference_of(score)), sign="+")))
    if not all(pool.is_measured(TRUST) for pool in pools):
        return "\n".join(lines)
    lines += ["", "| labels kept | by L_proj, mm | by trust, mm | difference, mm |", "|---|---|---|---|"]
    for share in YIELDS:
        def error_by(score, share=share):
            return lambda pool, draw: kept_error(score, share, pool, draw)
        by_l_proj, by_trust = error_by(L_PROJ), error_by(TRUST)
        change = interval(pools, draws, lambda pool, draw: by_trust(pool, draw) - by_l_proj(pool, draw))
        whole = [np.arange(len(pool.error)) for pool in pools]
        lines.append(f"| {share:.0%} | {mean_over(pools, whole, by_l_proj):.1f} | "
                     f"{mean_over(pools, whole, by_trust):.1f} | {text_of(change, 1, '+')} |")
    return "\n".join(lines)


@dataclass
class Fit:
    kind: str
    labels: int
    bias: float
    terms: list[tuple[str, float, float, float]]  # column, mean, deviation, weight


def logistic_regression(inputs: np.ndarray, good: np.ndarray, penalty: float) -> np.ndarray:
    """The bias and the weights, by Newton's method. `penalty` is that of the squared weights, without the bias."""
    inputs = np.concatenate([np.ones((len(inputs), 1)), inputs], 1)
    weights = np.zeros(inputs.shape[1])
    ridge = penalty * np.diag([0.0] + [1.0] * (len(weights) - 1))
    for _ in range(50):
        chance = 1 / (1 + np.exp(-inputs @ weights))
        gradient = inputs.T @ (good - chance) - ridge @ weights
        hessian = inputs.T @ (inputs * (chance * (1 - chance))[:, None]) + ridge
        step = np.linalg.solve(hessian, gradient)
        weights += step
        if np.abs(step).max() < 1e-10:
            break
    return weights


def good_bound(pools: Sequence[Pool]) -> float:
    """The error in mm that three quarters of the first pool's labels reach: at most this is good."""
    return float(np.quantile(pools[0].error, 1 - WORST))


def chosen_labels(pools: Sequence[Pool], kind: str) -> list[np.ndarray]:
    """Of each pool the labels of the kind, without those that an earlier pool has: two builds of one pool share many."""
    seen: set[str] = set()
    chosen = []
    for pool in pools:
        chosen.append(np.array([k for k in np.flatnonzero(pool.kinds == kind) if pool.names[k] not in seen], dtype=int))
        seen.update(pool.names[k] for k in chosen[-1])
    return chosen


def fit(pools: Sequence[Pool], kind: str, penalty: float = 1.0) -> Fit:
    """Logistic regression of "the label is good" on the standardised scores of the labels of one kind."""
    scores = [next(score for score in SCORES if score.column == column) for column in FITTED[kind]]
    chosen = chosen_labels(pools, kind)
    raw = np.concatenate([np.stack([pool.values(score)[own] * score.bad_is for score in scores], 1)
                          for pool, own in zip(pools, chosen)])
    if len(raw) < 20:
        raise SystemExit(f"{len(raw)} {kind} labels with a true body, expected 20 or more to fit their trust")
    good = np.concatenate([pool.error[own] <= good_bound(pools) for pool, own in zip(pools, chosen)]).astype(float)
    mean, deviation = raw.mean(0), np.maximum(raw.std(0), 1e-9)
    weights = logistic_regression((raw - mean) / deviation, good, penalty)
    return Fit(kind, len(raw), float(weights[0]), [(column, float(m), float(d), float(w))
                                   for column, m, d, w in zip(FITTED[kind], mean, deviation, weights[1:])])


def describe(result: Fit) -> str:
    lines = [f"{result.kind}: {result.labels} labels, bias {result.bias:.4g}",
             "  column, mean, deviation, weight of the log odds (of the logarithm where is_log):"]
    lines += [f"  {column:<18} {mean:8.4g} {deviation:8.4g} {weight:+8.4g}" for column, mean, deviation, weight in
              result.terms]
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fit", action="store_true", help="fit the combined score instead")
    parser.add_argument("--resamples", type=int, default=RESAMPLES)
    parser.add_argument("--seed", type=int, default=0, help="of the resamples")
    parser.add_argument("pools", nargs="+", type=pathlib.Path, metavar="POOL")
    options = parser.parse_args(arguments)
    pools = [read_pool(folder) for folder in options.pools]
    if options.fit:
        print(f"good: at most {good_bound(pools):.1f} mm")
        print("\n".join(describe(fit(pools, kind)) for kind in FITTED))
    else:
        print(table(pools, options.resamples, options.seed))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
