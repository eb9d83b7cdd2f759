"""Findings of what follows no recorded channel, from forces that are known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import cast

import numpy as np
import pytest
from scipy.signal import lfilter
from small_drives import FORCES, N, evidence, posterior_of, regression

from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck
from deeptruck_model.mismatch.correction.from_draws import Correction, simplest_terms
from deeptruck_model.mismatch.mechanisms.families import EACH_DRIVE, PLACE, SLOW, UNKNOWN
from deeptruck_model.mismatch.posterior.budget import budget
from deeptruck_model.mismatch.posterior.names import Compared, Named, Tree, names
from deeptruck_model.mismatch.posterior.posterior import Posterior, posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.prepare.drives import PreparedDrives
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.verdict import wording
from deeptruck_model.mismatch.verdict.findings import findings
from deeptruck_model.mismatch.verdict.result import Finding, Kind

RULES = Rules()
NOTHING = Correction(cast("CorrectedTruck", None), cast("CorrectedTruck", None))
ROAD = np.tile(0.08 * np.sin(np.arange(N // 3) / 90.0) * np.sin(np.arange(N // 3) / 230.0), 3)


def of_places() -> Posterior:
    """Drives on the same road along which a force of its places is missing."""
    e = evidence(ROAD)
    road = np.tile(np.cumsum(e["speed"][: N // 3]) * e.dt, 3)
    signals = {**e.signals, "place": road, "distance": np.arange(N) * e.dt * 18.0}
    return posterior(Regression(replace(e, signals=signals)), sweeps=60)


@cache
def compared(part: str) -> Compared:
    return _compared(of_places() if part == PLACE else posterior_of(part))


def _compared(p: Posterior) -> Compared:
    e, drives = p.regression.e, PreparedDrives((), (), (), (), (), (), None)
    return Compared({}, drives, e, p, names(p), budget(p, e))


def found(part: str, error: float = 1.0) -> tuple[Finding, ...]:
    return findings(compared(part), NOTHING, None, error, RULES.visible)


@pytest.mark.parametrize("part", [EACH_DRIVE, PLACE, SLOW])
def test_a_force_without_a_channel_is_a_finding_without_a_name(part: str) -> None:
    first = found(part)[0]
    assert (first.kind, first.effect, first.family) == (Kind.PHYSICS, UNKNOWN, UNKNOWN)
    assert first.says == wording.DRIFT[part]
    assert first.separating_manoeuvre == wording.RECORD_ROAD
    assert first.probability > 0.7
    assert first.force is not None
    planted = ROAD if part == PLACE else FORCES[part]
    assert np.corrcoef(first.force, planted)[0, 1] > 0.9


@pytest.mark.parametrize("part", [PLACE, SLOW])
def test_it_is_none_where_the_simulator_is_good_enough(part: str) -> None:
    assert wording.DRIFT[part] not in [f.says for f in found(part, error=0.5 * RULES.visible)]


@pytest.mark.parametrize("part", [EACH_DRIVE, PLACE, SLOW])
def test_its_share_of_the_error_is_that_of_its_part_of_the_budget(part: str) -> None:
    assert found(part)[0].share_of_error == pytest.approx(compared(part).budget.share(part))


def test_the_cause_of_events_stands_beside_what_lasts() -> None:
    """A force of 0.5 m/s^2 for 8 s, which no finding of slow forces is silent for."""
    c, force = compared(SLOW), np.zeros(N)
    force[2500:2540] = 0.5
    cause = Named("wheel_slip", Tree({"wheel_slip": 0.7}), 50.0, force)
    both = findings(replace(c, names=replace(c.names, found=(cause,))), NOTHING, None, 1.0, RULES.visible)
    assert {f.effect for f in both} == {UNKNOWN, "wheel_slip"}
    (own,) = (f for f in both if f.effect == "wheel_slip")
    assert own.in_drives == ("b",)
    assert own.strength is not None and own.strength.share_of_time < 0.05


def test_a_road_that_was_recovered_is_the_one_finding_of_its_name() -> None:
    """The residual of a learned truck has a rest of the slope that the recordings have whole."""
    c, whole = compared(SLOW), 3.0 * FORCES[SLOW]
    rest = Named("road_grade", Tree({"road_grade": 1.0}), 50.0, 0.1 * whole)
    road = Named("road_grade", Tree({"road_grade": 0.95, UNKNOWN: 0.05}), 500.0, whole)
    both = findings(replace(c, names=replace(c.names, found=(rest,))), NOTHING, road, 1.0, RULES.visible)
    (one,) = (f for f in both if f.effect == "road_grade")
    assert one.force is whole


def test_what_a_drive_has_of_its_own_has_a_size_by_drive() -> None:
    """Beside the middle one of three, whether or not the simulator is good enough."""
    (first,) = found(EACH_DRIVE, error=0.5 * RULES.visible)
    e = compared(EACH_DRIVE).regression.e
    for name, force in {"a": 0.1, "b": -0.04, "c": 0.0}.items():
        size = first.parameters[f"force[{name}]"]
        assert size.unit == "N"
        assert size.ci95 is not None
        assert size.ci95[0] - 60.0 < force * e.mass < size.ci95[1] + 60.0
    assert first.in_drives == ("a", "b")


@cache
def of_noise(persists: float, sd: float) -> Compared:
    """Nothing but noise, an autoregression, as a learned simulator may be off by."""
    noise = lfilter([1.0], [1.0, -persists], np.random.default_rng(3).normal(0.0, sd, N))
    e = replace(evidence(), residual=noise, learned_slow_noise=0.3)
    return _compared(posterior(regression(e), sweeps=60))


def test_what_adds_up_in_no_recorded_channel_is_slow_and_never_undetermined_alone() -> None:
    c = of_noise(0.95, 0.03)
    (f,) = findings(c, NOTHING, None, c.budget.speed_rmse, RULES.visible)
    assert (f.effect, f.says, f.separating_manoeuvre) == (
        UNKNOWN,
        wording.DRIFT[SLOW],
        wording.RECORD_ROAD,
    )
    assert f.share_of_error == pytest.approx(c.budget.share(SLOW) + c.budget.persistent)
    assert f.share_of_error > 0.5
    assert findings(c, NOTHING, None, 0.5 * RULES.visible, RULES.visible) == ()


def test_what_changes_within_seconds_is_said_as_such() -> None:
    c = of_noise(0.0, 0.2)
    (f,) = findings(c, NOTHING, None, 1.0, RULES.visible)
    assert (f.says, f.separating_manoeuvre) == (wording.DRIFT["left_over"], wording.RECORD_FAST)
    assert f.share_of_error == pytest.approx(c.budget.share("left_over") - c.budget.persistent)
    assert f.probability == round(c.posterior.nameless(), 3) >= 0.5


def test_names_that_these_drives_do_not_distinguish_have_the_size_that_each_needs() -> None:
    """A rolling resistance of 0.1 m/s^2 at 20 m/s, where the mechanism has 0.03 as a rule."""
    p = posterior(regression(evidence(-0.1 * evidence()["speed"] / 20.0)), sweeps=40)
    c = _compared(p)
    name = "rolling_resistance_speed"
    given = p.inside(name)
    terms = [t for t in simplest_terms(p) if t.mechanism.effect == name]
    correction = replace(NOTHING, terms=tuple(terms))
    named = Named(name, Tree({name: 0.5, "drag_area": 0.4}), 10.0, p.force(name, given), given=given)
    unsure, stated = (
        replace(named, tree=tree) for tree in (named.tree, Tree({name: 0.95, "drag_area": 0.04}))
    )
    one, other = (
        findings(replace(c, names=replace(c.names, found=(n,))), correction, None, 0.0, RULES.visible)[0]
        for n in (unsure, stated)
    )
    own, rival = one.alternatives
    assert (own.name, own.probability, rival.name) == (name, 0.5, "drag_area")
    assert own.times_usual is not None and 1.5 < own.times_usual < 6.0
    assert other.stated == name and other.alternatives == ()
