"""Reads shards: HDF5 files with one row for each labelled sample (docs/shard-format.md).

HDF5 is asked only where the columns lie. The rows are then read from the file directly, so a Shard takes no lock, may
be used by many threads, survives a fork and can be pickled.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import pathlib
import re
import threading
from collections.abc import Iterable, Sequence
from typing import Any, Literal, TypeAlias

import h5py
import numpy as np
import numpy.typing as npt

Source: TypeAlias = str | os.PathLike[str]

FORMAT = "quadruped3d-shard"
SCHEMAS = (1, 2)

# The end of a dataset.json: the SHA-256 of all bytes before these two lines. Only files of schema 1 have none.
_SEAL = re.compile(rb'  "digest": "([0-9a-f]{64})"\n}\n\Z')
_SHARD_NAME = re.compile(r"shards/[A-Za-z0-9_-][A-Za-z0-9_.-]*\.h5")

# The columns that schema 2 adds. A shard of schema 1 is read as if they had not been measured: NaN.
TRUST_COLUMNS = (
    "trust",
    "trust_mirror",
    "trust_aux_2d",
    "trust_aux_3d",
    "trust_pose_prior",
    "trust_shape_prior",
    "trust_limbs",
    "trust_sides",
    "trust_mask",
    "trust_visible",
)


class ShardError(RuntimeError):
    """A file or folder that is no shard or dataset, or one that this version cannot read."""


@dataclasses.dataclass(frozen=True)
class Column:
    """Where a column lies in the file, and what its rows are."""

    kind: Literal["number", "text", "bytes"]
    dtype: str  # NumPy's, of one element; "S40" for texts
    row_shape: tuple[int, ...]
    offset: int  # of the first row in the file
    row_bytes: int  # 0 for bytes, whose rows have different lengths


class Shard:
    """An open shard.

    `attributes` holds the texts of the file itself: dataset, version, unit, image_encoding and the meaning of all
    columns.
    """

    def __init__(self, path: Source) -> None:
        """Raises ShardError if the file is no shard, or has a schema that this package does not know."""
        self.path = pathlib.Path(path)
        try:
            with h5py.File(self.path, "r") as file:
                self.attributes = {
                    name: value.decode() if isinstance(value, bytes) else str(value)
                    for name, value in file.attrs.items()
                }
                self._check_identity()
                self.rows = int(file.attrs["rows"])
                self._offsets = {
                    name.removesuffix("_offsets"): np.asarray(file[name][:], np.int64)
                    for name in file
                    if name.endswith("_offsets")
                }
                self.columns = {name: self._column(name, file[name]) for name in file if not name.endswith("_offsets")}
        except OSError as error:
            raise ShardError(f"{self.path}: not a readable HDF5 file: {error}") from error
        self._open()

    def _check_identity(self) -> None:
        got = self.attributes.get("format")
        if got != FORMAT:
            raise ShardError(f'{self.path}: attribute format is {got!r}, expected "{FORMAT}": not a shard')
        schema = self.attributes.get("schema", "")
        if schema not in map(str, SCHEMAS):
            raise ShardError(
                f"{self.path}: shard schema {schema!r}, but this package reads {', '.join(map(str, SCHEMAS))}; "
                "install a newer quadruped3d"
            )

    def _column(self, name: str, dataset: h5py.Dataset) -> Column:
        if dataset.chunks is not None:
            raise ShardError(f"{self.path}: column {name} is chunked, expected contiguous data")
        is_bytes = name in self._offsets
        if not is_bytes and dataset.shape[0] != self.rows:
            raise ShardError(f"{self.path}: column {name} has {dataset.shape[0]} rows, expected {self.rows}")
        kind: Literal["number", "text", "bytes"] = (
            "bytes" if is_bytes else "text" if dataset.dtype.kind == "S" else "number"
        )
        row_shape = tuple(int(extent) for extent in dataset.shape[1:])
        row_bytes = 0 if is_bytes else int(np.prod(row_shape, dtype=np.int64)) * dataset.dtype.itemsize
        offset = dataset.id.get_offset()
        if offset is None and dataset.size > 0:
            raise ShardError(f"{self.path}: column {name} has no data in the file")
        return Column(kind, dataset.dtype.str, row_shape, int(offset or 0), row_bytes)

    # The file descriptor is no part of the state: an unpickled shard opens the file for itself.
    def _open(self) -> None:
        self._lock = threading.Lock()
        self._descriptor: int | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in ("_lock", "_descriptor")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._open()

    def close(self) -> None:
        """Closes the file; the next read opens it again."""
        with self._lock:
            if self._descriptor is not None:
                os.close(self._descriptor)
                self._descriptor = None

    def __del__(self) -> None:
        if getattr(self, "_descriptor", None) is not None:
            self.close()

    def _read_at(self, offset: int, count: int) -> bytes:
        if self._descriptor is None:
            with self._lock:
                if self._descriptor is None:
                    self._descriptor = os.open(self.path, os.O_RDONLY | os.O_CLOEXEC)
        content = os.pread(self._descriptor, count, offset)
        while len(content) < count:  # one call reads at most 2 GiB
            more = os.pread(self._descriptor, count - len(content), offset + len(content))
            if not more:
                raise ShardError(f"{self.path}: ends at byte {offset + len(content)}, expected {offset + count} or more")
            content += more
        return content

    @property
    def schema(self) -> int:
        return int(self.attributes["schema"])

    @property
    def image_encoding(self) -> str:
        """"jpeg", "png", or "reference" for a shard without pictures."""
        return self.attributes["image_encoding"]

    @property
    def terms(self) -> dict[str, dict[str, str]]:
        """Licence, source_url and citation of each source dataset, by "dataset/split"; nothing in schema 1."""
        terms: dict[str, dict[str, str]] = json.loads(self.attributes.get("datasets", "{}"))
        return terms

    def describe(self) -> dict[str, dict[str, str]]:
        """dtype, shape, units and meaning of every column, as the shard itself says."""
        described: dict[str, dict[str, str]] = json.loads(self.attributes["columns"])
        return described

    def read(self, column: str, first: int = 0, count: int | None = None) -> npt.NDArray[Any]:
        """The rows [first, first + count) of a column of numbers or texts; all from `first` on without `count`.

        Texts come as str, and trust scores of a shard of schema 1 as NaN. Raises KeyError for a column that the shard
        lacks and IndexError for rows that it lacks.
        """
        count = self.rows - first if count is None else count
        if self.schema == 1 and column in TRUST_COLUMNS:
            self._check_rows(first, count)
            return np.full(count, np.nan)
        found = self._find(column)
        if found.kind == "bytes":
            raise KeyError(f"{self.path}: column {column} holds pictures; use picture()")
        self._check_rows(first, count)
        content = self._read_at(found.offset + first * found.row_bytes, count * found.row_bytes) if count else b""
        values = np.frombuffer(bytearray(content), np.dtype(found.dtype)).reshape(count, *found.row_shape)
        if found.kind == "text":
            return np.char.decode(values, "utf-8") if count else np.array([], str)
        return values

    def picture(self, row: int, column: str = "crop") -> bytes:
        """The encoded picture of a row: `crop`, or `crop_mask`, which is empty where there is no mask."""
        found = self._find(column)
        if found.kind != "bytes":
            raise KeyError(f"{self.path}: column {column} holds no pictures; use read()")
        self._check_rows(row, 1)
        start, end = (int(value) for value in self._offsets[column][row : row + 2])
        return self._read_at(found.offset + start, end - start) if end > start else b""

    def _find(self, column: str) -> Column:
        if column in self.columns:
            return self.columns[column]
        raise KeyError(f"{self.path}: no column {column} in schema {self.schema}; there are {', '.join(self.columns)}")

    def _check_rows(self, first: int, count: int) -> None:
        if first < 0 or count < 0 or first + count > self.rows:
            raise IndexError(f"{self.path}: {count} rows from {first} on, but there are {self.rows}")


def dataset_folder(source: Source) -> pathlib.Path:
    """The folder that holds dataset.json: the given one, or `latest` of an output folder. Raises ShardError."""
    for folder in (pathlib.Path(source), pathlib.Path(source) / "latest"):
        if (folder / "dataset.json").is_file():
            return folder
    raise ShardError(f"{source}: expected a dataset's folder (with dataset.json) or an output folder of `build`")


def read_manifest(source: Source) -> dict[str, Any]:
    """dataset.json of a dataset: name, version, counts, thresholds, provenance, shards; without its digest, which is
    compared with the text. Raises ShardError."""
    file = dataset_folder(source) / "dataset.json"
    content = file.read_bytes()
    sealed = _SEAL.search(content)
    if sealed and hashlib.sha256(content[: sealed.start()]).hexdigest().encode() != sealed[1]:
        raise ShardError(f"{file}: its text is not the one that its member \"digest\" was made of: it is damaged")
    try:
        manifest: dict[str, Any] = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ShardError(f"{file}: not readable JSON: {error}") from error
    if not isinstance(manifest, dict):
        raise ShardError(f"{file}: got no JSON object, expected one")
    if manifest.get("format") != "quadruped3d-dataset":
        raise ShardError(f"{file}: format is {manifest.get('format')!r}, expected \"quadruped3d-dataset\"")
    if not sealed and ("digest" in manifest or manifest.get("schema") != 1):
        raise ShardError(f"{file}: got no digest at its end, which only files of schema 1 lack: it is damaged")
    manifest.pop("digest", None)
    return manifest


def shard_files(source: Source) -> list[pathlib.Path]:
    """The shards of a source, in order.

    A source is a shard, a dataset's folder, an output folder (its `latest` is taken), or a folder with *.h5 files. Of
    a dataset, the shards are those that dataset.json lists. Raises ShardError if there are none.
    """
    path = pathlib.Path(source)
    if path.is_file():
        return [path]
    for folder in (path, path / "latest"):
        if (folder / "dataset.json").is_file():
            return [folder / _shard_name(entry["file"], folder) for entry in read_manifest(folder)["shards"]]
    for folder in (path, path / "shards"):
        files = sorted(folder.glob("*.h5"))
        if files:
            return files
    raise ShardError(f"{source}: neither a shard nor a folder of a dataset or of shards")


def _shard_name(name: Any, folder: pathlib.Path) -> str:
    """The name of a shard in dataset.json, which must not lead out of the folder."""
    if isinstance(name, str) and _SHARD_NAME.fullmatch(name):
        return name
    raise ShardError(f"{folder / 'dataset.json'}: the list of shards names {name!r}, expected shards/NAME.h5")


def open_shards(sources: Source | Iterable[Source]) -> list[Shard]:
    """Opens all shards of one or several sources, in order; there is at least one. Raises ShardError."""
    shards = [Shard(file) for source in as_sources(sources) for file in shard_files(source)]
    if not shards:
        raise ShardError(f"{sources}: a dataset without shards")
    return shards


def as_sources(sources: Source | Iterable[Source]) -> Sequence[Source]:
    """One source, or several, as a list."""
    return [sources] if isinstance(sources, (str, os.PathLike)) else list(sources)
