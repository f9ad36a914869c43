#!/usr/bin/env python3
"""Runs the benchmarks of the network and of the feed beside their baselines, and says what bounds each.

    python bench/run.py BUILD [--threads 1] [--rounds 3] [--without-adaptation] [--out bench/results.json]

BUILD is a build folder with benchmarks (`make bench` calls this). Ours and the baseline take turns in every round, and
the table has the medians: compare the rows of one run with each other. CPU seconds count all threads; beside other
work on the machine they say more than wall time. The full-size network needs 6 GB of memory, and the baseline's
adaptation a minute of CPU a round.

The bounds come from the same run: the rate at which packed matrices multiply, and the operations that the work needs.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import platform
import re
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[1]
# Operations a picture at the released sizes, counted from the shapes of the matrix products: both encoders and the
# decoder once; keys and values of the image; and one pass of the decoder's 53 tokens, of which only one leaves the last
# layer. An iteration of adaptation is a pass forward and one back to the tokens.
PREDICT_GFLOP = 249 + 34 + 22
KEYS_GFLOP = 7.6
PASS_GFLOP = 13.5
PRODUCT_GFLOP = 2e-9 * 8 * 193 * 1280 * 5120  # of a MatrixRate, whose time is in milliseconds
ITERATIONS = 10
BATCH = 8


def ours(build: pathlib.Path, dtype: str, threads: int) -> dict[str, dict[str, float]]:
    pattern = f"(Predict|Adapt)/vith/{dtype}/{BATCH}/|MatrixRate/.*/{dtype}/"
    command = [str(build / "bench/model_bench"), f"--benchmark_filter={pattern}", "--benchmark_format=json",
               "--benchmark_min_time=0.2"]
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads), "OMP_WAIT_POLICY": "PASSIVE"}
    answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    found = {}
    for row in json.loads(answer.stdout)["benchmarks"]:
        name = row["name"].split("/")
        if name[0] == "MatrixRate":
            found[f"{name[1]} rate"] = {"gflop_a_second": PRODUCT_GFLOP / row["cpu_time"] * 1e3}
        else:
            each = 1000 * BATCH
            found[name[0].lower()] = {"wall_s": row["real_time"] / each, "cpu_s": row["cpu_time"] / each,
                                      "peak_gb": row["peak_GB"]}
    return found


def baseline(dtype: str, threads: int, iterations: int) -> dict[str, dict[str, float]]:
    with tempfile.TemporaryDirectory() as folder:
        answer = pathlib.Path(folder, "answer.json")
        subprocess.run([sys.executable, str(ROOT / "tools/bench_peer.py"), "--dtype", dtype, "--threads", str(threads),
                        "--rounds", "1", "--iterations", str(iterations), "--json", str(answer)], check=True,
                       env={**os.environ, "OMP_WAIT_POLICY": "PASSIVE"}, stdout=subprocess.DEVNULL)
        return json.loads(answer.read_text())["rows"]


def feed(build: pathlib.Path) -> dict[str, float]:
    answer = subprocess.run([str(build / "bench/feed_bench"), "5"], capture_output=True, text=True, check=True)
    found = re.search(r"^1 threads: .* (\d+) a CPU second", answer.stdout, re.MULTILINE)
    bound = re.search(r"^decoding alone: (\d+) crops a CPU second", answer.stdout, re.MULTILINE)
    assert found and bound, answer.stdout
    return {"samples_a_cpu_second": float(found[1]), "whole_crops_decoded_a_cpu_second": float(bound[1])}


def median(rounds: list[dict[str, dict[str, float]]]) -> dict[str, dict[str, float]]:
    return {name: {key: statistics.median(each[name][key] for each in rounds) for key in rounds[0][name]}
            for name in rounds[0]}


def network_rows(dtype: str, own: dict[str, dict[str, float]], peer: dict[str, dict[str, float]]) -> list[str]:
    rate = max(own["packed rate"]["gflop_a_second"], own["linear rate"]["gflop_a_second"])
    predict_bound = PREDICT_GFLOP / rate
    best = min(row["cpu_s"] for name, row in peer.items() if name.startswith("predict"))
    rows = [f"predict, {dtype}", f"{own['predict']['cpu_s']:.2f}", f"{own['predict']['wall_s']:.2f}", f"{best:.2f}",
            f"{best / own['predict']['cpu_s']:.2f}", f"{predict_bound:.2f}"]
    table = [" | ".join(rows)]
    slow = peer.get(f"adapt, {ITERATIONS} iterations")
    if slow:
        both = own["predict"]["cpu_s"] + own["adapt"]["cpu_s"]
        wall = own["predict"]["wall_s"] + own["adapt"]["wall_s"]
        bound = (PREDICT_GFLOP + KEYS_GFLOP + (2 * ITERATIONS + 1) * PASS_GFLOP) / rate
        rows = [f"predict and {ITERATIONS} iterations, {dtype}", f"{both:.2f}", f"{wall:.2f}", f"{slow['cpu_s']:.2f}",
                f"{slow['cpu_s'] / both:.2f}", f"{bound:.2f}"]
        table.append(" | ".join(rows))
    return table


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--dtypes", nargs="*", default=["float32", "bfloat16"])
    parser.add_argument("--without-adaptation", action="store_true", help="leaves the baseline's adaptation out")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "bench/results.json")
    options = parser.parse_args()
    results: dict[str, object] = {"machine": platform.processor() or platform.machine(), "threads": options.threads,
                                  "rounds": options.rounds}
    lines = []
    for dtype in options.dtypes:
        own, peer = [], []
        for _ in range(options.rounds):
            own.append(ours(options.build, dtype, options.threads))
            peer.append(baseline(dtype, options.threads, 0 if options.without_adaptation else ITERATIONS))
        results[dtype] = {"ours": median(own), "baseline": median(peer)}
        lines += network_rows(dtype, median(own), median(peer))
        rates = median(own)
        lines.append(f"matrix products, {dtype}: linear {rates['linear rate']['gflop_a_second']:.0f} and packed "
                     f"{rates['packed rate']['gflop_a_second']:.0f} GFLOP/s")
    found = feed(options.build)
    results["feed"] = found
    lines.append(f"feed, one thread: {found['samples_a_cpu_second']:.0f} samples a CPU second; whole crops decoded: "
                 f"{found['whole_crops_decoded_a_cpu_second']:.0f}")
    options.out.write_text(json.dumps(results, indent=1) + "\n")
    print("what | CPU s a picture | wall s | baseline, CPU s | ratio | bound, CPU s")
    print("\n".join(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
