#!/usr/bin/env python3
"""Writes the bill of materials of an installed program as SPDX 2.3: what it is made of, and what it needs.

  tools/make_sbom.py PREFIX --version 0.2.0 --plotly build/plotly/plotly.min.js --out quadruped3d.spdx.json

It lists the files of PREFIX that are programs or weights, the libraries that the programs load (by the Debian packages
that own them), the packages that the project was compiled with (tools/debian-packages.txt), the wheels that pip is
allowed to install (tools/requirements.txt, with their digests), and the files that the programs carry in themselves.
`cmake --install` runs it. Where there is no dpkg, libraries are listed without their packages.

Exit codes: 0 done, 1 a file cannot be read, 2 wrong usage.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
from typing import Any

from fetch_plotly import SCRIPT_SHA256, WHEEL_SHA256
from fetch_plotly import VERSION as PLOTLY_VERSION

ROOT = pathlib.Path(__file__).resolve().parents[1]
DOCUMENT = "SPDXRef-DOCUMENT"
PROGRAM = "SPDXRef-quadruped3d"
PROGRAMS = ("bin/quadruped3d", "libexec/quadruped3d/quadruped3d-network")
PIN = re.compile(r"^([A-Za-z0-9._-]+)==([^ ;\\]+)(.*?)(?=^\S|\Z)", re.MULTILINE | re.DOTALL)
HASH = re.compile(r"--hash=sha256:([0-9a-f]{64})")
# Files of the sources that are compiled into the programs.
EMBEDDED = ("pipeline/report/page/*", "configs/topologies/*.json")
TORCH_WHEEL = re.compile(r"/(torch|nvidia)/")


def sha256(path: pathlib.Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def checksums(*digests: str) -> list[dict[str, str]]:
    return [{"algorithm": "SHA256", "checksumValue": digest} for digest in digests]


def spdx_id(*words: str) -> str:
    return "SPDXRef-" + re.sub(r"[^A-Za-z0-9.]+", "-", "-".join(words).replace("+", "plus")).strip("-")


def package(kind: str, name: str, version: str, purl: str, licence: str = "NOASSERTION", **more: Any) -> dict[str, Any]:
    return {
        "SPDXID": spdx_id(kind, name),
        "name": name,
        "versionInfo": version,
        "downloadLocation": "NOASSERTION",
        "filesAnalyzed": False,
        "licenseConcluded": licence,
        "licenseDeclared": licence,
        "copyrightText": "NOASSERTION",
        "externalRefs": [{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl", "referenceLocator": purl}],
        **more,
    }


def pinned_wheels(requirements: str) -> list[dict[str, Any]]:
    """A package for each pin, with the digests of all wheels of it that pip accepts."""
    return [
        package("PyPI", name, version, f"pkg:pypi/{name.lower()}@{version}", checksums=checksums(*HASH.findall(rest)))
        for name, version, rest in PIN.findall(requirements)
    ]


def loaded_libraries(program: pathlib.Path) -> set[pathlib.Path]:
    """The files that the dynamic linker loads with a program."""
    listed = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout
    return {pathlib.Path(path) for path in re.findall(r"(?:=> |^\s+)(/\S+) \(", listed, re.MULTILINE)}


def owners(libraries: set[pathlib.Path]) -> tuple[set[str], set[pathlib.Path]]:
    """The Debian packages that own the files, and the files that none owns."""
    # /lib is a link to /usr/lib, and dpkg knows a file by the name under which its package has it.
    names = {name: library for library in libraries
             for name in (str(library), str(library.resolve()), str(library.resolve()).removeprefix("/usr"))}
    found = subprocess.run(["dpkg", "-S", *sorted(names)], capture_output=True, text=True).stdout
    owner_of = {names[name]: owner for owner, name in re.findall(r"^([a-z0-9.+-]+)(?::\w+)?: (.+)$", found, re.MULTILINE)
                if name in names}
    return set(owner_of.values()), libraries - owner_of.keys()


def debian_packages(names: set[str]) -> list[dict[str, Any]]:
    if not names:
        return []
    form = "${Package}\t${Version}\t${Architecture}\t${db:Status-Status}\n"
    lines = subprocess.run(["dpkg-query", "-W", "-f", form, *sorted(names)], capture_output=True, text=True).stdout
    found: dict[str, dict[str, Any]] = {}
    for name, version, architecture, status in (line.split("\t") for line in lines.splitlines()):
        if status == "installed":
            found[name] = package("Debian", name, version, f"pkg:deb/debian/{name}@{version}?arch={architecture}")
    return list(found.values())


def file_entry(path: pathlib.Path, name: str) -> dict[str, Any]:
    return {
        "SPDXID": spdx_id("File", name),
        "fileName": "./" + name,
        "checksums": checksums(sha256(path)),
        "licenseConcluded": "NOASSERTION",
        "copyrightText": "NOASSERTION",
    }


def relation(one: str, kind: str, other: str) -> dict[str, str]:
    return {"spdxElementId": one, "relationshipType": kind, "relatedSpdxElement": other}


def created() -> str:
    """Now, or the moment that SOURCE_DATE_EPOCH gives for builds that are to have equal bytes."""
    given = os.environ.get("SOURCE_DATE_EPOCH")
    now = datetime.datetime.now(datetime.timezone.utc)
    moment = datetime.datetime.fromtimestamp(int(given), datetime.timezone.utc) if given else now
    return moment.strftime("%Y-%m-%dT%H:%M:%SZ")


class Document:
    def __init__(self, version: str) -> None:
        self.packages: dict[str, dict[str, Any]] = {}
        self.files: list[dict[str, Any]] = []
        self.relations = [relation(DOCUMENT, "DESCRIBES", PROGRAM)]
        self.version = version
        program = package("x", "quadruped3d", version, f"pkg:generic/quadruped3d@{version}", "Apache-2.0")
        self.packages[PROGRAM] = {**program, "SPDXID": PROGRAM}

    def add(self, packages: list[dict[str, Any]], kind: str) -> None:
        """`kind` reads from the program to the package."""
        for each in packages:
            self.packages.setdefault(each["SPDXID"], each)
            self.relations.append(relation(PROGRAM, kind, each["SPDXID"]))

    def add_file(self, path: pathlib.Path, name: str) -> None:
        entry = file_entry(path, name)
        self.files.append(entry)
        self.relations.append(relation(PROGRAM, "CONTAINS", entry["SPDXID"]))

    def to_json(self) -> dict[str, Any]:
        body = {"packages": list(self.packages.values()), "files": self.files, "relationships": self.relations}
        digest = hashlib.sha256(json.dumps(body, sort_keys=True).encode()).hexdigest()
        return {
            "spdxVersion": "SPDX-2.3",
            "dataLicense": "CC0-1.0",
            "SPDXID": DOCUMENT,
            "name": f"quadruped3d-{self.version}",
            "documentNamespace": f"https://spdx.org/spdxdocs/quadruped3d-{self.version}-{digest[:32]}",
            "creationInfo": {"created": created(), "creators": ["Tool: quadruped3d-make_sbom"]},
            **body,
        }


def add_libraries(document: Document, programs: list[pathlib.Path]) -> None:
    libraries = set().union(*map(loaded_libraries, programs))
    own = {path for path in libraries if not TORCH_WHEEL.search(str(path))}  # LibTorch's stand for the wheel `torch`
    names, left = owners(own) if shutil.which("dpkg") else (set(), own)
    document.add(debian_packages(names), "DYNAMIC_LINK")
    for path in sorted(left):
        document.add([package("Library", path.name, "NOASSERTION", f"pkg:generic/{path.name}")], "DYNAMIC_LINK")
    if shutil.which("dpkg-query"):
        compiled_with = set((ROOT / "tools/debian-packages.txt").read_text().split())
        for each in debian_packages(compiled_with):
            document.packages.setdefault(each["SPDXID"], each)
            document.relations.append(relation(each["SPDXID"], "BUILD_DEPENDENCY_OF", PROGRAM))


def bill(prefix: pathlib.Path, version: str, plotly: pathlib.Path) -> dict[str, Any]:
    document = Document(version)
    for name in PROGRAMS:
        document.add_file(prefix / name, name)
    for weights in sorted(prefix.glob("share/quadruped3d/models/*.safetensors")):
        document.add_file(weights, str(weights.relative_to(prefix)))
    for pattern in EMBEDDED:
        for source in sorted(ROOT.glob(pattern)):
            document.add_file(source, f"embedded/{source.relative_to(ROOT)}")
    if sha256(plotly) != SCRIPT_SHA256:
        raise ValueError(f"{plotly}: its SHA-256 is not the pinned one; configure the project again")
    document.add_file(plotly, "embedded/plotly.min.js")
    document.add([package("PyPI", "plotly", PLOTLY_VERSION, f"pkg:pypi/plotly@{PLOTLY_VERSION}", "MIT",
                          checksums=checksums(WHEEL_SHA256))], "CONTAINS")
    wheels = pinned_wheels((ROOT / "tools/requirements.txt").read_text())
    document.add([wheel for wheel in wheels if wheel["name"] == "torch"], "DYNAMIC_LINK")
    document.add([wheel for wheel in wheels if wheel["name"] != "torch"], "DEPENDS_ON")
    add_libraries(document, [prefix / name for name in PROGRAMS])
    return document.to_json()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("prefix", type=pathlib.Path)
    parser.add_argument("--version", required=True)
    parser.add_argument("--plotly", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    try:
        document = bill(arguments.prefix, arguments.version, arguments.plotly)
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
        arguments.out.write_text(json.dumps(document, indent=1) + "\n")
    except (OSError, ValueError, subprocess.CalledProcessError) as error:
        print(f"make_sbom: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
