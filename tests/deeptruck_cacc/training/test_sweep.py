from __future__ import annotations

import json
import sys

import pytest

from deeptruck_cacc import cli, load_policy
from deeptruck_cacc.training import sweep
from deeptruck_core import files
from deeptruck_core.errors import InputError

TINY = {"iterations": [2], "rollouts": [2], "window": [20], "seeds": [2]}
TRUCK = "truck:trucksim"
NAME = "iterations=2,rollouts=2,window=20,seeds=2"


@pytest.mark.usefixtures("quick_exam")
def test_every_combination_is_trained_and_the_best_comes_first(tmp_path):
    out = tmp_path / "s"
    rows = sweep.sweep(TRUCK, out, TINY | {"memory": [True, False], "learning_rate": [1e-3, 6e-3]})
    assert len(rows) == 4 and [r["score"] for r in rows] == sorted(r["score"] for r in rows)
    for row in rows:
        policy = load_policy(row["policy"])
        assert policy.card["config"] | row["settings"] == policy.card["config"]
        assert policy.card["validation"]["score"] == row["score"] <= row["worst"]
    assert json.loads((out / "sweep.json").read_text()) == rows
    assert (out / "sweep.md").read_text().count("\n") == 6


@pytest.mark.usefixtures("quick_exam")
def test_a_killed_sweep_goes_on_only_where_asked(tmp_path):
    out, lines = tmp_path / "s", []
    grid = TINY | {"learning_rate": [1e-3, 6e-3]}

    def kill(line: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep.sweep(TRUCK, out, grid, say=kill)
    assert [p.name for p in tmp_path.iterdir()] == [".s.unfinished"]
    first = next(files.unfinished(out).glob("*/policy.json"))
    stamp = first.stat().st_mtime_ns
    with pytest.raises(InputError, match=r"was begun and not finished .*; add --resume .*, or --overwrite"):
        sweep.sweep(TRUCK, out, grid)
    with pytest.raises(InputError, match="simulator was truck:trucksim, given truck:volvo"):
        sweep.sweep("truck:volvo", out, grid, resume=True)
    rows = sweep.sweep(TRUCK, out, grid, resume=True, say=lines.append)
    assert len(rows) == len(lines) == 2 and [p.name for p in tmp_path.iterdir()] == ["s"]
    assert (out / first.parent.name / "policy.json").stat().st_mtime_ns == stamp  # not trained again


@pytest.mark.long
def test_another_process_gives_the_same(tmp_path):
    one = TINY | {"seeds": [1]}
    plain = sweep.sweep(TRUCK, tmp_path / "plain", one)
    apart = sweep.sweep(TRUCK, tmp_path / "apart", one, workers=2)
    assert apart[0]["score"] == plain[0]["score"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--set", "speed=3"], "no setting 'speed'"),
        (
            ["--set", "seeds=0", "--set", "window=-5"],
            "(1) seeds is 0; it must be at least 1 (2) window is -5",
        ),
        (["--set", "memory"], "write it as"),
        (["--set", "iterations=many"], "cannot have iterations=many"),
        (["--set", "learning_rate=0.003,-1"], "learning_rate is -1; it must be 0 to 1e+30"),
        (["--set", "window=-5"], "window is -5; it must be at least 3"),
        (["--set", "seeds=0"], "seeds is 0; it must be at least 1"),
        (["--trainer", "trpo", "--set", "gamma=2"], "gamma is 2; it must be 0 to 1"),
        (["--trainer", "trpo", "--set", "curvature_share=NaN"], "curvature_share is nan; it must be 0 to 1"),
    ],
)
def test_bad_settings_are_one_line(monkeypatch, capsys, tmp_path, options, says):
    command = ["deeptruck-cacc", "sweep", "--simulator", TRUCK, "--out", str(tmp_path / "s"), *options]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 2 and says in capsys.readouterr().err
    assert not (tmp_path / "s").exists()
