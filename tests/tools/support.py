"""Functions that the tests share: the command line, an independent reader of safetensors, a writer of Python 2 pickles,
and classes of packages that are not installed."""

import contextlib
import io
import json
import os
import pickle
import struct
import sys
import types

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
PARITY = os.environ.get("Q3D_PARITY_DIR", os.path.join(ROOT, "tests", "data", "parity"))
sys.path.insert(0, os.path.join(ROOT, "tools"))

import import_assets  # noqa: E402  (needs the path above)

NUMPY_TYPES = {"F64": "<f8", "F32": "<f4", "F16": "<f2", "BF16": "<u2", "I64": "<i8", "I32": "<i4", "I16": "<i2"}
NUMPY_TYPES |= {"I8": "<i1", "U8": "<u1", "BOOL": "?"}


def run(*arguments):
    """Runs import_assets.py. Returns its exit code, standard output and standard error."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = import_assets.main([str(argument) for argument in arguments])
        except SystemExit as stop:  # argparse
            code = stop.code
    return code, out.getvalue(), err.getvalue()


def read_safetensors(path):
    """Returns {name: array} and the metadata. A bfloat16 tensor is returned as its bits."""
    with open(path, "rb") as file:
        raw = file.read()
    (length,) = struct.unpack("<Q", raw[:8])
    header = json.loads(raw[8 : 8 + length])
    metadata = header.pop("__metadata__", {})
    tensors = {}
    for name, entry in header.items():
        begin, end = (8 + length + offset for offset in entry["data_offsets"])
        assert begin % np.dtype(NUMPY_TYPES[entry["dtype"]]).itemsize == 0, f"{name} is not aligned"
        tensors[name] = np.frombuffer(raw[begin:end], NUMPY_TYPES[entry["dtype"]]).reshape(entry["shape"])
    return tensors, metadata


@contextlib.contextmanager
def foreign_classes(*paths):
    """Makes classes importable inside a `with` block. A class is given as ("yacs.config.CfgNode", dict): path, base."""
    made, before = {}, dict(sys.modules)
    try:
        for path, base in paths:
            module_name, _, name = path.rpartition(".")
            parts = module_name.split(".")
            for i in range(len(parts)):
                parent = ".".join(parts[: i + 1])
                sys.modules.setdefault(parent, types.ModuleType(parent))
            made[name] = type(name, (base,), {"__module__": module_name})
            setattr(sys.modules[module_name], name, made[name])
        yield types.SimpleNamespace(**made)
    finally:
        for name in set(sys.modules) - set(before):
            del sys.modules[name]


class _Python2Pickler(pickle._Pickler):
    """Writes text and bytes as Python 2 does, which has one type for both."""

    dispatch = dict(pickle._Pickler.dispatch)

    def save_string(self, value):
        raw = value.encode("latin-1") if isinstance(value, str) else value
        if self.bin == 0:
            self.write(b"S" + repr(raw)[1:].encode("ascii") + b"\n")
        elif len(raw) < 256:
            self.write(b"U" + bytes([len(raw)]) + raw)
        else:
            self.write(b"T" + struct.pack("<i", len(raw)) + raw)
        self.memoize(value)

    dispatch[str] = save_string
    dispatch[bytes] = save_string


def python2_pickle(value, protocol=2):
    """Pickles `value` as Python 2's cPickle does, with the module names of numpy 1."""
    buffer = io.BytesIO()
    _Python2Pickler(buffer, protocol=protocol, fix_imports=True).dump(value)
    return buffer.getvalue().replace(b"numpy._core.", b"numpy.core.")
