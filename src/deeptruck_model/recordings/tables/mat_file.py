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


def read(path: Path) -> pa.Table:
    """The vectors of a file of version 4 to 7 as columns, those of structures as STRUCTURE.FIELD.

    If vectors differ in length, those of the most frequent length are used. Raises InputError for a file of
    version 7.3 (which is HDF5), a damaged one, and one without numeric vectors.
    """
    from scipy.io import loadmat

    try:
        held = loadmat(path, squeeze_me=True, struct_as_record=False)
    except Exception as error:  # whatever a damaged byte leads the library to
        raise InputError(
            f"{path} cannot be read as a MAT file ({plain(str(error), 120)}); save it with '-v7', or as CSV"
        ) from None
    columns = {
        name: values
        for key, value in held.items()
        if not key.startswith("__")
        for name, values in _vectors(key, value)
    }
    lengths = [len(values) for values in columns.values()]
    if not lengths:
        raise InputError(f"{path} holds no vector of numbers; save time and signals as vectors")
    most = max(set(lengths), key=lambda length: (lengths.count(length), length))
    return pa.table({name: values for name, values in columns.items() if len(values) == most})


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
