"""Reads files that torch.save wrote, without using torch.

Such a file is a zip archive of uncompressed entries: data.pkl names the tensors, and data/0, data/1, ... hold their
numbers. The file is mapped into memory, and a tensor's bytes are read only when they are needed.
"""

from __future__ import annotations

import math
import mmap
import re
import struct
import zipfile
import zlib
from dataclasses import dataclass
from typing import Iterator

import numpy as np

import restricted_pickle
from pickle_machine import short
from restricted_pickle import Global, Record, RefusedPickle
from safetensors_file import CHUNK_BYTES, ITEM_BYTES, MAX_AXES, Tensor, TensorFileError, are_sizes, walk

MAX_ENTRIES = 100_000
MAX_DIRECTORY_BYTES = 32 << 20  # of the zip; zipfile makes an object of ten times its size of each entry
# Tensors may share their numbers. Without a limit, a file of 1 GB could describe a thousand networks.
MAX_SHARING = 8
MAX_PICKLE_BYTES = 256 << 20

_STORAGE_DTYPES = {
    "DoubleStorage": "F64",
    "FloatStorage": "F32",
    "HalfStorage": "F16",
    "BFloat16Storage": "BF16",
    "LongStorage": "I64",
    "IntStorage": "I32",
    "ShortStorage": "I16",
    "CharStorage": "I8",
    "ByteStorage": "U8",
    "BoolStorage": "BOOL",
}
# The format of torch before 1.6, which newer versions can still write.
_LEGACY_MAGIC = b"\x80\x02\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19"
_LOCAL_HEADER_BYTES = 30
_ENCRYPTED = 0x1


@dataclass(frozen=True)
class _Storage:
    kind: str  # a key of _STORAGE_DTYPES if the type is supported
    key: str
    count: int  # how many numbers it holds


class _BoundedFile:
    """A file from which zipfile reads no larger directory than MAX_DIRECTORY_BYTES."""

    def __init__(self, file, path: str):
        self._file, self._path = file, path
        self.seek, self.tell = file.seek, file.tell

    def read(self, count: int = -1) -> bytes:
        if count > MAX_DIRECTORY_BYTES:
            raise TensorFileError(
                f"{self._path}: a zip directory of {count} bytes, expected at most {MAX_DIRECTORY_BYTES}"
            )
        # Without a count, zipfile reads the end of the file: 64 KiB at most.
        return self._file.read(count if count >= 0 else MAX_DIRECTORY_BYTES)


