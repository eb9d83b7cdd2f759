"""Vectors of a MAT file as the columns of one table."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from deeptruck_core import reading
from deeptruck_core.errors import InputError

SUFFIX = ".mat"
MOST_IN_A_MATRIX = 64  # columns of a matrix
CLOCKS = ("time", "t", "timestamp", "tout")  # fields of a structure that are the time of the others

Vectors = dict[str, NDArray[Any]]


def read(path: Path) -> tuple[pa.Table, list[str]]:
    """The vectors of a file of version 4 to 7, those of structures as STRUCTURE.FIELD, and remarks.

    Structures with a time of their own (Structure With Time of Simulink, exported timeseries, groups of a
    logger) share one column `time`, the union of theirs; a signal is blank in rows that are not its own.
    Without such, vectors of the most frequent length are used. Raises InputError for a file of version 7.3
    (which is HDF5), a damaged one, and one without numeric vectors.
    """
    from scipy.io import loadmat

    try:
        held = loadmat(path, squeeze_me=True, struct_as_record=False)
    except Exception as error:  # whatever a damaged byte leads the library to
        raise InputError(
            f"{path} cannot be read as a MAT file ({reading.plain(str(error), 120)}); save it with '-v7', or "
            "as CSV"
        ) from None
    timed: list[tuple[NDArray[Any], Vectors]] = []
    others: Vectors = {}
    for key, value in held.items():
        if not key.startswith("__"):
            others |= _of(key, value, timed)
    if not timed and not others:
        raise InputError(f"{path} holds no vector of numbers; save time and signals as vectors")
    columns: Vectors = {}
    lengths = [len(values) for values in others.values()]
    rows = max(set(lengths), key=lambda length: (lengths.count(length), length)) if lengths else 0
    if timed:
        columns["time"] = np.unique(np.concatenate([time for time, _ in timed]))
        rows = len(columns["time"])
    for time, vectors in timed:
        for name, values in vectors.items():
            columns[name] = np.full(rows, np.nan)
            columns[name][np.searchsorted(columns["time"], time)] = values
    columns |= {name: values for name, values in others.items() if len(values) == rows}
    table = pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})
    left_out = [name for name in others if name not in columns]
    return table, [f"of another length than the others, left out: {', '.join(left_out)}"] if left_out else []


def _of(name: str, value: Any, timed: list[tuple[NDArray[Any], Vectors]]) -> Vectors:
    """The vectors of a variable that have no time of their own; those that have are added to `timed`."""
    found: Vectors = {}
    if isinstance(value, np.ndarray) and value.dtype == object:  # an array of structures
        for k, one in enumerate(value.ravel()):
            label = getattr(one, "name", "")
            found |= _of(f"{name}.{label if isinstance(label, str) and label else k + 1}", one, timed)
        return found
    if not hasattr(value, "_fieldnames"):
        return dict(_vectors(name, value))
    for inner in value._fieldnames:
        found |= _of(f"{name}.{inner}", getattr(value, inner), timed)
    clocks = {f"{name}.{clock}".lower() for clock in CLOCKS}
    clock = next((one for one in found if one.lower() in clocks), "")
    if not clock or not (np.diff(time := found[clock].astype(float)) > 0.0).all():
        return found
    timed.append(
        (np.round(time, 9), {one: x for one, x in found.items() if one != clock and len(x) == len(time)})
    )
    return {one: x for one, x in found.items() if one != clock and len(x) != len(time)}


def _vectors(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
        return
    if value.ndim == 1 and len(value) > 1:
        yield name, value
    elif value.ndim == 2:
        yield from ((f"{name}[{k + 1}]", value[:, k]) for k in range(min(value.shape[1], MOST_IN_A_MATRIX)))
