#!/usr/bin/env python3
"""Puts plotly.min.js, which draws the report's charts, into a file: tools/fetch_plotly.py FILE

CMake runs it when it configures. It takes the library from PyPI's package `plotly` with pip, so pip's settings hold
(an index, a proxy, PIP_NO_INDEX with PIP_FIND_LINKS where there is no network), and accepts no other wheel and no other
file than those pinned here. A file that is there already and right is left alone.

To move to another version, change VERSION and both digests, and look at a report with your own eyes.
"""

from __future__ import annotations

import hashlib
import pathlib
import subprocess
import sys
import tempfile
import zipfile

VERSION = "7.1.0"  # of the package; it holds plotly.js 4.1.1
WHEEL_SHA256 = "dbb7fa18afce40d0a8e80d1bf162eceb3faa0ce5a77fe741ad09a74cf78f53f3"
SCRIPT = "plotly/package_data/plotly.min.js"
SCRIPT_SHA256 = "3b6e15d45dbb7fca5bd2094291e961ddc5472cd887009e6009a56dab668d721f"


def is_right(path: pathlib.Path) -> bool:
    return path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == SCRIPT_SHA256


def download() -> bytes:
    """The script, from a wheel that pip has compared with its digest. Throws CalledProcessError and ValueError."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        pins = folder / "requirements.txt"
        pins.write_text(f"plotly=={VERSION} --hash=sha256:{WHEEL_SHA256}\n")
        subprocess.run([sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps",
                        "--only-binary", ":all:", "--require-hashes", "--dest", name, "--requirement", str(pins)],
                       check=True, stdout=sys.stderr)
        wheel, = folder.glob("plotly-*.whl")
        with zipfile.ZipFile(wheel) as archive:
            script = archive.read(SCRIPT)
    got = hashlib.sha256(script).hexdigest()
    if got != SCRIPT_SHA256:
        raise ValueError(f"{SCRIPT} of plotly {VERSION} has SHA-256 {got}, expected {SCRIPT_SHA256}")
    return script


def main() -> int:
    if len(sys.argv) != 2:
        print(__doc__.splitlines()[0], file=sys.stderr)
        return 2
    target = pathlib.Path(sys.argv[1])
    if is_right(target):
        return 0
    try:
        script = download()
    except (subprocess.CalledProcessError, ValueError) as error:
        print(f"fetch_plotly: {error}", file=sys.stderr)
        print("fetch_plotly: without a network, put the wheel into a folder and set PIP_NO_INDEX=1 and "
              "PIP_FIND_LINKS=FOLDER (docs/install.md, \"Offline\")", file=sys.stderr)
        return 1
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_suffix(".tmp")
    temporary.write_bytes(script)
    temporary.replace(target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
