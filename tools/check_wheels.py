#!/usr/bin/env python3
"""Lists the pinned packages that are incomplete in the environment of the Python that runs it.

  check_wheels.py requirements.txt            prints the packages that are absent, of another version, or lack files
  check_wheels.py --forget requirements.txt   prints those that lack files, and removes their metadata, after which pip
                                              installs them anew; pip does not notice that they are incomplete

Exit codes: 0 all are complete, 1 the printed ones are not, 2 wrong usage.
"""

from __future__ import annotations

import argparse
import csv
import importlib.metadata
import pathlib
import re
import shutil
import sys
import sysconfig

PIN = re.compile(r"^([A-Za-z0-9._-]+)==([^ ;\\]+)")


def pins(requirements: str) -> dict[str, str]:
    """Returns the name and version of every package that a requirements file pins with `==`."""
    found = (PIN.match(line) for line in requirements.splitlines())
    return {match[1]: match[2] for match in found if match}


def metadata_folder(name: str, site: pathlib.Path) -> pathlib.Path | None:
    """Returns the package's folder NAME-VERSION.dist-info, or None when it is not installed."""
    for distribution in importlib.metadata.distributions(name=name, path=[str(site)]):
        return pathlib.Path(distribution._path)  # the only way to a folder that may lack its METADATA
    return None


def is_complete(folder: pathlib.Path) -> bool:
    """Returns True when every file that the package's RECORD lists exists and has its size. It reads no contents."""
    try:
        with open(folder / "RECORD", encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
    except FileNotFoundError:  # pip writes it last
        return False
    for path, _, size in rows:
        if not size:  # compiled modules and RECORD itself are listed without a size
            continue
        try:
            if (folder.parent / path).stat().st_size != int(size):
                return False
        except FileNotFoundError:
            return False
    return bool(rows)


def forget_half_installed(pinned: dict[str, str], site: pathlib.Path) -> list[str]:
    """Removes the metadata of packages that lack files, and the folders `~...` that an interrupted pip leaves behind.
    Returns the names of these packages."""
    broken = []
    for name in pinned:
        folder = metadata_folder(name, site)
        if folder is not None and not is_complete(folder):
            shutil.rmtree(folder)
            broken.append(name)
    for leftover in site.glob("~*"):
        shutil.rmtree(leftover)
    return broken


def not_installed(pinned: dict[str, str], site: pathlib.Path) -> list[str]:
    """Returns the names of the packages that are absent, incomplete, or of another version than the pinned one."""
    missing = []
    for name, version in pinned.items():
        folder = metadata_folder(name, site)
        if folder is None or not is_complete(folder) or importlib.metadata.Distribution.at(folder).version != version:
            missing.append(name)
    return missing


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--forget", action="store_true")
    parser.add_argument("requirements", type=pathlib.Path)
    options = parser.parse_args(arguments)
    pinned = pins(options.requirements.read_text(encoding="utf-8"))
    site = pathlib.Path(sysconfig.get_path("purelib"))
    broken = forget_half_installed(pinned, site) if options.forget else not_installed(pinned, site)
    print(*broken, sep="\n", end="\n" if broken else "")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
