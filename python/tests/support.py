"""What the tests of the package share: where the package, the C++ feed's dump and the test data are.

ctest says where the program dump_feed is (Q3D_DUMP_FEED). It writes shards, and the batches that the C++ feed makes of
them.
"""

import hashlib
import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

PACKAGE = pathlib.Path(__file__).resolve().parents[1]
REPOSITORY = PACKAGE.parent
sys.path.insert(0, str(PACKAGE))

import numpy as np  # noqa: E402

from quadruped3d import body  # noqa: E402


class Folder(unittest.TestCase):
    """Tests with a folder of their own."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="q3d_python_"))
        self.addCleanup(shutil.rmtree, self.folder)


def dump_feed(*arguments):
    """Runs the C++ program and returns what it printed."""
    result = subprocess.run([os.environ["Q3D_DUMP_FEED"], *map(str, arguments)], capture_output=True, text=True)
    if result.returncode != 0:
        raise AssertionError(f"dump_feed {arguments} ended with {result.returncode}\n{result.stderr}")
    return result.stdout


class Shards(Folder):
    """Tests on the shards that dump_feed writes: png.h5 (7 samples), single.h5 (1) and jpeg.h5 (6)."""

    @classmethod
    def setUpClass(cls):
        cls.shards = pathlib.Path(tempfile.mkdtemp(prefix="q3d_shards_"))
        cls.addClassCleanup(shutil.rmtree, cls.shards)
        dump_feed("shards", cls.shards)


_SHAPES = {"image": (3, 256, 256), "keypoints_2d": (26, 3), "keypoints_3d": (26, 4), "rotations": (35, 3, 3),
           "betas": (41,), "has_pose": (), "has_betas": ()}


def feed_batch(folder, sources, weights=(1.0,), seed=1, first=0, count=8, augment=None, raw_v=False):
    """The C++ feed's batch: its arrays by name, and `draws`, `ids`, `names` (of the species), `family`, `species`."""
    request = {"sources": [[str(path) for path in pool] for pool in sources], "weights": list(weights), "seed": seed,
               "first": first, "count": count, "augment": augment, "raw_v": raw_v, "out": str(folder)}
    file = folder / "request.json"
    file.write_text(json.dumps(request))
    batch = json.loads(dump_feed("batches", file))
    for name, shape in _SHAPES.items():
        batch[name] = np.fromfile(folder / name, np.float32).reshape(count, *shape)
    return batch


def read_safetensors(path):
    """Every tensor of a safetensors file, by name."""
    types = {"F64": np.float64, "F32": np.float32, "I32": np.int32, "U8": np.uint8}
    content = path.read_bytes()
    length, = struct.unpack("<Q", content[:8])
    data = content[8 + length:]
    return {name: np.frombuffer(data[slice(*entry["data_offsets"])], types[entry["dtype"]]).reshape(entry["shape"])
            for name, entry in json.loads(content[8:8 + length]).items() if name != "__metadata__"}


def check_issues(case, croissant):
    """Croissant 1.1 without an error or a warning of mlcroissant, but that a date is missing: equal exports have equal
    bytes."""
    case.assertEqual(croissant.metadata.ctx.conforms_to.value, "http://mlcommons.org/croissant/1.1")
    issues = croissant.metadata.ctx.issues
    case.assertEqual(set(issues.errors), set())
    case.assertEqual([text for text in issues.warnings if "datePublished" not in text], [])


def seal(document):
    """The text of a document that ends with the digest over itself, as the program writes dataset.json."""
    body = json.dumps(document, indent=2).removesuffix("\n}") + ",\n"
    return body + f'  "digest": "{hashlib.sha256(body.encode()).hexdigest()}"\n}}\n'


def make_dataset(folder, shards, terms=None):
    """A dataset's folder of copies of shards, with a dataset.json that counts them as `build` does.

    `terms` are the licences by "dataset/split"; without them the manifest is one of schema 1.
    """
    from quadruped3d import Shard

    (folder / "shards").mkdir(parents=True)
    opened, entries = [], []
    for unit, shard in enumerate(shards):
        name = f"shards/{unit:06}.h5"
        content = pathlib.Path(shard).read_bytes()
        (folder / name).write_bytes(content)
        opened.append(Shard(folder / name))
        entries.append({"file": name, "unit": unit, "rows": opened[-1].rows, "bytes": len(content),
                        "sha256": hashlib.sha256(content).hexdigest()})

    def counts(rows):
        return {"candidates": rows, "retained": rows, "refined": 0, "discarded": 0, "failed": 0}

    def groups(column):
        names = [str(name) or "unknown" for shard in opened for name in column(shard)]
        return {name: counts(names.count(name)) for name in sorted(set(names))}

    kinds = [str(kind) for shard in opened for kind in shard.read("label_kind")]
    manifest = {
        "format": "quadruped3d-dataset", "schema": 2 if terms is not None else 1, "name": "made", "version": "1.0.0",
        "key": "0" * 64, "toolkit": "0.2.0", "profile": "paper",
        "content_id": hashlib.sha256("".join(entry["sha256"] + "\n" for entry in entries).encode()).hexdigest(),
        "counts": counts(len(kinds)),
        "labels": {kind: kinds.count(kind) for kind in ("truth", "retained", "refined", "2d_only")},
        "thresholds": {"jpeg": {"tau_low": 0.03, "tau_high": 0.08, "delta": 0.05}},
        "statistics": {
            "all": counts(len(kinds)), "reasons": {},
            "by_dataset": groups(lambda shard: [f"{name}/{split}" for name, split in
                                                zip(shard.read("dataset"), shard.read("split"))]),
            "by_family": groups(lambda shard: [body.family_name(int(family)) for family in shard.read("family")]),
            "by_species": groups(lambda shard: shard.read("species")),
        },
        "provenance": {
            "config": {"datasets": [{"name": name} for name in
                                    sorted({str(name) for shard in opened for name in shard.read("dataset")})]},
            "checkpoint_sha256": None, "smal_asset_sha256": None, "device": None,
            "stage_keys": {"ingest": "i", "predict": "p", "fidelity": "f", "refine": "r", "measure": None, "shards": "s"},
        },
        "verdicts": {"file": "verdicts.csv", "sha256": ""},
        "shards": entries,
    }
    if terms is not None:
        manifest["datasets"] = terms
    (folder / "dataset.json").write_text(json.dumps(manifest) if terms is None else seal(manifest))
    return folder
