#!/usr/bin/env python3
"""Finds small faults in text files: trailing spaces, tabs in sources, Windows line ends, no line end at the end of the
file, leftovers of a merge, JSON that cannot be read, links in pages that lead nowhere, and files above 1 MB.

    tools/check_text.py            every tracked file
    tools/check_text.py FILE...    these files

Prints each finding and exits with 1 if there is one.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys

LARGEST_BYTES = 1_000_000
NO_TABS = (".cpp", ".h", ".py", ".json", ".yaml", ".yml", ".cmake", "CMakeLists.txt")
LINK = re.compile(r"\]\(([^)#\s]+)")  # [text](target), without the target's #part
MERGE = re.compile(r"^(<{7}|>{7})( |$)")

# The golden numbers and the shipped network are large; the rest of this list is data, or a text that others wrote.
MAY_BE_LARGE = ("models/", "tests/data/")
LEFT_ALONE = ("tests/data/", "tests/fuzz/corpus/", "LICENSE")


def faults_of_line(name: str, line: str) -> list[str]:
    faults = []
    if line.endswith("\r"):
        faults.append("a Windows line end")
    elif line != line.rstrip():
        faults.append("spaces at the end of the line")
    if "\t" in line and name.endswith(NO_TABS):
        faults.append("a tab")
    if MERGE.match(line):
        faults.append("a leftover of a merge")
    return faults


def dead_links(name: str, text: str) -> list[str]:
    """Links of a Markdown page to files that are not in the repository. Addresses on the web are not tried."""
    code = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)
    targets = LINK.findall(code.sub("", text))
    here = os.path.dirname(name)
    local = [target for target in targets if not re.match(r"[a-z]+:", target)]
    return [f"{name}: the link to {target} leads nowhere" for target in local
            if not os.path.exists(os.path.join(here, target))]


def faults(name: str) -> list[str]:
    """Each finding as `file:line: what`. A link, a folder and a binary file have none but their size."""
    if os.path.islink(name) or not os.path.isfile(name):
        return []
    size = os.path.getsize(name)
    if size > LARGEST_BYTES and not name.startswith(MAY_BE_LARGE):
        return [f"{name}: {size} bytes, expected at most {LARGEST_BYTES}"]
    if name.startswith(LEFT_ALONE):
        return []
    with open(name, "rb") as file:
        content = file.read()
    if b"\0" in content:
        return []
    try:
        text = content.decode()
    except UnicodeDecodeError:
        return [] if name.endswith((".jpg", ".png")) else [f"{name}: not UTF-8"]
    lines = text.split("\n")
    found = [f"{name}:{i}: {fault}" for i, line in enumerate(lines, 1) for fault in faults_of_line(name, line)]
    if text and not text.endswith("\n"):
        found.append(f"{name}:{len(lines)}: no line end at the end of the file")
    if name.endswith(".md"):
        found += dead_links(name, text)
    if name.endswith(".json") and "//" not in text:  # configs may have comments, which Python does not read
        try:
            json.loads(text)
        except ValueError as error:
            found.append(f"{name}: not valid JSON: {error}")
    return found


def main(names: list[str]) -> int:
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    names = [os.path.abspath(name) for name in names]
    os.chdir(root)
    if not names:
        listed = subprocess.run(["git", "ls-files", "-z"], check=True, capture_output=True).stdout
        names = [name.decode() for name in listed.split(b"\0") if name]
    found = [fault for name in names for fault in faults(os.path.relpath(name))]
    for fault in found:
        print(fault)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
