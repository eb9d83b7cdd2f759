from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from deeptruck_model import cli
from deeptruck_model.recordings import CrashSafeWriter, read

COLUMNS = (
    "time: {rate_hz: 1.0}\nchannels:\n  speed: {column: v, unit: m/s}\n  elevation: {column: h, unit: m}\n"
)


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    rows = "".join(f"{5 + k % 3},{100 + k}\n" for k in range(100))
    (tmp_path / "drive.csv").write_text(f"v,h\n{rows}")
    (tmp_path / "columns.yaml").write_text(COLUMNS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """The exit code of the console script."""
    monkeypatch.setattr(sys, "argv", ["deeptruck-model", *arguments])
    try:
        cli.main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def test_a_bag_becomes_a_table(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "import", "drive.csv", "--columns", "columns.yaml", "--out", "bag") == 0
    assert run(monkeypatch, "table", "bag", "--out", "table.csv") == 0
    said = capsys.readouterr().out
    assert "table.csv: 100 rows of 1 piece\n" in said and "channels: speed" in said
    assert (workplace / "table.csv").read_text().startswith('"recording","time","speed","acceleration"')
    assert run(monkeypatch, "table", "bag", "--out", "table.csv") == 2
    assert run(monkeypatch, "table", "bag", "--out", "table.xlsx") == 2
    assert run(monkeypatch, "table", "nothing", "--out", "other.csv") == 2
    assert not list(workplace.glob(".other*")) and not (workplace / "other.csv").exists()
    assert run(monkeypatch, "import", "drive.csv", "--columns", "columns.yaml", "--out", "again") == 0
    assert run(monkeypatch, "table", "bag", "again", "--out", "both.csv") == 0
    assert "both.csv: 200 rows of 2 pieces\n" in capsys.readouterr().out


def test_import_then_coverage(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "import", "drive.csv", "--columns", "columns.yaml", "--out", "bag") == 0
    said = capsys.readouterr().out
    assert "bag: 100.0 s in 1 piece" in said and "note: acceleration derived from speed" in said
    assert run(monkeypatch, "coverage", "bag", "bag", "--out", "coverage") == 0
    assert "bag: 200.0 s at 1 Hz in 2 pieces" in capsys.readouterr().out
    assert {p.name for p in (workplace / "coverage").iterdir()} == {
        "coverage.json",
        "coverage.png",
        "coverage.html",
        ".deeptruck.json",
    }


def test_the_seal_is_printed(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (workplace / "columns.yaml").write_text(COLUMNS + "conceal: [elevation]\n")
    assert run(monkeypatch, "import", "drive.csv", "--columns", "columns.yaml", "--out", "bag") == 0
    assert "sealed: bag.sealed.csv sha256 " in capsys.readouterr().out


def test_repair(workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    writer = CrashSafeWriter(workplace / "bag")
    writer.write("/a", "std_msgs/msg/Float64", bytes(12), 1)
    writer.flush()
    assert run(monkeypatch, "repair", "bag") == 0
    assert "bag was not finished: kept 1 message," in capsys.readouterr().out
    assert run(monkeypatch, "repair", "bag") == 0
    assert "nothing to do" in capsys.readouterr().out
    writer.close()


def test_a_bag_that_keeps_no_message_is_not_repaired(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with CrashSafeWriter(workplace / "bag") as writer:
        writer.write("/a", "std_msgs/msg/Float64", bytes(12), 1)
    file = workplace / "bag" / "bag_0.mcap"
    file.write_bytes(file.read_bytes()[:100])
    before = {path: path.read_bytes() for path in (workplace / "bag").iterdir()}
    assert run(monkeypatch, "repair", "bag") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "bag_0.mcap holds no whole chunk of messages in its 100 bytes" in line
    assert {path: path.read_bytes() for path in (workplace / "bag").iterdir()} == before


@pytest.mark.parametrize(
    "arguments",
    [
        ["import", "nowhere.csv", "--columns", "columns.yaml", "--out", "bag"],
        ["import", "drive.csv", "--columns", "nowhere.yaml", "--out", "bag"],
        ["coverage", "drive.csv", "--out", "coverage"],
        ["coverage", "nowhere", "--out", "coverage"],
        ["repair", "nowhere"],
    ],
)
def test_bad_input_is_one_line_and_code_2(
    workplace: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
) -> None:
    assert run(monkeypatch, *arguments) == 2
    said = capsys.readouterr()
    assert said.err.startswith("deeptruck-model: ") and said.err.count("\n") == 1
    assert {p.name for p in workplace.iterdir()} == {"drive.csv", "columns.yaml"}


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ("time: {column: t, unit: ms}\nchannels:\n  speed: {column: v, unit: m/s}\n", "unit of time"),
        ("time: {column: t, unit: h}\nchannels:\n  speed: {column: v, unit: m/s}\n", "unit of time"),
        ("time: {rate_hz: 10}\nchannels:\n  speed: {column: v, unit: m/s, scale: 0}\n", "leave no values"),
        (
            "time: {rate_hz: 10}\nchannels:\n  speed: {column: v, unit: m/s, offset: .nan}\n",
            "leave no values",
        ),
    ],
)
def test_a_unit_or_scale_that_cannot_be_meant(
    workplace: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    columns: str,
    says: str,
) -> None:
    rows = "".join(f"{k / 10:.1f},{5 + k % 3}\n" for k in range(100))
    (workplace / "drive.csv").write_text(f"t,v\n{rows}")
    (workplace / "columns.yaml").write_text(columns)
    assert run(monkeypatch, "import", "drive.csv", "--columns", "columns.yaml", "--out", "bag") == 2
    assert says in capsys.readouterr().err and not (workplace / "bag").exists()


def test_ragged_rows_are_counted_on_the_terminal_and_in_the_bag(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with (workplace / "drive.csv").open("a") as table:
        table.write("5,100,7\n5\n6,101\n")
    assert run(monkeypatch, "import", "drive.csv", "--columns", "columns.yaml", "--out", "bag") == 0
    says = [
        "2 with more or fewer cells than the header, first line 102",
        "rows are the clock: what lies behind one that was left out is too early",
    ]
    printed = capsys.readouterr().out.splitlines()
    assert "drive.csv: 103 rows read, 101 used, 2 set aside" in printed
    assert all(f"  {line}" in printed and line in read(workplace / "bag")[0].notes for line in says)


def test_a_bag_is_replaced_when_asked_only(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("import", "drive.csv", "--columns", "columns.yaml", "--out", "bag")
    assert run(monkeypatch, *words) == 0
    assert run(monkeypatch, *words) == 2
    assert "holds an imported bag already" in capsys.readouterr().err
    assert run(monkeypatch, *words, "--overwrite") == 0


@pytest.mark.usefixtures("undrawn")
def test_a_reader_of_a_bag_says_what_a_killed_run_left_beside_it(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "import", "drive.csv", "--columns", "columns.yaml", "--out", "bag") == 0
    (workplace / ".bag.4194305.new").mkdir()
    (workplace / ".gone.4194305.old").mkdir()
    assert run(monkeypatch, "coverage", "bag", "--out", "coverage") == 0
    assert (
        "note: .bag.4194305.new is another bag, whose run could not put it in place"
        in capsys.readouterr().err
    )
    assert run(monkeypatch, "coverage", "gone", "--out", "other") == 2
    says = capsys.readouterr().err
    assert "gone does not exist; .gone.4194305.old is an older gone" in says and says.count("\n") == 1


@pytest.mark.usefixtures("undrawn")
def test_coverage_warns_of_a_missing_command(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "import", "drive.csv", "--columns", "columns.yaml", "--out", "bag") == 0
    assert run(monkeypatch, "coverage", "bag", "--out", "coverage") == 0
    says = "no recording has a valid engine_command, without which none can be trained on"
    assert f"warning: {says}" in capsys.readouterr().err
    assert json.loads((workplace / "coverage" / "coverage.json").read_text())["warnings"] == [says]
