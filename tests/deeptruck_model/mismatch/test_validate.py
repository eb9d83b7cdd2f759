"""Free runs on held-out recordings decide whether a correction is validated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deeptruck_model import driving_cycles, trucks
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.data.prepared import Prepared, prepare
from deeptruck_model.mismatch.mechanisms import variant
from deeptruck_model.mismatch.mechanisms.air_and_tyres import NOBODY_M
from deeptruck_model.mismatch.model import Made, Recipe
from deeptruck_model.mismatch.posterior.regression import Model
from deeptruck_model.mismatch.validate import validate

TRUCK = trucks.load("trucksim")
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
    made = Made(drafting, plain, Recipe(), Model.__new__(Model))
    fit = validate(TRUCK, made, held_out, []).fit
    assert fit.errors is not None and fit.errors.after.speed < fit.errors.before.speed
    assert fit.without_exogenous is not None and fit.without_exogenous.signals == ("gap",)
    assert fit.without_exogenous.after == fit.errors.before.speed
    assert fit.validated
