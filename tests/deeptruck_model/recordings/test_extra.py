"""Channels under names of their own: from a table or a bag into recordings, and into no simulator."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from csv_tables import write_csv
from foreign_bags import Message, S, bag_of, number, twist

from deeptruck_model.recordings import import_table, read

COLUMNS = """\
time: {column: t, unit: s}
channels:
  speed: {column: v, unit: m/s}
extra:
  oil_temperature: T_oil
  roof_fan: {column: fan, scale: 0.01, late_s: 0.5}
"""


def test_columns_of_a_table_are_carried_as_they_are_written(tmp_path: Path) -> None:
    k = np.arange(100)
    table = write_csv(tmp_path / "drive.csv", {"t": k / 10, "v": 10 + k / 20, "T_oil": -90 - k, "fan": k})
    import_table(table, yaml.safe_load(COLUMNS), tmp_path / "bag")
    (again,) = read(tmp_path / "bag")
    assert again.channels["oil_temperature"][:3].tolist() == [-90.0, -91.0, -92.0]
    assert again.channels["roof_fan"][:3] == pytest.approx([0.05, 0.06, 0.07])
    assert again.interface.unit("oil_temperature") == ""
    assert again.account is not None and again.account.channels["roof_fan"].used > 90


def test_topics_of_a_bag_are_carried_too(tmp_path: Path) -> None:
    messages: list[Message] = []
    for k in range(100):
        at = k * S // 10 + S
        messages += [("/speed", twist(10.0, at), at), ("/oil", number(90.0 + k), at)]
    extra = {"oil_temperature": {"topic": "/oil", "field": "data"}}
    topics = {"speed": {"topic": "/speed", "field": "twist.linear.x"}, "extra": extra}
    (found,) = read(bag_of(tmp_path / "bag", messages), topic_map=topics)
    assert np.nanmax(found.channels["oil_temperature"]) == 189.0
