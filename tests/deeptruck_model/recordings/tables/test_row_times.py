"""The time of each row, however it is written: the same ten seconds at 10 Hz."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from csv_tables import SPEED, write_csv
from pyarrow import parquet

from deeptruck_model.recordings import import_table
from deeptruck_model.recordings.tables.columns import load_columns
from deeptruck_model.recordings.tables.row_times import timed
from deeptruck_model.recordings.tables.table import without_copies
from deeptruck_model.recordings.tables.table_file import read_table

COUNT = 100
DATES = [datetime(2026, 8, 5, 23, 59, 56, tzinfo=UTC) + k * timedelta(seconds=0.1) for k in range(COUNT)]
NS = 1_700_000_000_123_456_789 + 100_000_000 * np.arange(COUNT)


def milliseconds(date: datetime) -> str:
    return f"{date.microsecond // 1000:03d}"


def times(path: Path, time: dict[str, Any], **more: Any) -> np.ndarray[Any, Any]:
    meaning = load_columns({"time": time, "channels": SPEED, **more})
    table = read_table(path, meaning.form)
    return timed(without_copies(table, meaning.time.columns), meaning.time)[1]


@pytest.mark.parametrize(
    ("write", "time"),
    [
        (lambda d: d.isoformat(), {"unit": "iso"}),
        (lambda d: f"{d:%Y/%m/%d %H:%M:%S}.{milliseconds(d)}", {"unit": "iso"}),
        (lambda d: f"{d.year}-{d.month}-{d.day} {d:%H:%M:%S},{milliseconds(d)}", {"unit": "iso"}),
        (lambda d: f"{d.year}/{d.month}/{d.day} {d:%H:%M:%S}.{milliseconds(d)} +02:00", {"unit": "iso"}),
        (lambda d: f"{d:%Y-%m-%dT%H:%M:%S}.{milliseconds(d)}000001Z", {"unit": "iso"}),
        (lambda d: f"{d:%H:%M:%S}.{milliseconds(d)}", {"unit": "iso"}),
        (lambda d: f"{d:%H:%M:%S},{milliseconds(d)}", {"format": "%H:%M:%S,%f"}),
        (lambda d: f"{d:%M:%S}.{milliseconds(d)}", {"format": "%M:%S.%f"}),
        (lambda d: f"{d:%d.%m.%Y %H:%M:%S},{milliseconds(d)}", {"format": "%d.%m.%Y %H:%M:%S,%f"}),
        (lambda d: f"{d:%m/%d/%Y %I:%M:%S.%f %p}", {"format": "%m/%d/%Y %I:%M:%S.%f %p"}),
        (lambda d: f"{d:%d-%b-%Y %H:%M:%S.%f}0", {"format": "%d-%b-%Y %H:%M:%S.%f"}),
        (lambda d: f"{d:%a %b %d %H:%M:%S.%f} GMT+01:00 2026", {"format": "%a %b %d %H:%M:%S.%f GMT%z %Y"}),
        (lambda d: f"{(d - datetime(1899, 12, 30, tzinfo=UTC)) / timedelta(days=1):.10f}", {"unit": "days"}),
        (lambda d: f"{d.timestamp():.3f}", {"unit": "s"}),
        (lambda d: f"{int(d.timestamp() * 1000 + 0.5)}", {"unit": "ms"}),
        (lambda d: f"{d.timestamp() * 1e6:.12e}", {"unit": "us"}),
        (lambda d: f"{(d - DATES[0]) / timedelta(minutes=1):.12f}", {"unit": "min"}),
        (lambda d: f"{d.isoformat().replace('+00:00', '')}+02:00", {"unit": "datetime"}),
    ],
)
def test_the_same_times_however_they_are_written(tmp_path: Path, write: Any, time: dict[str, Any]) -> None:
    cells = [write(date) for date in DATES]
    write_csv(tmp_path / "d.csv", {"t": cells, "v": np.full(COUNT, 5.0)}, delimiter=";")
    found = times(tmp_path / "d.csv", {"column": "t", **time})
    np.testing.assert_allclose(found, 0.1 * np.arange(COUNT), atol=1e-5)


@pytest.mark.parametrize("time", [{}, {"format": "%d.%m.%Y %H:%M:%S,%f"}])
def test_a_date_and_a_time_of_day_in_two_columns(tmp_path: Path, time: dict[str, str]) -> None:
    form = "%d.%m.%Y" if time else "%Y-%m-%d"
    cells = {
        "Date": [f"{date:{form}}" for date in DATES],
        "Time": [f"{date:%H:%M:%S},{milliseconds(date)}" for date in DATES],
        "v": np.full(COUNT, 5.0),
    }
    write_csv(tmp_path / "d.csv", cells, delimiter=";")
    found = times(tmp_path / "d.csv", {"column": ["Date", "Time"], **time})
    np.testing.assert_allclose(found, 0.1 * np.arange(COUNT), atol=1e-9)


def test_a_new_day_is_said(tmp_path: Path) -> None:
    cells = [f"{date:%H:%M:%S.%f}" for date in DATES]
    write_csv(tmp_path / "d.csv", {"t": cells, "v": np.full(COUNT, 5.0)})
    done = import_table(
        tmp_path / "d.csv", {"time": {"column": "t", "unit": "iso"}, "channels": SPEED}, tmp_path / "bag"
    )
    (recording,) = done.recordings
    assert recording.account is not None and recording.account.spans == [(0.0, pytest.approx(9.9))]
    assert recording.account.remarks == ["the time passes midnight in line 42"]


@pytest.mark.parametrize(
    ("column", "unit"),
    [
        (pa.array(NS), "ns"),
        (pa.array(NS.astype(np.uint64)), "ns"),
        (pa.array(NS).cast(pa.decimal128(19, 0)), "ns"),
        (pa.array(NS).cast(pa.timestamp("ns")), "iso"),
        (pa.array(NS).cast(pa.timestamp("ns", tz="Europe/Berlin")), "s"),
        (pa.array(NS).cast(pa.duration("ns")), "s"),
        (pa.array(NS % 86_400_000_000_000).cast(pa.time64("ns")), "iso"),
        (pa.array(NS.astype(str)), "ns"),
        (pa.array(NS // 1000).cast(pa.timestamp("us")), "iso"),
        (pa.array(NS // 1_000_000).cast(pa.timestamp("ms")), "s"),
        (pa.array((NS // 1_000_000 % 86_400_000).astype(np.int32)).cast(pa.time32("ms")), "iso"),
    ],
    ids=lambda value: str(value.type) if isinstance(value, pa.Array) else value,
)
def test_types_of_parquet_lose_nothing(tmp_path: Path, column: pa.Array, unit: str) -> None:
    parquet.write_table(pa.table({"t": column, "v": np.full(COUNT, 5.0)}), tmp_path / "d.parquet")
    found = times(tmp_path / "d.parquet", {"column": "t", "unit": unit})
    np.testing.assert_allclose(found, 0.1 * np.arange(COUNT), rtol=0, atol=1e-12)


def test_nanoseconds_apart_stay_apart(tmp_path: Path) -> None:
    """A float has an epoch in ns to 256 ns only."""
    jitter = NS + np.arange(COUNT) % 7
    write_csv(tmp_path / "d.csv", {"t": jitter, "v": np.full(COUNT, 5.0)})
    exact = (jitter - jitter[0]) * 1e-9
    np.testing.assert_allclose(
        times(tmp_path / "d.csv", {"column": "t", "unit": "ns"}), exact, rtol=0, atol=1e-14
    )
