"""Reads what the program wrote, with other libraries than the program's own, and damages files."""

import csv
import hashlib
import json
import re
import shutil
import struct

import h5py
import numpy as np


def latest(out):
    """The newest dataset of an output folder."""
    return (out / "latest").resolve()


def read_csv(path):
    """Rows of a CSV file as dictionaries."""
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def verdicts(dataset):
    """Rows of a dataset's verdicts.csv, one a candidate, in ingest order."""
    return read_csv(dataset / "verdicts.csv")


def kept(rows):
    """The rows whose candidates became samples."""
    return [row for row in rows if row["verdict"] in ("retained", "refined")]


def file_sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def digests(folder):
    """SHA-256 of every file below a folder, by its path in the folder."""
    return {str(p.relative_to(folder)): file_sha256(p) for p in sorted(folder.rglob("*")) if p.is_file()}


def build_digests(out):
    """digests() of a build's output folder, without the caches and the plan, which hold paths or times."""
    return {name: digest for name, digest in digests(out).items()
            if not name.startswith("stages/builds/") and name not in (".lock", "digests.txt")}


def stamps(paths):
    """Inode and time of change of every file: they are equal only if nobody wrote the file again."""
    return {path: (path.stat().st_ino, path.stat().st_mtime_ns) for path in paths}


def seal_json(document):
    """The text of a document that ends with the digest over itself, as the program writes dataset.json."""
    document.pop("digest", None)
    body = json.dumps(document, indent=2).removesuffix("\n}") + ",\n"
    return body + f'  "digest": "{hashlib.sha256(body.encode()).hexdigest()}"\n}}\n'


def copy_folder(source, target):
    """Copies a folder with its links as links, such as an output folder with `latest`."""
    return shutil.copytree(source, target, symlinks=True)


def read_samples(dataset, columns=None):
    """Every sample of a dataset, in order, as a dictionary of its columns; texts are bytes, as h5py gives them.

    Without `columns`: all that have one value or array a sample, which leaves out the encoded pictures.
    """
    samples = []
    for path in sorted((dataset / "shards").glob("*.h5")):
        with h5py.File(path) as shard:
            count = len(shard["id"])
            names = columns or [name for name in shard if not _is_bytes(shard, name)]
            values = {name: shard[name][:] for name in names}
            samples += [{name: value[i] for name, value in values.items()} for i in range(count)]
    return samples


def read_byte_column(dataset, name):
    """The bytes of one column of every sample, in order: an encoded picture, or b"" where there is none."""
    values = []
    for path in sorted((dataset / "shards").glob("*.h5")):
        with h5py.File(path) as shard:
            offsets = shard[f"{name}_offsets"][:]
            values += [shard[name][start:end].tobytes() for start, end in zip(offsets, offsets[1:])]
    return values


def _is_bytes(shard, name):
    """Byte columns come in pairs: all values end to end, and their offsets."""
    return f"{name}_offsets" in shard or name.endswith("_offsets")


def journal_lines(out):
    """How many units the journals of all stages name as finished."""
    return sum(path.read_text().count("\n") for path in out.glob("stages/*/journal.jsonl"))


def units_in_journals(out, stage):
    """Numbers of the units that a stage has finished."""
    return {int(number) for path in out.glob(f"stages/{stage}-*/journal.jsonl")
            for number in re.findall(r'"unit":(\d+)', path.read_text())}


def flip_bit(path, offset=None, bit=0):
    """Flips one bit of a file, in the middle unless `offset` (in bytes) says where. The file keeps its size. Other
    hard links of the file keep the old content, as after a copy that went wrong."""
    content = bytearray(path.read_bytes())
    content[len(content) // 2 if offset is None else offset] ^= 1 << bit
    path.unlink()
    path.write_bytes(content)


_NUMPY_TYPES = {"F64": np.float64, "F32": np.float32, "F16": np.float16, "I32": np.int32, "I64": np.int64}


def split_safetensors(path):
    """(header, data) of a safetensors file: its JSON as a dictionary, and the bytes that data_offsets count in."""
    content = path.read_bytes()
    length, = struct.unpack("<Q", content[:8])
    return json.loads(content[8 : 8 + length]), content[8 + length :]


def write_safetensors(path, header, data):
    """The inverse of split_safetensors."""
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(text)) + text + data)


def read_safetensors(path):
    """Every tensor of a safetensors file, by name."""
    header, data = split_safetensors(path)
    tensors = {}
    for name, entry in header.items():
        if name == "__metadata__":
            continue
        first, last = entry["data_offsets"]
        tensors[name] = np.frombuffer(data[first:last], _NUMPY_TYPES[entry["dtype"]]).reshape(entry["shape"])
    return tensors
