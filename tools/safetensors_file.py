"""Reads and writes safetensors files one tensor at a time.

A file holds the length N of its header (8 bytes, little-endian), the header (N bytes of JSON: name -> dtype, shape,
data_offsets), and the bytes of the tensors.
"""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from typing import Callable, Iterable, Iterator

import numpy as np

ITEM_BYTES = {"F64": 8, "F32": 4, "F16": 2, "BF16": 2, "I64": 8, "I32": 4, "I16": 2, "I8": 1, "U8": 1, "BOOL": 1}
CHUNK_BYTES = 8 << 20
MAX_HEADER_BYTES = 100_000_000  # the format's own limit
SOURCE_KEY = "imported_from"  # in the metadata of every imported file

MAX_AXES = 32  # numpy's limit; the network's tensors have up to four

_NUMPY_NAMES = {"float64": "F64", "float32": "F32", "float16": "F16", "int64": "I64", "int32": "I32", "bool": "BOOL"}


class TensorFileError(ValueError):
    """A tensor file cannot be read. The message says what is wrong, where, what was found and what was expected."""


@dataclass(frozen=True)
class Tensor:
    """A tensor whose bytes are read only when they are needed: little-endian, row-major, in chunks."""

    dtype: str  # the format's name, a key of ITEM_BYTES
    shape: tuple[int, ...]
    chunks: Callable[[], Iterable]

    @property
    def byte_count(self) -> int:
        return math.prod(self.shape) * ITEM_BYTES[self.dtype]

    def __str__(self) -> str:
        return f"{self.dtype} {list(self.shape)}"


def are_sizes(numbers: Iterable) -> bool:
    """Whether all are whole numbers that a size or an offset can be. Products of larger ones would take hours."""
    return all(type(number) is int and 0 <= number < 1 << 63 for number in numbers)


def from_array(values: np.ndarray) -> Tensor:
    """Returns a Tensor that refers to the array; the array must not change before it is written."""
    values = np.asarray(values, values.dtype.newbyteorder("<"), order="C")
    return Tensor(_NUMPY_NAMES[values.dtype.name], values.shape, lambda: [values.reshape(-1).view(np.uint8).data])


def source_names(paths: Iterable[str]) -> str:
    """Returns the value for SOURCE_KEY: the names of the files, without their folders."""
    return ", ".join(os.path.basename(path) for path in paths)


def walk(view: memoryview) -> Iterator[memoryview]:
    """Yields the view in pieces of at most CHUNK_BYTES."""
    for start in range(0, len(view), CHUNK_BYTES):
        yield view[start : start + CHUNK_BYTES]


def write(path: str, tensors: dict[str, Tensor], metadata: dict[str, str]) -> None:
    """Writes a file under a temporary name in the same folder, syncs it and renames it. `path` is then complete, or
    after a failure unchanged.

    Tensors of wider types come first, which aligns every tensor; otherwise the order is kept. The bytes of the file
    depend only on the arguments. Throws OSError.
    """
    order = sorted(tensors, key=lambda name: -ITEM_BYTES[tensors[name].dtype])
    header: dict[str, object] = {"__metadata__": metadata}
    offset = 0
    for name in order:
        tensor = tensors[name]
        end = offset + tensor.byte_count
        header[name] = {"dtype": tensor.dtype, "shape": list(tensor.shape), "data_offsets": [offset, end]}
        offset = end
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    folder = os.path.dirname(os.path.abspath(path))
    temporary = os.path.join(folder, f".{os.path.basename(path)}.{os.getpid()}.tmp")
    try:
        with open(temporary, "wb") as file:
            file.write(len(text).to_bytes(8, "little") + text)
            for name in order:
                written = sum(file.write(chunk) for chunk in tensors[name].chunks())
                if written != tensors[name].byte_count:
                    raise TensorFileError(f"{name}: {written} bytes, expected {tensors[name].byte_count}")
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        if os.path.exists(temporary):
            os.unlink(temporary)
        raise
    directory = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(directory)
    finally:
        os.close(directory)


def read(path: str) -> tuple[dict[str, Tensor], dict[str, str]]:
    """Returns the tensors and the metadata. The tensors read the file again when their bytes are needed. Throws
    TensorFileError and OSError."""
    try:
        with open(path, "rb") as file:
            return _read(file)
    except TensorFileError as error:
        raise TensorFileError(f"{path}: not a usable safetensors file: {error}") from None


def _read(file) -> tuple[dict[str, Tensor], dict[str, str]]:
    size = os.fstat(file.fileno()).st_size
    if size < 8:
        raise TensorFileError(f"{size} bytes, expected at least 8")
    header_bytes = int.from_bytes(file.read(8), "little")
    if header_bytes > min(MAX_HEADER_BYTES, size - 8):
        raise TensorFileError(f"a header of {header_bytes} bytes in a file of {size} bytes")
    try:
        header = json.loads(file.read(header_bytes))
    except (ValueError, RecursionError) as error:
        raise TensorFileError(f"the header is not JSON: {error}") from None
    if not isinstance(header, dict):
        raise TensorFileError("the header is not a JSON object")
    metadata = header.pop("__metadata__", {})
    if not isinstance(metadata, dict) or not all(isinstance(value, str) for value in metadata.values()):
        raise TensorFileError("__metadata__ is not an object of strings")
    data_start, data_bytes = 8 + header_bytes, size - 8 - header_bytes
    tensors = {name: _entry(file.name, data_start, data_bytes, name, entry) for name, entry in header.items()}
    reached = 0
    for begin, end in sorted(entry["data_offsets"] for entry in header.values()):
        if begin != reached:
            raise TensorFileError(f"a tensor starts at byte {begin} of the data, expected {reached}")
        reached = end
    if reached != data_bytes:
        raise TensorFileError(f"the data has {data_bytes} bytes, expected {reached}")
    return tensors, metadata


def _entry(path: str, data_start: int, data_bytes: int, name: str, entry: object) -> Tensor:
    fields = entry if isinstance(entry, dict) else {}
    dtype, shape, offsets = (fields.get(key) for key in ("dtype", "shape", "data_offsets"))
    if not isinstance(dtype, str) or dtype not in ITEM_BYTES:
        raise TensorFileError(f"{name[:200]}: dtype {str(dtype)[:20]!r}, expected one of {', '.join(ITEM_BYTES)}")
    for numbers in (shape, offsets):
        if not isinstance(numbers, list) or len(numbers) > MAX_AXES or not are_sizes(numbers):
            raise TensorFileError(f"{name[:200]}: its shape and data_offsets are not lists of up to {MAX_AXES} sizes")
    if len(offsets) != 2 or not offsets[0] <= offsets[1] <= data_bytes:
        raise TensorFileError(f"{name[:200]}: data_offsets {offsets} outside the {data_bytes} bytes of data (truncated?)")
    start, end = data_start + offsets[0], data_start + offsets[1]
    tensor = Tensor(dtype, tuple(shape), lambda: _pieces(path, start, end))
    if end - start != tensor.byte_count:
        raise TensorFileError(f"{name[:200]}: {end - start} bytes, expected {tensor.byte_count} from its shape and dtype")
    return tensor


def _pieces(path: str, start: int, end: int) -> Iterator[bytes]:
    with open(path, "rb", buffering=0) as file:
        file.seek(start)
        while start < end:
            piece = file.read(min(CHUNK_BYTES, end - start))
            if not piece:
                raise TensorFileError(f"{path}: ends at byte {start} while it is being read, expected {end}")
            start += len(piece)
            yield piece
