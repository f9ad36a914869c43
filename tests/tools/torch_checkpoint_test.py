"""Reads files of torch.save without torch, and compares them with torch's own tensors."""

import io
import json
import os
import pathlib
import pickle
import struct
import tempfile
import unittest
import zipfile

import support  # first of ours: it sets the path
import safetensors_file
import torch
from restricted_pickle import RefusedPickle
from safetensors_file import TensorFileError
from torch_checkpoint import TorchFile


def numbers(tensor):
    """Returns the bytes of a safetensors_file.Tensor."""
    return b"".join(bytes(chunk) for chunk in tensor.chunks())


def bits(tensor):
    return tensor.detach().contiguous().flatten().view(torch.uint8).numpy().tobytes() if tensor.numel() else b""


class TorchFileCase(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = os.path.join(self.folder.name, "file.ckpt")

    def save(self, value, **options):
        torch.save(value, self.path, **options)
        return self.path

    def entries(self):
        with zipfile.ZipFile(self.path) as archive:
            return {info.filename: archive.read(info) for info in archive.infolist()}

    def rewrite(self, entries, compression=zipfile.ZIP_STORED):
        with zipfile.ZipFile(self.path, "w", compression) as archive:
            for name, data in entries.items():
                archive.writestr(name, data)


class ReadingTest(TorchFileCase):
    def test_every_dtype_and_layout(self):
        torch.manual_seed(3)
        base = torch.randn(6, 5)
        tensors = {
            str(dtype).removeprefix("torch."): (torch.randn(3, 4) * 20).to(dtype)
            for dtype in (
                torch.float64, torch.float32, torch.float16, torch.bfloat16, torch.int64, torch.int32, torch.int16,
                torch.int8, torch.uint8, torch.bool,
            )
        }  # fmt: skip
        tensors |= {
            "scalar": torch.tensor(7.0),
            "empty": torch.zeros(0, 4),
            "transposed": base.t(),
            "rows": base[2:4],
            "columns": base[:, 1:3],
            "steps": base[::2, ::3],
            "permuted": torch.randn(2, 3, 4).permute(2, 0, 1),
            "one": base[3, 3],
            "tied": base,
            "again": base,
            "parameter": torch.nn.Parameter(torch.randn(4)),
            "large": torch.randn(3000, 1000).t(),  # is written in several chunks
        }
        file = TorchFile(self.save(tensors))
        read = file.tensors(file.root, "root")
        self.assertEqual(list(read), list(tensors))
        for name, tensor in tensors.items():
            with self.subTest(name=name):
                self.assertEqual(read[name].shape, tuple(tensor.shape))
                self.assertEqual(numbers(read[name]), bits(tensor))
        names = {"float64": "F64", "bfloat16": "BF16", "int8": "I8", "uint8": "U8", "bool": "BOOL"}
        self.assertEqual({name: read[name].dtype for name in names}, names)

    def test_whole_storages_are_streamed(self):
        file = TorchFile(self.save({"big": torch.zeros(5 << 20)}))
        chunks = list(file.tensors(file.root, "root")["big"].chunks())
        self.assertGreater(len(chunks), 1)
        self.assertEqual(sum(map(len, chunks)), 20 << 20)

    def test_values_that_are_not_tensors(self):
        file = TorchFile(self.save({"a": torch.ones(1), "b": [1]}))
        with self.assertRaisesRegex(TensorFileError, "file.ckpt: root: b: a list, expected a tensor"):
            file.tensors(file.root, "root")
        with self.assertRaisesRegex(TensorFileError, "root is a list"):
            file.tensors([1], "root")
        file = TorchFile(self.save({3: torch.ones(1)}))
        with self.assertRaisesRegex(TensorFileError, "expected names"):
            file.tensors(file.root, "root")


class DamageTest(TorchFileCase):
    def assert_broken(self, message, error=TensorFileError, **options):
        with self.assertRaisesRegex(error, message) as caught:
            file = TorchFile(self.path, **options)
            for tensor in file.tensors(file.root, "root").values():
                numbers(tensor)
        self.assertIn(self.path, str(caught.exception))

    def test_truncated_files(self):
        whole = pathlib.Path(self.save({"w": torch.randn(64, 64), "v": torch.randn(9)})).read_bytes()
        for length in [*range(0, 200), *range(200, len(whole), 997), len(whole) - 1]:
            with open(self.path, "wb") as file:
                file.write(whole[:length])
            self.assert_broken("")

    def test_flipped_bit_in_a_tensor(self):
        weights = torch.full((64, 64), 3.0)
        data = bytearray(pathlib.Path(self.save({"w": weights, "part": weights[1:3]})).read_bytes())
        where = data.index(struct.pack("<f", 3.0) * 16)
        data[where + 5000] ^= 0x10
        with open(self.path, "wb") as file:
            file.write(data)
        self.assert_broken("data/0': CRC-32")
        file = TorchFile(self.path, check_sums=False)
        self.assertNotEqual(numbers(file.tensors(file.root, "root")["w"]), bits(weights))

    def test_flipped_bit_in_the_pickle(self):
        data = bytearray(pathlib.Path(self.save({"weight_name": torch.ones(1)})).read_bytes())
        data[data.index(b"weight_name")] ^= 1
        with open(self.path, "wb") as file:
            file.write(data)
        self.assert_broken("data.pkl': CRC-32")

    def test_zips_that_torch_did_not_write(self):
        self.save({"w": torch.randn(40)})
        entries = self.entries()
        self.rewrite(entries, zipfile.ZIP_DEFLATED)
        self.assert_broken("compressed")
        self.rewrite({name: data for name, data in entries.items() if not name.endswith("data/0")})
        self.assert_broken("storage 'file/data/0' is not in the file")
        self.rewrite(entries | {"file/data/0": b"\0" * 8})
        self.assert_broken("has 8 bytes, expected 160")
        self.rewrite(entries | {"file/byteorder": b"big"})
        self.assert_broken("big-endian")
        self.rewrite({"other.txt": b""})
        self.assert_broken("0 entries named data.pkl")
        self.rewrite(entries | {"b/data.pkl": b""})
        self.assert_broken("2 entries named data.pkl")

    def test_entries_that_appear_twice(self):
        self.save({"w": torch.randn(4)})
        with self.assertWarns(UserWarning), zipfile.ZipFile(self.path, "a") as archive:
            archive.writestr("file/data/0", b"\0" * 16)
        self.assert_broken("appears twice")

    def test_files_that_are_something_else(self):
        for content, message in (
            (b"", "empty"),
            (b"<!DOCTYPE html><title>Google Drive</title>", "a web page"),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\n", "Git LFS pointer"),
            (b"\x93NUMPY", "not a whole torch file"),
        ):
            with open(self.path, "wb") as file:
                file.write(content)
            self.assert_broken(message)
        self.save({"w": torch.ones(2)}, _use_new_zipfile_serialization=False)
        self.assert_broken("old format")


class HostileTest(TorchFileCase):
    def refuse(self, root, *mentions, error=RefusedPickle, persistent_id=None):
        """Writes a checkpoint with a pickle of `root`, in which every _Id is a persistent id. Checks that reading it
        fails with these mentions."""
        self.save({"w": torch.zeros(4)})
        buffer = io.BytesIO()
        pickler = pickle._Pickler(buffer, 2)
        pickler.persistent_id = lambda value: value.identity if isinstance(value, _Id) else None
        pickler.dump(root)
        self.rewrite(self.entries() | {"file/data.pkl": buffer.getvalue()})
        with self.assertRaises(error) as caught:
            file = TorchFile(self.path)
            for tensor in file.tensors(file.root, "root").values():
                numbers(tensor)
        for mention in (self.path, *mentions):
            self.assertIn(mention, str(caught.exception))

    def test_persistent_ids_of_strange_shape(self):
        for identity in (
            "storage",
            ["storage", torch.FloatStorage, "0", "cpu", 4],
            ("storage", torch.FloatStorage, "0", "cpu"),
            ("module", torch.FloatStorage, "0", "cpu", 4),
            ("storage", "FloatStorage", "0", "cpu", 4),
            ("storage", torch.FloatStorage, "../../data.pkl", "cpu", 4),
            ("storage", torch.FloatStorage, "0", "cpu", -4),
            ("storage", torch.FloatStorage, "0", "cpu", True),
            ("storage", torch.FloatStorage, "0", 7, 4),
        ):
            with self.subTest(identity=identity):
                self.refuse({"w": _Id(identity)}, "persistent id")
        self.refuse({"w": _Id(("storage", torch.nn.Linear, "0", "cpu", 4))}, "torch.nn.modules.linear.Linear")

    def test_tensors_that_reach_outside(self):
        for offset, shape, strides, mention in (
            (0, (5,), (1,), "reaches number 4"),
            (4, (1,), (1,), "reaches number 4"),
            (0, (2, 2), (3, 1), "reaches number 4"),
            (0, (2**40, 2**40), (0, 0), "repeats its storage"),
            (0, (2**62, 4), (0, 1), "repeats its storage"),
            (-1, (4,), (1,), "sizes"),
            (0, (-4,), (1,), "sizes"),
            (0, (4,), (-1,), "sizes"),
            (0, (4,), (1, 1), "sizes"),
            (0, [4], (1,), "sizes"),
            (0, (1 << 63,), (0,), "sizes"),
            # A product of these has a million digits.
            (0, (1 << 2000,) * 10_000, (0,) * 10_000, "sizes"),
            (0, (1,) * 33, (0,) * 33, "sizes"),
        ):
            with self.subTest(shape=str(shape)[:60], offset=offset):
                storage = _Id(("storage", torch.FloatStorage, "0", "cpu", 4))
                tensor = _Rebuild(torch._utils._rebuild_tensor_v2, (storage, offset, shape, strides, False, {}))
                self.refuse({"w": tensor}, mention, error=TensorFileError)

    def test_many_tensors_of_one_storage(self):
        """A file of 40 kB that describes 40 MB."""
        weights = torch.zeros(10_000)
        self.save({str(i): weights for i in range(1_000)})
        file = TorchFile(self.path)
        with self.assertRaisesRegex(TensorFileError, "8 times as many bytes as the file has"):
            file.tensors(file.root, "root")

    def test_a_zip_directory_that_would_fill_the_memory(self):
        end = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 0xFFFF, 0xFFFF, 40 << 20, 0, 0)
        pathlib.Path(self.path).write_bytes(b"PK\3\4" + bytes((40 << 20) - 4) + end)
        with self.assertRaisesRegex(TensorFileError, "a zip directory of 41943040 bytes"):
            TorchFile(self.path)

    def test_sizes_of_a_safetensors_file_that_are_none(self):
        for shape in ([10**4000] * 2_000, [1] * 33, [1 << 63], [-1], [1.0], ["1"]):
            header = json.dumps({"w": {"dtype": "F32", "shape": shape, "data_offsets": [0, 4]}}).encode()
            pathlib.Path(self.path).write_bytes(len(header).to_bytes(8, "little") + header + bytes(4))
            with self.assertRaisesRegex(TensorFileError, "w: its shape and data_offsets"):
                safetensors_file.read(self.path)

    def test_dtypes_that_the_network_never_has(self):
        storage = _Id(("storage", torch.ComplexFloatStorage, "0", "cpu", 2))
        tensor = _Rebuild(torch._utils._rebuild_tensor_v2, (storage, 0, (2,), (1,), False, {}))
        self.refuse({"w": tensor}, "ComplexFloatStorage", error=TensorFileError)

    def test_programs_in_the_pickle(self):
        self.refuse({"hyper_parameters": _Rebuild(os.system, ("true",))}, "posix.system")
        self.refuse({"w": _Rebuild(torch.load, ("x",))}, "torch.serialization.load")


class _Id:
    def __init__(self, identity):
        self.identity = identity


class _Rebuild:
    def __init__(self, function, args):
        self.call = function, args

    def __reduce__(self):
        return self.call


if __name__ == "__main__":
    unittest.main()
