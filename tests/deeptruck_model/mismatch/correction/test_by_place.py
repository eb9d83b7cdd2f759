"""A stretch of soft ground that nobody told, and that every drive passes, is corrected where it is."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from deeptruck_model import driving_cycles, trucks
from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.mismatch.output import write
from deeptruck_model.mismatch.report.explorer.curves import curve
from deeptruck_model.mismatch.result import Mismatch
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks.driver import EPISODE, LOGGED, drive_along

Array = NDArray[np.float64]

TRUCK = trucks.load("trucksim")
SPACING_M, LONG_M = 10.0, 8000.0
SOFT = (900.0, 1200.0)  # m along the road
FORCE = 0.3  # m/s^2
DEGREE_M = np.radians(1.0) * 6371e3


def drive(k: int) -> Recording:
    """A drive that begins 50 m further along the road than the last, of which a receiver tells positions."""
    begins, rng = 50.0 * k, np.random.default_rng(k)
    targets = 6.0 + driving_cycles.speed_profile(200.0, seed=rng, dt=TRUCK.dt) / 3.0
    place = begins + SPACING_M * np.arange(int((LONG_M - begins) / SPACING_M))
    told = 0.01 * np.sin(place / 400.0)
    felt = told + FORCE / GRAVITY * ((place > SOFT[0]) & (place < SOFT[1]))
    idle = np.zeros(len(targets))
    log = drive_along(TRUCK, targets, idle, np.array([], EPISODE), felt, SPACING_M)
    channels = {c: np.ascontiguousarray(log[:, i]) for i, c in enumerate(LOGGED)}
    along = begins + np.cumsum(channels["speed"]) * TRUCK.dt
    channels["grade"] = np.interp(along, place, told)
    channels["speed"] = channels["speed"] + rng.normal(0.0, 0.02, len(along))
    channels["latitude"] = 48.0 + (along + rng.normal(0.0, 2.0, len(along))) / DEGREE_M
    channels["longitude"] = np.full(len(along), 11.0)
    del channels["elevation"]
    return Recording(f"drive-{k}", TRUCK.dt, channels, TRUCK.interface, notes=())


@pytest.fixture(scope="module")
def found() -> Mismatch:
    drives = [drive(k) for k in range(8)]
    return find_mismatch(TRUCK, drives[:6], drives[6:])


@pytest.mark.long
def test_a_road_is_named(found: Mismatch) -> None:
    (only,) = found.findings
    assert only.effect == "road_surface" and set(only.cannot_be_told_from) <= {"road_grade"}


@pytest.mark.long
def test_it_is_corrected_where_it_is(found: Mismatch) -> None:
    fit = found.result.fit
    assert fit is not None and fit.errors is not None and fit.validated
    assert fit.errors.after.speed < 0.4 * fit.errors.before.speed
    assert fit.errors.after.speed < 0.5 * fit.errors.parameters_only.speed
    assert not fit.by_mean
    assert fit.handed_over is not None and fit.handed_over.without == ("place",)


@pytest.mark.long
def test_held_out_drives_that_tell_no_place_validate_nothing() -> None:
    drives = [drive(k) for k in range(8)]
    unplaced = [
        replace(d, channels={c: x for c, x in d.channels.items() if c not in ("latitude", "longitude")})
        for d in drives[6:]
    ]
    mismatch = find_mismatch(TRUCK, drives[:6], unplaced)
    (only,), fit = mismatch.findings, mismatch.result.fit
    assert only.effect in ("road_surface", "road_grade")
    assert fit is not None and fit.changes_nothing and not fit.validated


@pytest.mark.long
def test_where_it_is_stands_in_a_file_with_positions(found: Mismatch, tmp_path: Path) -> None:
    write(found, tmp_path / "found")
    with (tmp_path / "found" / "road.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    along = np.array([(float(r["latitude"]) - 48.0) * DEGREE_M for r in rows])
    told = np.array([float(r["value"]) for r in rows])
    soft = (along > SOFT[0] + 20.0) & (along < SOFT[1] - 20.0)
    away = (along < SOFT[0] - 20.0) | (along > SOFT[1] + 20.0)
    assert soft.sum() > 20 and (told[away] == 0.0).all()
    per_mass = found.evidence.mass if found.evidence is not None else 0.0
    wanted = FORCE / GRAVITY if rows[0]["name"] == "road_grade" else -FORCE * per_mass
    assert told[soft] == pytest.approx(wanted, rel=0.1)


@pytest.mark.long
def test_it_is_drawn_along_the_road(found: Mismatch) -> None:
    e, x = found.evidence, found.explanation
    assert e is not None and x is not None
    first = found.findings[0]
    assert first.cause is not None
    per_mass = 1.0 / e["effective_mass_gain"]
    drawn = curve(e, x, first, e.residual - first.cause.force, per_mass)
    assert drawn is not None and drawn.by == "place on the road, m" and drawn.share > 0.9
    assert drawn.force[(drawn.x > SOFT[0] + 30.0) & (drawn.x < SOFT[1] - 30.0)] == pytest.approx(
        -FORCE, rel=0.1
    )
