"""Tests that the unpickler reads data correctly and executes nothing."""

import collections
import datetime
import enum
import io
import os
import pathlib
import pickle
import struct
import subprocess
import sys
import tempfile
import tracemalloc
import unittest

import support  # first of ours: it sets the path
from restricted_pickle import MAX_OPCODES, BrokenPickle, Global, Record, RefusedPickle, load


class Colour(enum.Enum):
    RED = 1


class Plain:
    """Its state shows whether __init__ was called, and __setstate__ fails when it is called."""

    def __init__(self):
        self.value = [1, 2]

    def __setstate__(self, state):
        raise AssertionError("executed")


def read(data):
    return load(data, "test.pkl")


def call(module, name, *args):
    """Returns a protocol-2 pickle that calls module.name(*args)."""
    body = b"c" + module.encode() + b"\n" + name.encode() + b"\n("
    for arg in args:
        body += b"X" + struct.pack("<I", len(arg)) + arg.encode()
    return b"\x80\x02" + body + b"tR."


class PlainDataTest(unittest.TestCase):
    VALUE = {
        "none": None,
        "flags": [True, False],
        "integers": [0, 1, -1, 255, 256, 65536, -(2**31), 2**31, 2**63, -(2**100), 10**60],
        "reals": [0.0, -1.5, 1e300],
        "texts": ["", "plain", "Grüße", "日本", "a\nb\\'\"", "x" * 300],
        "bytes": [b"", b"\x00\xff", b"y" * 300],
        "tuples": [(), (1,), (1, 2), (1, 2, 3), (1, 2, 3, 4)],
        "nested": {"a": {"b": [[], [{}]]}, 7: "seven", None: 0, (1, "x"): 1},
        "sets": [{1, 2}, frozenset({"a"})],
    }

    def test_agrees_with_pickle_in_every_protocol(self):
        for protocol in range(2, 6):
            value = dict(self.VALUE)
            if protocol < 4:  # older protocols pickle bytes and sets as calls
                del value["bytes"], value["sets"]
            with self.subTest(protocol=protocol):
                self.assertEqual(read(pickle.dumps(value, protocol)), value)

    def test_agrees_with_pickle_in_text_protocols(self):
        value = {key: self.VALUE[key] for key in ("none", "flags", "integers", "reals", "texts", "tuples", "nested")}
        for protocol in (0, 1):
            with self.subTest(protocol=protocol):
                self.assertEqual(read(pickle.dumps(value, protocol)), value)

    def test_shared_and_recursive_objects_stay_one(self):
        shared = [1]
        result = read(pickle.dumps([shared, shared], 2))
        self.assertIs(result[0], result[1])
        loop = []
        loop.append(loop)
        result = read(pickle.dumps(loop, 2))
        self.assertIs(result[0], result)

    def test_python2_strings_are_text_or_bytes(self):
        for protocol in (0, 1, 2):
            data = support.python2_pickle({"ascii": "it's\n", "raw": b"\x93\x00\xff" * 100}, protocol)
            self.assertEqual(read(data), {"ascii": "it's\n", "raw": b"\x93\x00\xff" * 100})


class ForeignObjectTest(unittest.TestCase):
    def test_unknown_classes_are_records(self):
        path = f"{Plain.__module__}.Plain"
        for protocol in range(6):
            with self.subTest(protocol=protocol):
                record = read(pickle.dumps(Plain(), protocol))
                self.assertEqual((type(record), record.path, record.state), (Record, path, {"value": [1, 2]}))

    def test_subclasses_of_containers_keep_their_items(self):
        with support.foreign_classes(("yacs.config.CfgNode", dict), ("lab.Names", list)) as made:
            node, names = made.CfgNode(depth=32), made.Names(["a", "b"])
            node.frozen = True
            data = [pickle.dumps([node, names], protocol) for protocol in range(2, 6)]
        self.assertNotIn("yacs", sys.modules)
        for pickled in data:
            record, listed = read(pickled)
            self.assertEqual((record.path, record.state), ("yacs.config.CfgNode", {"frozen": True}))
            self.assertEqual(record.entries, {"depth": 32})
            self.assertEqual((listed.path, listed.elements), ("lab.Names", ["a", "b"]))

    def test_values_of_the_standard_library(self):
        value = [
            pathlib.PurePosixPath("a/b"),
            datetime.datetime(2026, 1, 2),
            collections.OrderedDict(a=1),
            collections.defaultdict(list),
            Colour.RED,
            int,
        ]
        for protocol in range(2, 6):
            path, _, ordered, default, colour, integer = read(pickle.dumps(value, protocol))
            self.assertTrue(path.path.startswith("pathlib."))
            self.assertEqual(ordered.entries, {"a": 1})
            self.assertEqual(default.args, (Global("builtins", "list"),))
            self.assertEqual(colour.cls.name, "Colour")
            self.assertIn(integer.path, ("builtins.int", "builtins.long"))


