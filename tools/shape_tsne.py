#!/usr/bin/env python3
"""t-SNE of a dataset's shapes, for its report: tools/shape_tsne.py OUT [--perplexity 30] [--seed 0] [--most 2500]

Reads the betas of the labels from the shards of OUT (a version's folder, or an output folder with `latest`) and writes
tsne.json into OUT/report/<version>, where `quadruped3d report` finds it. It needs scikit-learn, which is optional:

    .venv/bin/pip install scikit-learn
"""

from __future__ import annotations

import argparse
import json
import pathlib
import sys

import h5py
import numpy as np


def dataset_folder(given: pathlib.Path) -> pathlib.Path:
    """The version's folder, resolved. Throws SystemExit where there is none."""
    for folder in (given, given / "latest"):
        if (folder / "dataset.json").exists():
            return folder.resolve()
    sys.exit(f"shape_tsne: {given}: expected a dataset's folder or an output folder of `build`")


def read_labels(folder: pathlib.Path) -> tuple[np.ndarray, list[str], list[str], list[str]]:
    """Betas (labels, 41), families, species and ids of all labels that have a shape."""
    betas, families, species, ids = [], [], [], []
    for path in sorted((folder / "shards").glob("*.h5")):
        with h5py.File(path) as shard:
            has = shard["has_betas"][:].astype(bool)
            betas.append(shard["betas"][:][has])
            for name, target in (("species", species), ("id", ids)):
                target += [text for text, chosen in zip(shard[name].asstr()[:], has) if chosen]
            families += [int(number) for number in shard["family"][:][has]]
    names = {-1: "none", 0: "felidae", 1: "canidae", 2: "equidae", 3: "bovidae", 4: "hippopotamidae"}
    return np.concatenate(betas) if betas else np.zeros((0, 41)), [names[number] for number in families], species, ids


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--perplexity", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--most", type=int, default=2500, help="labels that are shown, evenly spread")
    arguments = parser.parse_args()
    try:
        from sklearn.manifold import TSNE
    except ImportError:
        print("shape_tsne: scikit-learn is not installed: .venv/bin/pip install scikit-learn", file=sys.stderr)
        return 2
    folder = dataset_folder(arguments.out)
    betas, families, species, ids = read_labels(folder)
    count = min(len(betas), arguments.most)
    if count <= arguments.perplexity:
        print(f"shape_tsne: {count} labels have a shape, expected more than the perplexity, "
              f"{arguments.perplexity:g}", file=sys.stderr)
        return 1
    chosen = [i * len(betas) // count for i in range(count)]
    points = TSNE(perplexity=arguments.perplexity, random_state=arguments.seed, init="pca").fit_transform(betas[chosen])
    document = {
        "content_id": json.loads((folder / "dataset.json").read_text())["content_id"],
        "perplexity": arguments.perplexity, "seed": arguments.seed, "labels": len(betas),
        "x": [round(float(x), 3) for x in points[:, 0]], "y": [round(float(y), 3) for y in points[:, 1]],
        "family": [families[i] for i in chosen], "species": [species[i] for i in chosen], "id": [ids[i] for i in chosen],
    }
    target = folder.parent / "report" / folder.name / "tsne.json"
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_suffix(".tmp")
    temporary.write_text(json.dumps(document))
    temporary.replace(target)
    print(target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
