from __future__ import annotations

import json
import sys

import pytest

from deeptruck_cacc import cli, load_policy, sweep
from deeptruck_model.errors import InputError

TINY = {"iterations": [2], "rollouts": [2], "window": [20], "seeds": [2]}
TRUCK = "truck:trucksim"


def test_every_combination_is_trained_and_the_best_comes_first(tmp_path):
    rows = sweep.sweep(TRUCK, tmp_path, TINY | {"memory": [True, False], "learning_rate": [1e-3, 6e-3]})
    assert len(rows) == 4 and [r["score"] for r in rows] == sorted(r["score"] for r in rows)
    for row in rows:
        policy = load_policy(row["policy"])
        assert policy.card["config"] | row["settings"] == policy.card["config"]
        assert policy.card["validation"]["score"] == row["score"] <= row["worst"]
    assert json.loads((tmp_path / "sweep.json").read_text()) == rows
    assert (tmp_path / "sweep.md").read_text().count("\n") == 6


def test_another_process_gives_the_same(tmp_path):
    plain = sweep.sweep(TRUCK, tmp_path / "plain", TINY)
    apart = sweep.sweep(TRUCK, tmp_path / "apart", TINY, workers=2)
    assert apart[0]["score"] == plain[0]["score"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--set", "speed=3"], "no setting 'speed'"),
        (["--set", "memory"], "write it as"),
        (["--set", "iterations=many"], "cannot have iterations=many"),
        (["--set", "learning_rate=0.003,-1"], "learning_rate is -1; it must be 0 to 1e+30"),
        (["--set", "window=-5"], "window is -5; it must be at least 3"),
        (["--set", "seeds=0"], "seeds is 0; it must be at least 1"),
        (["--trainer", "trpo", "--set", "gamma=2"], "gamma is 2; it must be 0 to 1"),
        (["--trainer", "trpo", "--set", "value_share=NaN"], "value_share is nan; it must be 0 to 1"),
    ],
)
def test_bad_settings_are_one_line(monkeypatch, capsys, tmp_path, options, says):
    command = ["deeptruck-cacc", "sweep", "--simulator", TRUCK, "--out", str(tmp_path / "s"), *options]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 2 and says in capsys.readouterr().err
    assert not (tmp_path / "s").exists()


def test_a_file_in_the_way_is_refused(tmp_path):
    (tmp_path / "s").write_text("x")
    with pytest.raises(InputError, match="s is a file; give a folder"):
        sweep.sweep(TRUCK, tmp_path / "s", TINY)
