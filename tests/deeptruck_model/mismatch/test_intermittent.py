"""What acts now and then alone: planted in noise of the same kind as everything else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deeptruck_model.mismatch import intermittent
from deeptruck_model.mismatch.evidence import Evidence, Stretch
from deeptruck_model.mismatch.explain import explain
from deeptruck_model.mismatch.findings import from_cause
from deeptruck_model.mismatch.search import Search

N, DT, SIGMA = 6000, 0.2, 0.03
rng = np.random.default_rng(5)
TIME = np.arange(N) * DT
SPEED = 18.0 + 4.0 * np.sin(TIME / 40.0)
ENGINE = 0.25 + 0.25 * np.sin(TIME / 11.0) * np.sin(TIME / 3.1)
BRAKE = 0.8 * (np.sin(TIME / 23.0) > 0.9)
STUCK = ((TIME > 300) & (TIME < 306)) | ((TIME > 801) & (TIME < 809))
EVIDENCE = Evidence(
    dt=DT,
    stretches=(Stretch("a", 0, 3000, 0.0, False), Stretch("b", 3000, N, 0.0, True)),
    residual=rng.normal(0.0, SIGMA, N),
    simulated=ENGINE - BRAKE - 0.1,
    disagreement=np.zeros(N),
    valid=np.ones(N, dtype=bool),
    signals={
        "speed": SPEED,
        "engine": ENGINE,
        "brake": BRAKE,
        "drag": 1e-4 * SPEED**2,
        "rolling": np.full(N, 0.06),
        "simulated": ENGINE - BRAKE - 0.1,
        "elapsed": np.concatenate([TIME[:3000], TIME[:3000]]),
        "distance": np.cumsum(SPEED) * DT,
        "engine_command": ENGINE,
        "brake_command": BRAKE,
    },
    sensitivity={"torque_gain": ENGINE, "brake_gain": -BRAKE},
    mass=20000.0,
    rerun=lambda name, amount: np.zeros(N),
)


def test_noise_alone_has_no_windows() -> None:
    search = Search(EVIDENCE)
    assert intermittent.windows(EVIDENCE, search.background(())) == []


def test_the_windows_are_where_the_brake_sticks() -> None:
    stuck = replace(EVIDENCE, residual=EVIDENCE.residual - 0.25 * STUCK)
    spans = intermittent.windows(stuck, Search(stuck).background(()))
    marked = np.zeros(N, dtype=bool)
    for i, first, last in spans:
        marked |= (stuck.record == i) & (stuck["elapsed"] >= first) & (stuck["elapsed"] <= last)
    assert marked[STUCK].mean() > 0.9 and marked[~STUCK].mean() < 0.02


def test_what_sticks_now_and_then_is_named_and_acts_nowhere_else() -> None:
    stuck = replace(EVIDENCE, residual=EVIDENCE.residual - 0.25 * STUCK)
    found = explain(Search(stuck))
    assert found.causes and found.causes[0].shape is not None and "when" in found.causes[0].shape.settings
    names = {found.causes[0].effect, *found.causes[0].not_told_from}
    assert "dragging_brake" in names
    assert "seen now and then alone" in from_cause(found.causes[0], stuck, found, {}).data["says"]
    near = np.convolve(STUCK, np.ones(61), mode="same") > 0
    assert np.abs(found.causes[0].force[~near]).max() < 1e-9
