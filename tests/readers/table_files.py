"""Tables and maps of columns that a user may give: how small valid ones are made, and how they are read."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from csv_tables import write_csv
from pyarrow import parquet

from deeptruck_model.recordings import import_table

COLUMNS = {
    "time": {"column": "t", "unit": "s"},
    "channels": {"speed": {"column": "v", "unit": "km/h"}, "elevation": {"column": "h", "unit": "m"}},
}


def _columns(rows: int = 40) -> dict[str, Any]:
    k = np.arange(rows)
    return {"t": np.round(5 + 0.1 * k, 3), "v": 36 + 0.25 * k, "h": 100 + 0.125 * k}


def csv_table(folder: Path) -> Path:
    """A CSV file."""
    return write_csv(folder / "table.csv", _columns())


def parquet_table(folder: Path) -> Path:
    """A Parquet file with the checksums that the format has."""
    parquet.write_table(pa.table(_columns()), folder / "table.parquet", write_page_checksum=True)
    return folder / "table.parquet"


def read_table(file: Path) -> list[Any]:
    """What an import makes of a table."""
    out = file.parent / "imported"
    try:
        return [(r.dt, r.channels) for r in import_table(file, COLUMNS, out).recordings]
    finally:
        shutil.rmtree(out, ignore_errors=True)


def columns_yaml(folder: Path) -> Path:
    """COLUMNS.yaml with all its keys."""
    text = """# of truck 7
time: {column: t, unit: s}
delimiter: ";"
encoding: utf-8
skip_rows: 2
decimal: ","
name: truck7
grade_window_m: 60.0
split_at: {speed_step: 2.5, elevation_step: 4.0}
channels:
  speed: {column: v, unit: km/h, scale: 1.0, offset: 0.0, late_s: 0.1}
  elevation: {column: h, unit: m}
  fuel_rate: {column: f, unit: kg/h, density: 0.83}
  grade: {column: g, unit: "%"}
"""
    (folder / "columns.yaml").write_text(text)
    return folder / "columns.yaml"


def topic_map(folder: Path) -> Path:
    """A topic map."""
    text = """speed: {topic: /odom, field: twist.twist.linear.x, unit: m/s}
grade: {topic: /road, field: "position[name=grade]", scale: 0.01, offset: 0.0}
fuel_rate: {topic: /fuel, field: data, unit: kg/h, density: 830}
"""
    (folder / "topics.yaml").write_text(text)
    return folder / "topics.yaml"
