"""Exports of a dataset as Parquet files, with Croissant metadata and a card: `python -m quadruped3d.export`.

The program's `quadruped3d export --format parquet` and `--format hf` call it. It needs pyarrow
(pip install 'quadruped3d[export]'); from Python, call quadruped3d.export.parquet.export.
"""
