from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.paper import control, learning, page
from benchmarks.paper.drives import TRAIN_SEED, drive_of
from benchmarks.paper.run import Chain, app
from deeptruck_cacc import training
from deeptruck_cacc.environments.rollouts import Trace
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_model._terminal import console


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        console.run(app, "paper", ["control", *map(str, arguments)])
    return int(ended.value.code or 0)


@pytest.mark.long
@pytest.mark.usefixtures("quick_exam")
def test_the_control_half_has_every_chain_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = drive_of("trucksim", 9, TRAIN_SEED)
    monkeypatch.setattr(learning, "drives", lambda truck: (whole, whole))
    monkeypatch.setattr(learning, "drive_of", lambda *_: whole.piece(0, 600))
    few = {r: replace(a, updates=2, rounds=1) for r, a in learning.RECIPES.items()}
    monkeypatch.setattr(learning, "RECIPES", few)
    command = ["--out", tmp_path, "--seeds", 1, "--iterations", 1]
    assert run(*command, "--chain", "paper", "--chain", "default") == 0
    out = tmp_path / "paper"
    page = (out / "paper.md").read_text()
    assert (
        "| seeds | | 1 | not run | 1 | not run |" in page
        and "TruckSIM-set: time-gap error after 10 s" in page
    )
    assert "exactly has -0.47 to 0.46 m/s behind this leader" in page
    for file in control.CAPTIONS:
        assert f"(paper/{file.format('paper')})" in page
    printed = json.loads((out / "work/policies/paper/policy.json").read_text())["card"]
    assert printed["config"]["printed_reward"] and printed["config"]["path"] == 800
    monkeypatch.setattr(training, "train", None)  # nothing is trained again
    assert run(*command, "--chain", "paper", "--chain", "default") == 0
    assert (out / "paper.md").read_text() == page


def test_an_unknown_chain_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--out", tmp_path, "--chain", "moon") == 2
    assert "'moon' is not one of 'paper', 'trpo', 'default', 'unaided'" in capsys.readouterr().err
    assert not list(tmp_path.iterdir()) and tuple(Chain) == tuple(control.CHAINS)


def test_an_overshoot_is_an_error_on_the_other_side() -> None:
    """Two trucks begin 1 m/s too slow and too fast; only the first gets too fast, by 0.3 m/s."""
    time = np.arange(400) * 0.1
    slow = np.where(time < 5.0, 1.0, np.where(time < 8.0, -0.3, 0.0))
    fast = np.where(time < 5.0, -1.0, 0.0)
    still = np.zeros((2, 400))
    scene = Scene(np.full(2, 15.0), np.array([14.0, 16.0]), np.full(2, 30.0), np.full(2, 2.0), still, still)
    signals = {"speed_error": np.column_stack([slow, fast]), "time_gap_error": np.full((400, 2), 0.01)}
    trace = Trace(0.1, scene, {**signals, "crash": np.zeros((400, 2), bool)})
    over = control._overshoot(trace)
    assert over["slow"] == pytest.approx(0.3) and over["fast"] == 0.0
    found = control._of_set(trace)
    assert found["crashes"] == 0
    assert found["time_gap"] == [0.01, 0.01] and found["speed"] == [0.0, 0.0]


def test_the_leader_ripples_only_at_the_end() -> None:
    scene = control.closing_with_ripple(np.random.default_rng(0), 3, 400, 0.1)
    assert not scene.leader_acceleration[:, :170].any()
    assert set(np.abs(scene.leader_acceleration[:, 170:]).ravel()) == {page.RIPPLE}


def test_an_exact_follower_lags_by_time_gap_times_acceleration() -> None:
    still = np.zeros((1, 600))
    scene = Scene(np.array([10.0]), np.array([10.0]), np.array([15.0]), np.array([1.5]), still + 0.3, still)
    errors = control.exact_follower(scene, 0.1)
    assert errors[-1, 0] == pytest.approx(1.5 * 0.3, rel=0.05) and 0.0 < errors[0, 0] < 0.05
