"""README.md of an export: what the dataset holds, how it was made, its terms and its limits."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

PAPER = """@article{yu2026prima,
  title  = {{PRIMA}: Boosting Animal Mesh Recovery with Biological Priors and Test-Time Adaptation},
  author = {Yu, Xiaohang and Wang, Ti and Mathis, Mackenzie Weygandt},
  journal = {arXiv:2606.02366},
  year   = {2026}
}"""

LIMITS = (
    "Labels of the kinds `retained` and `refined` are pseudo labels: a network predicted them, and a rule on the "
    "reprojection error of 2D keypoints decided which to keep. A small 2D error does not prove a right 3D pose, least of "
    "all in depth. Animals that the network knows badly are kept more rarely, so the shares of species and poses differ "
    "from those of the photographs. The bodies are SMAL's, whose shape space was made from five families; every other "
    "animal is fitted with those."
)


def summary_of(manifest: Mapping[str, Any]) -> str:
    """One sentence that says what the dataset is."""
    counts = manifest["counts"]
    kept = counts["retained"] + counts["refined"]
    return (
        f"3D labels (SMAL pose, shape and camera) of {kept} quadrupeds in photographs, kept of {counts['candidates']} "
        f"candidates and built by quadruped3d {manifest['toolkit']}."
    )


def terms_of(manifest: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Licence, source_url and citation by "dataset/split"; empty texts where the build's config says nothing."""
    stated: Mapping[str, Mapping[str, str]] = manifest.get("datasets", {})  # schema 1 has none
    names = stated or manifest["statistics"]["by_dataset"]
    return {
        name: {key: str(stated.get(name, {}).get(key, "")) for key in ("licence", "source_url", "citation")}
        for name in names
    }


def card_of(manifest: Mapping[str, Any], splits: Sequence[str], schema_names: Sequence[str], pictures: bool) -> str:
    """The text of README.md, with the header that Hugging Face reads."""
    parts = [
        _header(manifest, splits),
        f"# {_cell(str(manifest['name']))} {_cell(str(manifest['version']))}\n\n{summary_of(manifest)}",
        _use(splits, pictures),
        _counts(manifest),
        _thresholds(manifest),
        _terms(manifest, pictures),
        f"## Limits\n\n{LIMITS}",
        _columns(schema_names),
        _provenance(manifest),
        f"## Citation\n\nPlease cite the paper whose method this is, and the datasets above.\n\n```bibtex\n{PAPER}\n```",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _header(manifest: Mapping[str, Any], splits: Sequence[str]) -> str:
    licences = sorted({terms["licence"] for terms in terms_of(manifest).values()})
    single = licences[0] if len(licences) == 1 else ""
    is_spdx = re.fullmatch(r"[A-Za-z0-9.+-]+", single) is not None
    lines = ["---", f"license: {single.lower()}" if is_spdx else "license: other"]
    if not is_spdx:
        lines += ["license_name: see-the-table-of-licences", "license_link: README.md"]
    lines += [f"pretty_name: {_quoted(manifest['name'] + ' ' + manifest['version'])}", "tags:"]
    lines += [f"- {tag}" for tag in ("animals", "3d", "pose-estimation", "smal", "quadruped3d")]
    lines += ["configs:", "- config_name: default", "  data_files:"]
    for split in splits:
        lines += [f"  - split: {split}", f"    path: data/{split}-*.parquet"]
    return "\n".join([*lines, "---"])


def _quoted(text: str) -> str:
    """YAML's quoted text, which may hold what JSON's may; a line break in a name must not begin a new key."""
    return json.dumps(text, ensure_ascii=False)


def _use(splits: Sequence[str], pictures: bool) -> str:
    first = splits[0] if splits else "train"
    shown = 'sample["image"]  # a PIL picture' if pictures else 'sample["pose"]  # (35, 3, 3)'
    return (
        "## Use\n\n```python\nfrom datasets import load_dataset\n\n"
        f'samples = load_dataset("THIS FOLDER", split="{first}")\nsample = samples[0]\n{shown}\n```'
    )


def _cell(text: str) -> str:
    """A cell shows names of species and datasets, whoever chose them, as text: neither as HTML nor as a new row."""
    return html.escape(" ".join(text.splitlines()), quote=False).replace("|", "\\|")


def _table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    def line(cells: Sequence[Any]) -> str:
        return "| " + " | ".join(_cell(str(cell)) for cell in cells) + " |"

    return "\n".join([line(head), "|" + "---|" * len(head), *(line(row) for row in rows)])


def _counts(manifest: Mapping[str, Any]) -> str:
    counts, statistics = manifest["counts"], manifest["statistics"]
    verdicts = _table(["verdict", "candidates"], [[name, count] for name, count in counts.items()])
    labels = _table(["kind of label", "samples"], [[name, count] for name, count in manifest["labels"].items()])
    groups = []
    for title, key in (("family", "by_family"), ("species", "by_species"), ("dataset", "by_dataset")):
        rows = [
            [name, group["candidates"], group["retained"] + group["refined"]]
            for name, group in sorted(statistics[key].items(), key=lambda item: (-item[1]["candidates"], item[0]))
        ]
        groups.append(_table([title, "candidates", "kept"], rows))
    return "\n\n".join(["## Counts", verdicts, labels, *groups])


def _thresholds(manifest: Mapping[str, Any]) -> str:
    if not manifest["thresholds"]:
        return ""
    rows = [[name, *(values[key] for key in ("tau_low", "tau_high", "delta"))] for name, values in manifest["thresholds"].items()]
    return (
        "## Thresholds\n\nA prediction whose reprojection error (in sides of the crop) is below tau_low is kept, one at or "
        "above tau_high is dropped, and what lies between is refined by test-time adaptation and must gain at least delta. "
        f"The profile is `{manifest['profile']}`.\n\n" + _table(["dataset", "tau_low", "tau_high", "delta"], rows)
    )


def _terms(manifest: Mapping[str, Any], pictures: bool) -> str:
    terms = terms_of(manifest)
    rows = [[name, own["licence"] or "not stated", own["source_url"] or "not stated", own["citation"] or "not stated"]
            for name, own in terms.items()]
    text = "## Licences and sources\n\n" + _table(["dataset", "licence", "source", "citation"], rows)
    text += "\n\nThe SMAL body model has a licence of its own (smal.is.tue.mpg.de): non-commercial research."
    if not pictures:
        text += " This export holds labels alone, no pictures."
    return text


def _columns(names: Sequence[str]) -> str:
    listed = ", ".join(f"`{name}`" for name in names)
    return (
        "## Columns\n\nOne row is one sample. The metadata of each Parquet column and croissant.json say its units and its "
        f"meaning. {listed}."
    )


def _provenance(manifest: Mapping[str, Any]) -> str:
    return (
        "## Provenance\n\n"
        f"- dataset key `{manifest['key']}`\n- content id `{manifest['content_id']}` (SHA-256 over the shards' digests)\n"
        f"- shard schema {manifest['schema']}, quadruped3d {manifest['toolkit']}"
    )
