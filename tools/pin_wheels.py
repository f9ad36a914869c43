#!/usr/bin/env python3
"""Writes tools/requirements.txt: the version and SHA-256 of every wheel that tools/requirements.in needs.

Run it after changing requirements.in, and review the difference. It asks pip to resolve the requirements for each of
PYTHONS on each of MACHINES, without installing anything. Where the package index does not offer the wheels' metadata,
pip has to download the wheels: about 3 GB for each combination.
"""

from __future__ import annotations

import json
import pathlib
import subprocess
import sys
import tempfile
import urllib.parse

HERE = pathlib.Path(__file__).resolve().parent
SOURCE, TARGET = HERE / "requirements.in", HERE / "requirements.txt"
PYTHONS = ("3.11", "3.12")  # Debian 12, Ubuntu 24.04
MACHINES = ("x86_64", "aarch64")
GLIBC_MINOR = 36  # Debian 12 has glibc 2.36, Ubuntu 24.04 has 2.39


def resolve(python: str, machine: str) -> dict[str, tuple[str, str, str]]:
    """Returns {name: (version, file name of the wheel, its SHA-256)}.

    pip evaluates environment markers for the Python that runs this script, not for the target. The result is right as
    long as no requirement depends on the version of Python or on the machine. Throws CalledProcessError.
    """
    platforms = [f"manylinux_2_{minor}_{machine}" for minor in range(5, GLIBC_MINOR + 1)] + [f"manylinux2014_{machine}"]
    with tempfile.TemporaryDirectory() as folder:
        report = pathlib.Path(folder) / "report.json"
        command = [sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", "--no-cache-dir"]
        command += ["--quiet", "--disable-pip-version-check", "--only-binary", ":all:", "--target", folder]
        command += ["--implementation", "cp", "--python-version", python, "--report", str(report)]
        command += ["--requirement", str(SOURCE)]
        for platform in platforms:
            command += ["--platform", platform]
        subprocess.run(command, check=True, stdout=sys.stderr)
        items = json.loads(report.read_text(encoding="utf-8"))["install"]
    found = {}
    for item in items:
        name = item["metadata"]["name"].lower().replace("_", "-")
        wheel = urllib.parse.unquote(item["download_info"]["url"].rpartition("/")[2])
        found[name] = (item["metadata"]["version"], wheel, item["download_info"]["archive_info"]["hashes"]["sha256"])
    return found


def render(resolved: list[dict[str, tuple[str, str, str]]]) -> str:
    """Returns the text of requirements.txt. Throws ValueError when a package has different versions on the targets."""
    lines = [
        f"# CPython {', '.join(PYTHONS)} on Linux ({', '.join(MACHINES)})",
        "# tools/pin_wheels.py writes this file from requirements.in. pip accepts these wheels and no others.",
    ]
    faults = []
    for name in sorted(set().union(*resolved)):
        entries = [packages[name] for packages in resolved if name in packages]
        versions = {version for version, _, _ in entries}
        if len(versions) > 1:
            faults.append(f"{name} ({', '.join(sorted(versions))})")
        wheels = {wheel: digest for _, wheel, digest in entries}
        lines += [f"#   {wheel}" for wheel in wheels]
        hashes = [f"--hash=sha256:{digest}" for digest in wheels.values()]
        lines.append(" \\\n    ".join([f"{name}=={versions.pop()}", *hashes]))
    if faults:
        raise ValueError(f"several versions of: {'; '.join(faults)}. Pin one of each in {SOURCE.name}")
    return "\n".join(lines) + "\n"


def main() -> int:
    resolved = []
    for python in PYTHONS:
        for machine in MACHINES:
            print(f"pin_wheels: resolving for CPython {python} on {machine}", file=sys.stderr)
            resolved.append(resolve(python, machine))
    TARGET.write_text(render(resolved), encoding="utf-8")
    print(f"pin_wheels: {TARGET} pins {len(set().union(*resolved))} packages", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
