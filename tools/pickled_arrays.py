"""Converts records of numpy, chumpy and scipy objects (see restricted_pickle.py) to numpy arrays.

Before it creates an array, it compares the array's size with the number of bytes in the record.
"""

from __future__ import annotations

import math
import re

import numpy as np

from pickle_machine import short
from restricted_pickle import BrokenPickle, Global, Record

# The largest table in the official SMAL files has 3.6 million numbers. The limit is needed because a sparse matrix can
# declare any shape in a few bytes.
MAX_DENSE_ELEMENTS = 1 << 26
# Lists can hold one list many times over, so that a pickle of 400 bytes describes a table of billions. The official
# files hold their tables as arrays and use lists for a few sizes only.
MAX_LIST_ITEMS = 1_000_000
MAX_AXES = 8

_NUMPY_MAKERS = re.compile(r"numpy\.(_?core)\.(multiarray|numeric)\.(_reconstruct|_frombuffer|scalar)")
_SPARSE_CLASS = re.compile(r"scipy\.sparse\.(\w+\.)*(csc|csr|coo)_(matrix|array)")
_PLAIN_DTYPE = re.compile(r"[<>|=]?(b1|[iu][1248]|f[248])")


def array(value, what: str) -> np.ndarray:
    """Returns the array that `value` describes: a numpy array or scalar, a chumpy array that stores its numbers, a
    number, or a (nested) list of these with equal shapes. Throws BrokenPickle, whose message names `what`."""
    try:
        _refuse_bombs(value, what)
        return _array(value, what)
    except RecursionError:
        raise BrokenPickle(
            f"{what} is not a rectangular table of numbers: its lists or objects lie too deep in each other"
        ) from None


def _refuse_bombs(value, what: str) -> None:
    """Throws BrokenPickle if the table that lists and chumpy arrays describe is too large to be walked or to be held.
    Each of them is looked at once, however often it is shared, and no array is created that holds others."""
    known: dict[int, tuple[int, int]] = {}

    def measure(part) -> tuple[int, int]:
        """How many items a walk over the part visits, and how many numbers it describes."""
        if not isinstance(part, (list, tuple, Record)):
            return 1, 1
        if id(part) in known:
            return known[id(part)]
        known[id(part)] = (MAX_LIST_ITEMS + 1, 0)  # for one that holds itself
        if _is_chumpy(part):
            items, numbers = measure(_chumpy_numbers(part, what))
            known[id(part)] = (1 + items, numbers)
        elif isinstance(part, Record):
            known[id(part)] = (1, _array(part, what).size)
        else:
            sizes = [measure(item) for item in part]
            known[id(part)] = (1 + sum(items for items, _ in sizes), sum(numbers for _, numbers in sizes))
        return known[id(part)]

    items, numbers = measure(value)
    if items > MAX_LIST_ITEMS or numbers > MAX_DENSE_ELEMENTS:
        raise BrokenPickle(
            f"{what} is a list that describes more than {MAX_LIST_ITEMS:,} items or {MAX_DENSE_ELEMENTS:,} numbers; "
            "no known file has such a list"
        )


def _array(value, what: str) -> np.ndarray:
    if isinstance(value, Record):
        if _is_chumpy(value):
            return _array(_chumpy_numbers(value, what), what)
        maker = _NUMPY_MAKERS.fullmatch(value.path)
        if maker is None:
            raise BrokenPickle(f"{what} is a {value.path}, expected an array")
        return {"_reconstruct": _reconstructed, "_frombuffer": _from_buffer, "scalar": _scalar}[maker[3]](value, what)
    if isinstance(value, bool) or not isinstance(value, (int, float, list, tuple)):
        raise BrokenPickle(f"{what} is a {type(value).__name__}, expected an array")
    try:
        if isinstance(value, (int, float)):
            return np.asarray(value, np.float64 if isinstance(value, float) else np.int64)
        return np.stack([_array(item, f"{what}[{i}]") for i, item in enumerate(value)])
    except (ValueError, OverflowError) as error:
        raise BrokenPickle(f"{what} is not a rectangular table of numbers: {error}") from None


