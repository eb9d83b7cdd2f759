"""The YAML in docs/recordings.md and layouts/columns is what the code understands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from deeptruck_model.recordings.columns import load_columns
from deeptruck_model.recordings.topic_map import load
from deeptruck_model.signals import CHANNELS

ROOT = Path(__file__).parents[3]
BLOCKS = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "recordings.md").read_text(), flags=re.S)


def test_the_topic_map_of_the_documentation() -> None:
    sources = load(yaml.safe_load(BLOCKS[0]))
    assert sources["engine_command"].field == "position[name=throttle]"
    assert sources["fuel_rate"].convert is not None and sources["fuel_rate"].convert.unit == "cm^3/s"


def test_the_columns_of_the_documentation() -> None:
    columns = load_columns(yaml.safe_load(BLOCKS[1]))
    assert set(columns.channels) == set(CHANNELS) - {"latitude", "longitude"}
    assert columns.conceal == ("elevation",) and columns.split_at == {"speed": 2.5, "elevation": 4.0}


@pytest.mark.parametrize("path", sorted((ROOT / "layouts" / "columns").glob("*.yaml")), ids=lambda p: p.stem)
def test_the_columns_we_ship(path: Path) -> None:
    assert load_columns(path).name == path.stem
