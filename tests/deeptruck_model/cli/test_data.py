"""`deeptruck-model import`, `table`, `coverage` and `repair`: what they say, write and replace."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from deeptruck_model.recordings import CrashSafeWriter, read

Script = Callable[..., tuple[int, str, str]]
COLUMNS = (
    "time: {rate_hz: 1.0}\nchannels:\n  speed: {column: v, unit: m/s}\n  elevation: {column: h, unit: m}\n"
)
IMPORT = ("import", "drive.csv", "--columns", "columns.yaml", "--out", "bag")


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    rows = "".join(f"{5 + k % 3},{100 + k}\n" for k in range(100))
    (tmp_path / "drive.csv").write_text(f"v,h\n{rows}")
    (tmp_path / "columns.yaml").write_text(COLUMNS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_bag_becomes_a_table(workplace: Path, script: Script) -> None:
    assert script(*IMPORT)[0] == 0
    code, said, _ = script("table", "bag", "--out", "table.csv")
    assert code == 0 and "100 rows" in said
    assert (workplace / "table.csv").read_text().startswith('"recording","time","speed","acceleration"')
    for bag, out in (("bag", "table.csv"), ("bag", "table.xlsx"), ("nothing", "other.csv")):
        assert script("table", bag, "--out", out)[0] == 2
    assert not list(workplace.glob(".other*")) and not (workplace / "other.csv").exists()
    assert script(*IMPORT[:-1], "again")[0] == 0
    code, said, _ = script("table", "bag", "again", "--out", "both.csv")
    assert code == 0 and "200 rows" in said


def test_import_then_coverage(workplace: Path, script: Script) -> None:
    code, said, _ = script(*IMPORT)
    assert code == 0 and "100.0 s" in said
    code, said, errors = script("coverage", "bag", "bag", "--out", "coverage")
    assert code == 0 and "200.0 s" in said
    written = {"coverage.json", "coverage.png", "coverage.html", ".deeptruck.json"}
    assert {p.name for p in (workplace / "coverage").iterdir()} == written
    warnings = json.loads((workplace / "coverage" / "coverage.json").read_text())["warnings"]
    assert len(warnings) == 2 and all(f"warning: {one}" in errors for one in warnings)


def test_several_sources_of_one_name_are_imported_by_their_folders(workplace: Path, script: Script) -> None:
    table, *rest = IMPORT[1:-1]
    for folder in ("monday", "friday"):
        (workplace / folder).mkdir()
        (workplace / folder / table).write_bytes((workplace / table).read_bytes())
    several = [f"{folder}/{table}" for folder in ("monday", "friday")]
    assert script("import", *several, *rest, "bags")[0] == 0
    name = Path(table).stem
    assert all((workplace / "bags" / folder / name).is_dir() for folder in ("monday", "friday"))
    code, _, errors = script("import", several[0], several[0], *rest, "more")
    assert code == 2 and "is given twice" in errors


def test_repair(workplace: Path, script: Script) -> None:
    writer = CrashSafeWriter(workplace / "bag")
    writer.write("/a", "std_msgs/msg/Float64", bytes(12), 1)
    writer.flush()
    for says in ("kept 1 message,", "nothing to do"):
        code, said, _ = script("repair", "bag")
        assert code == 0 and says in said
    writer.close()
    assert script("repair", "nowhere")[0] == 2


def test_a_bag_that_keeps_no_message_is_not_repaired(workplace: Path, script: Script) -> None:
    with CrashSafeWriter(workplace / "bag") as writer:
        writer.write("/a", "std_msgs/msg/Float64", bytes(12), 1)
    file = workplace / "bag" / "bag_0.mcap"
    file.write_bytes(file.read_bytes()[:100])
    before = {path: path.read_bytes() for path in (workplace / "bag").iterdir()}
    code, _, errors = script("repair", "bag")
    assert code == 2 and errors.count("\n") == 1
    assert "bag_0.mcap holds no whole chunk of messages in its 100 bytes" in errors
    assert {path: path.read_bytes() for path in (workplace / "bag").iterdir()} == before


@pytest.mark.parametrize(
    ("time", "speed", "says"),
    [
        ("column: t, unit: ms", "unit: m/s", "unit of time"),
        ("column: t, unit: h", "unit: m/s", "unit of time"),
        ("rate_hz: 10", "unit: m/s, scale: 0", "speed.scale: 0 does not fit"),
        ("rate_hz: 10", "unit: m/s, offset: .nan", "speed.offset: nan is not of type"),
    ],
)
def test_a_unit_or_scale_that_cannot_be_meant(
    workplace: Path, script: Script, time: str, speed: str, says: str
) -> None:
    rows = "".join(f"{k / 10:.1f},{5 + k % 3}\n" for k in range(100))
    (workplace / "drive.csv").write_text(f"t,v\n{rows}")
    columns = f"time: {{{time}}}\nchannels:\n  speed: {{column: v, {speed}}}\n"
    (workplace / "columns.yaml").write_text(columns)
    code, _, errors = script(*IMPORT)
    assert code == 2 and says in errors and not (workplace / "bag").exists()


def test_ragged_rows_are_counted_on_the_terminal_and_in_the_bag(workplace: Path, script: Script) -> None:
    with (workplace / "drive.csv").open("a") as table:
        table.write("5,100,7\n5\n6,101\n")
    code, said, _ = script(*IMPORT)
    assert code == 0 and "103 rows read, 101 used" in said
    notes = [note for note in read(workplace / "bag")[0].notes if "line 102" in note]
    assert len(notes) == 1 and notes[0] in said
