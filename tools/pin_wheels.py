#!/usr/bin/env python3
"""Writes tools/requirements.txt and tools/requirements-tests.txt: the version and SHA-256 of every wheel that the .in
file of the same name needs.

  pin_wheels.py                     writes both
  pin_wheels.py requirements-tests  writes this one

Run it after changing a .in file, and review the difference. It asks pip to resolve the requirements for each of PYTHONS
on each of MACHINES, without installing anything. Where the package index does not offer the wheels' metadata, pip has
to download the wheels: about 3 GB for each combination. The packages of requirements-tests.txt are installed into the
environment of requirements.txt, so they are resolved with the versions that are pinned there.

A package without any wheel is named in a line `--no-binary NAME` of the .in file. Its source archive is pinned.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import urllib.parse

import check_wheels

HERE = pathlib.Path(__file__).resolve().parent
BUILD, TESTS = "requirements", "requirements-tests"
PYTHONS = ("3.11", "3.12")  # Debian 12, Ubuntu 24.04
MACHINES = ("x86_64", "aarch64")
GLIBC_MINOR = 36  # Debian 12 has glibc 2.36, Ubuntu 24.04 has 2.39
NO_WHEEL = re.compile(r"^--no-binary (\S+)\n", re.MULTILINE)

Packages = dict[str, tuple[str, str, str]]  # name -> (version, file name of the archive, its SHA-256)


def report_of(*options: str) -> Packages:
    """Returns what `pip install` with these options would install. Throws CalledProcessError."""
    with tempfile.TemporaryDirectory() as folder:
        report = pathlib.Path(folder) / "report.json"
        command = [sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", "--no-cache-dir"]
        command += ["--quiet", "--disable-pip-version-check", "--report", str(report), *options]
        subprocess.run(command, check=True, stdout=sys.stderr)
        items = json.loads(report.read_text(encoding="utf-8"))["install"]
    found = {}
    for item in items:
        name = item["metadata"]["name"].lower().replace("_", "-")
        archive = urllib.parse.unquote(item["download_info"]["url"].rpartition("/")[2])
        found[name] = (item["metadata"]["version"], archive, item["download_info"]["archive_info"]["hashes"]["sha256"])
    return found


def sources(text: str, folder: pathlib.Path) -> Packages:
    """Returns the source archives of the packages that a .in file names in `--no-binary`, and puts a wheel of each into
    a folder: pip resolves for another machine only where it finds wheels."""
    pinned = check_wheels.pins(text)
    found = {}
    for name in NO_WHEEL.findall(text):
        requirement = f"{name}=={pinned[name]}"
        found |= report_of("--no-deps", "--no-binary", name, requirement)
        command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps"]
        subprocess.run([*command, "--wheel-dir", str(folder), requirement], check=True, stdout=sys.stderr)
    return found


def resolve(python: str, machine: str, requirements: pathlib.Path, constraints: pathlib.Path) -> Packages:
    """Returns the wheels that a file of requirements needs.

    pip evaluates environment markers for the Python that runs this script, not for the target. The result is right as
    long as no requirement depends on the version of Python or on the machine. Throws CalledProcessError.
    """
    platforms = [f"manylinux_2_{minor}_{machine}" for minor in range(5, GLIBC_MINOR + 1)] + [f"manylinux2014_{machine}"]
    options = ["--only-binary", ":all:", "--implementation", "cp", "--python-version", python]
    options += ["--find-links", str(requirements.parent), "--target", str(requirements.parent / "none")]
    options += ["--requirement", str(requirements), "--constraint", str(constraints)]
    for platform in platforms:
        options += ["--platform", platform]
    return report_of(*options)


def render(source: str, resolved: list[Packages], without_wheel: list[str]) -> str:
    """Returns the text of the .txt file. Throws ValueError when a package has different versions on the targets."""
    lines = [
        f"# CPython {', '.join(PYTHONS)} on Linux ({', '.join(MACHINES)})",
        f"# tools/pin_wheels.py writes this file from {source}. pip accepts these wheels and no others.",
        *(f"--no-binary {name}" for name in without_wheel),
    ]
    faults = []
    for name in sorted(set().union(*resolved)):
        entries = [packages[name] for packages in resolved if name in packages]
        versions = {version for version, _, _ in entries}
        if len(versions) > 1:
            faults.append(f"{name} ({', '.join(sorted(versions))})")
        archives = {archive: digest for _, archive, digest in entries}
        lines += [f"#   {archive}" for archive in archives]
        hashes = [f"--hash=sha256:{digest}" for digest in archives.values()]
        lines.append(" \\\n    ".join([f"{name}=={versions.pop()}", *hashes]))
    if faults:
        raise ValueError(f"several versions of: {'; '.join(faults)}. Pin one of each in {source}")
    return "\n".join(lines) + "\n"


def write(name: str) -> None:
    """Writes NAME.txt from NAME.in."""
    source, target = HERE / f"{name}.in", HERE / f"{name}.txt"
    text = source.read_text(encoding="utf-8")
    # Packages that the first list pins are already present and are not pinned again.
    there = check_wheels.pins((HERE / f"{BUILD}.txt").read_text(encoding="utf-8")) if name == TESTS else {}
    with tempfile.TemporaryDirectory() as home:
        folder = pathlib.Path(home)
        archives = sources(text, folder)
        requirements, constraints = folder / "requirements.in", folder / "constraints.txt"
        requirements.write_text(NO_WHEEL.sub("", text), encoding="utf-8")
        constraints.write_text("".join(f"{package}=={version}\n" for package, version in there.items()))
        resolved = []
        for python in PYTHONS:
            for machine in MACHINES:
                print(f"pin_wheels: {name}: resolving for CPython {python} on {machine}", file=sys.stderr)
                found = resolve(python, machine, requirements, constraints) | archives
                resolved.append({package: entry for package, entry in found.items() if package not in there})
    target.write_text(render(source.name, resolved, list(archives)), encoding="utf-8")
    print(f"pin_wheels: {target} pins {len(set().union(*resolved))} packages", file=sys.stderr)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lists", nargs="*", metavar="LIST")
    lists = parser.parse_args().lists or [BUILD, TESTS]
    if unknown := set(lists) - {BUILD, TESTS}:
        parser.error(f"unknown list: {', '.join(sorted(unknown))}; expected {BUILD} or {TESTS}")
    for name in lists:
        write(name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
