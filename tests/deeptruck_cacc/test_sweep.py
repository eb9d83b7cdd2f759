from __future__ import annotations

import json
import sys
from multiprocessing.pool import ThreadPool
from types import ModuleType

import pytest

from deeptruck_cacc import cli, load_policy, sweep
from deeptruck_model.errors import InputError

TINY = {"iterations": [2], "rollouts": [2], "window": [20], "seeds": [2]}
TRUCK = "truck:trucksim"


@pytest.fixture
def cluster(monkeypatch):
    """A Ray whose workers are threads: what we ask of it is multiprocessing's interface."""
    asked = []

    def pool(workers: int) -> ThreadPool:
        asked.append(workers)
        return ThreadPool(workers)

    for name in ("ray", "ray.util", "ray.util.multiprocessing"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    sys.modules["ray.util.multiprocessing"].Pool = pool
    return asked


def test_every_combination_is_trained_and_the_best_comes_first(tmp_path):
    rows = sweep.sweep(TRUCK, tmp_path, TINY | {"memory": [True, False], "learning_rate": [1e-3, 6e-3]})
    assert len(rows) == 4 and [r["score"] for r in rows] == sorted(r["score"] for r in rows)
    for row in rows:
        policy = load_policy(row["policy"])
        assert policy.card["config"] | row["settings"] == policy.card["config"]
        assert policy.card["validation"]["score"] == row["score"] <= row["worst"]
    assert json.loads((tmp_path / "sweep.json").read_text()) == rows
    assert (tmp_path / "sweep.md").read_text().count("\n") == 6


def test_on_ray_it_gives_the_same(tmp_path, cluster):
    plain = sweep.sweep(TRUCK, tmp_path / "plain", TINY)
    rays = sweep.sweep(TRUCK, tmp_path / "rays", TINY, ray=True, workers=1)
    assert rays[0]["score"] == plain[0]["score"] and cluster == [1]


def test_without_ray_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.setitem(sys.modules, "ray.util.multiprocessing", None)
    with pytest.raises(InputError, match="pip install"):
        sweep.sweep(TRUCK, tmp_path, TINY, ray=True)


def test_values_are_read_as_they_are_meant():
    grid = sweep.read_grid(["memory=true,false", "learning_rate=3e-3", "scene=wide,paper"])
    assert grid == {"memory": [True, False], "learning_rate": [0.003], "scene": ["wide", "paper"]}


@pytest.mark.parametrize(
    ("options", "says"),
    [(["--set", "speed=3"], "no setting 'speed'"), (["--set", "memory"], "write it as")],
)
def test_bad_settings_are_one_line(monkeypatch, capsys, tmp_path, options, says):
    command = ["deeptruck-cacc", "sweep", "--simulator", TRUCK, "--out", str(tmp_path / "s"), *options]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 2 and says in capsys.readouterr().err
    assert not (tmp_path / "s").exists()
