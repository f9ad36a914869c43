"""The stack machine behind restricted_pickle.py.

It has no side effects: where Python would create an object, it creates a record that describes the object.
"""

from __future__ import annotations

from typing import Callable, Optional

from pickle_names import BrokenPickle, Global, RefusedPickle, is_class_name, makes_values


class Record:
    """Describes an object whose class was not imported."""

    __slots__ = ("cls", "args", "state", "entries", "elements")

    def __init__(self, cls: Global, args: tuple):
        self.cls = cls
        self.args = args  # the arguments that its constructor or __new__ would receive
        self.state = None  # the argument that __setstate__ would receive
        self.entries: dict = {}  # the items, if the class is a subclass of dict
        self.elements: list = []  # the items, if the class is a subclass of list or set

    @property
    def path(self) -> str:
        return self.cls.path

    def __repr__(self) -> str:
        return f"<{self.path}>"


class Machine:
    """The state of an unpickler: a stack, marks on the stack, and a memo."""

    def __init__(self, data: memoryview, persistent: Optional[Callable[[object], object]]):
        self.data = data
        self.persistent = persistent
        self.position = 0
        self.opcode_at = 0
        self.stack: list = []
        self.marks: list[int] = []
        self.memo: dict[int, object] = {}
        self.stopped = False

    def result(self):
        """Returns the object that the pickle describes. It must be the only one left on the stack."""
        value = self.pop()
        if self.stack or self.marks:
            raise BrokenPickle("the pickle ends with unused objects on its stack")
        if self.position != len(self.data):
            raise BrokenPickle(f"{len(self.data) - self.position} bytes follow the end of the pickle")
        return value

    # --- input ---

    def take(self, count: int) -> memoryview:
        left = len(self.data) - self.position
        if count > left:
            raise BrokenPickle(f"the file ends early: {count} bytes expected, {left} left")
        self.position += count
        return self.data[self.position - count : self.position]

    def unsigned(self, width: int) -> int:
        return int.from_bytes(self.take(width), "little")

    def line(self) -> bytes:
        start = self.position
        step = 4096
        while True:
            chunk = bytes(self.data[self.position : self.position + step])
            if not chunk:
                raise BrokenPickle("the file ends early: inside a line of text")
            end = chunk.find(b"\n")
            if end >= 0:
                self.position += end + 1
                return bytes(self.data[start : self.position - 1])
            self.position += len(chunk)
            step = min(2 * step, 1 << 24)

    def text_line(self) -> str:
        return decode(self.line(), "ascii")

    # --- the stack ---

    def push(self, value) -> None:
        self.stack.append(value)

    def pop(self):
        if len(self.stack) <= (self.marks[-1] if self.marks else 0):
            raise BrokenPickle("takes an object from an empty stack")
        return self.stack.pop()

    def top(self):
        value = self.pop()
        self.push(value)
        return value

    def pop_mark(self) -> list:
        if not self.marks:
            raise BrokenPickle("takes objects up to a mark that is not there")
        start = self.marks.pop()
        values = self.stack[start:]
        del self.stack[start:]
        return values

    def remember(self, index: int) -> None:
        if not 0 <= index < 1 << 32:
            raise BrokenPickle(f"stores an object under the number {index}")
        self.memo[index] = self.top()

    def recall(self, index: int) -> None:
        if index not in self.memo:
            raise BrokenPickle(f"recalls object {index}, which was never stored")
        self.push(self.memo[index])

    # --- objects ---

    def call(self, target, args) -> Record:
        """Returns a record of the object that a call would create. Throws RefusedPickle when the target does not look
        like a class."""
        if not isinstance(target, Global):
            raise RefusedPickle(f"calls {short(target)}, which is not a class")
        if not isinstance(args, tuple):
            raise RefusedPickle(f"calls {target.path} with {short(args)} as its arguments")
        match target.path, args:
            case "copyreg._reconstructor", (Global() as cls, Global() as base, content):  # protocols 0 and 1
                return Record(cls, () if base.path == "builtins.object" else (content,))
            case "copyreg.__newobj__", (Global() as cls, *rest):
                return Record(cls, tuple(rest))
            case "builtins.getattr", (Global() as enum, str() as member) if is_class_name(enum.name):
                return Record(enum, (member,))  # Python 3.11 pickles a member of an Enum in this way
        if not makes_values(target):
            raise RefusedPickle(f"calls {target.path}, which is unknown and does not look like a class")
        return Record(target, args)

    def build(self, target, state) -> None:
        if not isinstance(target, Record):
            raise RefusedPickle(f"sets the state of {short(target)}, which has no state")
        if target.state is not None:
            raise RefusedPickle(f"sets the state of one {target.path} twice")
        target.state = state

    def set_items(self, target, values: list) -> None:
        if len(values) % 2:
            raise BrokenPickle("sets a key that has no value")
        entries = target.entries if isinstance(target, Record) else target
        if not isinstance(entries, dict):
            raise RefusedPickle(f"sets items of {short(target)}, which is not a dict")
        for key, value in zip(values[::2], values[1::2]):
            entries[checked_key(key)] = value

    def append(self, target, values: list) -> None:
        elements = target.elements if isinstance(target, Record) else target
        if not isinstance(elements, list):
            raise RefusedPickle(f"appends to {short(target)}, which is not a list")
        elements.extend(values)

    def identify(self, identity) -> None:
        if self.persistent is None:
            raise RefusedPickle("names an object outside the file (a persistent id)")
        self.push(self.persistent(identity))


MAX_KEY_PARTS = 16
MAX_KEY_LENGTH = 1 << 16


def checked_key(key):
    """Returns the key if it is safe to hash. Hashing recurses without a limit, so nested keys are refused. A tuple is
    hashed, and equal texts are compared, each time that they are used, so long ones are refused too."""
    scalars = (str, bytes, bool, float, type(None), Global, Record)
    if isinstance(key, tuple) and len(key) > MAX_KEY_PARTS:
        raise RefusedPickle(f"a tuple of {len(key)} parts as the key of a dict or the member of a set")
    for part in key if isinstance(key, tuple) else (key,):
        if isinstance(part, (str, bytes)) and len(part) > MAX_KEY_LENGTH:
            raise RefusedPickle(f"a text of {len(part)} characters as the key of a dict or the member of a set")
        # Large integers with equal remainders would all fall into one bucket.
        if not isinstance(part, scalars) and not (isinstance(part, int) and abs(part) < 1 << 60):
            raise RefusedPickle(f"{short(part)} as the key of a dict or the member of a set")
    return key


def decode(raw: bytes, encoding: str) -> str:
    try:
        return raw.decode(encoding, "surrogatepass" if encoding == "utf-8" else "strict")
    except UnicodeDecodeError:
        raise BrokenPickle(f"text that is not {encoding}: {short(raw)}") from None


def short(value: object) -> str:
    """Describes a value for a message, in a bounded number of characters."""
    if isinstance(value, (str, bytes)):
        text = repr(value[:60])
        return text if len(value) <= 60 else text + "..."
    if isinstance(value, (Global, Record)):
        return value.path
    return f"a {type(value).__name__}"
