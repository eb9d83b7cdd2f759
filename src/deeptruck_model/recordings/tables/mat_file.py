"""Reads tables from MAT files, by scipy."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from deeptruck_model._io.reading import plain
from deeptruck_model.errors import InputError

SUFFIX = ".mat"
MOST_COLUMNS = 64  # of a matrix


def read(path: Path) -> tuple[pa.Table, list[str]]:
    """The vectors of a file of version 4 to 7 as columns, those of structures as STRUCTURE.FIELD, and the
    names of vectors that are left out.

    Structures with a `time` of their own (Structure With Time of Simulink, exported timeseries) share one
    column `time`, the union of theirs; a signal is blank in rows that are not its own. Without such, vectors
    of the most frequent length are used. Raises InputError for a file of version 7.3 (which is HDF5), a
    damaged one, and one without numeric vectors.
    """
    from scipy.io import loadmat

    try:
        held = loadmat(path, squeeze_me=True, struct_as_record=False)
    except Exception as error:  # whatever a damaged byte leads the library to
        raise InputError(
            f"{path} cannot be read as a MAT file ({plain(str(error), 120)}); save it with '-v7', or as CSV"
        ) from None
    of_time: list[tuple[NDArray[Any], dict[str, NDArray[Any]]]] = []
    others: dict[str, NDArray[Any]] = {}
    for key, value in held.items():
        vectors = {} if key.startswith("__") else dict(_vectors(key, value))
        clock = next((name for name in vectors if name.lower() == f"{key}.time".lower()), "")
        if clock:
            of_time.append((vectors.pop(clock).astype(float), vectors))
        else:
            others |= vectors
    if not of_time and not others:
        raise InputError(f"{path} holds no vector of numbers; save time and signals as vectors")
    columns: dict[str, NDArray[Any]] = {}
    lengths = [len(values) for values in others.values()]
    rows = max(set(lengths), key=lambda length: (lengths.count(length), length)) if lengths else 0
    if of_time:
        columns["time"] = np.unique(np.concatenate([time for time, _ in of_time]))
        rows = len(columns["time"])
    for time, vectors in of_time:
        for name, values in vectors.items():
            if len(values) == len(time):
                columns[name] = np.full(rows, np.nan)
                columns[name][np.searchsorted(columns["time"], time)] = values
    columns |= {name: values for name, values in others.items() if len(values) == rows}
    names = [*others, *(name for _, vectors in of_time for name in vectors)]
    table = pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})
    return table, [name for name in names if name not in columns]


def _vectors(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    if hasattr(value, "_fieldnames"):
        for inner in value._fieldnames:
            yield from _vectors(f"{name}.{inner}", getattr(value, inner))
    elif not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
        return
    elif value.ndim == 1 and len(value) > 1:
        yield name, value
    elif value.ndim == 2:
        yield from ((f"{name}[{k + 1}]", value[:, k]) for k in range(min(value.shape[1], MOST_COLUMNS)))
