"""Reads a pickle as data. It imports, calls and executes nothing that the file names.

A class or function that the file names becomes a `Global`, which holds two strings. An object becomes a `Record`, which
holds the class, the constructor's arguments, the state and the items that the file gives. Code that knows a class
interprets its records afterwards (pickled_arrays.py, torch_checkpoint.py).

This alone makes a hostile pickle harmless. A file that names something dangerous, such as `os.system`, is refused all
the same, because it is not the file that its user believes it to be (see pickle_names.py).

The size of the file and MAX_OPCODES bound the time and the memory that reading takes.
"""

from __future__ import annotations

import codecs
import struct
from typing import Callable, Optional

from pickle_machine import Machine, Record, checked_key, decode, short
from pickle_names import BrokenPickle, Global, RefusedPickle, check_name

__all__ = ["BrokenPickle", "Global", "Record", "RefusedPickle", "load"]

MAX_OPCODES = 1_000_000  # a Lightning checkpoint with its optimizers takes about 150,000
MAX_INTEGER_BYTES = 256


def load(data, where: str, persistent: Optional[Callable[[object], object]] = None):
    """Returns the object of one pickle, of any protocol (0 to 5).

    data: bytes, or a memoryview. where: the file's name for messages. persistent: converts a persistent id into an
    object, or raises RefusedPickle for an unknown id; without it, persistent ids are refused.

    Dicts, lists, tuples, sets, numbers and text are returned as such. A Python 2 string is returned as text if it is
    ASCII, otherwise as bytes. Throws BrokenPickle and RefusedPickle, whose message has the byte position.
    """
    machine = Machine(memoryview(data), persistent)
    try:
        return _run(machine)
    except (BrokenPickle, RefusedPickle) as error:
        raise type(error)(f"{where}: byte {machine.opcode_at} of the pickle: {error}") from None


def _run(machine: Machine):
    for _ in range(MAX_OPCODES):
        machine.opcode_at = machine.position
        code = machine.take(1)[0]
        handler = _HANDLERS.get(code)
        if handler is None:
            raise BrokenPickle(f"unknown opcode 0x{code:02x}")
        handler(machine)
        if machine.stopped:
            return machine.result()
    raise RefusedPickle(f"more than {MAX_OPCODES:,} opcodes; no known file needs so many")


_HANDLERS: dict[int, Callable[[Machine], None]] = {}


def _opcode(code: bytes):
    def register(handler):
        _HANDLERS[code[0]] = handler
        return handler

    return register


def _python2_string(raw: bytes):
    try:
        return raw.decode("ascii")
    except UnicodeDecodeError:
        return raw


def _checked_integer(count: int) -> int:
    if count > MAX_INTEGER_BYTES:
        raise RefusedPickle(f"an integer of {count} bytes, expected at most {MAX_INTEGER_BYTES}")
    return count


def _text_number(machine: Machine, text: str, kind: Callable):
    _checked_integer(len(text))
    try:
        return kind(text)
    except ValueError:
        raise BrokenPickle(f"{short(text)} where a number is expected") from None


# --- opcodes: control ----------------------------------------------------------------------------------------------


@_opcode(b"\x80")
def _proto(machine):
    version = machine.unsigned(1)
    if version > 5:
        raise BrokenPickle(f"protocol {version}, expected 0 to 5")


@_opcode(b"\x95")
def _frame(machine):
    size = machine.unsigned(8)
    left = len(machine.data) - machine.position
    if size > left:
        raise BrokenPickle(f"the file ends early: a frame of {size} bytes, {left} left")


@_opcode(b".")
def _stop(machine):
    machine.stopped = True


@_opcode(b"(")
def _mark(machine):
    machine.marks.append(len(machine.stack))


@_opcode(b"0")
def _pop(machine):
    if machine.marks and machine.marks[-1] == len(machine.stack):
        machine.marks.pop()
    else:
        machine.pop()


_HANDLERS[b"1"[0]] = Machine.pop_mark
_HANDLERS[b"2"[0]] = lambda machine: machine.push(machine.top())

