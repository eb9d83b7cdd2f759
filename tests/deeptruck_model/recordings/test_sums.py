"""Whatever numbers a table or a CAN log holds: what was read was used or set aside, derived channels too."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from csv_tables import COLUMNS, drive, write_csv
from hypothesis import given, settings
from hypothesis import strategies as st

from deeptruck_core.errors import InputError
from deeptruck_model.recordings import import_table

MEANING = {
    **COLUMNS,
    "channels": {
        **COLUMNS["channels"],
        "elevation": {"column": "h", "unit": "m"},
        "engine_speed": {"column": "n", "unit": "rpm"},
        "gear": {"column": "gear"},
    },
}
CELLS = st.sampled_from(["", "-1", "0", "102", "255", "65535", "1e30", "nan", "-40", "x", "12 km/h", "N"])
FAULT = st.tuples(
    st.sampled_from(["v", "gas", "brake", "h", "n", "gear"]), CELLS, st.integers(0, 299), st.integers(1, 40)
)

LINE: dict[str, Callable[[str], str]] = {  # what becomes of a line of cells
    "cut": lambda line: line[:5],
    "longer": lambda line: f"{line},5,5,5",
    "no time": lambda line: "," + line.partition(",")[2],
    "a header again": lambda line: f"{line}\nt,v,gas,brake,a,h,n,gear",
    "blank cells": lambda line: f"{line}\n,,",
    "an empty line": lambda line: "",
    "another empty line": lambda line: f"{line}\n",
    "a quote": lambda line: line[::-1].replace(",", '",', 1)[::-1],
    "units": lambda line: f"{line}\ns,m/s,-",
}
DAMAGE = st.tuples(st.sampled_from([*LINE]), st.integers(0, 299))


@settings(max_examples=60, deadline=None)
@given(st.lists(FAULT, max_size=6), st.lists(DAMAGE, max_size=5), st.sampled_from(["", ",", ",,"]))
def test_each_row_of_a_table_is_used_or_set_aside(
    tmp_path_factory: pytest.TempPathFactory,
    faults: list[tuple[str, str, int, int]],
    damage: list[tuple[str, int]],
    trail: str,
) -> None:
    """Rows read are the filled lines below the header."""
    columns = drive(300)
    t = columns["t"]
    columns |= {"h": np.round(200 + 5 * np.sin(t / 9), 2), "n": np.round(1100 + 20 * t), "gear": 3 + t // 10}
    columns = {name: list(map(str, values)) for name, values in columns.items()}
    for name, cell, start, count in faults:
        columns[name][start : start + count] = [cell] * len(columns[name][start : start + count])
    folder = tmp_path_factory.mktemp("faulty")
    head, *rows = (line + trail for line in write_csv(folder / "t.csv", columns).read_text().splitlines())
    for kind, at in damage:
        rows[at] = LINE[kind](rows[at])
    lines = [line for row in rows for line in row.split("\n") if line]
    (folder / "t.csv").write_text("\n".join([head, *rows]) + "\n")
    try:
        done = import_table(folder / "t.csv", MEANING, folder / "bag")
    except InputError as error:
        assert "\n" not in str(error)
        return
    account = done.recordings[0].account
    assert account is not None and account.balanced and account.total.read == len(lines)
    for derived in ("acceleration", "grade"):
        kept = [r.channels[derived] for r in done.recordings if derived in r.channels]
        if kept:
            tally = account.channels[derived]
            assert tally.read == sum(map(len, kept))
            assert tally.used == sum(int(np.isfinite(x).sum()) for x in kept)


REST = st.sampled_from(["18FEF100#R", "18FEF100#R8", "20000004#0000000000000000", "18FEF100#", "18FECA00#00"])


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(REST, st.integers(0, 119)), max_size=12))
def test_each_frame_of_a_can_log_is_used_or_set_aside(
    tmp_path_factory: pytest.TempPathFactory, faults: list[tuple[str, int]]
) -> None:
    """Requests to transmit, error frames, and frames that are too short or nobody's."""
    frames = [
        frame
        for k in range(60)
        for frame in (f"18FEF100#FF{k:02X}28FFFFFFFFFF", f"0CF00400#F1{125 + k % 20:02X}7D401F00FF7D")
    ]
    for text, at in faults:
        frames[at] = text
    folder = tmp_path_factory.mktemp("faulty")
    lines = [f"({1000 + 0.05 * k:.6f}) can0 {frame}" for k, frame in enumerate(frames)]
    (folder / "drive.log").write_text("\n".join(lines) + "\n")
    done = import_table(folder / "drive.log", {}, folder / "bag")
    account = done.recordings[0].account
    assert account is not None and account.balanced and account.total.read == len(lines)
