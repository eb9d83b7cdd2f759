"""One posterior over small drives whose truth is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from small_drives import FORCES, N, evidence, posterior_of, regression

from deeptruck_core.constants import GRAVITY
from deeptruck_core.signals import FELT, FELT_SD
from deeptruck_model.mismatch.mechanisms.air_tyres_road import HEADWIND
from deeptruck_model.mismatch.mechanisms.families import EACH_DRIVE, SLOW
from deeptruck_model.mismatch.posterior.names import names
from deeptruck_model.mismatch.posterior.posterior import (
    Posterior,
    _lasting,
    gains,
    posterior,
    without_roads,
)
from deeptruck_model.mismatch.posterior.regression import Regression, changed_by
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules

RULES = Rules()
HILLS = 0.01 * np.sin(2 * np.pi * evidence()["distance"] / 700.0)


def test_of_noise_nothing_is_found() -> None:
    found = names(posterior_of("none"))
    assert not found.found
    assert found.explanations[0].names == ()


def test_a_parameter_that_is_wrong_is_found_with_its_size() -> None:
    p = posterior_of("brakes")
    found = names(p)
    assert found.found[0].tree.families["brakes"] > 0.9
    assert p.probability("brake_gain") > 0.5
    change, sd = p.change("brake_gain", np.ones(len(p.draws.coefficients), bool))
    assert change == pytest.approx(-0.2, abs=3.0 * sd + 0.01)


@pytest.mark.parametrize("block", [EACH_DRIVE, SLOW])
def test_what_follows_no_channel_is_a_drift_and_no_name(block: str) -> None:
    p = posterior_of(block)
    assert p.probability(block) > 0.7
    force = p.force(block)
    assert np.corrcoef(force[p.regression.rows], FORCES[block][p.regression.rows])[0, 1] > 0.9


def test_a_drawn_force_has_the_coefficients_of_columns_that_make_it_up() -> None:
    p = posterior_of("brakes")
    name = names(p).found[0].name
    columns = np.stack([p.force(name, p.inside(name)), np.ones(N)], axis=1)
    b = p.on_columns(name, columns, p.inside(name))
    assert b.shape == (p.inside(name).sum(), 2)
    np.testing.assert_allclose(b.mean(axis=0), [1.0, 0.0], atol=0.05)


def without_slope(**options: Sequence[str]) -> Posterior:
    e = evidence(GRAVITY * HILLS)
    e = replace(e, signals={n: x for n, x in e.signals.items() if n != "grade"})
    return posterior(Regression(e, **options), sweeps=30)


def test_hills_that_were_not_recorded_are_a_slope() -> None:
    p = without_slope()
    assert names(p).found[0].name == "road_grade"
    force, rows = p.force("road_grade"), p.regression.rows
    assert np.corrcoef(force[rows], HILLS[rows])[0, 1] > 0.95


def test_a_slope_that_is_left_out_of_the_library_has_no_block() -> None:
    p = without_slope(exclude=["road_grade"])
    assert "road_grade" not in {k.name for k in p.of}


def test_the_mean_force_is_what_was_planted() -> None:
    p = posterior_of("brakes")
    first = names(p).found[0]
    planted = FORCES["brakes"][p.regression.rows]
    left = first.force[p.regression.rows] - planted
    assert np.sum(left**2) < 0.1 * np.sum(planted**2)


def test_probabilities_of_explanations_add_up_to_at_most_one() -> None:
    found = names(posterior_of("drag"))
    assert 0.5 < sum(x.probability for x in found.explanations) <= 1.0 + 1e-9
    assert all(0.0 < x <= 1.0 for x in found.tree.names.values())


def test_a_name_gains_most_of_its_own_force() -> None:
    by_name = gains(regression(evidence(FORCES["brakes"])))
    assert by_name["brake_gain"] > 20.0
    assert by_name["brake_gain"] > by_name.get("drag_area", 0.0)


@pytest.mark.parametrize(("gain", "x"), [(1.0, -0.5), (1.0, 1.0), (0.6, -0.5), (0.6, 1.0)])
def test_a_mass_that_changed_much_is_found_from_what_it_changes_to_first_order(gain: float, x: float) -> None:
    """Of the mass that is accelerated a share turns, and does not change."""
    slope = x / (1.0 + gain * x)  # what a line through the simulator's own answer says of F / (m (1 + x) + J)
    assert changed_by("mass", slope, gain) == pytest.approx(x)
    assert changed_by("drag_area", slope, gain) == slope


def test_a_parameter_that_moved_far_has_a_wide_interval() -> None:
    """What a line may be off by is in it."""
    p = posterior_of("brakes")
    change, sd = p.change("brake_gain", p.inside("brake_gain") | True)
    assert sd >= 0.5 * change**2


def _felt(of_road: float) -> Evidence:
    """Evidence with a slow force that is that of a road, of which an accelerometer felt the share `of_road`;
    what it felt beside that is another road."""
    along = evidence()["distance"]
    hills, others = (
        0.02 * np.sin(along / at + 0.3) + 0.01 * np.sin(along / (2.3 * at)) for at in (310.0, 170.0)
    )
    e = evidence(-GRAVITY * hills)
    felt = of_road * hills + (1.0 - of_road) * others
    return replace(e, signals=e.signals | {FELT: felt, FELT_SD: np.full(len(e), 0.001)})


def test_a_slow_force_that_the_accelerometer_felt_is_the_road() -> None:
    p = posterior(Regression(_felt(1.0)), sweeps=40)
    road = p.force("road_grade")
    assert p.probability("road_grade") > 0.95
    assert np.corrcoef(road, -GRAVITY * _felt(1.0)[FELT])[0, 1] > 0.99


def test_a_slow_force_that_the_accelerometer_did_not_feel_is_no_road() -> None:
    p = posterior(Regression(_felt(0.0)), sweeps=40)
    assert p.probability("road_grade") < 0.3


def test_beside_a_learned_simulator_the_noise_is_that_beside_any_draws() -> None:
    search = Regression(replace(_felt(1.0), known_physics=False))
    sigma = [posterior(search, seed=seed, sweeps=1).noise.sigma for seed in range(2)]
    assert np.ptp(sigma) < 0.03 * min(sigma)


def test_what_is_slow_and_was_not_felt_is_wind_rather_than_a_drift() -> None:
    e = _felt(0.0)
    assert HEADWIND.chance(e) == 5.0 * HEADWIND.chance(evidence()) > 0.0


def test_roads_of_a_simulators_own_recordings_are_none_of_its_errors() -> None:
    e = _felt(1.0)
    assert without_roads(e).residual.std() < 0.3 * e.residual.std()
    bare = replace(e, signals={k: x for k, x in e.signals.items() if k not in (FELT, FELT_SD)})
    assert without_roads(bare).residual.std() < 0.5 * e.residual.std()


def test_the_error_of_forms_is_a_share_of_what_lasts_and_not_of_noise() -> None:
    slow = 0.2 * np.sin(np.arange(N) / 100.0)
    noise, both = (_lasting(regression(evidence(force, noise=0.3))) for force in (0.0, slow))
    assert noise < 0.05
    assert both == pytest.approx(np.std(slow), rel=0.15)
