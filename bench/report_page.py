#!/usr/bin/env python3
"""How long a report takes to open in a browser, and what the browser complains about.

    apt-get install chromium chromium-driver
    python bench/report_page.py out/report/VERSION/report.html [--rounds 3] [--screenshot page.png] [--limit-s 3]

A round starts a new headless Chromium that has no network, opens the page, and waits until two frames were drawn after
the page was loaded. It prints when that was, how long the page's main thread computed until then, and every line of the
browser's console of level WARNING or above. Other work on the machine delays the page, but does not make the thread
compute longer, so --limit-s is compared with the thread's time unless --wall is given.

    python bench/report_page.py --repeat 78 out/latest repeated

writes a version with every candidate of another version 78 times, each time under another id, in a few seconds instead
of the hours of a build: as many shards, rows of verdicts.csv and counts, which makes a report as large as that of a
full-size dataset. It lacks the tables of the stages, so nothing is known of where the keypoints of dropped candidates
lie.

Exit codes: 0 all is well, 1 the console has an error or the slowest round took longer than --limit-s, 2 wrong usage.
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import csv
import hashlib
import json
import pathlib
import shutil
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from typing import Any

import h5py
import numpy as np

BROWSER = ["--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1280,1000", "--proxy-server=127.0.0.1:9"]
DRAWN = """
const done = arguments[0];
requestAnimationFrame(() => requestAnimationFrame(() => {
  const entry = performance.getEntriesByType("navigation")[0];
  done({loaded: entry.loadEventEnd / 1000, drawn: performance.now() / 1000});
}));
"""


class Driver:
    """A session of WebDriver, which is JSON over HTTP."""

    def __init__(self, port: int) -> None:
        self.base = f"http://127.0.0.1:{port}"
        chrome = {"goog:chromeOptions": {"args": BROWSER}, "goog:loggingPrefs": {"browser": "ALL"}}
        session = self.call("/session", {"capabilities": {"alwaysMatch": {"browserName": "chrome", **chrome}}})
        self.base += f"/session/{session['sessionId']}"

    def call(self, path: str, body: dict[str, Any] | None = None, method: str | None = None) -> Any:
        content = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.base + path, content, {"Content-Type": "application/json"}, method=method)
        with urllib.request.urlopen(request, timeout=300) as answer:
            return json.load(answer)["value"]

    def devtools(self, command: str, **parameters: Any) -> Any:
        """Chromium's own protocol."""
        return self.call("/goog/cdp/execute", {"cmd": command, "params": parameters})


@contextlib.contextmanager
def driver() -> Iterator[Driver]:
    """A new browser. Exits with 2 where chromedriver is not installed."""
    try:
        process = subprocess.Popen(["chromedriver", "--port=0"], stdout=subprocess.PIPE, text=True)
    except FileNotFoundError:
        print("report_page.py: chromedriver is not installed: apt-get install chromium chromium-driver", file=sys.stderr)
        sys.exit(2)
    try:
        assert process.stdout is not None
        port = next(int(line.split()[-1].rstrip(".")) for line in process.stdout if "started successfully" in line)
        session = Driver(port)
        try:
            yield session
        finally:
            session.call("", method="DELETE")
    finally:
        process.terminate()
        process.wait()


def open_page(page: pathlib.Path, screenshot: pathlib.Path | None) -> tuple[dict[str, float], list[dict[str, Any]]]:
    """The times of one round in seconds, and the lines of the console."""
    with driver() as browser:
        browser.devtools("Performance.enable", timeDomain="threadTicks")
        browser.call("/url", {"url": page.resolve().as_uri()})
        times = browser.call("/execute/async", {"script": DRAWN, "args": []})
        metrics = {entry["name"]: entry["value"] for entry in browser.devtools("Performance.getMetrics")["metrics"]}
        times["computed"] = metrics["TaskDuration"]
        if screenshot:
            screenshot.write_bytes(base64.b64decode(browser.call("/screenshot")))
        lines = browser.call("/se/log", {"type": "browser"})
    return times, [line for line in lines if line["level"] in ("WARNING", "SEVERE")]


