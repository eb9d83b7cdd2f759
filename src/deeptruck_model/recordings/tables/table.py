"""A table: its columns by name and its rows, each with its place in the file and what became of it."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.account import Account
from deeptruck_core.arrays import Array, Mask
from deeptruck_core.errors import InputError
from deeptruck_core.reading import plain, quoted
from deeptruck_model.recordings.tables.column import MOST_ABOVE, Column

SHOWN = 12  # columns that an error lists
MOST_WITHOUT_KEY = 0.1  # of the rows; where more have no time, the column or its unit is mistaken
ABOVE = "of units or text above the numbers"


@dataclass(frozen=True)
class Table:
    """Columns by name (blanks around names ignored).

    `rows` (n,) are the row numbers in the file, from 0 below the header; `place` describes one of them, such
    as 'line 7'. `account` counts the rows read, kept and omitted.
    """

    path: Path
    columns: dict[str, Column]
    rows: NDArray[np.int64]
    place: Callable[[int], str]
    account: Account
    decimal: str = "."

    def __len__(self) -> int:
        return len(self.rows)

    def at(self, row: int) -> str:
        """Description of a row's place in the file."""
        return self.place(int(self.rows[row]))

    def __getitem__(self, name: str) -> Column:
        """One column. Raises InputError with the nearest names if there is none."""
        name = name if name in self.columns else name.strip()
        if name in self.columns:
            return self.columns[name]
        few = list(self.columns)[:SHOWN]
        near = difflib.get_close_matches(name, self.columns, n=3, cutoff=0.5) or few
        near = few if len(self.columns) <= SHOWN else near
        more = f", and {len(self.columns) - len(near)} more" if len(self.columns) > len(near) else ""
        raise InputError(f"{self.path} has no column '{name}'; there is: {plain(', '.join(near))}{more}")

    def numbers(self, name: str, channel: str, across: str = "") -> Array:
        """A column, or the norm with the one `across`, as float64 (n,), NaN for cells that are blank or not
        numbers.

        The account counts its filled cells under `channel`. Raises InputError if no cell is a number.
        """
        column = self[name]
        values, unreadable = column.values, column.unreadable
        if across:
            alone = np.isnan(values) != np.isnan(self[across].values)
            values = np.hypot(values, self[across].values)
            unreadable = unreadable | self[across].unreadable | alone
        known, first = ~np.isnan(values), int(np.argmax(unreadable))
        tally = self.account.channel(channel)
        tally.read += int(known.sum() + unreadable.sum())
        tally.used += int(known.sum())
        cell = f"{quoted(column.cells[first])} in {self.at(first)}" if unreadable.any() else ""
        tally.set_aside("no number", cell, int(unreadable.sum()))
        if not known.any():
            why = f"its first is {cell}" if cell else "all its cells are blank"
            raise InputError(f"{self.path}: column '{name}' holds no numbers; {why}")
        return values

    @property
    def numeric(self) -> list[Column]:
        """The columns of numbers."""
        return [column for column in self.columns.values() if column.is_numbers]

    def counted_anew(self) -> Table:
        """The table with an account of its own."""
        return replace(self, account=Account(str(self.path), "rows"))

    def with_units(self, units: Mapping[str, str]) -> Table:
        """The table with units that the file states elsewhere than at its columns."""
        columns = {name: replace(c, below=units.get(name, "")) for name, c in self.columns.items()}
        return replace(self, columns=columns)

    def take(self, rows: NDArray[np.int64]) -> Table:
        """The table with these of its rows, in this order."""
        columns = {name: column.take(rows) for name, column in self.columns.items()}
        return replace(self, columns=columns, rows=self.rows[rows])

    def without(self, out: Mask, reason: str, first: str = "") -> Table:
        """The table without the rows `out` (n,), which the account counts as omitted for a reason."""
        if not out.any():
            return self
        at = int(np.argmax(out))
        self.account.total.set_aside(reason, f"{self.at(at)}{first}", int(out.sum()))
        left = self.take(np.flatnonzero(~out))
        self.account.total.used = len(left)
        return left

    def filled(self, names: Iterable[str]) -> Mask:
        """Which rows (n,) have a cell in one of these columns."""
        found = np.zeros(len(self), dtype=bool)
        for name in names:
            found |= self.columns[name].has_cell
            if found.all():
                break
        return found

    def without_text_above(self, known: Mask) -> Table:
        """The table without its first few rows if these are not `known` (n,): units or text."""
        above = int(np.argmax(known)) if known.any() else len(self)
        return self.without(np.arange(len(self)) < above, ABOVE) if above <= MOST_ABOVE else self

    def with_key(self, known: Mask, what: str, names: Iterable[str], advice: str = "") -> Table:
        """The rows that have a time or distance, marked by `known` (n,).

        Raises InputError, ending with `advice`, if more than a tenth of the rows below units and text have
        none.
        """
        table = self.without_text_above(known)
        known = known[len(known) - len(table) :]
        column = " and ".join(f"'{name}'" for name in names)
        if (~known).sum() > MOST_WITHOUT_KEY * len(known):
            at = table.at(int(np.argmin(known)))
            raise InputError(
                f"{self.path}: {(~known).sum()} rows have no {what} in {column}, first {at}{advice}"
            )
        return table.without(~known, f"without a {what} in {column}")
