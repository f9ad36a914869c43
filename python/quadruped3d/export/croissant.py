"""Croissant 1.1 metadata (docs.mlcommons.org/croissant) of an export in Parquet files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa

# The specification's own @context.
_CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "arrayShape": "cr:arrayShape",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "containedIn": "cr:containedIn",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "description": {"@container": "@language"},
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileObject": "cr:fileObject",
    "fileProperty": "cr:fileProperty",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isArray": "cr:isArray",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "name": {"@container": "@language"},
    "parentField": "cr:parentField",
    "path": "cr:path",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}
_PARQUET = "application/x-parquet"


def croissant_of_tables(
    *,
    name: str,
    description: str,
    version: str,
    licences: Sequence[str],
    citation: str,
    limits: str,
    sources: Sequence[str],
    files: Mapping[str, Mapping[str, Any]],
    splits: Sequence[str],
    schema: pa.Schema,
) -> str:
    """The text of croissant.json: one record set for each split, whose files are data/<split>-*.parquet.

    `files` are the entries of the export's manifest by their names.
    """
    distribution: list[dict[str, Any]] = [
        {
            "@type": "cr:FileObject",
            "@id": file,
            "name": file,
            "contentUrl": file,
            "contentSize": f"{entry['bytes']} B",
            "encodingFormat": _PARQUET,
            "sha256": entry["sha256"],
        }
        for file, entry in sorted(files.items())
        if file.endswith(".parquet")
    ]
    for split in splits:
        distribution.append(
            {
                "@type": "cr:FileSet",
                "@id": f"{split}-files",
                "name": f"{split}-files",
                "description": f"The files of the split {split}.",
                "encodingFormat": _PARQUET,
                "includes": f"data/{split}-*.parquet",
            }
        )
    document: dict[str, Any] = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.1",
        "name": name,
        "description": description,
        "version": version,
        "license": list(licences),
        "citeAs": citation,
        "rai:dataLimitations": limits,
        "distribution": distribution,
        "recordSet": [_record_set(split, schema) for split in splits],
    }
    if sources:
        document["isBasedOn"] = list(sources)
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _record_set(split: str, schema: pa.Schema) -> dict[str, Any]:
    return {
        "@type": "cr:RecordSet",
        "@id": split,
        "name": split,
        "description": f"The samples of the split {split}.",
        "key": {"@id": f"{split}/id"},
        "field": [_field(split, field) for field in schema],
    }


def _field(split: str, field: Any) -> dict[str, Any]:
    kind, shape = field.type, []
    while pa.types.is_fixed_size_list(kind):
        shape.append(kind.list_size)
        kind = kind.value_type
    about = {key.decode(): value.decode() for key, value in (field.metadata or {}).items()}
    units = f" ({about['units']})" if about.get("units") else ""
    source: dict[str, Any] = {"fileSet": {"@id": f"{split}-files"}, "extract": {"column": field.name}}
    described: dict[str, Any] = {
        "@type": "cr:Field",
        "@id": f"{split}/{field.name}",
        "name": field.name,
        "description": about.get("meaning", _PICTURES.get(field.name, field.name)) + units,
        "dataType": _data_type(kind),
        "source": source,
    }
    if pa.types.is_struct(kind):
        source["transform"] = {"jsonPath": "bytes"}
    if shape:
        described.update(isArray=True, arrayShape=",".join(map(str, shape)))
    return described


_PICTURES = {
    "image": "the stored crop of the photograph; null where its dataset states no licence",
    "mask": "the animal's silhouette in the stored crop; null where there is none",
}


def _data_type(kind: Any) -> str:
    if pa.types.is_struct(kind):
        return "sc:ImageObject"
    if pa.types.is_string(kind):
        return "sc:Text"
    names = {"float": "cr:Float32", "double": "cr:Float64", "int8": "cr:Int8", "uint8": "cr:UInt8", "int32": "cr:Int32"}
    return names[str(kind)]
