"""Columns out of a CSV or Parquet file, as numbers, saying how many cells were none."""

from __future__ import annotations

import csv as text_csv
import difflib
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import csv, parquet

from deeptruck_model import reading
from deeptruck_model.errors import InputError

Array = NDArray[np.float64]

PARQUET = (".parquet", ".pq")


SHOWN = 12  # columns that an error lists


@dataclass(frozen=True)
class TextTable:
    """Columns by name (blanks around names ignored), cells still as they stand in the file."""

    path: Path
    columns: dict[str, pa.ChunkedArray]
    decimal: str = "."
    ragged: int = 0  # rows left out because they have more or fewer cells than the header

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def column(self, name: str) -> pa.ChunkedArray:
        """One column. Raises InputError, naming the nearest ones, where it is not there."""
        if name in self.columns:
            return self.columns[name]
        if name.strip() in self.columns:
            return self.columns[name.strip()]
        few = list(self.columns)[:SHOWN]
        near = difflib.get_close_matches(name, self.columns, n=3, cutoff=0.5) or few
        near = few if len(self.columns) <= SHOWN else near
        more = f", and {len(self.columns) - len(near)} more" if len(self.columns) > len(near) else ""
        raise InputError(f"{self.path} has no column '{name}'; there is: {', '.join(near)}{more}")

    def numbers(self, name: str) -> tuple[Array, int]:
        """A column as float64 (n,), NaN for empty and non-numeric cells, and the number of the latter.

        Raises InputError where no cell is a number.
        """
        values, strange = self._parsed(name, _number)
        if np.isnan(values).all():
            raise InputError(f"{self.path}: column '{name}' holds no numbers{self._other_decimal(name)}")
        return values, strange

    def _other_decimal(self, name: str) -> str:
        """What to mend where the first cell of a column is a number by the other decimal mark."""
        first = next((str(cell) for cell in self.column(name).to_pylist() if cell is not None), "")
        other = "," if self.decimal == "." else "."
        if other not in first or _number(first.strip().replace(other, ".")) is None:
            return ""
        return f"; its first is '{first.strip()}': set decimal: \"{other}\" in the columns file"

    def dates(self, name: str) -> Array:
        """A column of ISO 8601 dates and times as s since the first, (n,); NaN for cells that are none."""
        column = self.column(name)
        if pa.types.is_timestamp(column.type):
            ticks = pc.cast(column, pa.timestamp("ns", tz=column.type.tz)).to_numpy()
            return (ticks - ticks[0]).astype("timedelta64[ns]").astype(np.float64) / 1e9
        values, _ = self._parsed(name, _date)
        return values - values[0]

    def _parsed(self, name: str, parse: Callable[[str], float | None]) -> tuple[Array, int]:
        column = self.column(name)
        if not pa.types.is_string(column.type):
            try:
                return pc.cast(column, pa.float64()).fill_null(np.nan).to_numpy().astype(np.float64), 0
            except pa.ArrowException:
                raise InputError(
                    f"{self.path}: column '{name}' of type {column.type} holds no numbers"
                ) from None
        cells = pc.utf8_trim_whitespace(column)
        if self.decimal != ".":
            cells = pc.replace_substring(cells, self.decimal, ".")
        if parse is _number:
            try:
                return cells.cast(pa.float64()).fill_null(np.nan).to_numpy().astype(np.float64), 0
            except pa.ArrowInvalid:
                pass  # some cell is no number: one by one
        parsed = [None if cell is None else parse(cell) for cell in cells.to_pylist()]
        strange = sum(p is None and bool(cell) for p, cell in zip(parsed, cells.to_pylist(), strict=True))
        return np.array([np.nan if p is None else p for p in parsed], dtype=np.float64), strange


def read_table(
    path: Path,
    *,
    delimiter: str = ",",
    encoding: str = "utf-8",
    skip_rows: int = 0,
    decimal: str = ".",
) -> TextTable:
    """A CSV file (`skip_rows` lines before the header are ignored) or a Parquet file, by its suffix.

    CSV has no checksum: a changed digit is another number. Parquet's page checksums are looked at where the
    file has them. Raises InputError for a file that is missing, empty, or not in that encoding.
    """
    reading.check_file(path, "give a CSV or Parquet table")
    ragged: list[int] = []
    try:
        if path.suffix.lower() in PARQUET:
            table = parquet.read_table(path, page_checksum_verification=True)
        else:
            table = _read_csv(path, delimiter, encoding, skip_rows, ragged)
    except (pa.ArrowException, UnicodeError, LookupError, OSError) as error:
        raise InputError(f"{path} cannot be read: {_why(error, encoding)}") from None
    if table.num_rows == 0:
        raise InputError(_no_rows(path, table.num_columns, len(ragged)))
    columns: dict[str, Any] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        columns.setdefault(name.strip(), column)  # of equal names the first counts
    return TextTable(path, columns, decimal, len(ragged))


def _read_csv(path: Path, delimiter: str, encoding: str, skip_rows: int, ragged: list[int]) -> pa.Table:
    if "16" not in encoding and "32" not in encoding and _is_binary(path):
        raise InputError(f"{path} is no text table but binary; export it as CSV or Parquet")

    def skip(row: csv.InvalidRow) -> str:
        ragged.append(row.actual_columns)
        return "skip"

    return csv.read_csv(
        path,
        read_options=csv.ReadOptions(encoding=encoding, skip_rows=skip_rows, use_threads=False),
        parse_options=csv.ParseOptions(delimiter=delimiter, invalid_row_handler=skip),
        convert_options=csv.ConvertOptions(
            column_types=dict.fromkeys(_header(path, delimiter, encoding, skip_rows), pa.string()),
            strings_can_be_null=True,
            null_values=[""],
        ),
    )


def _no_rows(path: Path, columns: int, ragged: int) -> str:
    """Why a file that was read gave no row."""
    if not ragged:
        return f"{path} is empty: it has no rows below its header"
    return (
        f"{path} is no table as it is read: its header has {columns} cell{'s' if columns != 1 else ''}, and "
        f"none of the {ragged} rows below has as many; set 'delimiter', or 'skip_rows' where the header "
        "comes later"
    )


def _is_binary(path: Path) -> bool:
    with path.open("rb") as file:
        return b"\0" in file.read(4096)


def _header(path: Path, delimiter: str, encoding: str, skip_rows: int) -> list[str]:
    with path.open(
        encoding="utf-8-sig" if encoding.lower() in ("utf-8", "utf8") else encoding, newline=""
    ) as file:
        for _ in range(skip_rows):
            file.readline()
        return next(text_csv.reader(file, delimiter=delimiter), [])


def _why(error: BaseException, encoding: str) -> str:
    text = reading.plain(str(error))
    if isinstance(error, UnicodeDecodeError) or "UTF8" in text or "decod" in text:
        return f"it is not in {encoding}; set 'encoding' (latin-1, for example)"
    return text


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _date(cell: str) -> float | None:
    try:
        date = datetime.fromisoformat(cell)
    except ValueError:
        return None
    return date.replace(tzinfo=date.tzinfo or UTC).timestamp()
