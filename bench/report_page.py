#!/usr/bin/env python3
"""How long a report takes to open in a browser, and what the browser complains about.

    apt-get install chromium chromium-driver
    python bench/report_page.py out/report/VERSION/report.html [--rounds 3] [--screenshot page.png] [--limit-s 3]

A round starts a new headless Chromium that has no network, opens the page, and waits until two frames were drawn after
the page was loaded. It prints when that was, how long the page's main thread computed until then, and every line of the
browser's console of level WARNING or above. Other work on the machine delays the page, but does not make the thread
compute longer, so --limit-s is compared with the thread's time unless --wall is given.

    python bench/report_page.py --repeat 78 configs/sample.json repeated.json

writes a config with every dataset of another config 78 times, under names that end in a number. A build of it has 78
times as many candidates, each with pictures, tables and labels of its own, which makes a report as large as that of a
full-size dataset. Each keeps its dataset's thresholds, and adaptation ends after ten iterations.

Exit codes: 0 all is well, 1 the console has an error or the slowest round took longer than --limit-s, 2 wrong usage.
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import json
import pathlib
import re
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from typing import Any

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


def repeat(times: int, source: pathlib.Path, target: pathlib.Path) -> int:
    """Writes the config with repeated datasets. Its paths become absolute."""
    text = re.sub(r"^\s*//.*$", "", source.read_text(encoding="utf-8"), flags=re.MULTILINE)
    config = json.loads(text)

    def absolute(path: str) -> str:
        return str((source.parent / path).resolve())

    for dataset in config["datasets"]:
        dataset["root"] = absolute(dataset["root"])
    for section, key in (("network", "checkpoint"), ("network", "smal_asset"), ("guards", "priors")):
        if key in config.get(section, {}):
            config[section][key] = absolute(config[section][key])
    config["datasets"] = [{**dataset, "name": f"{dataset['name']}_{number:03}"}
                          for number in range(times) for dataset in config["datasets"]]
    config["name"] += "-repeated"
    config.setdefault("tta", {})["iterations_max"] = 10
    config["shards"] = {"unit_size": 512}
    target.write_text(json.dumps(config, indent=1) + "\n", encoding="utf-8")
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, metavar="TIMES")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--limit-s", type=float, default=3.0)
    parser.add_argument("--wall", action="store_true", help="compare the time of the clock: for a machine that is idle")
    parser.add_argument("--screenshot", type=pathlib.Path)
    parser.add_argument("page", type=pathlib.Path, help="report.html, or a config after --repeat")
    parser.add_argument("target", type=pathlib.Path, nargs="?", help="the config to write, after --repeat")
    options = parser.parse_args()
    if (options.repeat is None) != (options.target is None):
        parser.error("--repeat TIMES needs two files: the config to read and the config to write")
    if options.repeat is not None:
        return repeat(options.repeat, options.page, options.target)
    return measure(options)


if __name__ == "__main__":
    sys.exit(main())
