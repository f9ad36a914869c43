"""Reads the labels of whole datasets as NumPy arrays or as a pandas table."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
import numpy.typing as npt

from .shards import Source, open_shards

if TYPE_CHECKING:
    import pandas


@overload
def load(
    sources: Source | Iterable[Source], columns: Sequence[str] | None = None, *, table: Literal[False] = False
) -> dict[str, npt.NDArray[Any]]: ...


@overload
def load(
    sources: Source | Iterable[Source], columns: Sequence[str] | None = None, *, table: Literal[True]
) -> pandas.DataFrame: ...


def load(
    sources: Source | Iterable[Source], columns: Sequence[str] | None = None, *, table: bool = False
) -> dict[str, npt.NDArray[Any]] | pandas.DataFrame:
    """Reads columns of all samples: arrays whose first axis counts the samples, by the column's name.

    `columns` defaults to all that hold numbers or texts and that every shard has. With `table`, the result is a pandas table with one row for
    each sample; a column with more than one number a sample holds an array in each cell. Raises ShardError for a
    source that cannot be read, KeyError for a column that it lacks, and ImportError if pandas is missing.
    """
    shards = open_shards(sources)
    if columns is None:
        common = [name for name in shards[0].columns if all(name in shard.columns for shard in shards)]
        columns = [name for name in common if shards[0].columns[name].kind != "bytes"]
    arrays = {name: np.concatenate([shard.read(name) for shard in shards]) for name in columns}
    return _as_table(arrays) if table else arrays


def _as_table(arrays: dict[str, npt.NDArray[Any]]) -> pandas.DataFrame:
    try:
        import pandas
    except ImportError as error:
        raise ImportError("load(table=True) needs pandas: pip install 'quadruped3d[pandas]'") from error
    return pandas.DataFrame({name: list(values) if values.ndim > 1 else values for name, values in arrays.items()})
