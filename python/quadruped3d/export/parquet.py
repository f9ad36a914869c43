"""Exports of a dataset as Parquet files: labels alone (`parquet`), or with pictures (`hf`); both with a card."""

from __future__ import annotations

import pathlib
import re
from typing import Any, Literal

import pyarrow.parquet

from ..shards import Shard, Source, read_manifest, shard_files
from . import card, croissant, tables
from .folder import ExportFolder

_CODE = 1  # raise it when the bytes or the meaning of the files change
_FILE_BYTES = 512 << 20  # of shards in one Parquet file


def export(
    source: Source,
    out: Source,
    kind: Literal["parquet", "hf"],
    *,
    pictures_anyway: bool = False,
    quiet: bool = True,
) -> dict[str, Any]:
    """Exports a dataset into a folder and returns the manifest's summary: files, samples, pictures, left out.

    A run that was stopped goes on where it ended; one that is complete is checked and left as it is. Raises ExportError
    if the folder holds something else, and ShardError if the dataset cannot be read.
    """
    manifest = read_manifest(source)
    shards = [Shard(file) for file in shard_files(source)]
    terms = card.terms_of(manifest)
    licensed = frozenset(name for name, own in terms.items() if own["licence"] or pictures_anyway)
    about = {
        "export": kind,
        "code": _CODE,
        "name": manifest["name"],
        "version": manifest["version"],
        "key": manifest["key"],
        "content_id": manifest["content_id"],
        "pictures_anyway": pictures_anyway,
    }
    folder = ExportFolder(pathlib.Path(out), about)
    if not folder.is_complete:
        _write(folder, manifest, shards, kind, licensed, quiet)
    rows = [name for shard in shards for name in tables.dataset_names(shard)]
    has_pictures = kind == "hf" and any(shard.image_encoding != "reference" for shard in shards)
    return {
        "out": str(out),
        "files": len(folder.files),
        "samples": len(rows),
        "pictures": sum(name in licensed for name in rows) if has_pictures else 0,
        "without_licence": sorted({name for name in rows if name not in licensed}) if has_pictures else [],
    }


def _write(
    folder: ExportFolder,
    manifest: dict[str, Any],
    shards: list[Shard],
    kind: Literal["parquet", "hf"],
    licensed: frozenset[str],
    quiet: bool,
) -> None:
    schema = tables.schema_of(shards[0], pictures=kind == "hf")
    groups = _groups(shards)
    splits = sorted({_split_name(str(split)) for shard in shards for split in shard.read("split")})
    done = 0
    for split in splits:
        parts = [(group, rows) for group in groups if any(rows := [_rows(shard, split) for shard in group])]
        for number, (group, rows) in enumerate(parts):
            name = f"data/{split}-{number:05}-of-{len(parts):05}.parquet"
            count = sum(map(len, rows))
            folder.write(name, lambda path: _write_table(path, group, rows, schema, licensed), rows=count)  # noqa: B023
            done += count
            if not quiet:
                print(f"{name}: {count} samples ({done} of {sum(shard.rows for shard in shards)})", flush=True)
    folder.write_text("croissant.json", _croissant(folder, manifest, splits, schema))
    folder.write_text("README.md", card.card_of(manifest, splits, schema.names, kind == "hf"))
    folder.finish()


def _groups(shards: list[Shard]) -> list[list[Shard]]:
    """Runs of shards whose files together have about _FILE_BYTES."""
    groups: list[list[Shard]] = []
    size = 0
    for shard in shards:
        own = shard.path.stat().st_size
        if not groups or size + own > _FILE_BYTES:
            groups.append([])
            size = 0
        groups[-1].append(shard)
        size += own
    return groups


def _rows(shard: Shard, split: str) -> list[int]:
    return [row for row, name in enumerate(shard.read("split")) if _split_name(str(name)) == split]


def _split_name(split: str) -> str:
    """Hugging Face allows letters, digits, "_" and "." in the name of a split."""
    return re.sub(r"[^A-Za-z0-9_.]", "_", split)


def _write_table(
    path: pathlib.Path, shards: list[Shard], rows: list[list[int]], schema: Any, licensed: frozenset[str]
) -> None:
    with pyarrow.parquet.ParquetWriter(path, schema, compression="zstd") as writer:
        for shard, own in zip(shards, rows, strict=True):
            if own:
                writer.write_table(tables.table_of(shard, own, schema, licensed))
            shard.close()


def _croissant(folder: ExportFolder, manifest: dict[str, Any], splits: list[str], schema: Any) -> str:
    terms = card.terms_of(manifest)
    stated = [own["citation"] for own in terms.values() if own["citation"]]
    return croissant.croissant_of_tables(
        name=manifest["name"],
        description=card.summary_of(manifest),
        version=manifest["version"],
        licences=sorted({own["licence"] or "not stated" for own in terms.values()}),
        citation="\n\n".join([card.PAPER, *dict.fromkeys(stated)]),
        limits=card.LIMITS,
        sources=sorted({own["source_url"] for own in terms.values() if own["source_url"]}),
        files=folder.files,
        splits=splits,
        schema=schema,
    )
