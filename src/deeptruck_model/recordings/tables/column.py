"""One column of a table, parsed once: decimal mark, thousands, units in cells, words of states and gears; and
what its header says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.errors import InputError
from deeptruck_model.recordings import units
from deeptruck_model.recordings.words import Header, header, spelled

LOOKED_AT = 5000  # rows by which the decimal mark is found
MOST_ABOVE = 3  # rows of units above the numbers
NUMBER = r"^[+-]?((\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|(?i:nan|inf|infinity))$"
WITH_UNIT = r"^(?P<number>[+-]?(?:\d[\d.,]*|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>[^\d\s.,:/+-]\D*\d?)$"
IN_UNITS = 0.9  # of the filled cells; fewer with a unit behind their number are notes
STATES = {  # words of switches
    **dict.fromkeys(("true", "on", "yes", "pressed", "active", "ein", "an", "ja", "wahr"), 1.0),
    **dict.fromkeys(("false", "off", "no", "released", "inactive", "aus", "nein", "falsch"), 0.0),
}
GEARS = {"n": 0.0, "neutral": 0.0, "r": -1.0, "reverse": -1.0}  # letters of gears that are numbers, too
MOST_GEARS = 24
RARE = 0.002  # of the values: codes of faults, which say nothing of the unit
MOSTLY = 0.5  # of the filled cells of a column of numbers
_NO_VALUE = r"^(?i:-+|\?+|n/?a|#n/a|null|none|inv|err)$"
_WITH_MARK = {mark: rf"^[+-]?\d*[{mark}]\d+([eE][+-]?\d+)?$" for mark in ",."}
_GROUPED = r"^\s*[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?\s*$"  # 1,300 and 1,300.5
_THOUSANDS = r"^[-+]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?$"


@dataclass(frozen=True)
class Parsed:
    """The numbers of a column (n,), NaN for blank cells and text; which rows (n,) are such text; and the unit
    written behind the numbers, as `units.conversion` spells it, '' if there is none."""

    values: Array
    unreadable: Mask
    unit: str = ""


@dataclass(eq=False)
class Column:
    """One column, parsed at its first use: decimal mark, thousands, units in cells, states and gears.

    `raw` (n,) are the cells as in the file; `mark` is the table's decimal mark, and `pointed` says that other
    columns have decimal points, so that commas in this one separate thousands. `below` is its unit where the
    file states it elsewhere than in the header and the cells.
    """

    name: str
    raw: pa.ChunkedArray
    mark: str = "."
    pointed: bool = False
    below: str = ""

    @property
    def is_text(self) -> bool:
        """Whether it has cells of text, as all columns of CSV have."""
        return bool(pa.types.is_string(self.raw.type))

    @property
    def is_temporal(self) -> bool:
        """Whether it has a type of time, as columns of Parquet may have."""
        return bool(pa.types.is_temporal(self.raw.type))

    @cached_property
    def cells(self) -> pa.ChunkedArray:
        """Text without surrounding blanks, null if empty."""
        try:
            cells = pc.utf8_trim_whitespace(pc.cast(self.raw, pa.string()))
        except (pa.ArrowInvalid, pa.ArrowNotImplementedError, pa.ArrowTypeError):
            raise InputError(
                f"column '{self.name}' of type {self.raw.type} holds no text or numbers"
            ) from None
        return pc.if_else(pc.equal(cells, ""), pa.scalar(None, pa.string()), cells)

    @property
    def has_cell(self) -> Mask:
        """Which rows (n,) have a cell that is filled."""
        return np.asarray(pc.is_valid(self.cells if self.is_text else self.raw).to_numpy())

    @property
    def values(self) -> Array:
        """The numbers (n,), NaN for blank cells and text."""
        return self._parsed.values

    @property
    def unreadable(self) -> Mask:
        """Which rows (n,) have text that is no number."""
        return self._parsed.unreadable

    @property
    def unit(self) -> str:
        """The unit behind the numbers of its cells, as in '54 km/h'; '' if there is none."""
        return self._parsed.unit

    @cached_property
    def header(self) -> Header:
        """The words of its name and its unit: stated elsewhere, in its cells, a row of units, or its name."""
        if self.below:
            return header(self.name, self.below, "by the form of the table")
        if self.is_text and self.unit:
            return header(self.name, self.unit, "behind its numbers")
        above = [cell or "" for cell in self.cells[:MOST_ABOVE].to_pylist()] if self.is_text else []
        unit = next((cell for cell in above if spelled(cell, self.name)), "")
        return header(self.name, unit)

    @cached_property
    def is_numbers(self) -> bool:
        """Whether most filled cells are numbers, other than texts for no value."""
        try:
            finite, text = np.isfinite(self.values), self.unreadable
        except InputError:
            return False
        if text.any():
            none = pc.fill_null(pc.match_substring_regex(self.cells, _NO_VALUE), False).to_numpy()
            text = text & ~none
        return bool(finite.any() and finite.sum() >= MOSTLY * (finite.sum() + text.sum()))

    @property
    def largest(self) -> float:
        """The largest magnitude without rare codes; NaN for a column without numbers."""
        sizes = np.abs(self.values[np.isfinite(self.values)])
        return float(np.quantile(sizes, 1.0 - RARE, method="lower")) if len(sizes) else np.nan

    @property
    def filled(self) -> float:
        """The share of rows that have a number."""
        return float(np.isfinite(self.values).mean())

    @cached_property
    def _parsed(self) -> Parsed:
        if not self.is_text:
            try:
                numbers = pc.cast(self.raw, pa.float64(), safe=False).fill_null(np.nan).to_numpy()
            except pa.ArrowException:
                raise InputError(f"column '{self.name}' of type {self.raw.type} holds no numbers") from None
            return Parsed(numbers.astype(np.float64), np.zeros(len(numbers), dtype=bool))
        values, unreadable = floats(self.cells, self.mark)
        if unreadable.any() and self.mark == "." and self.pointed and self._grouped():
            values, unreadable = floats(pc.replace_substring(self.cells, ",", ""), self.mark)
        if not unreadable.any():
            return Parsed(values, unreadable)
        return self._with_units() or self._with_words(values, unreadable)

    def _grouped(self) -> bool:
        """Whether all commas are as in 1,300."""
        commas = pc.match_substring(self.cells, ",")
        return bool(pc.all(pc.equal(commas, pc.match_substring_regex(self.cells, _GROUPED))).as_py())

    def _with_units(self) -> Parsed | None:
        """Numbers with their unit behind them, each cell read in its own and given in the most frequent one;
        None if nearly all cells have no unit."""
        parts = pc.extract_regex(self.cells, WITH_UNIT)
        written = pc.dictionary_encode(pc.struct_field(parts, "unit")).combine_chunks()
        of = written.indices.fill_null(-1).to_numpy(zero_copy_only=False)
        if (of >= 0).sum() <= IN_UNITS * pc.sum(pc.is_valid(self.cells)).as_py():
            return None
        names = written.dictionary.to_pylist()
        usual = names[int(np.argmax(np.bincount(of[of >= 0])))]
        values, unreadable = floats(pc.coalesce(pc.struct_field(parts, "number"), self.cells), self.mark)
        for code, name in enumerate(names):
            into = units.between(spelled(name, self.name), spelled(usual, self.name))
            if name != usual and into is not None:
                values = np.where(of == code, into[0] * values + into[1], values)
            elif name != usual and (of == code).mean() > 0:
                unreadable = unreadable | (of == code)
        return Parsed(np.where(unreadable, np.nan, values), unreadable, spelled(usual, self.name))

    def _with_words(self, values: Array, unreadable: Mask) -> Parsed:
        """Words of switches as 1 and 0 in a column without numbers, and letters of gears beside numbers of
        gears."""
        known = values[np.isfinite(values)]
        gears = bool((known == np.rint(known)).all() and np.abs(known).max(initial=0.0) <= MOST_GEARS)
        words = STATES | GEARS if not len(known) else GEARS if gears else {}
        index = pc.index_in(pc.utf8_lower(self.cells), pa.array([*words], pa.string()))
        found = pc.is_valid(index).to_numpy()
        of = pc.take(pa.array([*words.values()], pa.float64()), index.combine_chunks())
        numbers = of.fill_null(np.nan).to_numpy(zero_copy_only=False)
        return Parsed(np.where(found, numbers, values), unreadable & ~found)

    def take(self, rows: NDArray[np.int64]) -> Column:
        """The column with these of its rows; what was parsed stays."""
        other = replace(self, raw=self.raw.take(pa.array(rows)))
        if parsed := self.__dict__.get("_parsed"):
            other.__dict__["_parsed"] = Parsed(parsed.values[rows], parsed.unreadable[rows], parsed.unit)
        if named := self.__dict__.get("header"):
            other.__dict__["header"] = named
        return other


def floats(cells: pa.ChunkedArray, decimal: str) -> tuple[Array, Mask]:
    """Text cells as float64 (n,), NaN if null or not a number, and (n,) which cells are filled but not
    numbers."""
    if decimal != ".":
        cells = pc.replace_substring(_without_thousands(cells), decimal, ".")
    plain = pc.fill_null(pc.match_substring_regex(cells, NUMBER), False)
    numbers = pc.if_else(plain, cells, pa.scalar(None, pa.string()))
    values = numbers.cast(pa.float64()).fill_null(np.nan).to_numpy().astype(np.float64)
    return values, pc.and_(pc.is_valid(cells), pc.invert(plain)).to_numpy()


def _without_thousands(cells: pa.ChunkedArray) -> pa.ChunkedArray:
    """Cells with a decimal comma, in which points can only separate thousands: 1.580 and 1.580,0 are 1580.

    A column that has points in other positions and no comma has a decimal point, whatever the others have.
    """
    points = pc.match_substring(cells, ".")
    if not pc.any(points).as_py():
        return cells
    marked = pc.match_substring_regex(cells, _THOUSANDS)
    commas = pc.any(pc.match_substring(cells, ",")).as_py()
    others = pc.and_(points, pc.invert(marked))
    if pc.any(others).as_py() and not commas:
        return cells
    cells = pc.if_else(marked, pc.replace_substring(cells, ".", ""), cells)
    return pc.if_else(others, pc.binary_join_element_wise(cells, pa.scalar("?"), ""), cells)  # is no number


def decimal_mark(columns: Sequence[pa.ChunkedArray], delimiter: str) -> str:
    """The decimal mark of a table, decided here for all its columns: a comma if cells have one and none has a
    point. Between commas, where every such cell could be of thousands (1,300), it stays a point."""
    if any(has_mark(column, ".") for column in columns):
        return "."
    commas = [column for column in columns if has_mark(column, ",")]
    alike = rf"{_GROUPED}|^[^,]*$"
    grouped = [pc.all(pc.match_substring_regex(c.drop_null(), alike)).as_py() for c in commas]
    return "," if commas and (delimiter != "," or not all(grouped)) else "."


def has_mark(column: pa.ChunkedArray, mark: str) -> bool:
    """Whether a number in a column of text has this decimal mark, or one with a unit behind it."""
    if not pa.types.is_string(column.type):
        return False
    for part in (column.slice(0, LOOKED_AT), column.slice(LOOKED_AT)):
        some = part.filter(pc.match_substring(part, mark))
        some = pc.utf8_trim_whitespace(some)
        some = pc.coalesce(pc.struct_field(pc.extract_regex(some, WITH_UNIT), "number"), some)
        if pc.any(pc.match_substring_regex(some, _WITH_MARK[mark])).as_py():
            return True
    return False
