"""What is stated is set into the simulator, and its size is that of the truck."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from small_drives import TRUCK, LazyBrake, drives

from deeptruck_model import trucks
from deeptruck_model.mismatch.mechanisms import LIBRARY, variant
from deeptruck_model.mismatch.mechanisms.courses import EachDrive
from deeptruck_model.mismatch.posterior.exact import Exact, Fitted, Part
from deeptruck_model.mismatch.posterior.posterior import posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.prepare.drives import prepare_drives
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.verdict.sizes import fitted_sizes
from deeptruck_model.trucks import View

OFF = {"mass": 0.12, "drag_area": -0.15, "brake_gain": 0.1}


def exact(truck: trucks.PhysicsTruck, free: tuple[str, ...], parts: tuple[Part, ...]) -> Fitted:
    """The fit of a simulator to three drives of a truck; a fourth is held out."""
    prepared = prepare_drives(TRUCK, drives(truck, 4), [], Rules())
    e = gather(TRUCK, prepared.prepared, prepared.held_out)
    p = posterior(Regression(e.to_fit()), sweeps=1)
    return Exact(TRUCK, prepared.prepared, p, np.ones(len(p.draws.states), dtype=bool), free, parts).fit()


@cache
def late() -> Fitted:
    part = Part(LIBRARY["brake_lag"], variant("lag", side="lag", tau_s=0.35), (1.0,))
    return exact(TRUCK.with_forces([], [LazyBrake()]), (), (part,))


@cache
def other() -> Fitted:
    own = TRUCK.parameters()
    truck = TRUCK.with_parameters({name: own[name] * (1.0 + x) for name, x in OFF.items()})
    return exact(truck, tuple(own.keys() & {*OFF, "rolling_resistance", "torque_gain"}), ())


def test_a_lag_that_was_taken_too_short_is_as_long_as_the_truck_s() -> None:
    fitted = late()
    (part,) = fitted.setting.parts
    tau_s = dict(part.variant.constants)["tau_s"]
    assert tau_s == pytest.approx(0.6, rel=0.05)
    (size,) = fitted_sizes(fitted, "brake_lag").values()
    assert size.ci95 is not None and size.unit == "s" and size.value == pytest.approx(tau_s)
    assert size.ci95[0] < 0.6 < size.ci95[1] and size.ci95[1] - size.ci95[0] < 0.1
    assert fitted.relative_sd("brake_lag") == pytest.approx(np.sqrt(fitted.covariance[0, 0]), rel=0.5)


def test_the_force_of_a_path_is_what_the_simulator_does_without_it() -> None:
    fitted, rows = late(), late().of.rows
    force = fitted.force("brake_lag")[rows]
    before = fitted.of.e.residual[rows]
    assert np.std(before - force) < 0.6 * np.std(before)


def test_parameters_that_are_wrong_together_are_those_of_the_truck() -> None:
    fitted = other()
    for name in ("mass", "drag_area", "brake_gain", "torque_gain", "rolling_resistance"):
        change, sd = fitted.change(name)
        assert abs(change - OFF.get(name, 0.0)) < 3.0 * sd
        assert fitted.setting.moved.get(name, 0.0) == change
    assert fitted.change("mass")[0] == pytest.approx(OFF["mass"], abs=0.04)


def test_a_drive_is_left_out_of_the_fit() -> None:
    fitted = other()
    nobody, first = np.zeros(4, dtype=bool), np.arange(4) == 0
    rows = fitted.of.rows
    all_in, without_first = (fitted.left_out(away)[rows] for away in (nobody, first))
    assert np.std(all_in) == pytest.approx(np.std(without_first), rel=0.1)
    assert not np.allclose(all_in, without_first)
    assert np.std(fitted.left_out(nobody, "mass")[rows]) > np.std(all_in)


class Wind:
    """A headwind, m/s."""

    def __init__(self, wind: float) -> None:
        self.wind = wind

    def reset(self, batch: int) -> None:
        """It has no state."""

    def force(self, view: View, dt: float) -> np.ndarray:
        """Newtons, positive forward."""
        air = view.speed + self.wind
        return -0.5 * 1.2 * TRUCK.parameters()["drag_area"] * (air * np.abs(air) - view.speed**2)


def test_a_wind_of_each_drive_has_a_size_of_each() -> None:
    winds = (6.0, -6.0, 4.0)
    fit = [
        replace(d, name="abc"[k])
        for k, wind in enumerate(winds)
        for d in drives(TRUCK.with_forces([Wind(wind)], []), 1, 180.0, seed=k)
    ]
    prepared = prepare_drives(TRUCK, fit, fit[:0], Rules())
    e = gather(TRUCK, prepared.prepared, prepared.held_out).to_fit()
    p = posterior(Regression(e), sweeps=1)
    names = tuple(s.name for s in e.drives)
    each = variant("each drive", EachDrive(names, 1.0 / len(names)), around_m_s=6.0)  # and exact at any
    part = Part(LIBRARY["headwind"], each, (0.0,) * len(names))
    given = np.ones(len(p.draws.states), dtype=bool)
    sizes = fitted_sizes(Exact(TRUCK, prepared.prepared, p, given, (), (part,)).fit(), "headwind")
    by_drive = {x.drive: x for x in sizes.values()}
    assert by_drive.keys() == {s.name for s in e.drives if not s.held_out}
    for s in (s for s in e.drives if not s.held_out):
        size = by_drive[s.name]
        assert size.ci95 is not None and size.ci95[0] <= winds["abc".index(s.name)] <= size.ci95[1]
        assert size.ci95[1] - size.ci95[0] < 3.0
