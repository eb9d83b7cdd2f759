"""Candidate terms of mechanisms that have a memory of their own, each on signals made for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY, candidate_term
from deeptruck_model.mismatch.mechanisms.air_and_tyres import SpeedPowers
from deeptruck_model.mismatch.mechanisms.base import distinct
from deeptruck_model.mismatch.mechanisms.brakes import Keeps
from deeptruck_model.mismatch.mechanisms.driveline import PlayTaken
from deeptruck_model.mismatch.mechanisms.engine import Boost, LastingLoad, Top
from deeptruck_model.mismatch.mechanisms.engine_drag import OMEGA, Demanded, Overrun
from deeptruck_model.mismatch.mechanisms.variants import Constants, Static
from deeptruck_model.mismatch.residual.evidence import Evidence


def column(e: Evidence, effect: str, constants: Constants, **signals: np.ndarray) -> np.ndarray:
    """The one column of a term on these recordings with other signals, where the gain is one."""
    whole = {"effective_mass_gain": np.ones(len(e)), "holds": np.zeros(len(e)), "made up": np.zeros(len(e))}
    made = candidate_term(LIBRARY[effect], Static(constants), replace(e, signals=e.signals | whole | signals))
    assert made.columns.shape[1] == 1
    return made.columns[:, 0]


def at(e: Evidence, seconds: float) -> int:
    """The row of the first recording so long after its start."""
    return e.stretches[0].start + round(seconds / e.dt)


def test_shoes_that_do_not_let_go_keep_a_share_of_their_force(
    nothing_missing: Evidence,
) -> None:
    e = nothing_missing
    brake = np.zeros(len(e))
    brake[at(e, 20) : at(e, 25)], brake[at(e, 60) : at(e, 65)] = 2.0, 0.5
    drag = column(e, "dragging_brake", Keeps(10.0), brake=brake)
    assert (drag[: at(e, 20)] == 0.0).all()
    assert drag[at(e, 35)] == pytest.approx(-2.0 * np.exp(-1.0), rel=0.05)
    assert drag[at(e, 75)] == pytest.approx(-0.5 * np.exp(-1.0), rel=0.05)


def test_a_demanded_engine_brake_is_a_force_or_a_torque_that_follows_engine_speed(
    nothing_missing: Evidence,
) -> None:
    e = nothing_missing
    n = len(e)
    turning = np.linspace(80.0, 240.0, n)
    signals = {
        "engine_command": np.where(np.arange(n) % 2, -500.0, 300.0),
        "engine_speed": turning,
        "ratio": np.full(n, 8.0),
        "lever": np.full(n, 8.0),
    }
    force = column(e, "engine_brake", Demanded(1000.0), **signals)
    np.testing.assert_allclose(force, np.where(np.arange(n) % 2, -0.5, 0.0))
    torque = column(e, "engine_brake", Demanded(1000.0, 2, reference=4.0), **signals)
    np.testing.assert_allclose(torque, 2.0 * force * (turning / OMEGA) ** 2)


@pytest.mark.parametrize(("stays", "lost"), [(False, 0.5), (True, 0.1)])
def test_boost_that_stays_outlasts_a_shift(nothing_missing: Evidence, stays: bool, lost: float) -> None:
    e = nothing_missing
    engine = np.full(len(e), 1.0)
    engine[at(e, 40) : at(e, 40.4)] = 0.0
    late = column(e, "turbo_lag", Boost(1.6, stays=stays), engine=engine)
    after = -late[at(e, 40.6)]
    assert (after > lost) if not stays else (lost < after < 0.4)


def test_a_limited_command_takes_its_share_of_the_pull_where_no_gear_ratio_is_known(
    nothing_missing: Evidence,
) -> None:
    e = nothing_missing
    command = np.where(np.arange(len(e)) % 3 == 0, 1200.0, 600.0)
    lost = column(e, "torque_limit", Top("command", 900.0), engine=command / 1000.0, engine_command=command)
    np.testing.assert_allclose(lost, -np.maximum(command - 900.0, 0.0) / 1000.0)
    offered = [v.constants for v in LIBRARY["torque_limit"].variants(e)]
    assert [v for v in offered if isinstance(v, Top) and v.by == "command"]
    ratio = {"ratio": np.full(len(e), 8.0), "lever": np.full(len(e), 8.0)}
    with_ratio = LIBRARY["torque_limit"].variants(replace(e, signals=e.signals | ratio))
    assert not [v for v in with_ratio if isinstance(v.constants, Top) and v.constants.by == "command"]


@pytest.mark.parametrize("order", [1, 2, 4])
def test_rolling_resistance_is_reported_per_power_of_speed(nothing_missing: Evidence, order: int) -> None:
    e = nothing_missing
    (made,) = LIBRARY["rolling_resistance_speed"].build(Static(SpeedPowers((order,))))
    np.testing.assert_allclose(made.expression.rows(e), -made.factor * e["speed"] ** order)


def test_an_engine_is_derated_as_a_lasting_load_heats_it_from_cold(nothing_missing: Evidence) -> None:
    e = nothing_missing
    steady = {"engine": np.full(len(e), 0.5), "speed": np.full(len(e), 20.0)}
    lost = column(e, "torque_derate", LastingLoad(60.0, 10.0), **steady)
    for seconds in (0.0, 60.0, 300.0):
        heat = 1.0 - np.exp(-seconds / 60.0)
        assert lost[at(e, seconds)] == pytest.approx(-0.5 * heat, abs=0.01)


def test_a_play_is_taken_up_once_for_each_change_of_sign(nothing_missing: Evidence) -> None:
    e = nothing_missing
    engine = np.full(len(e), -0.2)
    engine[at(e, 50) : at(e, 80)] = 0.4
    lost = -column(e, "driveline_backlash", PlayTaken(0.4, 0.0), engine=engine)
    crossing = lost[at(e, 50) : at(e, 80)]
    assert crossing.sum() * e.dt == pytest.approx(0.4) and (crossing[round(2.0 / e.dt) :] == 0.0).all()


def test_every_different_force_of_a_mechanism_is_an_alternative(nothing_missing: Evidence) -> None:
    e = nothing_missing
    one = candidate_term(LIBRARY["turbo_lag"], Static(Boost(1.6, stays=False)), e)
    rng = np.random.default_rng(0)
    other = [replace(one, columns=rng.standard_normal(one.columns.shape)) for _ in range(4)]
    assert distinct([one], e) == 1.0
    assert distinct([one, replace(one, columns=-2.0 * one.columns)], e) == pytest.approx(1.0)
    assert distinct(other, e) == pytest.approx(4.0, rel=0.01)
    assert 1.0 < distinct([one, one, one, other[0]], e) < 2.0


@pytest.mark.parametrize(("lingers", "offered"), [(0.0, {36.0}), (0.1, {36.0, 6.0})])
def test_a_pedal_that_lingers_is_not_let_go_by_one_border_alone(
    nothing_missing: Evidence, lingers: float, offered: set[float]
) -> None:
    """An engine brake that begins below half a percent was fitted beside one that begins below three."""
    e = nothing_missing
    share = np.arange(len(e)) / len(e)
    command = np.where(share < 0.3, 0.0, np.where(share < 0.3 + lingers, 20.0, 1200.0))
    asked = replace(e, signals=e.signals | {"engine_command": command})
    terms = [v.constants for v in LIBRARY["engine_brake"].variants(asked)]
    assert {round(c.small, 6) for c in terms if isinstance(c, Overrun)} == offered


def test_full_power_is_the_0_95_quantile_of_pull_times_speed_where_the_engine_pulls(
    nothing_missing: Evidence,
) -> None:
    e = nothing_missing
    pull = np.maximum(e["engine"], 0.0)
    full = np.quantile((pull * e["speed"])[e.valid & (pull > 0.02)], 0.95)
    offered = [v.constants for v in LIBRARY["torque_derate"].variants(e)]
    assert [c.full for c in offered if isinstance(c, LastingLoad)] == [full] * 3