def matrix(value, what: str) -> np.ndarray:
    """Does the same as array(), and also accepts scipy's csc, csr and coo matrices, which it returns as dense arrays.
    Repeated entries of a sparse matrix are added up."""
    if isinstance(value, Record) and _SPARSE_CLASS.fullmatch(value.path):
        return _dense(value, what)
    return array(value, what)


def _is_chumpy(value) -> bool:
    return isinstance(value, Record) and value.path == "chumpy.ch.Ch"


def _chumpy_numbers(record: Record, what: str):
    """Returns the numbers of a chumpy array. chumpy stores them in `x`, unless it computes the array from others."""
    state = record.state if isinstance(record.state, dict) else {}
    if "x" not in state:
        raise BrokenPickle(f"{what} is a chumpy array without stored numbers (no 'x' in its state)")
    return state["x"]


# --- numpy ---------------------------------------------------------------------------------------------------------


def _dtype(value, what: str) -> np.dtype:
    """Returns the dtype of a record: dtype('f8', align, copy) with the state (version, byte order, ...)."""
    if not isinstance(value, Record) or value.path != "numpy.dtype" or not value.args:
        raise BrokenPickle(f"{what} has no numpy dtype")
    code = value.args[0]
    if not isinstance(code, str) or not _PLAIN_DTYPE.fullmatch(code):
        raise BrokenPickle(f"{what} has dtype {short(code)}, expected plain numbers (b1, i1..i8, u1..u8, f2..f8)")
    order = value.state[1] if isinstance(value.state, tuple) and len(value.state) > 1 else None
    return np.dtype(code).newbyteorder(order) if order in ("<", ">") else np.dtype(code)


def _bytes(value, what: str) -> bytes:
    """Returns the raw bytes of numbers. A pickle holds them as bytes, as a Python 2 string, or, if Python 3 wrote it in
    protocol 2, as a call of encode(text, 'latin1') or bytes()."""
    if isinstance(value, Record) and value.path == "builtins.bytes" and value.args == ():
        return b""
    if isinstance(value, Record) and value.path in ("_codecs.encode", "codecs.encode") and len(value.args) == 2:
        text, encoding = value.args
        if isinstance(text, str) and encoding in ("latin1", "latin-1"):
            value = text
    if isinstance(value, str):
        try:
            return value.encode("latin-1")
        except UnicodeEncodeError:
            pass
    if not isinstance(value, bytes):
        raise BrokenPickle(f"{what} holds a {type(value).__name__}, expected the bytes of its numbers")
    return value


def _shaped(raw: bytes, dtype: np.dtype, shape, fortran: bool, what: str) -> np.ndarray:
    if not isinstance(shape, tuple) or len(shape) > MAX_AXES or not all(map(_is_size, shape)):
        raise BrokenPickle(f"{what} has the shape {_short(shape)}, expected up to {MAX_AXES} sizes")
    expected = math.prod(shape) * dtype.itemsize
    if len(raw) != expected:
        raise BrokenPickle(f"{what} has {len(raw)} bytes, expected {expected} for {list(shape)} {dtype}")
    return np.frombuffer(raw, dtype).reshape(shape, order="F" if fortran else "C")


def _is_size(value) -> bool:
    return type(value) is int and 0 <= value < 1 << 63


def _short(shape) -> str:
    """A shape for a message. A hostile one may have a million parts of hundreds of digits."""
    if not isinstance(shape, (list, tuple)):
        return f"{type(shape).__name__}"
    if len(shape) > MAX_AXES or not all(map(_is_size, shape)):
        return f"of {len(shape)} parts"
    return str(list(shape))