class TorchFile:
    """A checkpoint. `root` is its pickled object: dicts, lists, numbers and records (restricted_pickle.py).

    Its functions throw TensorFileError, BrokenPickle, RefusedPickle and OSError; the messages name the file.
    """

    def __init__(self, path: str, check_sums: bool = True):
        self.path = path
        self.check_sums = check_sums
        self._checked: set[str] = set()
        with open(path, "rb") as file:
            self._start = file.read(64)
            if not self._start:
                raise TensorFileError(f"{path}: the file is empty")
            self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
            self._bytes = memoryview(self._map)
            self._entries = self._list_entries(file)
        pickles = [name for name in self._entries if name == "data.pkl" or name.endswith("/data.pkl")]
        if len(pickles) != 1:
            raise TensorFileError(f"{path}: a zip with {len(pickles)} entries named data.pkl, expected 1")
        self._prefix = pickles[0].removesuffix("data.pkl")
        order = self._entries.get(self._prefix + "byteorder")
        if order is not None and bytes(self._data_of(order)) != b"little":
            raise TensorFileError(f"{path}: written by a big-endian machine, which is not supported")
        entry = self._entries[pickles[0]]
        if entry.file_size > MAX_PICKLE_BYTES:
            raise RefusedPickle(f"{path}: a data.pkl of {entry.file_size} bytes, expected at most {MAX_PICKLE_BYTES}")
        self._check_sum(pickles[0])
        self.root = restricted_pickle.load(self._data_of(entry), f"{path}: data.pkl", self._storage)

    def tensors(self, table, what: str) -> dict[str, Tensor]:
        """Returns the tensors of a state dict by name. Throws TensorFileError when a value is not a tensor."""
        entries = table.entries if isinstance(table, Record) else table
        if not isinstance(entries, dict):
            raise TensorFileError(f"{self.path}: {what} is a {_kind(table)}, expected a table of tensors")
        tensors = {}
        left = MAX_SHARING * len(self._bytes)
        for name, value in entries.items():
            if not isinstance(name, str):
                raise TensorFileError(f"{self.path}: {what} has the key {short(name)}, expected names")
            try:
                tensors[name] = self._tensor(value)
            except TensorFileError as error:
                raise TensorFileError(f"{self.path}: {what}: {name[:200]}: {error}") from None
            left -= tensors[name].byte_count
            if left < 0:
                raise TensorFileError(
                    f"{self.path}: {what} describes more than {MAX_SHARING} times as many bytes as the file has; its"
                    " tensors share their numbers more often than those of any known file"
                )
        return tensors

    # --- the zip archive ---

    def _list_entries(self, file) -> dict[str, zipfile.ZipInfo]:
        if self._start.startswith(_LEGACY_MAGIC):
            raise TensorFileError(
                f"{self.path}: saved in torch's old format (before 1.6), which is not supported; save it "
                "again with a newer torch: torch.save(torch.load(IN, weights_only=True), OUT)"
            )
        try:
            with zipfile.ZipFile(_BoundedFile(file, self.path)) as archive:
                infos = archive.infolist()
        except TensorFileError:
            raise
        except (zipfile.BadZipFile, NotImplementedError, ValueError, struct.error, EOFError) as error:
            reason = _impostor(self._start) or f"not a whole torch file: {error}"
            raise TensorFileError(f"{self.path}: {reason}") from None
        if len(infos) > MAX_ENTRIES:
            raise TensorFileError(f"{self.path}: {len(infos)} zip entries, expected at most {MAX_ENTRIES}")
        entries: dict[str, zipfile.ZipInfo] = {}
        for info in infos:
            if info.filename in entries:
                raise TensorFileError(f"{self.path}: the zip entry {info.filename[:200]!r} appears twice")
            entries[info.filename] = info
        return entries

    def _data_of(self, info: zipfile.ZipInfo) -> memoryview:
        start, end = self._span(info)
        return self._bytes[start:end]

    def _span(self, info: zipfile.ZipInfo) -> tuple[int, int]:
        """Returns where the bytes of an entry begin and end. The entry's local header gives the lengths of the fields
        in front of the data, which may differ from those in the directory."""
        where = f"{self.path}: zip entry {info.filename[:200]!r}"
        stored = info.compress_type == zipfile.ZIP_STORED and info.compress_size == info.file_size
        if not stored or info.flag_bits & _ENCRYPTED:
            raise TensorFileError(f"{where}: compressed or encrypted; torch.save writes neither")
        header = self._bytes[info.header_offset : info.header_offset + _LOCAL_HEADER_BYTES]
        if len(header) < _LOCAL_HEADER_BYTES or bytes(header[:4]) != b"PK\x03\x04":
            raise TensorFileError(f"{where}: its local header is not where the directory says (truncated?)")
        start = info.header_offset + _LOCAL_HEADER_BYTES + sum(struct.unpack("<HH", header[26:30]))
        if start + info.file_size > len(self._bytes):
            raise TensorFileError(
                f"{where}: {info.file_size} bytes from byte {start} of a file of {len(self._bytes)} bytes (truncated?)"
            )
        return start, start + info.file_size

    def _check_sum(self, name: str) -> None:
        if self.check_sums and name not in self._checked:
            for _ in self._checked_chunks(name):
                pass

    def _checked_chunks(self, name: str) -> Iterator[memoryview]:
        """Yields all bytes of an entry. At the end it compares their CRC-32 with the one in the zip, and releases the
        pages of the mapping, so that they do not count as used memory."""
        info = self._entries[name]
        start, end = self._span(info)
        crc = 0
        for chunk in walk(self._bytes[start:end]):
            if self.check_sums:
                crc = zlib.crc32(chunk, crc)
            yield chunk
        if self.check_sums and crc != info.CRC:
            raise TensorFileError(
                f"{self.path}: zip entry {name!r}: CRC-32 {crc:08x}, expected {info.CRC:08x}: the file is damaged; "
                "fetch it again (or pass --skip-crc if it was saved without check sums)"
            )
        self._checked.add(name)
        first = -(-start // mmap.PAGESIZE) * mmap.PAGESIZE
        if end - first >= mmap.PAGESIZE and hasattr(self._map, "madvise"):
            self._map.madvise(mmap.MADV_DONTNEED, first, (end - first) // mmap.PAGESIZE * mmap.PAGESIZE)

    # --- the tensors ---

    def _storage(self, identity) -> _Storage:
        """Converts a persistent id of torch: ('storage', class, key, device, count of numbers)."""
        well_formed = (
            isinstance(identity, tuple)
            and len(identity) == 5
            and identity[0] == "storage"
            and isinstance(identity[1], Global)
            and isinstance(identity[2], str)
            and re.fullmatch(r"[0-9]{1,9}", identity[2], re.ASCII)
            and isinstance(identity[3], str)
            and type(identity[4]) is int
            and identity[4] >= 0
        )
        if not well_formed:
            raise RefusedPickle("a persistent id that is not torch's ('storage', class, key, device, size)")
        _, cls, key, _, count = identity
        if cls.module not in ("torch", "torch.storage") or not cls.name.endswith("Storage"):
            raise RefusedPickle(f"a storage of class {cls.path}, which is not one of torch's")
        return _Storage(cls.name, key, count)

    def _tensor(self, value) -> Tensor:
        if isinstance(value, Record) and value.path in (
            "torch._utils._rebuild_parameter",
            "torch._utils._rebuild_parameter_with_state",
        ):
            value = value.args[0] if value.args else None
        if not isinstance(value, Record) or value.path not in (
            "torch._utils._rebuild_tensor",
            "torch._utils._rebuild_tensor_v2",
        ):
            raise TensorFileError(f"a {_kind(value)}, expected a tensor")
        if len(value.args) < 4 or not isinstance(value.args[0], _Storage):
            raise TensorFileError("a tensor without a storage")
        storage, offset, shape, strides = value.args[:4]
        return self._view(storage, offset, shape, strides)

    def _view(self, storage: _Storage, offset, shape, strides) -> Tensor:
        are_lists = isinstance(shape, tuple) and isinstance(strides, tuple) and len(shape) == len(strides)
        if not are_lists or len(shape) > MAX_AXES or not are_sizes([offset, *shape, *strides]):
            raise TensorFileError(f"a tensor whose offset, sizes and strides are not sizes of up to {MAX_AXES} axes")
        dtype = _STORAGE_DTYPES.get(storage.kind)
        if dtype is None:
            raise TensorFileError(f"a {storage.kind}, expected one of {', '.join(_STORAGE_DTYPES)}")
        item = ITEM_BYTES[dtype]
        name = f"{self._prefix}data/{storage.key}"
        if name not in self._entries:
            raise TensorFileError(f"its storage {name[:200]!r} is not in the file")
        data = self._data_of(self._entries[name])
        if len(data) != storage.count * item:
            raise TensorFileError(f"its storage has {len(data)} bytes, expected {storage.count * item}")
        count = math.prod(shape)
        last = offset + sum((size - 1) * stride for size, stride in zip(shape, strides))
        if count and last >= storage.count:
            raise TensorFileError(f"reaches number {last} of a storage of {storage.count} numbers")
        if count > storage.count:
            raise TensorFileError(f"repeats its storage: {count} numbers out of {storage.count}")
        if count == storage.count and _is_row_major(shape, strides):
            return Tensor(dtype, shape, lambda: self._checked_chunks(name))
        numbers = np.frombuffer(data, np.dtype(f"u{item}"))
        return Tensor(dtype, shape, lambda: self._gathered(name, numbers[offset:], shape, strides))

    def _gathered(self, name: str, numbers: np.ndarray, shape, strides) -> Iterator:
        """Yields the bytes of a tensor that is a part of a storage or has another order. _view() checked the bounds."""
        self._check_sum(name)
        if math.prod(shape) == 0:
            return
        steps = tuple(stride * numbers.itemsize for stride in strides)
        view = np.lib.stride_tricks.as_strided(numbers, shape, steps, writeable=False)
        if not shape:
            yield view.tobytes()
            return
        rows = max(1, CHUNK_BYTES // max(1, view[0].nbytes))
        for start in range(0, shape[0], rows):
            yield np.ascontiguousarray(view[start : start + rows]).reshape(-1).view(np.uint8).data


def _is_row_major(shape: tuple, strides: tuple) -> bool:
    expected = 1
    for size, stride in zip(reversed(shape), reversed(strides)):
        if size != 1 and stride != expected:
            return False
        expected *= size
    return True


def _kind(value) -> str:
    return value.path if isinstance(value, (Record, Global)) else type(value).__name__


def _impostor(start: bytes) -> str:
    """Recognises the usual results of a download that went wrong; '' when it is none of them."""
    if start.startswith(b"version https://git-lfs"):
        return "a Git LFS pointer, not the file itself; fetch it with `git lfs pull` or by its download link"
    if start.lstrip()[:1] == b"<":
        return "a web page, not the file itself; open the download link in a browser and save the file"
    return ""
