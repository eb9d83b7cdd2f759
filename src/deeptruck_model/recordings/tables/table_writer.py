"""Writes recordings as one CSV or Parquet table for other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv, parquet

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.formats import WRITTEN
from deeptruck_core.signals import CHANNELS
from deeptruck_model.recordings.recording import Recording


def check_table(path: Path) -> None:
    """Raises InputError unless `path` is a new file whose suffix is .csv or .parquet."""
    if path.suffix.lower() not in WRITTEN:
        raise InputError(f"{path} must end on {' or '.join(WRITTEN)}: the ending says which table is written")
    files.check_new(path)


def write_table(path: str | Path, recordings: Sequence[Recording]) -> Path:
    """Write a new table: the piece's name, `time` in s since the start of its bag, then every channel.

    A channel that a piece lacks is empty there, as are invalid samples. Parquet stores the unit of each
    column in its metadata (`unit`). Raises InputError as `check_table` does, and if there are no recordings.
    """
    path = Path(path)
    check_table(path)
    if not recordings:
        raise InputError("there is no recording to write")
    table = as_table(recordings)
    with files.new_file(path) as draft:
        if path.suffix.lower() == ".csv":
            csv.write_csv(table, draft)
        else:
            parquet.write_table(table, draft)
    return path


def as_table(recordings: Sequence[Recording]) -> pa.Table:
    """The table that `write_table` writes."""
    present = {name for r in recordings for name in r.channels}
    names = [*(n for n in CHANNELS if n in present), *sorted(present - set(CHANNELS))]
    fields = [pa.field("recording", pa.string()), pa.field("time", pa.float64(), metadata={"unit": "s"})]
    units = [recordings[0].interface.unit(name) for name in names]
    fields += [pa.field(n, pa.float64(), metadata={"unit": u}) for n, u in zip(names, units, strict=True)]
    columns = [
        pa.array(np.repeat([r.name for r in recordings], [len(r) for r in recordings])),
        pa.array(np.concatenate([r.time for r in recordings])),
    ]
    columns += [
        pa.array(
            np.concatenate([r.channels.get(n, np.full(len(r), np.nan)) for r in recordings]), from_pandas=True
        )
        for n in names
    ]
    return pa.table(columns, pa.schema(fields))