def _reconstructed(record: Record, what: str) -> np.ndarray:
    """Returns an array that was pickled as an empty one with the state ([version,] shape, dtype, is_fortran, bytes)."""
    cls = record.args[0] if record.args else None
    state = record.state
    if cls != Global("numpy", "ndarray") or not isinstance(state, tuple) or len(state) not in (4, 5):
        raise BrokenPickle(f"{what} is not a complete numpy array")
    shape, described, fortran, raw = state[-4:]
    dtype = _dtype(described, what)
    return _shaped(_bytes(raw, what), dtype, shape, bool(fortran), what)


def _from_buffer(record: Record, what: str) -> np.ndarray:
    if len(record.args) != 4:
        raise BrokenPickle(f"{what} is not a complete numpy array")
    raw, dtype, shape, order = record.args
    return _shaped(_bytes(raw, what), _dtype(dtype, what), shape, order == "F", what)


def _scalar(record: Record, what: str) -> np.ndarray:
    if len(record.args) != 2:
        raise BrokenPickle(f"{what} is not a complete numpy scalar")
    return _shaped(_bytes(record.args[1], what), _dtype(record.args[0], what), (), False, what)


# --- scipy ---------------------------------------------------------------------------------------------------------


def _dense(record: Record, what: str) -> np.ndarray:
    state = record.state if isinstance(record.state, dict) else {}

    def part(name: str) -> np.ndarray:
        if name not in state:
            raise BrokenPickle(f"{what} is a {record.path} without '{name}'")
        numbers = array(state[name], f"{what}.{name}")
        if numbers.ndim != 1:
            raise BrokenPickle(f"{what}.{name} has {numbers.ndim} axes, expected 1")
        return numbers

    shape = state.get("_shape", state.get("shape"))
    if isinstance(shape, (tuple, list)) and len(shape) == 2:
        shape = tuple(_whole(size, f"{what}.shape") for size in shape)
    if not isinstance(shape, tuple) or len(shape) != 2 or min(shape) < 1 or math.prod(shape) > MAX_DENSE_ELEMENTS:
        raise BrokenPickle(
            f"{what} has the shape {_short(shape)}, expected two sizes, at most {MAX_DENSE_ELEMENTS} numbers"
        )
    values = part("data")
    kind = _SPARSE_CLASS.fullmatch(record.path)[2]
    if kind == "coo":
        rows, columns = part("row"), part("col")
    else:
        majors = shape[1] if kind == "csc" else shape[0]
        rows, columns = _expand(part("indptr"), part("indices"), majors, len(values), what)
        if kind == "csc":
            rows, columns = columns, rows
    for name, index, size in (("row", rows, shape[0]), ("column", columns, shape[1])):
        if len(index) != len(values) or index.dtype.kind not in "iu" or (len(index) and not _inside(index, size)):
            raise BrokenPickle(f"{what} has a {name} index outside 0 to {size - 1}, or too few of them")
    dense = np.zeros(shape, values.dtype)
    np.add.at(dense, (rows.astype(np.int64), columns.astype(np.int64)), values)
    return dense


def _whole(value, what: str) -> int:
    number = array(value, what)
    if number.ndim != 0 or number.dtype.kind not in "iu":
        raise BrokenPickle(f"{what} holds an array of {number.dtype} with {number.ndim} axes, expected a whole number")
    return int(number)


def _inside(index: np.ndarray, size: int) -> bool:
    return bool(index.min() >= 0 and index.max() < size)


def _expand(starts: np.ndarray, minors: np.ndarray, majors: int, count: int, what: str):
    """Returns the major and the minor index of each number. starts: where each row (csr) or column (csc) begins."""
    whole = starts.dtype.kind in "iu" and len(starts) == majors + 1 and int(starts[0]) == 0
    lengths = np.diff(starts.astype(np.int64)) if whole else np.array([-1])
    if lengths.min() < 0 or int(starts[-1]) != count:
        raise BrokenPickle(f"{what}.indptr does not divide its {count} numbers among {majors} rows or columns")
    return np.repeat(np.arange(majors), lengths), minors
