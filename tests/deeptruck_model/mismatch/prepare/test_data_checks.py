"""The data before the truck: what is set aside, and faults of sensors that are no physics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from deeptruck_core.signals import TruckInterface
from deeptruck_model.mismatch.prepare.drives import CUT, STUCK, clean
from deeptruck_model.mismatch.prepare.prepared import derivative
from deeptruck_model.mismatch.prepare.sensors import acceleration_is_measured, corrected, sensor_faults
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.recordings import Recording

DT, N = 0.1, 3000
INTERFACE = TruckInterface("test", fuel=False)


def drive(
    seed: int, *, bias: float = 0.0, scale: float = 1.0, late: int = 0, noise: float = 0.02
) -> Recording:
    """An honest drive whose sensors then have faults; `scale` is that of the speed."""
    rng = np.random.default_rng(seed)
    a = gaussian_filter1d(rng.normal(0.0, 1.0, N), 15.0) * 3.0
    a -= a.mean()
    speed = 20.0 + np.cumsum(a) * DT
    channels = {
        "speed": scale * speed + rng.normal(0.0, 0.003, N),
        "acceleration": np.roll(a, late) + bias + rng.normal(0.0, noise, N),
        "engine_command": np.full(N, 500.0),
        "brake_command": np.zeros(N),
        "grade": np.zeros(N),
    }
    return Recording(f"drive-{seed}", DT, channels, INTERFACE)


@pytest.mark.parametrize(
    ("moves", "slows", "rejects"), [(False, True, True), (True, True, False), (False, False, False)]
)
def test_braking_with_a_command_that_never_moves_was_not_recorded(
    moves: bool, slows: bool, rejects: bool
) -> None:
    r = drive(1)
    r.channels["speed"] = np.full(N, 20.0)
    r.channels["speed"][1000:1100] = np.linspace(20.0, 5.0 if slows else 19.0, 100)
    r.channels["speed"][1100:] = r.channels["speed"][1099]
    r.channels["brake_command"][2000:2100] = 30.0 if moves else 0.0
    (cleaned,), rejected = clean([r])
    lost = np.flatnonzero(np.isnan(cleaned.channels["brake_command"]))
    assert (STUCK in {item.rule for item in rejected}) == rejects == bool(len(lost))
    if rejects:
        assert lost[0] in range(990, 1001) and lost[-1] in range(1095, 1111)


def test_impossible_samples_go_by_rule_and_are_counted() -> None:
    r = drive(0)
    r.channels["speed"][100] = 70.0
    r.channels["speed"][200] += 5.0
    r.channels["brake_command"][300:310] = -1.0
    r.channels["grade"][400:420] = np.nan
    before = {name: x.copy() for name, x in r.channels.items()}
    (cleaned,), rejected = clean([r])
    count = {item.rule: item.samples for item in rejected}
    assert count["speed outside -1 .. 60 m/s"] == 1
    assert count["brake_command outside 0 .. 200 percent"] == 10
    assert count["grade missing or invalid"] == 20
    assert count["speed jumps by more than 12 m/s^2"] >= 2
    assert np.isnan(cleaned.channels["speed"][[100, 200]]).all()
    assert np.isnan(cleaned.channels["brake_command"][300:310]).all()
    for name, x in before.items():  # the caller's own arrays are untouched
        np.testing.assert_array_equal(x, r.channels[name])


def test_good_data_loses_nothing() -> None:
    (cleaned,), rejected = clean([drive(1)])
    assert rejected == [] and np.isfinite(cleaned.y).all()


@pytest.mark.parametrize("shift", [0, 1, -1])
def test_a_derived_acceleration_is_no_second_sensor(shift: int) -> None:
    r = drive(2)
    assert acceleration_is_measured([r])
    r.channels["acceleration"] = np.roll(derivative(r.channels["speed"], DT), shift)
    assert not acceleration_is_measured([r])
    r.channels["acceleration"] = np.full(N, np.nan)
    assert not acceleration_is_measured([r])


def test_honest_sensors_are_not_accused() -> None:
    for seed in range(0, 24, 3):
        assert sensor_faults([drive(seed + k) for k in range(3)], Rules()) == []


@pytest.mark.parametrize(
    ("fault", "effect", "size", "tolerance"),
    [
        ({"bias": 0.15}, "acceleration_bias", 0.15, 0.01),
        ({"bias": -0.1}, "acceleration_bias", -0.1, 0.01),
        ({"scale": 1.06}, "speed_scale", 1.06, 0.01),
        ({"late": 8}, "clock_offset", 0.8, 0.1),
    ],
)
def test_each_fault_is_called_by_its_name_and_size(
    fault: dict[str, float], effect: str, size: float, tolerance: float
) -> None:
    found = {f.effect: f for f in sensor_faults([drive(k, **fault) for k in range(3)], Rules())}
    assert found[effect].value == pytest.approx(size, abs=tolerance)
    assert abs(found[effect].value - size) < 5 * max(found[effect].se, tolerance / 5)
    assert effect == "clock_offset" or set(found) == {effect}


def test_an_accelerometer_that_feels_gravity_is_a_fault_and_not_a_late_one() -> None:
    """In hills whose slope changes faster than the offset could be seen by itself."""
    tilt = np.radians(2.0)

    def tilted(r: Recording) -> Recording:
        grade = 0.04 * np.sin(np.arange(N) * DT / 23.0)
        felt = r.channels["acceleration"] * np.cos(tilt) + 9.80665 * np.sin(np.arctan(grade) + tilt)
        return replace(r, channels={**r.channels, "grade": grade, "acceleration": felt})

    (fault,) = sensor_faults([tilted(drive(k)) for k in range(3)], Rules())
    assert fault.effect == "acceleration_bias" and fault.value == pytest.approx(0.342, abs=0.01)
    assert "has gravity in it, 9.8" in fault.says and "a tilt of 2.0 degrees" in fault.says


def test_the_sensor_that_is_not_at_fault_fits_the_commands_better() -> None:
    (fault,) = sensor_faults([drive(k, scale=1.06) for k in range(3)], Rules())
    other = fault.elsewhere()
    assert fault.channel == "speed" and fault.says.endswith(": acceleration fits the commands better")
    assert other is not None and other.channel == "acceleration"
    assert other.says.endswith(": speed fits the commands better")


@pytest.mark.parametrize(("fault", "channel"), [({"scale": 1.06}, "speed"), ({"late": 8}, "acceleration")])
def test_a_fault_that_was_found_is_mended(fault: dict[str, float], channel: str) -> None:
    bad, good = drive(5, **fault), drive(5)
    sound = corrected(bad, sensor_faults([bad], Rules()))
    inner = slice(50, -50)
    left = np.std((sound.channels[channel] - good.channels[channel])[inner])
    assert left < 0.4 * np.std((bad.channels[channel] - good.channels[channel])[inner])


def test_without_an_accelerometer_nothing_is_said() -> None:
    r = drive(6)
    r.channels["acceleration"] = np.full(N, np.nan)
    assert sensor_faults([r], Rules()) == []


def test_a_minute_without_speed_is_reported_though_it_cuts_the_drive_in_two() -> None:
    r = drive(0)
    before, after = r.piece(0, 900), r.piece(1500, len(r))
    _, rejected = clean([replace(before, name="a#0"), replace(after, name="a#1")])
    assert {item.rule: item.samples for item in rejected} == {CUT: 600}
    _, rejected = clean([before, r.piece(900, len(r))])  # nothing lies between
    assert not rejected
