"""The folder that an export fills: whole files alone, resumable, with a manifest written last.

A file is written under a temporary name, synced, renamed, and then listed in `export.journal`. A run that was stopped
goes on with the files that are not listed there. `export.json` exists when the export is complete.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import pathlib
from collections.abc import Callable
from typing import Any

MANIFEST = "export.json"
JOURNAL = "export.journal"


class ExportError(RuntimeError):
    """An export that cannot be made as it was asked for."""


def sha256_file(path: pathlib.Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def write_atomically(path: pathlib.Path, write: Callable[[pathlib.Path], None]) -> None:
    """Lets `write` fill a temporary file beside `path`, makes it durable and renames it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f"{path.name}.tmp")
    try:
        write(temporary)
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _file_name(name: Any) -> str:
    """A name of a file below the folder. A manifest may be a stranger's, whose names must lead nowhere else."""
    parts = name.split("/") if isinstance(name, str) else [""]
    if any(part in ("", ".", "..") or not part.isprintable() or set(part) & set("\\:") for part in parts):
        raise ValueError(f"it lists {name!r}, expected a file below its folder")
    return str(name)


class ExportFolder:
    """The files of one export. `about` says what is exported and how; equal exports have equal words there."""

    def __init__(self, out: pathlib.Path, about: dict[str, Any]) -> None:
        """Raises ExportError if `out` holds another export, other files, or an export that runs now."""
        self.out = out
        self.about = {"format": "quadruped3d-export", **about}
        self.files: dict[str, dict[str, Any]] = {}  # by their names in the folder
        self.is_complete = self._has_manifest()
        if self.is_complete:
            return
        if out.exists() and any(entry.name not in (JOURNAL, f"{MANIFEST}.tmp") for entry in out.iterdir()):
            if not (out / JOURNAL).exists():
                raise ExportError(f"{out}: holds other files; choose a folder that is empty or does not exist")
        out.mkdir(parents=True, exist_ok=True)
        self._journal = (out / JOURNAL).open("a+", encoding="utf-8")
        try:
            fcntl.flock(self._journal, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._journal.close()
            raise ExportError(f"{out}: another export is writing there") from error
        self._read_journal()

    def _has_manifest(self) -> bool:
        file = self.out / MANIFEST
        if not file.exists():
            return False
        try:
            manifest = json.loads(file.read_text(encoding="utf-8"))
            self._refuse_other(manifest)
            self.files = {_file_name(entry["file"]): entry for entry in manifest["files"]}
        except (ValueError, RecursionError, AttributeError, KeyError, TypeError) as error:
            raise ExportError(
                f"{file}: not what an export writes: {error}; remove {self.out} and export again"
            ) from error
        for name, entry in self.files.items():
            path = self.out / name
            if not path.is_file() or sha256_file(path) != entry.get("sha256"):
                raise ExportError(f"{path}: is gone or differs from {file}; remove {self.out} and export again")
        return True

    def _refuse_other(self, found: dict[str, Any]) -> None:
        for name, value in self.about.items():
            if found.get(name) != value:
                raise ExportError(
                    f"{self.out}: holds another export: {name} is {found.get(name)!r}, now {value!r}; choose another folder"
                )

    def _read_journal(self) -> None:
        self._journal.seek(0)
        lines = self._journal.read().splitlines(keepends=True)
        entries = []
        for line in lines:
            try:
                if not line.endswith("\n"):
                    break  # torn when its writer was killed
                entries.append(json.loads(line))
            except ValueError:
                break
        if entries:
            self._refuse_other(entries[0])
        for entry in entries[1:]:
            path = self.out / str(entry["file"])
            if path.is_file() and sha256_file(path) == entry["sha256"]:
                self.files[str(entry["file"])] = entry
        self._journal.seek(0)
        self._journal.truncate()
        for entry in [self.about, *self.files.values()]:
            self._append(entry)

    def _append(self, entry: dict[str, Any]) -> None:
        self._journal.write(json.dumps(entry) + "\n")
        self._journal.flush()
        os.fsync(self._journal.fileno())

    def write(self, name: str, write: Callable[[pathlib.Path], None], **more: Any) -> None:
        """Writes one file, unless an earlier run has finished it. `more` goes into the manifest."""
        if name in self.files:
            return
        path = self.out / name
        write_atomically(path, write)
        entry = {"file": name, "bytes": path.stat().st_size, "sha256": sha256_file(path), **more}
        self.files[name] = entry
        self._append(entry)

    def write_text(self, name: str, text: str) -> None:
        """Writes a text, also over that of an earlier run."""
        self.files.pop(name, None)
        self.write(name, lambda path: _write_text(path, text))

    def finish(self) -> None:
        """Writes the manifest, which makes the export complete, and removes the journal."""
        manifest = {**self.about, "files": [self.files[name] for name in sorted(self.files)]}
        write_atomically(self.out / MANIFEST, lambda path: _write_text(path, json.dumps(manifest, indent=2) + "\n"))
        (self.out / JOURNAL).unlink()
        self._journal.close()
        self.is_complete = True


def _write_text(path: pathlib.Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