# --- opcodes: numbers and text -------------------------------------------------------------------------------------

for _code, _value in {b"N": None, b"\x88": True, b"\x89": False}.items():
    _HANDLERS[_code[0]] = lambda machine, value=_value: machine.push(value)

_HANDLERS[b"K"[0]] = lambda machine: machine.push(machine.unsigned(1))
_HANDLERS[b"M"[0]] = lambda machine: machine.push(machine.unsigned(2))
_HANDLERS[b"J"[0]] = lambda machine: machine.push(struct.unpack("<i", machine.take(4))[0])
_HANDLERS[b"G"[0]] = lambda machine: machine.push(struct.unpack(">d", machine.take(8))[0])
_HANDLERS[b"F"[0]] = lambda machine: machine.push(_text_number(machine, machine.text_line(), float))


@_opcode(b"I")
def _int(machine):
    text = machine.text_line()
    truth = {"00": False, "01": True}.get(text)  # protocols 0 and 1 write bools in this way
    machine.push(_text_number(machine, text, int) if truth is None else truth)


@_opcode(b"L")
def _long(machine):
    machine.push(_text_number(machine, machine.text_line().removesuffix("L"), int))


for _code, _width in {b"\x8a": 1, b"\x8b": 4}.items():
    _HANDLERS[_code[0]] = lambda machine, width=_width: machine.push(
        int.from_bytes(machine.take(_checked_integer(machine.unsigned(width))), "little", signed=True)
    )

# take() compares a length with the rest of the file before anything is copied.
for _code, _width, _kind in (
    (b"T", 4, _python2_string),
    (b"U", 1, _python2_string),
    (b"B", 4, bytes),
    (b"C", 1, bytes),
    (b"\x8e", 8, bytes),
    (b"\x96", 8, bytes),
    (b"X", 4, lambda raw: decode(raw, "utf-8")),
    (b"\x8c", 1, lambda raw: decode(raw, "utf-8")),
    (b"\x8d", 8, lambda raw: decode(raw, "utf-8")),
):
    _HANDLERS[_code[0]] = lambda machine, width=_width, kind=_kind: machine.push(
        kind(bytes(machine.take(machine.unsigned(width))))
    )


@_opcode(b"S")
def _string(machine):
    quoted = machine.line().strip()
    if len(quoted) < 2 or quoted[:1] not in b"'\"" or quoted[-1:] != quoted[:1]:
        raise BrokenPickle(f"a string without quotes: {short(quoted)}")
    try:
        machine.push(_python2_string(codecs.escape_decode(quoted[1:-1])[0]))
    except ValueError:
        raise BrokenPickle("a string with a broken escape") from None


_HANDLERS[b"V"[0]] = lambda machine: machine.push(decode(machine.line(), "raw-unicode-escape"))

# --- opcodes: containers -------------------------------------------------------------------------------------------

_HANDLERS[b"]"[0]] = lambda machine: machine.push([])
_HANDLERS[b"l"[0]] = lambda machine: machine.push(machine.pop_mark())
_HANDLERS[b")"[0]] = lambda machine: machine.push(())
_HANDLERS[b"t"[0]] = lambda machine: machine.push(tuple(machine.pop_mark()))
_HANDLERS[b"}"[0]] = lambda machine: machine.push({})
_HANDLERS[b"\x8f"[0]] = lambda machine: machine.push(set())
_HANDLERS[b"\x91"[0]] = lambda machine: machine.push(frozenset(map(checked_key, machine.pop_mark())))

for _code, _count in {b"\x85": 1, b"\x86": 2, b"\x87": 3}.items():
    _HANDLERS[_code[0]] = lambda machine, count=_count: machine.push(
        tuple([machine.pop() for _ in range(count)][::-1])
    )


@_opcode(b"a")
def _append(machine):
    value = machine.pop()
    machine.append(machine.top(), [value])


@_opcode(b"e")
def _appends(machine):
    values = machine.pop_mark()
    machine.append(machine.top(), values)


