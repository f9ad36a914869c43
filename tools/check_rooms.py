#!/usr/bin/env python3
"""Keeps the table of rooms in docs/architecture.md equal to what CMake links.

usage: tools/check_rooms.py build/release [--write]

CMake writes rooms.tsv when it configures: each room's folder, the rooms that it links, and its job. This script sorts
the rooms into floors (a room stands one floor above the highest room that it links), refuses a cycle, and compares the
table with the page. With --write it replaces the table in the page.
"""

import pathlib
import sys

PAGE = pathlib.Path(__file__).resolve().parent.parent / "docs" / "architecture.md"
BEGIN = "<!-- rooms: made by tools/check_rooms.py -->\n"
END = "<!-- end of rooms -->\n"


def read_rooms(build):
    rooms = {}
    for line in (build / "rooms.tsv").read_text().splitlines():
        folder, links, torch, job = line.split("\t")
        rooms[folder] = (links.split(), torch == "TRUE", job)
    folders = {folder.replace("/", "_"): folder for folder in rooms}
    return {folder: ([folders[link] for link in links], torch, job) for folder, (links, torch, job) in rooms.items()}


def floor_of(folder, rooms, above=()):
    if folder in above:
        raise SystemExit("these rooms link each other in a circle: " + " -> ".join([*above, folder]))
    return 1 + max((floor_of(link, rooms, (*above, folder)) for link in rooms[folder][0]), default=0)


def table(rooms):
    floors = {folder: floor_of(folder, rooms) for folder in rooms}
    lines = ["| floor | room | job | links |", "|---|---|---|---|"]
    for folder in sorted(rooms, key=lambda folder: (-floors[folder], folder)):
        links, torch, job = rooms[folder]
        links = sorted(links) + (["LibTorch"] if torch else [])
        lines.append(f"| {floors[folder]} | {folder} | {job} | {', '.join(links)} |")
    return "\n".join(lines) + "\n"


def main():
    arguments = [argument for argument in sys.argv[1:] if argument != "--write"]
    if len(arguments) != 1:
        raise SystemExit(__doc__)
    page = PAGE.read_text()
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    wanted = before + BEGIN + table(read_rooms(pathlib.Path(arguments[0]))) + END + after
    if "--write" in sys.argv:
        PAGE.write_text(wanted)
    elif wanted != page:
        raise SystemExit(f"{PAGE.name}: the table of rooms is not what CMake links; run: tools/check_rooms.py {arguments[0]} --write")


if __name__ == "__main__":
    main()
