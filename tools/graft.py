#!/usr/bin/env python3
"""Gives an untrained network the weights of a trained one, wherever both have a parameter of the same name and shape.

So a network gets another stem and keeps what it has learnt behind it. What only the untrained network has keeps its
values. The metadata are those of the untrained network, and say where the weights came from.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import sys

import safetensors_file

FAILURE, INTERRUPTED = 1, 130


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(
        prog="graft.py",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="""Example, a trained network of size small with the stem of size lite:
  quadruped3d init --size lite --stem models/efficientnet_lite0.safetensors --out untrained.safetensors
  tools/graft.py untrained.safetensors small.safetensors grafted.safetensors
Exit codes: 0 done, 1 the files cannot be used (the message says why), 2 wrong usage, 130 stopped.""",
    )
    parser.add_argument("untrained", help="the checkpoint whose parameters decide what the result holds")
    parser.add_argument("trained", help="the checkpoint that gives its values")
    parser.add_argument("output", help="the checkpoint to write")
    options = parser.parse_args(arguments)
    try:
        graft(options.untrained, options.trained, options.output)
    except KeyboardInterrupt:
        print("graft: interrupted; no incomplete file is left", file=sys.stderr)
        return INTERRUPTED
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        print(f"graft: {where}{error.strerror or error}", file=sys.stderr)
        return FAILURE
    except ValueError as error:
        print(f"graft: {error}", file=sys.stderr)
        return FAILURE
    return 0


def graft(untrained: str, trained: str, output: str) -> None:
    """Writes the result and says what it holds. Throws ValueError (TensorFileError among them) when a file cannot be
    read or the two networks share nothing, and OSError."""
    base, metadata = safetensors_file.read(untrained)
    donor, _ = safetensors_file.read(trained)
    taken = [name for name, tensor in base.items() if name in donor and donor[name].shape == tensor.shape]
    if not taken:
        raise ValueError(f"{trained}: no parameter has a name and shape of {untrained}; are both networks?")
    with open(trained, "rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    origin = f"{os.path.basename(trained)}, SHA-256 {digest}"
    tensors = {name: donor[name] if name in taken else tensor for name, tensor in base.items()}
    safetensors_file.write(output, tensors, metadata | {"grafted_from": origin})
    print(f"{output}: {len(taken)} of {len(base)} tensors from {trained}")
    kept = sorted({name.split("._blocks.")[0] for name in base if name not in taken})
    print(f"  as in {untrained}: {', '.join(kept) if kept else 'none'}")
    left = sorted(name for name in donor if name not in taken)
    print(f"  not used of {trained}: {', '.join(left) if left else 'none'}")


if __name__ == "__main__":
    sys.exit(main())
