"""Decides which names a pickle may mention and call.

The unpickler never imports anything, so these lists are not what makes it safe. They detect a file that asks for
something that data never needs, and the user is told about it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

MAX_NAME_LENGTH = 256


class BrokenPickle(ValueError):
    """The bytes are not a complete pickle, or the pickle does not hold what was expected."""


class RefusedPickle(ValueError):
    """The pickle asks for something that data never needs."""


@dataclass(frozen=True)
class Global:
    """The name of a class or function. Modules that Python 3 renamed have their new name."""

    module: str
    name: str

    @property
    def path(self) -> str:
        return f"{self.module}.{self.name}"


# These modules run programs, load code, or access files and networks. No array, tensor or setting needs them, so a
# pickle that only mentions one of them is refused.
_PROGRAM_MODULES = frozenset(
    "os posix nt subprocess commands popen2 pty sys importlib imp pkgutil runpy zipimport shutil socket ssl "
    "ctypes _ctypes codeop pdb bdb timeit pickle cPickle _pickle dill cloudpickle joblib marshal operator "
    "_operator webbrowser multiprocessing threading _thread atexit asyncio concurrent urllib urllib2 http httplib "
    "ftplib smtplib requests httpx aiohttp io _io pip setuptools distutils ensurepip venv sqlite3".split()
)

# From these modules only the names of plain data are accepted.
_DATA_NAMES = {
    "builtins": frozenset(
        "object dict list tuple set frozenset int long float complex bool str unicode bytes bytearray range slice "
        "xrange getattr".split()
    ),
    "types": frozenset(["SimpleNamespace", "NoneType"]),
    "copyreg": frozenset(["_reconstructor", "__newobj__"]),
    "_codecs": frozenset(["encode"]),
    "codecs": frozenset(["encode"]),
}

_PYTHON2_MODULES = {"__builtin__": "builtins", "copy_reg": "copyreg"}

# Functions that pickles call to create plain values. Every other name that is called must look like a class.
_VALUE_MAKERS = frozenset(
    [f"builtins.{name}" for name in _DATA_NAMES["builtins"] if name != "getattr"]
    + [
        "_codecs.encode",
        "codecs.encode",
        "collections.defaultdict",
        "collections.deque",
        "datetime.date",
        "datetime.datetime",
        "datetime.time",
        "datetime.timedelta",
        "datetime.timezone",
        "functools.partial",
        "numpy.dtype",
        "numpy.ndarray",
        "numpy.core.multiarray._reconstruct",
        "numpy.core.multiarray.scalar",
        "numpy.core.numeric._frombuffer",
        "numpy._core.multiarray._reconstruct",
        "numpy._core.multiarray.scalar",
        "numpy._core.numeric._frombuffer",
        "torch.device",
    ]
)

_NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)


def check_name(module: object, name: object) -> Global:
    for text in (module, name):
        if not isinstance(text, str) or len(text) > MAX_NAME_LENGTH or not _NAME.fullmatch(text):
            # A list may hold others so often that its text would fill the memory.
            shown = repr(text[:60]) if isinstance(text, str) else f"of type {type(text).__name__}"
            raise RefusedPickle(f"a global with the name {shown}, which is not a Python name")
    found = Global(_PYTHON2_MODULES.get(module, module), name)
    if found.module.partition(".")[0] in _PROGRAM_MODULES:
        raise RefusedPickle(f"names {found.path}, which can run programs or access files")
    allowed = _DATA_NAMES.get(found.module)
    if allowed is not None:
        if name not in allowed:
            raise RefusedPickle(f"names {found.path}, which is not plain data")
    elif any(part.startswith("__") for part in name.split(".")):
        raise RefusedPickle(f"names {found.path}, which is an internal of a class")
    return found


def is_class_name(name: str) -> bool:
    return name.rpartition(".")[2].lstrip("_")[:1].isupper()


def makes_values(target: Global) -> bool:
    """True when a pickle may call the target: it looks like a class, or it is known to create plain values."""
    rebuilds = target.module == "torch._utils" and target.name.startswith("_rebuild_")
    return rebuilds or target.path in _VALUE_MAKERS or is_class_name(target.name)
