#!/usr/bin/env python3
"""Writes into a checkpoint what its network was trained on and how far its predictions lie from held-out pictures.

    tools/describe_checkpoint.py CHECKPOINT OUT --pictures rendered --trained-on TEXT \\
        --evaluation FOLDER --held-out TEXT

FOLDER is the output of `quadruped3d evaluate` with this checkpoint on pictures that training has not seen; its
samples.csv gives L_proj of every prediction. OUT is the same checkpoint with the metadata `prima_domain`, which
pipeline/device/domain.h describes; it may be CHECKPOINT itself. `build` and `calibrate` compare a pool with it and warn
where the network is far from what it knows.
"""

from __future__ import annotations

import argparse
import csv
import json
import pathlib
import sys
from typing import Sequence

import numpy as np

import safetensors_file

DOMAIN_KEY = "prima_domain"
SHARES = (0.05, 0.25, 0.5, 0.75, 0.95)


def read_errors(samples: pathlib.Path) -> np.ndarray:
    """L_proj in crop units of every prediction that has one. Throws SystemExit that names the file if none has."""
    with open(samples, newline="") as file:
        errors = [float(row["l_proj"]) for row in csv.DictReader(file)
                  if row["setting"] == "prediction" and row["l_proj"]]
    if len(errors) < 20:
        raise SystemExit(f"{samples}: L_proj of {len(errors)} predictions, expected 20 or more")
    return np.array(errors)


def domain(pictures: str, trained_on: str, held_out: str, errors: np.ndarray | None) -> dict:
    document: dict = {"pictures": pictures, "trained_on": trained_on}
    if errors is not None:
        quantiles = np.quantile(errors, SHARES)
        document["held_out"] = {"what": held_out, "pictures": len(errors),
                                "l_proj": {str(share): round(float(value), 6)
                                           for share, value in zip(SHARES, quantiles)}}
    return document


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--pictures", required=True, choices=["rendered", "photographs"])
    parser.add_argument("--trained-on", required=True, help="for people: the data")
    parser.add_argument("--evaluation", type=pathlib.Path, help="output folder of `quadruped3d evaluate`")
    parser.add_argument("--held-out", default="", help="for people: which pictures were evaluated")
    options = parser.parse_args(arguments)
    if bool(options.evaluation) != bool(options.held_out):
        parser.error("--evaluation and --held-out belong together")
    errors = read_errors(options.evaluation / "samples.csv") if options.evaluation else None
    document = domain(options.pictures, options.trained_on, options.held_out, errors)
    tensors, metadata = safetensors_file.read(str(options.checkpoint))
    # The bytes are read before OUT replaces a CHECKPOINT of the same name.
    safetensors_file.write(str(options.out), tensors, metadata | {DOMAIN_KEY: json.dumps(document)})
    print(json.dumps(document, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
