"""The paper's generator, equation by equation, and what driving it records."""

from __future__ import annotations

from math import ceil, exp

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import CHANNELS
from deeptruck_model import trucks
from deeptruck_model.trucks.driving_cycles import (
    RoadSettings,
    SpeedSettings,
    drive,
    drive_episodes,
    road_grade,
    speed_profile,
)

PRINTED = SpeedSettings(soft_limit_speed=35.0)


def paper(seconds: float, seed: int, s: SpeedSettings, limit: float, dt: float = 0.1) -> np.ndarray:
    """The section's equations in the paper's order, in plain Python."""
    rng = np.random.default_rng(seed)
    n = round(seconds / dt)
    noise, holds = rng.standard_normal(n), rng.normal(s.mu_T, s.sigma_T, int(seconds) + 2)
    v_ref = (s.v_min + s.v_max) / 2
    v = v_at_t = s.v_min + noise[0] % (s.v_max - s.v_min)
    t_i, i, a = 0.0, 0, []
    for k in range(n):
        if k * dt >= t_i - 1e-9:
            v_at_t = v
            mu = 1 - v_at_t / v_ref
            t_i += ceil(max(holds[i] * (1 - abs(mu)), dt))
            i += 1
        mu, sigma = 1 - v_at_t / v_ref, v_at_t / v_ref * (1 - v_at_t / s.v_max)
        a.append(s.mu_a_scaling * mu + s.sigma_a_scaling * sigma * noise[k])
        v = max(min(v + a[-1] * dt, s.v_max), s.v_min)
    window = round(s.window / dt)
    smooth = [np.mean(a[max(k - window + 1, 0) : k + 1]) for k in range(n)]
    v_f = [s.v_min]
    for k in range(1, n):
        m = max(v_f[-1] + smooth[k] * dt, s.v_min)
        v_f.append(m / (1 + exp(0.5 * (m - limit))))
    return np.array(v_f)


@pytest.mark.parametrize(("settings", "limit"), [(SpeedSettings(), 50.0), (PRINTED, 35.0)])
def test_profile_is_the_paper_s(settings: SpeedSettings, limit: float) -> None:
    made = speed_profile(900.0, seed=5, settings=settings)
    np.testing.assert_allclose(made, paper(900.0, 5, settings, limit), atol=1e-9)


def test_road_stays_within_its_limit_spans_it_and_is_smooth() -> None:
    grade = road_grade(300_000.0, seed=3)
    assert np.abs(grade).max() <= 0.03
    share, _ = np.histogram(grade, np.linspace(-0.03, 0.03, 7))
    assert (share / len(grade) > 0.08).all()
    assert np.abs(np.diff(grade)).max() < 0.002
    np.testing.assert_array_equal(road_grade(1000.0, seed=3, settings=RoadSettings(limit=0.0)), 0.0)


@pytest.mark.parametrize("name", trucks.pool())
def test_recording_is_what_the_truck_did(name: str) -> None:
    """The recorded commands and grade, given to the truck again, give the recorded responses."""
    truck = trucks.load(name).with_grade_input()
    recording = drive(truck, seconds=1200.0, seed=2)
    assert len(recording) == 12000
    y = truck.rollout(recording.u[None], recording.w[None], recording.y[None, 0]).y[0]
    np.testing.assert_allclose(y[1:], recording.y[1:], atol=1e-9)
    speed, acceleration = recording.channels["speed"], recording.channels["acceleration"]
    np.testing.assert_allclose(speed[1:], speed[:-1] + 0.1 * acceleration[1:], atol=1e-9)
    climbed = np.diff(recording.channels["elevation"])
    angle = np.arctan(recording.channels["grade"][:-1])
    way = 0.5 * (speed[1:] + speed[:-1]) * 0.1
    np.testing.assert_allclose(climbed, way * np.sin(angle), atol=0.01)


def test_the_road_of_a_long_drive_stays_on_earth() -> None:
    """A random walk of the slope would lead below the sea; a reader then takes the unit to be wrong."""
    elevation = drive(trucks.load("trucksim"), hours=4.0, seed=1).channels["elevation"]
    assert elevation.min() == 0.0
    assert elevation.max() < CHANNELS["elevation"].high


@pytest.mark.parametrize("name", trucks.pool())
def test_cycle_spans_speed_grade_coasting_and_braking_to_rest(name: str) -> None:
    recording = drive(trucks.load(name).with_grade_input(), hours=4.0, seed=11)
    c = recording.channels
    share, _ = np.histogram(c["speed"], [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 45.0])
    assert (share[:-1] > 0.005 * len(recording)).all(), share
    coasting = (c["engine_command"] == 0.0) & (c["brake_command"] == 0.0)
    for low in range(0, 30, 5):
        assert (coasting & (c["speed"] >= low) & (c["speed"] < low + 5)).mean() > 0.002
    stops = (c["speed"][1:] == 0.0) & (c["speed"][:-1] > 0.0)
    assert stops.sum() > 30
    hard = 1.5 if name == "volvo" else 30.0
    assert (c["brake_command"] > hard).mean() > 0.005
    assert c["grade"].min() < -0.025 < 0.025 < c["grade"].max()
    for channel, values in c.items():
        assert np.isfinite(values).all(), channel


def test_episodes_begin_at_random_speeds_and_coast_or_brake_to_rest() -> None:
    """The paper's direct initialisation; the truck, given the commands from there, does the same again."""
    truck = trucks.load("trucksim")
    made = drive_episodes(truck, 40, seed=3)
    starts = np.array([one.channels["speed"][0] for one in made])
    assert np.histogram(starts, [0.0, 12.0, 24.0, 35.0])[0].min() >= 5
    assert len({one.channels["grade"][0] for one in made}) == 40
    for one in made[::2]:
        assert not one.u.any()
        assert 7.9 < len(one) * one.dt < 40.1 or one.channels["speed"][-1] == 0.0
    for one in made[1::2]:
        assert one.channels["brake_command"][1:].all() and not one.channels["engine_command"].any()
        assert one.channels["speed"][-1] == 0.0 and one.channels["speed"][:-1].all()
    y = truck.rollout(made[1].u[None], made[1].w[None], made[1].y[None, 0]).y[0]
    np.testing.assert_allclose(y[1:], made[1].y[1:], atol=1e-9)
    np.testing.assert_array_equal(drive_episodes(truck, 2, seed=3)[1].y, made[1].y)


def test_impossible_requests_are_refused() -> None:
    with pytest.raises(InputError, match="cannot drive -1 episodes"):
        drive_episodes(trucks.load("volvo"), -1, seed=1)
    with pytest.raises(InputError, match="cannot drive"):
        drive(trucks.load("volvo"), seed=1)
    with pytest.raises(InputError, match="span nothing"):
        speed_profile(60.0, seed=1, settings=SpeedSettings(v_min=10.0, v_max=10.0))


def test_a_truck_without_a_grade_sensor_records_neither_grade_nor_elevation() -> None:
    blind = drive(trucks.load("freightliner"), seconds=300.0, seed=4)
    seeing = drive(trucks.load("freightliner").with_grade_input(), seconds=300.0, seed=4)
    assert "grade" not in blind.channels
    assert "elevation" not in blind.channels
    np.testing.assert_array_equal(blind.y, seeing.y)
