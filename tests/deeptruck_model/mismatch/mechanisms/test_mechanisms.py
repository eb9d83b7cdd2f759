"""Candidate terms of mechanisms that have a memory of their own, each on signals made for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.mechanisms import LIBRARY, Variant, build, candidate_term, variant
from deeptruck_model.mismatch.mechanisms.record import Form
from deeptruck_model.mismatch.mechanisms.symbols import OMEGA
from deeptruck_model.mismatch.mechanisms.terms import every_variant
from deeptruck_model.mismatch.residual.evidence import Evidence


def column(e: Evidence, effect: str, of: Variant, **signals: np.ndarray) -> np.ndarray:
    """The one column of a term on these recordings with other signals, where the gain is one."""
    whole = {"effective_mass_gain": np.ones(len(e)), "holds": np.zeros(len(e)), "made up": np.zeros(len(e))}
    made = candidate_term(LIBRARY[effect], of, replace(e, signals=e.signals | whole | signals))
    assert made.columns.shape[1] == 1
    return made.columns[:, 0]


def at(e: Evidence, seconds: float) -> int:
    """The row of the first recording so long after its start."""
    return e.drives[0].start + round(seconds / e.dt)


def test_shoes_that_do_not_let_go_keep_a_share_of_their_force(
    nothing_missing: Evidence,
) -> None:
    e = nothing_missing
    brake = np.zeros(len(e))
    brake[at(e, 20) : at(e, 25)], brake[at(e, 60) : at(e, 65)] = 2.0, 0.5
    drag = column(e, "dragging_brake", variant("kept", keeps_s=10.0), brake=brake)
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
        "overall_ratio": np.full(n, 8.0),
    }
    force = column(e, "engine_brake", variant("demanded force", full=1000.0), **signals)
    np.testing.assert_allclose(force, np.where(np.arange(n) % 2, -0.5, 0.0))
    as_torque = variant("demanded torque", full=1000.0, order=2, reference=4.0)
    torque = column(e, "engine_brake", as_torque, **signals)
    np.testing.assert_allclose(torque, 2.0 * force * (turning / OMEGA) ** 2)


def boost(form: str) -> Variant:
    return variant(form, tau_s=1.6, reference=0.0, aspirated=0.0)


@pytest.mark.parametrize(
    ("form", "least", "most"), [("above aspirated", 0.5, 1.0), ("kept through a shift", 0.1, 0.4)]
)
def test_boost_that_stays_outlasts_a_shift(
    nothing_missing: Evidence, form: str, least: float, most: float
) -> None:
    e = nothing_missing
    engine = np.full(len(e), 1.0)
    engine[at(e, 40) : at(e, 40.4)] = 0.0
    late = column(e, "turbo_lag", boost(form), engine=engine)
    assert least < -late[at(e, 40.6)] < most


def test_a_limited_command_takes_its_share_of_the_pull_where_no_gear_ratio_is_known(
    nothing_missing: Evidence,
) -> None:
    e = nothing_missing
    command = np.where(np.arange(len(e)) % 3 == 0, 1200.0, 600.0)
    lost = column(
        e,
        "torque_limit",
        variant("command", limit_command=900.0),
        engine=command / 1000.0,
        engine_command=command,
    )
    np.testing.assert_allclose(lost, -np.maximum(command - 900.0, 0.0) / 1000.0)
    assert "command" in {v.form for v in every_variant(LIBRARY["torque_limit"], e)}
    ratio = {"ratio": np.full(len(e), 8.0), "overall_ratio": np.full(len(e), 8.0)}
    with_ratio = every_variant(LIBRARY["torque_limit"], replace(e, signals=e.signals | ratio))
    assert "command" not in {v.form for v in with_ratio}


@pytest.mark.parametrize("order", [1, 2, 4])
def test_rolling_resistance_is_reported_per_power_of_speed(nothing_missing: Evidence, order: int) -> None:
    e = nothing_missing
    (made,) = build(LIBRARY["rolling_resistance_speed"], (variant("powers", orders=(order,)),))
    np.testing.assert_allclose(made.expression.rows(e), -made.factor * e["speed"] ** order)


def test_an_engine_is_derated_as_a_lasting_load_heats_it_from_cold(nothing_missing: Evidence) -> None:
    e = nothing_missing
    steady = {"engine": np.full(len(e), 0.5), "speed": np.full(len(e), 20.0)}
    lost = column(e, "torque_derate", variant("lasting load", soak_s=60.0, full=10.0), **steady)
    for seconds in (0.0, 60.0, 300.0):
        heat = 1.0 - np.exp(-seconds / 60.0)
        assert lost[at(e, seconds)] == pytest.approx(-0.5 * heat, abs=0.01)


@pytest.mark.parametrize(("lingers", "offered"), [(0.0, {36.0}), (0.1, {36.0, 6.0})])
def test_a_pedal_that_lingers_is_not_let_go_by_one_border_alone(
    nothing_missing: Evidence, lingers: float, offered: set[float]
) -> None:
    """An engine brake that begins below half a percent was fitted beside one that begins below three."""
    e = nothing_missing
    share = np.arange(len(e)) / len(e)
    command = np.where(share < 0.3, 0.0, np.where(share < 0.3 + lingers, 20.0, 1200.0))
    asked = replace(e, signals=e.signals | {"engine_command": command})
    terms = [v for v in every_variant(LIBRARY["engine_brake"], asked) if v.form == "by speed"]
    assert {round(dict(v.constants)["small"], 6) for v in terms} == offered


def test_full_power_is_the_0_95_quantile_of_pull_times_speed_where_the_engine_pulls(
    nothing_missing: Evidence,
) -> None:
    e = nothing_missing
    pull = np.maximum(e["engine"], 0.0)
    full = np.quantile((pull * e["speed"])[e.valid & (pull > 0.02)], 0.95)
    offered = [v for v in every_variant(LIBRARY["torque_derate"], e) if v.form == "lasting load"]
    assert [dict(v.constants)["full"] for v in offered] == [full] * 3


def test_every_word_that_is_tried_is_permitted_and_every_reported_constant_is_one(
    nothing_missing: Evidence,
) -> None:
    e = nothing_missing
    for mechanism in (m for m in LIBRARY.values() if e.has(*m.needs)):
        for each in every_variant(mechanism, e):
            form, values = mechanism.forms[each.form], dict(each.constants)
            if isinstance(form, Form):
                assert form.units.keys() | form.words.keys() <= values.keys()
                words = {name: x for name, x in values.items() if isinstance(x, str)}
                assert words.keys() == form.words.keys()
                assert all(x in form.words[name] for name, x in words.items())
