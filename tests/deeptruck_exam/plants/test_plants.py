"""FASTSim's line-haul truck with something concealed; what needs FASTSim is skipped without it."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from deeptruck_exam.plants import cases, fastsim_truck, page, prove
from deeptruck_exam.plants.fastsim_equations import LineHaul, make
from deeptruck_exam.tool import ToolRun
from deeptruck_model import simulators
from deeptruck_model.mismatch.correction.added import Added, TruckWithForces
from deeptruck_model.mismatch.residual.expression import Signal
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import protocol_check

needs_fastsim = pytest.mark.skipif(
    find_spec("fastsim") is None, reason="FASTSim is not installed: pip install 'deeptruck[proof]'"
)


def free_error(recording: Recording, simulator: LineHaul) -> float:
    """RMSE of the speed, m/s, of a free run along the whole recording."""
    y = recording.y[None]
    u, w = recording.u[None], recording.w[None]
    run = simulators.free_run(simulators.completed(simulator), u, w, y[:, 0])
    return float(np.sqrt(np.mean((run.y - y)[0, :, 1] ** 2)))


def test_the_equations_balance_in_newtons() -> None:
    truck, y0 = make(), np.array([[0.0, 20.0], [0.0, 8.0], [0.0, 15.0]])
    u, w = np.array([[1500.0, 0.0], [3000.0, 0.0], [0.0, 1.0]]), np.array([[0.01], [-0.02], [0.0]])
    state, y = truck.step(truck.reset(y0), u, w)
    i = truck.inside(state)
    weight = i["mass"] * fastsim_truck.GRAVITY * np.sin(np.arctan(w[:, 0]))
    force = i["traction_force"] - i["brake_force"] - i["drag_force"] - i["rolling_force"] - weight
    np.testing.assert_allclose(i["effective_mass"] * y[:, 0], force, rtol=1e-6)
    power = 1500.0 * 20.0 * 4.0 / 0.506 - 3500.0  # less the auxiliaries, of which 97 % reach the road
    assert i["traction_force"][0] == pytest.approx(0.97 * power / 20.0, rel=1e-3)
    assert i["effective_mass"][0] == pytest.approx(31978.0 + 18 * 10.0 / 0.506**2)


def test_steps_of_a_forced_run_side_by_side_are_those_one_after_another() -> None:
    truck, rng = make({"grade": False}), np.random.default_rng(0)
    u = np.stack([rng.uniform(0.0, 3000.0, (2, 50)), np.zeros((2, 50))], axis=-1)
    w, y = np.zeros((2, 50, 0)), np.stack([np.zeros((2, 50)), rng.uniform(0.0, 20.0, (2, 50))], axis=-1)
    run, state = truck.rollout(u, w, y[:, 0], y), truck.reset(y[:, 0])
    for k in range(49):
        state, response = truck.step(state, u[:, k], w[:, k])
        np.testing.assert_array_equal(run.y[:, k + 1], response)
        for name, values in truck.inside(state).items():
            np.testing.assert_array_equal(run.inside[name][:, k + 1], values)
        state = truck.force(state, y[:, k + 1])


def test_it_is_fit_for_use_as_a_simulator_of_ones_own() -> None:
    loaded = simulators.load("python:deeptruck_exam.plants.fastsim_equations:make")
    assert not protocol_check.missing(protocol_check.examine(loaded))


def test_a_load_that_is_added_leaves_brakes_that_are_commanded_per_mass() -> None:
    """1 m/s^2 of braking is no less with more load; 0.02 m/s^2 of drag are."""
    base = simulators.completed(make())
    loaded = TruckWithForces(base, Added(((Signal("sensitivity:mass"), 1.0),)), holds=False)
    y0, u, w = np.array([[0.0, 15.0]]), np.array([[0.0, 1.0]]), np.zeros((1, 1))
    _, own = base.step(base.reset(y0), u, w)
    _, with_load = loaded.step(loaded.reset(y0), u, w)
    assert 0.0 < with_load[0, 0] - own[0, 0] < 0.05


@needs_fastsim
def test_the_equations_drive_as_fastsim_does_until_something_is_concealed() -> None:
    (nominal, *_) = cases.drives(cases.CONCEALED["nothing"], 7)
    assert free_error(nominal, make()) < 0.2
    for key, values in (("mass", {"mass": 36978.0}), ("drag", {"drag_area": 1.2 * 0.546 * 10.4})):
        (other, *_) = cases.drives(cases.CONCEALED[key], 7)
        assert free_error(other, make()) > 0.5, key
        assert free_error(other, make(values)) < 0.2, key


@needs_fastsim
def test_geared_drives_are_the_same_drives_in_gears() -> None:
    """Above idle speed the engine has the same power through either bus."""
    one, geared = (cases.drives(cases.CONCEALED["nothing"], 7, geared=g)[1].channels for g in (False, True))
    np.testing.assert_array_equal(one["speed"], geared["speed"])
    assert set(geared["gear"]) <= set(range(1, 11)) and len(set(geared["gear"])) > 5
    fast = (geared["speed"] > 9.5) & (np.diff(geared["gear"], prepend=0.0) == 0.0)
    powers = [c["engine_command"] * c["engine_speed"] for c in (one, geared)]
    np.testing.assert_allclose(powers[0][fast], powers[1][fast], rtol=0.05, atol=500.0)
    assert (geared["brake_command"][geared["speed"] == 0.0][2:] > 0.0).mean() > 0.8


@needs_fastsim
def test_a_slope_that_is_not_logged_and_a_payload_that_changes() -> None:
    blind = cases.drives(cases.CONCEALED["slope"], 7)
    assert all("grade" not in r.channels and not r.interface.grade for r in blind)
    whole = cases.drives(cases.CONCEALED["nothing"], 7)
    np.testing.assert_array_equal(blind[0].channels["speed"], whole[0].channels["speed"])
    loads = cases.drives(cases.CONCEALED["payload"], 7)
    for recording, kg in zip(loads, cases.CONCEALED["payload"].each_drive, strict=True):
        given, true = free_error(recording, make()), free_error(recording, make({"mass": 31978.0 + kg}))
        assert true < 0.5 * given or kg == 0.0, recording.name


def verdict(*names: str) -> dict[str, object]:
    return {
        "verdict": "parameter_error",
        "findings": [{"effect": n, "probability": 0.8} for n in names],
        "fit": {"before": {"speed_rmse": 1.5}, "after": {"speed_rmse": 0.1}, "offered": "correction"},
    }


def test_a_row_is_scored_by_the_rules_of_the_exam_and_stands_on_the_page() -> None:
    rows = []
    for key, names in (("mass", ("mass",)), ("drag", ("headwind",)), ("nothing", ())):
        row = prove.judged(cases.CONCEALED[key], ToolRun(0, 1.0, verdict(*names), ""))
        about = {"key": key, "concealed": cases.CONCEALED[key].what, "simulator": "learned", "seed": 3}
        rows.append({**about, **row})
    assert [r["outcome"] for r in rows] == ["right", "wrong", "silent"]
    assert (rows[0]["before"], rows[0]["parameters_only"], rows[0]["after"]) == (1.5, None, 0.1)
    text = "\n".join(page.lines([*rows, {**rows[-1], "seed": 4}]))
    assert "| learned | mass +5 t | mass | 1, 1, 1 of 1 | 1.50 | - | 0.10 | 0.10 |" in text


@needs_fastsim
@pytest.mark.long
@pytest.mark.timeout(1800)  # a minute of CPU time, more on a busy machine
def test_a_case_is_made_run_scored_and_kept(tmp_path: Path) -> None:
    out = tmp_path / "out"
    rows = prove.prove_plant(out, [7], concealed=("mass",), simulators=("own equations",), updates=40)
    assert [(r["outcome"], r["simulator"]) for r in rows] == [("right", "own equations")]
    (kept,) = out.glob("cases/*/own_equations.json")
    before = kept.stat().st_mtime_ns
    prove.prove_plant(out, [7], concealed=("mass",), simulators=("own equations",), updates=40)
    assert kept.stat().st_mtime_ns == before, "what is scored is not run again"
    assert "mass +5 t" in (out / "plant.md").read_text()
