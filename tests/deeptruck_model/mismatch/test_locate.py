"""Stretches of time and regimes of driving: found where the force was put."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch import locate
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.residual.evidence import Evidence, Stretch, unit

N, DT, MASS = 1500, 0.2, 2e4


@pytest.fixture
def evidence() -> Evidence:
    t = np.arange(N) * DT
    speed = 14.0 + 8.0 * np.sin(t / 9.0)
    zero = np.zeros(N)
    signals = {"speed": speed, "engine": 0.3 * np.cos(t / 4.0), "brake": zero, "simulated": zero}
    stretches = (Stretch("a", 0, 900, 10.0, False), Stretch("b", 900, N, 0.0, True))
    valid = np.ones(N, dtype=bool)
    return Evidence(DT, stretches, zero, zero, zero, valid, signals, {}, MASS, lambda name, amount: zero)


def cause(force: np.ndarray) -> Cause:
    return Cause("missing_physics", "dragging_brake", 50.0, 1.0, force)


def test_a_stretch_is_found_with_its_time_force_and_finding(evidence: Evidence) -> None:
    one, two = np.zeros(N), np.zeros(N)
    one[1000:1100], two[400:450] = -0.2, 0.1
    first, second = locate.segments(evidence, {0: cause(two), 1: cause(one)})
    assert (first.recording, first.finding, second.recording, second.finding) == ("b", 1, "a", 0)
    assert (first.start_s, first.end_s) == pytest.approx((20.0, 40.0), abs=0.5)
    assert (second.start_s, second.end_s) == pytest.approx((90.0, 100.0), abs=0.5)  # since the bag's begin
    assert first.mean_force_n == pytest.approx(-0.2 * MASS, rel=0.05)


def test_a_stretch_has_no_standstill_and_no_row_that_is_not_compared(evidence: Evidence) -> None:
    force, speed, valid = np.zeros(N), evidence["speed"].copy(), evidence.valid.copy()
    force[100:300], force[150:155], force[260:300] = 0.2, 9.0, 9.0
    speed[260:300], valid[150:155] = 0.05, False
    standing = replace(evidence, signals=evidence.signals | {"speed": speed}, valid=valid)
    (only,) = locate.segments(standing, {0: cause(force)})
    assert (only.start_s, only.end_s) == pytest.approx((30.0, 62.0), abs=0.3)
    assert only.mean_force_n == pytest.approx(0.2 * MASS, rel=0.05)


def test_without_a_known_mass_a_segment_has_no_newtons(evidence: Evidence) -> None:
    force = np.zeros(N)
    force[100:300] = 0.2
    (known,) = locate.segments(evidence, {0: cause(force)})
    (unknown,) = locate.segments(replace(evidence, mass_known=False), {0: cause(force)})
    assert unknown.to_json() == known.to_json() | {"mean_force_n": None}
    assert known.mean_force_n == pytest.approx(0.2 * MASS, rel=0.05)


def test_near_stretches_are_one_and_blinks_are_none(evidence: Evidence) -> None:
    force = np.zeros(N)
    force[100:130] = force[135:170] = 0.2
    force[600] = 0.2
    (only,) = locate.segments(evidence, {0: cause(force)})
    assert (only.start_s, only.end_s) == pytest.approx((30.0, 44.0), abs=0.5)
    assert locate.segments(evidence, {0: cause(np.zeros(N))}) == []


def test_a_regime_is_described_by_what_drives_the_error(evidence: Evidence) -> None:
    fast = evidence["speed"] > 18.0
    rng = np.random.default_rng(0)
    found = locate.regimes(evidence, 0.3 * fast + rng.normal(0.0, 0.01, N))
    assert sum(r.share_of_error for r in found) > 0.9
    assert sum(r.share_of_time for r in found) < 1.3 * fast.mean()
    assert "speed" in found[0].where and "m/s" in found[0].where


def test_a_border_so_near_zero_that_nobody_reads_it_is_at_zero(evidence: Evidence) -> None:
    rng = np.random.default_rng(0)
    command = np.where(np.arange(N) % 7 < 2, -6e-6, rng.uniform(0.5, 40.0, N)) * (np.arange(N) % 5 > 0)
    e = replace(evidence, signals=evidence.signals | {"engine_command": command})
    found = locate.regimes(e, 0.3 * (command < 0.0) + rng.normal(0.0, 0.001, N))
    (border,) = {b.high for b in found[0].bounds if b.signal == "engine_command"}
    assert border == 0.0


def test_an_error_that_is_everywhere_has_no_regime(evidence: Evidence) -> None:
    assert locate.regimes(evidence, np.ones(N)) == []


def test_a_regime_of_a_command_has_the_unit_of_this_truck(evidence: Evidence) -> None:
    command = np.random.default_rng(1).uniform(0.0, 40.0, N)
    e = replace(
        evidence,
        signals=evidence.signals | {"engine_command": command},
        command_units={"engine_command": "percent"},
    )
    found = locate.regimes(e, 0.3 * (command > 30.0) + np.random.default_rng(0).normal(0.0, 0.01, N))
    assert "engine_command" in found[0].where and " percent" in found[0].where


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("time since braking", "s"),
        ("braking power over 300 s", "W/kg"),
        ("change of brake_command", "bar"),
        ("gear", ""),
    ],
)
def test_conditions_have_units(name: str, says: str) -> None:
    assert unit(name, {"brake_command": "bar"}) == says