@_opcode(b"d")
def _dict(machine):
    values = machine.pop_mark()
    made: dict = {}
    machine.set_items(made, values)
    machine.push(made)


@_opcode(b"s")
def _setitem(machine):
    value, key = machine.pop(), machine.pop()
    machine.set_items(machine.top(), [key, value])


@_opcode(b"u")
def _setitems(machine):
    values = machine.pop_mark()
    machine.set_items(machine.top(), values)


@_opcode(b"\x90")
def _additems(machine):
    values = machine.pop_mark()
    target = machine.top()
    if isinstance(target, Record):
        target.elements.extend(values)
    elif isinstance(target, set):
        target.update(map(checked_key, values))
    else:
        raise RefusedPickle(f"adds to {short(target)}, which is not a set")


# --- opcodes: the memo ---------------------------------------------------------------------------------------------

_HANDLERS[b"q"[0]] = lambda machine: machine.remember(machine.unsigned(1))
_HANDLERS[b"r"[0]] = lambda machine: machine.remember(machine.unsigned(4))
_HANDLERS[b"p"[0]] = lambda machine: machine.remember(_text_number(machine, machine.text_line(), int))
_HANDLERS[b"\x94"[0]] = lambda machine: machine.remember(len(machine.memo))
_HANDLERS[b"h"[0]] = lambda machine: machine.recall(machine.unsigned(1))
_HANDLERS[b"j"[0]] = lambda machine: machine.recall(machine.unsigned(4))
_HANDLERS[b"g"[0]] = lambda machine: machine.recall(_text_number(machine, machine.text_line(), int))

# --- opcodes: names and objects ------------------------------------------------------------------------------------


@_opcode(b"c")
def _global(machine):
    module = machine.text_line()
    machine.push(check_name(module, machine.text_line()))


@_opcode(b"\x93")
def _stack_global(machine):
    name, module = machine.pop(), machine.pop()
    machine.push(check_name(module, name))


@_opcode(b"R")
def _reduce(machine):
    args, target = machine.pop(), machine.pop()
    machine.push(machine.call(target, args))


@_opcode(b"i")
def _inst(machine):
    module = machine.text_line()
    cls = check_name(module, machine.text_line())
    machine.push(machine.call(cls, tuple(machine.pop_mark())))


@_opcode(b"o")
def _obj(machine):
    values = machine.pop_mark()
    if not values:
        raise BrokenPickle("creates an object without a class")
    machine.push(machine.call(values[0], tuple(values[1:])))


@_opcode(b"\x81")
def _newobj(machine):
    args, cls = machine.pop(), machine.pop()
    if not isinstance(cls, Global) or not isinstance(args, tuple):
        raise RefusedPickle(f"creates an object of {short(cls)}, which is not a class")
    machine.push(Record(cls, args))


@_opcode(b"\x92")
def _newobj_ex(machine):
    keywords, args, cls = machine.pop(), machine.pop(), machine.pop()
    if not isinstance(cls, Global) or not isinstance(args, tuple) or not isinstance(keywords, dict):
        raise RefusedPickle(f"creates an object of {short(cls)}, which is not a class")
    machine.push(Record(cls, args + tuple(keywords.items())))


@_opcode(b"b")
def _build(machine):
    state = machine.pop()
    machine.build(machine.top(), state)


_HANDLERS[b"Q"[0]] = lambda machine: machine.identify(machine.pop())
_HANDLERS[b"P"[0]] = lambda machine: machine.identify(machine.line())


def _refused_extension(machine):
    raise RefusedPickle("uses the extension registry (EXT), which names a class by a number")


def _refused_buffer(machine):
    raise RefusedPickle("uses a buffer outside the file (NEXT_BUFFER)")


for _code in (b"\x82", b"\x83", b"\x84"):
    _HANDLERS[_code[0]] = _refused_extension
for _code in (b"\x97", b"\x98"):
    _HANDLERS[_code[0]] = _refused_buffer
