"""python -m quadruped3d.export parquet|hf DATASET --out FOLDER"""

from __future__ import annotations

import argparse
import json
import sys


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m quadruped3d.export", description=__doc__)
    parser.add_argument("format", choices=("parquet", "hf"))
    parser.add_argument("dataset", help="a dataset's folder, or an output folder of `build`")
    parser.add_argument("--out", required=True, help="folder for the export; empty, or that of the same export")
    parser.add_argument("--pictures-anyway", action="store_true", help="also pictures of datasets without a stated licence")
    parser.add_argument("--json", action="store_true", help="print a machine-readable summary to stdout")
    parser.add_argument("--quiet", action="store_true", help="do not show progress")
    arguments = parser.parse_args(words)
    try:
        from ..shards import ShardError
        from .folder import ExportError
        from .parquet import export
    except ImportError as error:
        print(f"quadruped3d.export: {error}; install it with: pip install 'quadruped3d[export]'", file=sys.stderr)
        return 2
    try:
        summary = export(
            arguments.dataset,
            arguments.out,
            arguments.format,
            pictures_anyway=arguments.pictures_anyway,
            quiet=arguments.quiet or arguments.json,
        )
    except (ExportError, ShardError, OSError) as error:
        print(f"quadruped3d.export: {error}", file=sys.stderr)
        return 1
    if arguments.json:
        print(json.dumps(summary))
    else:
        print(f"{summary['samples']} samples, {summary['pictures']} pictures in {summary['files']} files: {summary['out']}")
    for name in summary["without_licence"]:
        print(f"note: {name} states no licence, so its pictures were left out (--pictures-anyway)", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