class HostileTest(unittest.TestCase):
    """Every attack is refused with a message that names it, and has no effect."""

    def assert_refused(self, data, *mentions, error=RefusedPickle):
        with self.assertRaises(error) as caught:
            read(data)
        for mention in ("test.pkl", *mentions):
            self.assertIn(mention, str(caught.exception))
        self.assertLess(len(str(caught.exception)), 500)

    def test_programs(self):
        canary = os.path.join(tempfile.mkdtemp(), "canary")

        class Attack:
            def __reduce__(self):
                return os.system, (f"touch {canary}",)

        class Spawn:
            def __reduce__(self):
                return subprocess.Popen, (["touch", canary],)

        for protocol in range(6):
            self.assert_refused(pickle.dumps(Attack(), protocol), "posix.system")
            self.assert_refused(pickle.dumps([1, {"x": Spawn()}], protocol), ".Popen")  # Python 2: commands.Popen
        self.assertFalse(os.path.exists(canary))

    def test_functions(self):
        for module, name in (
            ("builtins", "eval"),
            ("__builtin__", "exec"),
            ("builtins", "__import__"),
            ("builtins", "open"),
            ("builtins", "type"),
            ("importlib", "import_module"),
            ("runpy", "run_path"),
            ("shutil", "rmtree"),
            ("pickle", "loads"),
            ("operator", "attrgetter"),
            ("types", "FunctionType"),
            ("ctypes", "CDLL"),
            ("socket", "socket"),
            ("torch.hub", "load"),
            ("numpy", "load"),
            ("lab.tools", "run_everything"),
        ):
            with self.subTest(name=name):
                self.assert_refused(call(module, name, "x"), name)

    def test_every_way_to_name_a_function(self):
        self.assert_refused(b"(S'ls'\nios\nsystem\n.", "os.system")  # INST
        self.assert_refused(b"(cos\nsystem\nS'ls'\no.", "os.system")  # OBJ
        self.assert_refused(b"\x80\x04\x8c\x02os\x8c\x06system\x93)R.", "os.system")  # STACK_GLOBAL
        self.assert_refused(b"\x80\x02cos\nsystem\n)\x81.", "os.system")  # NEWOBJ
        self.assert_refused(b"cos\nsystem\n.", "os.system")  # named, but never called
        self.assert_refused(b"\x80\x04\x8c\x03lab\x8c\x15Net.__init__.__module\x93.", "Net.__init__")
        self.assert_refused(b"\x80\x04K\x01K\x02\x93.", "not a Python name")
        self.assert_refused(b"clab; import os\nNet\n.", "not a Python name")

    def test_getattr_serves_enums_alone(self):
        self.assertEqual(read(b"cbuiltins\ngetattr\n(clab\nKind\nS'ONE'\ntR.").args, ("ONE",))
        self.assert_refused(b"cbuiltins\ngetattr\n(clab\ntools\nS'run'\ntR.", "getattr")
        self.assert_refused(b"cbuiltins\ngetattr\n((lS'__class__'\ntR.", "getattr")

    def test_calls_of_results(self):
        self.assert_refused(b"clab\nMaker\n)R)R.", "calls lab.Maker")
        self.assert_refused(b"S'eval'\n)R.", "calls 'eval'")
        self.assert_refused(b"clab\nMaker\n]R.", "as its arguments")
        self.assert_refused(b"\x80\x02])\x81.", "a list, which is not a class")
        self.assert_refused(b"\x80\x04clab\nNet\n)]\x92.", "lab.Net, which is not a class")

    def test_states(self):
        self.assert_refused(b"(l}b.", "sets the state of a list")
        self.assert_refused(b"clab\nNet\n}b.", "sets the state of lab.Net")  # this would set attributes of the class
        self.assert_refused(b"\x80\x02clab\nNet\n)\x81}b}b.", "twice")
        self.assert_refused(b"NS'a'\nK\x01s.", "sets items of a NoneType")
        self.assert_refused(b"\x80\x02}K\x01a.", "appends to a dict")
        self.assert_refused(b"\x80\x04](K\x01\x90.", "adds to a list")

    def test_objects_from_elsewhere(self):
        self.assert_refused(b"\x80\x02K\x01Q.", "persistent id")
        self.assert_refused(b"Pdevice\n.", "persistent id")
        for code in (b"\x82\x01", b"\x83\x01\x00", b"\x84\x01\x00\x00\x00"):
            self.assert_refused(b"\x80\x02" + code + b".", "EXT")
        self.assert_refused(b"\x80\x05\x97.", "NEXT_BUFFER")

    def test_bombs(self):
        bombs = {
            "an integer of 2147483647 bytes": b"\x80\x02\x8b\xff\xff\xff\x7f" + b"\x01" * 1000 + b".",
            "an integer of": b"L" + b"9" * 5000 + b"L\n.",
            "as the key": b"(" + b"K\x01" + b"\x85" * 200_000 + b"K\x01d.",  # hashing it overflows the C stack
        }
        for mention, data in bombs.items():
            with self.subTest(mention=mention):
                tracemalloc.start()
                self.assert_refused(data, mention)
                peak = tracemalloc.get_traced_memory()[1]
                tracemalloc.stop()
                self.assertLess(peak, 150 * len(data) + 1_000_000)
        self.assert_refused(b"N0" * (MAX_OPCODES // 2) + b"N.", "opcodes")

    def test_keys_that_take_long_to_hash_or_to_compare(self):
        long_tuple = b"(" + b"N" * 300_000 + b"t\x94"
        self.assert_refused(b"\x80\x04" + long_tuple + b"0}(" + b"h\x00N" * 200_000 + b"u.", "a tuple of 300000 parts")
        text = b"B" + (1 << 20).to_bytes(4, "little") + bytes(1 << 20) + b"\x94"
        self.assert_refused(b"\x80\x04}" + text + b"Ns.", "a text of 1048576 characters")

    def test_deep_and_wide_objects_are_harmless(self):
        deep = b"]" * 200_000 + b"a" * 199_999 + b"."
        self.assertEqual(len(read(deep)), 1)
        # Every list holds the previous one twice: there are 60 lists in memory, but a walk over them visits 2^60.
        layers = [b"]q" + bytes([i]) + b"(" + 2 * (b"h" + bytes([i - 1])) + b"e" for i in range(1, 61)]
        self.assertEqual(len(read(b"(]q\x00" + b"".join(layers) + b"t.")), 61)
        # Its text would be as long as the walk, so it is in no message.
        self.assert_refused(b"]q\x00" + b"".join(layers) + b"N\x93.", "a global with the name of type list")

    def test_lengths_beyond_the_end_of_the_file(self):
        longest = b"\xff\xff\xff\xff"
        for code in (b"T" + longest, b"B" + longest, b"X" + longest, b"\x8e" + 2 * longest, b"\x95" + 2 * longest):
            self.assert_refused(b"\x80\x04" + code + b"abc.", "ends early", error=BrokenPickle)


class BrokenTest(unittest.TestCase):
    def setUp(self):
        buffer = io.BytesIO()
        pickle.dump({"text": "abc", "list": [1, 2.5, None], "object": Plain(), "big": 2**70}, buffer, 2)
        self.data = buffer.getvalue()

    def test_every_truncation_is_reported(self):
        for length in range(len(self.data)):
            with self.assertRaises(BrokenPickle, msg=f"{length} bytes"):
                read(self.data[:length])
        with self.assertRaisesRegex(BrokenPickle, "3 bytes follow"):
            read(self.data + b"abc")

    def test_flipped_bytes_never_raise_anything_else(self):
        outcomes = collections.Counter()
        for position in range(len(self.data)):
            for flip in (0x01, 0x20, 0x80, 0xFF):
                damaged = bytearray(self.data)
                damaged[position] ^= flip
                try:
                    read(bytes(damaged))
                    outcomes["read"] += 1
                except (BrokenPickle, RefusedPickle) as error:
                    outcomes[type(error).__name__] += 1
        self.assertGreater(outcomes["BrokenPickle"], 100)

    def test_stack_and_memo_faults(self):
        for data, message in (
            (b"a.", "empty stack"),
            (b"t.", "mark"),
            (b"h\x05.", "object 5"),
            (b"g99\n.", "object 99"),
            (b"K.", "ends early"),
            (b"K\x01K\x02.", "unused objects"),
            (b"(K\x01d.", "no value"),
            (b"K\x01p-3\n.", "number -3"),
            (b"\xfe.", "unknown opcode 0xfe"),
            (b"\x80\x09.", "protocol 9"),
            (b"Ix1\n.", "where a number is expected"),
            (b"S'abc\n.", "without quotes"),
            (b"X\x02\x00\x00\x00\xff\xff.", "not utf-8"),
        ):
            with self.subTest(data=data), self.assertRaisesRegex(BrokenPickle, message):
                read(data)


if __name__ == "__main__":
    unittest.main()