def measure(options: argparse.Namespace) -> int:
    rounds = [open_page(options.page, options.screenshot) for _ in range(options.rounds)]
    for number, (times, lines) in enumerate(rounds):
        print(f"round {number}: loaded after {times['loaded']:.2f} s, drawn after {times['drawn']:.2f} s, "
              f"computed for {times['computed']:.2f} s")
        for line in lines:
            print(f"  {line['level']}: {line['message']}")
    slowest = max(times["drawn" if options.wall else "computed"] for times, _ in rounds)
    print(f"{options.page.stat().st_size / 1e6:.1f} MB; the slowest round: {slowest:.2f} s")
    failed = any(line["level"] == "SEVERE" for _, lines in rounds for line in lines)
    return 1 if failed or slowest > options.limit_s else 0


def multiplied(value: Any, times: int) -> Any:
    """Counts in a JSON value times a number. Means and other numbers that are not whole stay."""
    if isinstance(value, dict):
        return {key: multiplied(entry, times) for key, entry in value.items()}
    return value * times if isinstance(value, int) and not isinstance(value, bool) else value


def copied_shard(source: pathlib.Path, target: pathlib.Path, unit: int, suffix: str) -> str:
    """Copies a shard under another unit's number, its ids with a suffix, and returns its SHA-256."""
    shutil.copyfile(source, target)
    with h5py.File(target, "r+") as shard:
        ids = np.array([name + suffix.encode() for name in shard["id"][:]])
        attributes = dict(shard["id"].attrs)
        del shard["id"]
        shard.create_dataset("id", data=ids).attrs.update(attributes)
        del shard.attrs["unit"]
        shard.attrs["unit"] = np.bytes_(str(unit))
    return hashlib.sha256(target.read_bytes()).hexdigest()


def repeat(times: int, source: pathlib.Path, target: pathlib.Path) -> int:
    """Writes a version of a dataset's candidates, `times` times. `target` must not exist."""
    manifest = json.loads((source / "dataset.json").read_text(encoding="utf-8"))
    with open(source / "verdicts.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    (target / "shards").mkdir(parents=True)
    entries, repeated = [], []
    for copy in range(times):
        suffix, first = f"-{copy:04}", len(entries)
        for entry in manifest["shards"]:
            unit = len(entries)
            name = f"shards/{unit:06}.h5"
            digest = copied_shard(source / entry["file"], target / name, unit, suffix)
            size = (target / name).stat().st_size
            entries.append({**entry, "file": name, "unit": unit, "bytes": size, "sha256": digest})
        repeated += [{**row, "id": row["id"] + suffix,
                      "shard": str(int(row["shard"]) + first) if row["shard"] else ""} for row in rows]
    with open(target / "verdicts.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(repeated)
    for key in ("counts", "labels", "statistics"):
        manifest[key] = multiplied(manifest[key], times)
    content = hashlib.sha256("".join(entry["sha256"] + "\n" for entry in entries).encode()).hexdigest()
    verdicts = hashlib.sha256((target / "verdicts.csv").read_bytes()).hexdigest()
    manifest |= {"shards": entries, "content_id": content, "key": content,
                 "verdicts": {"file": "verdicts.csv", "sha256": verdicts}}
    manifest.pop("digest")
    text = json.dumps(manifest, indent=2).removesuffix("\n}") + ",\n"
    seal = hashlib.sha256(text.encode()).hexdigest()  # manifests/sealed_json.h
    (target / "dataset.json").write_text(f'{text}  "digest": "{seal}"\n}}\n', encoding="utf-8")
    print(f"{target}: {len(repeated)} candidates, {manifest['counts']['retained'] + manifest['counts']['refined']} kept")
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, metavar="TIMES")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--limit-s", type=float, default=3.0)
    parser.add_argument("--wall", action="store_true", help="compare the time of the clock: for a machine that is idle")
    parser.add_argument("--screenshot", type=pathlib.Path)
    parser.add_argument("page", type=pathlib.Path, help="report.html, or a version's folder after --repeat")
    parser.add_argument("target", type=pathlib.Path, nargs="?", help="the folder to write, after --repeat")
    options = parser.parse_args()
    if (options.repeat is None) != (options.target is None):
        parser.error("--repeat TIMES needs two folders: the version to read and the one to write")
    if options.repeat is not None:
        return repeat(options.repeat, options.page, options.target)
    return measure(options)


if __name__ == "__main__":
    sys.exit(main())
