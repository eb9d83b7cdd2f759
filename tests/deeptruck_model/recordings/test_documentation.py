"""The YAML and the snippet in docs/recordings.md, and layouts/columns, are what the code understands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from deeptruck_model.recordings import Recording, read
from deeptruck_model.recordings.tables.columns import load_columns
from deeptruck_model.recordings.topic_map import load

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "recordings.md").read_text()
BLOCKS = re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.S)
COLUMNS = """
time: {column: t, unit: s}
channels:
  speed: {column: v, unit: m/s}
  engine_command: {column: E, unit: N m}
  brake_command: {column: B, unit: percent}
"""


def test_the_topic_map_of_the_documentation() -> None:
    sources = load(yaml.safe_load(BLOCKS[0]))
    assert sources["engine_command"].field == "position[name=throttle]"
    assert sources["fuel_rate"].convert is not None and sources["fuel_rate"].convert.unit == "cm^3/s"


def test_the_columns_of_the_documentation() -> None:
    columns = load_columns(yaml.safe_load(BLOCKS[1]))
    assert {"speed", "engine_command", "oil_temperature"} <= set(columns.channels)
    assert columns.split_at == {"speed": 2.5}


@pytest.mark.parametrize("path", sorted((ROOT / "layouts" / "columns").glob("*.yaml")), ids=lambda p: p.stem)
def test_the_columns_we_ship(path: Path) -> None:
    assert load_columns(path).name == path.stem


def test_the_snippet_of_the_documentation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("columns.yaml").write_text(COLUMNS)
    rows = [f"{k / 10},{10 + k / 100},{500 + k % 7},0" for k in range(1200)]
    Path("drive.csv").write_text("\n".join(["t,v,E,B", *rows]) + "\n")
    (snippet,) = re.findall(r"^```python\n(.*?)^```", PAGE, re.S | re.M)
    names: dict[str, list[Recording]] = {}
    exec(compile(snippet, "recordings.md", "exec"), names)
    assert all(names[part] for part in ("train", "validation", "test"))
    assert Path("coverage/coverage.png").exists() and len(read("copy")) == 1
