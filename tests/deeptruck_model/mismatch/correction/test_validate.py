"""Free runs on held-out recordings decide whether a correction is validated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_drives import evidence

from deeptruck_core.constants import AIR_DENSITY
from deeptruck_model import trucks
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.correction.fit_result import Errors
from deeptruck_model.mismatch.correction.from_draws import Correction
from deeptruck_model.mismatch.correction.validate import _better, _falls, _log_ratio, at_high_speed, validate
from deeptruck_model.mismatch.folders import CORRECTION
from deeptruck_model.mismatch.mechanisms import variant
from deeptruck_model.mismatch.mechanisms.air_tyres_road import NOBODY_M
from deeptruck_model.mismatch.prepare.drives import PreparedDrives
from deeptruck_model.mismatch.prepare.prepared import Prepared, prepare
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.trucks import PARAMETERS, driving_cycles

TRUCK = trucks.load("trucksim")
RULES = Rules()
GAP_M, LENGTH_M, SHARE = 8.0, 20.0, 0.4


def behind_another(seed: int) -> Prepared:
    """A drive at one gap, where drafting takes one share of the drag."""
    drag_area = TRUCK.parameters()["drag_area"] * (1.0 - SHARE * np.exp(-GAP_M / LENGTH_M))
    drive = driving_cycles.drive(TRUCK.with_parameters({"drag_area": drag_area}), seconds=200.0, seed=seed)
    channels = drive.channels | {"gap": np.full(len(drive), GAP_M)}
    return prepare(replace(drive, channels=channels), False)


def test_a_correction_is_validated_that_without_the_gap_is_as_good_as_none() -> None:
    drafting = CorrectedTruck(
        TRUCK,
        [Term("drafting", (variant("exponential", length_m=LENGTH_M, usual_m=NOBODY_M),), (SHARE,))],
        {},
        None,
        False,
    )
    plain = CorrectedTruck(TRUCK, [], {}, None, False)
    held_out = [behind_another(seed) for seed in range(3)]
    drives = PreparedDrives(tuple(held_out), (True,) * 3, (), (), (), (), None)
    made = Correction(drafting, plain)
    driven = validate(TRUCK, made, drives, evidence())
    fit = driven.judged
    assert fit.errors is not None and fit.errors.after.speed < fit.errors.before.speed
    assert fit.without_exogenous is not None and fit.without_exogenous.signals == ("gap",)
    assert fit.without_exogenous.after == fit.errors.before.speed
    assert CORRECTION in driven.better


def test_a_parameter_is_driven_at_high_speed() -> None:
    drives = PreparedDrives((behind_another(0),), (True,), (), (), (), (), None)
    added, own = at_high_speed(TRUCK, drives), TRUCK.parameters()
    drag = 0.5 * AIR_DENSITY * own["drag_area"] * Limits.high_speed**2 / own["mass"]
    assert added["drag_area"] == pytest.approx(-drag * Limits.horizons_s[0], rel=0.2)
    assert added["torque_gain"] > 0.0 > added["rolling_resistance"] and "brake_gain" not in added


def test_a_parameter_at_its_largest_value_is_driven_with_a_smaller_one() -> None:
    drives = PreparedDrives((behind_another(0),), (True,), (), (), (), (), None)
    heaviest = TRUCK.with_parameters(
        {"mass": PARAMETERS["mass"].high, "drag_area": PARAMETERS["drag_area"].high}
    )
    added = at_high_speed(heaviest, drives)
    assert added["drag_area"] < 0.0 and np.isfinite(list(added.values())).all() and "mass" in added


@pytest.mark.parametrize(
    ("ratios", "size", "falls"),
    [
        ([0.3, 0.4, 0.3], 1.0, False),  # three drives are too few
        ([0.3, 0.4, 0.3, 0.5], 1.0, True),
        ([0.3, 0.4, 0.3, 0.5, 1.1, 0.4, 0.5, 0.6], 1.0, True),
        ([0.3, 1.4, 0.3, 1.5], 1.0, False),
        ([0.95, 1.0, 1.1, 0.9], 1.0, False),
        ([1.3, 1.4, 1.3, 1.5], 1.0, False),
        ([0.3, 0.4, 0.3, 0.5], 0.001, False),
        ([0.3, 0.4, 0.3, 5.0], 0.01, False),
    ],
)
def test_drives_together_show_whether_errors_fall(ratios: list[float], size: float, falls: bool) -> None:
    assert _falls(_log_ratio(size * np.array([[1.0, x] for x in ratios]), RULES), RULES) is falls


@pytest.mark.parametrize(
    ("rules", "falls"),
    [(RULES, True), (Rules(better=0.2), False), (Rules(drift=5.0), False)],
    ids=["ordinary", "better", "drift"],
)
def test_a_user_s_rules_say_what_falls(rules: Rules, falls: bool) -> None:
    ratio = _log_ratio(np.array([[1.0, x] for x in (0.3, 0.4, 0.3, 0.5)]), rules)
    assert _falls(ratio, rules) is falls


def runs(speed: float, drives: int) -> Errors:
    """One free run on every drive, off by `speed` throughout."""
    each = np.full((drives, 5), speed)
    return Errors(each, each, np.arange(drives), np.zeros(drives, dtype=int))


@pytest.mark.parametrize(
    ("after", "left_out", "better"), [(0.2, 0.2, True), (0.2, 0.6, False), (0.6, 0.2, False)]
)
def test_few_held_out_drives_are_judged_with_the_fitted_ones(
    after: float, left_out: float, better: bool
) -> None:
    """Two held-out runs, of which one is worse, are significant by themselves in no case."""
    before, fitted = runs(0.5, 2), {"before": np.full(6, 0.5), "after": np.full(6, left_out)}
    mixed = Errors(
        np.array([[after] * 5, [0.51] * 5]), np.zeros((2, 5)), np.arange(2), np.zeros(2, dtype=int)
    )
    plain = CorrectedTruck(TRUCK, [], {}, None, False)
    made = Correction(plain, plain, left_out=fitted)
    assert _better({"before": before, "after": mixed}, made, "after", RULES) is better
    assert not _better({"before": before, "after": mixed}, replace(made, left_out={}), "after", RULES)


def test_what_suits_held_out_drives_alone_is_not_better() -> None:
    """Held-out drives with a load that one fitted drive of three has too."""
    plain = CorrectedTruck(TRUCK, [], {}, None, False)
    left_out = {"before": np.array([0.01, 0.01, 0.6]), "after": np.array([0.4, 0.4, 0.5])}
    made = Correction(plain, plain, left_out=left_out)
    rng = np.random.default_rng(0)
    sizes = rng.uniform(0.4, 0.6, (12, 5))
    before, after = (
        Errors(x, x, np.zeros(12, dtype=int), np.zeros(12, dtype=int)) for x in (sizes, 0.7 * sizes)
    )
    assert not _better({"before": before, "after": after}, made, "after", RULES)
    assert _better({"before": before, "after": after}, replace(made, left_out={}), "after", RULES)
