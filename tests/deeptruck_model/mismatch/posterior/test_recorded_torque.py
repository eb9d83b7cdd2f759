"""The engine's own recorded torque tells whether a force is missing at the engine or beyond it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.posterior.explain import explain
from deeptruck_model.mismatch.posterior.recorded_torque import DRIVELINE, recorded_torque
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules

LEVER = 10.0  # rad/m
LIMIT = 0.3  # m/s^2
SURE = Rules().told_gain


def missing(e: Evidence) -> np.ndarray:
    """What an engine that is limited does not give, m/s^2."""
    return np.maximum(e["engine"] - LIMIT, 0.0)


def with_torque(e: Evidence, reported: float, off: float = 0.0) -> Evidence:
    """The evidence of a truck whose engine is limited, of which its controller tells a share; its report is
    `off` by a share and by 20 N m."""
    rng = np.random.default_rng(3)
    per_nm = DRIVELINE * LEVER / e.mass
    modelled = e["engine"] / per_nm
    said = (modelled - reported * missing(e) / per_nm) * (1.0 + off) + 20.0 * (off != 0.0)
    n = len(e)
    signals = e.signals | {
        "modelled_torque": modelled,
        "engine_torque": said + rng.normal(0.0, 8.0, n),
        "lever": np.full(n, LEVER),
        "ratio": np.full(n, LEVER),
        "engine_speed": LEVER * e["speed"],
    }
    return replace(e, signals=signals, residual=e.residual - missing(e))


def test_a_force_that_the_engine_reports_is_the_engines(nothing_missing: Evidence) -> None:
    e = with_torque(nothing_missing, reported=1.0)
    torque = recorded_torque(e)
    assert torque is not None
    assert torque.gain(-missing(e), shows=0.7) > 100.0
    assert torque.shows(-missing(e), SURE)


def test_a_force_that_is_not_reported_is_hardly_held_against_the_engine(nothing_missing: Evidence) -> None:
    """A controller may not know that air or fuel is short."""
    e = with_torque(nothing_missing, reported=0.0)
    torque = recorded_torque(e)
    assert torque is not None
    assert torque.shows(-missing(e), SURE) is False
    gain = torque.gain(-missing(e), shows=0.7)
    assert gain == pytest.approx(e.rules.temper * np.log(0.3), abs=0.2)


@pytest.mark.parametrize("off", [0.05, -0.05])
def test_a_report_that_is_a_little_off_shows_no_force(nothing_missing: Evidence, off: float) -> None:
    e = with_torque(nothing_missing, reported=0.0, off=off)
    torque = recorded_torque(e)
    assert torque is not None
    assert torque.gain(-missing(e), shows=0.7) < 3.0


def test_what_is_too_small_for_it_is_not_told(nothing_missing: Evidence) -> None:
    e = with_torque(nothing_missing, reported=1.0)
    torque = recorded_torque(e)
    assert torque is not None
    assert torque.shows(-0.001 * missing(e), SURE) is None


def test_without_a_recorded_torque_nothing_is_said(nothing_missing: Evidence) -> None:
    assert recorded_torque(nothing_missing) is None


@pytest.mark.long
def test_the_name_is_the_engines_where_its_torque_shows_it(nothing_missing: Evidence) -> None:
    """Beyond a pull, an engine is limited or the tyres slip; the report decides."""

    def told(e: Evidence) -> float:
        main = explain(Search(e)).causes[0]
        return main.names.get("torque_limit", 0.0)

    shown = told(with_torque(nothing_missing, reported=1.0))
    assert shown > 0.8
    assert told(with_torque(nothing_missing, reported=0.0)) < shown
