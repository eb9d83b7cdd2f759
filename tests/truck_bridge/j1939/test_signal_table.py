from __future__ import annotations

from pathlib import Path

from truck_bridge.j1939 import load
from truck_bridge.j1939.signal_table import table


def test_the_signal_table_is_that_of_the_dbc():
    root = Path(__file__).resolve().parents[3]
    assert (root / "docs" / "j1939_signals.csv").read_text() == table(load())
