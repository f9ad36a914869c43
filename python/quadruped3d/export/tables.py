"""The columns of shards as Arrow tables, one row for each sample."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from ..shards import TRUST_COLUMNS, Shard

# They come first; all other columns follow by name.
_FIRST = ("id", "dataset", "split", "source", "species", "family", "label_kind", "verdict")
_PICTURES = {"image": "crop", "mask": "crop_mask"}  # column of the table -> of the shard


def label_columns(shard: Shard) -> list[str]:
    """All columns of numbers and texts, in the table's order."""
    names = {name for name, column in shard.columns.items() if column.kind != "bytes"} | set(TRUST_COLUMNS)
    return [*_FIRST, *sorted(names - set(_FIRST))]


def schema_of(shard: Shard, pictures: bool) -> pa.Schema:
    """The table's schema. Each field says its units and meaning; Hugging Face's own description is in the metadata."""
    about = shard.describe()
    fields, features = [], {}
    for name in label_columns(shard):
        column = shard.columns.get(name)  # none: a trust score that schema 1 does not have
        inner = pa.string() if column and column.kind == "text" else pa.from_numpy_dtype(column.dtype if column else "f8")
        kind: Any = inner
        feature: dict[str, Any] = {"dtype": _feature_dtype(inner), "_type": "Value"}
        for extent in reversed(column.row_shape if column else ()):
            kind = pa.list_(kind, extent)
            feature = {"feature": feature, "length": extent, "_type": "Sequence"}
        meaning = {key: about[name][key] for key in ("units", "meaning") if name in about}
        fields.append(pa.field(name, kind, nullable=False, metadata=meaning))
        features[name] = feature
    if pictures:
        for name in _PICTURES:
            fields.append(pa.field(name, pa.struct([("bytes", pa.binary()), ("path", pa.string())])))
            features[name] = {"_type": "Image"}
    return pa.schema(fields, metadata={"huggingface": json.dumps({"info": {"features": features}})})


def table_of(shard: Shard, rows: Sequence[int], schema: pa.Schema, licensed: frozenset[str]) -> pa.Table:
    """Some rows of a shard. Pictures are null where the sample's dataset ("name/split") is not among `licensed`."""
    index = np.asarray(rows, np.int64)
    arrays = []
    for field in schema:
        if field.name in _PICTURES:
            arrays.append(_pictures(shard, index, field, licensed))
        else:
            arrays.append(_array(shard.read(field.name)[index], field.type))
    return pa.Table.from_arrays(arrays, schema=schema)


def dataset_names(shard: Shard) -> list[str]:
    """The source dataset of each row, "name/split"."""
    return [f"{name}/{split}" for name, split in zip(shard.read("dataset"), shard.read("split"), strict=True)]


def _feature_dtype(kind: Any) -> str:
    return {"float": "float32", "double": "float64"}.get(str(kind), str(kind))


def _array(values: npt.NDArray[Any], kind: Any) -> Any:
    if values.ndim == 1:
        return pa.array(values, kind)
    flat = pa.array(np.ascontiguousarray(values).reshape(-1))
    for extent in reversed(values.shape[1:]):
        flat = pa.FixedSizeListArray.from_arrays(flat, extent)
    return flat.cast(kind)


def _pictures(shard: Shard, index: npt.NDArray[np.int64], field: Any, licensed: frozenset[str]) -> Any:
    column = _PICTURES[field.name]
    suffix = "png" if column == "crop_mask" or shard.image_encoding == "png" else "jpg"
    names = dataset_names(shard)
    pictures = []
    for row in index.tolist():
        encoded = shard.picture(row, column) if names[row] in licensed else b""
        path = f"{field.name}_{int(shard.attributes['unit']):06}_{row:05}.{suffix}"
        pictures.append({"bytes": encoded, "path": path} if encoded else None)
    return pa.array(pictures, field.type)
