"""Faults between sensors, in speed and clock, and the unit of speed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import SPEED, TruckInterface
from deeptruck_model import trucks
from deeptruck_model.mismatch.prepare.drives import CUT, STUCK, clean
from deeptruck_model.mismatch.prepare.prepared import (
    Prepared,
    derivative,
    noise_of,
    observed_acceleration,
    prepare,
)
from deeptruck_model.mismatch.prepare.sensors import (
    acceleration_is_measured,
    check_speed_unit,
    compare,
    corrected,
    sensor_faults,
    speed_scale_faults,
)
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.consistency.agreement import ACCELEROMETERS, SPEEDS, factor_of
from deeptruck_model.simulators import Run
from deeptruck_model.trucks import driving_cycles

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
    assert "a tilt of 2.0 degrees" in fault.says


def test_the_sensor_that_is_not_at_fault_fits_the_commands_better() -> None:
    (fault,) = sensor_faults([drive(k, scale=1.06) for k in range(3)], Rules())
    other = fault.elsewhere()
    assert fault.channel == "speed"
    assert other is not None and other.channel == "acceleration"


@pytest.mark.parametrize(("fault", "channel"), [({"scale": 1.06}, "speed"), ({"late": 8}, "acceleration")])
def test_a_fault_that_was_found_is_mended(fault: dict[str, float], channel: str) -> None:
    bad, good = drive(5, **fault), drive(5)
    sound = corrected(bad, sensor_faults([bad], Rules()))
    inner = slice(50, -50)
    left = np.std((sound.channels[channel] - good.channels[channel])[inner])
    assert left < 0.4 * np.std((bad.channels[channel] - good.channels[channel])[inner])


def test_a_minute_without_speed_is_reported_though_it_cuts_the_drive_in_two() -> None:
    r = drive(0)
    before, after = r.piece(0, 900), r.piece(1500, len(r))
    _, rejected = clean([replace(before, name="a#0"), replace(after, name="a#1")])
    assert {item.rule: item.samples for item in rejected} == {CUT: 600}
    _, rejected = clean([before, r.piece(900, len(r))])  # nothing lies between
    assert not rejected


STEP_S, SAMPLES = 0.1, 6000


def raw(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Speed, and acceleration as its mean over each step."""
    rng = np.random.default_rng(seed)
    a = gaussian_filter1d(rng.normal(0.0, 1.0, SAMPLES), 15.0) * 3.0
    return 20.0 + np.cumsum(a - a.mean()) * STEP_S, a - a.mean()


def test_noise_is_measured_beneath_a_moving_signal() -> None:
    speed, _ = raw()
    noisy = speed + np.random.default_rng(1).normal(0.0, 0.02, SAMPLES)
    assert noise_of(noisy) == pytest.approx(0.02, rel=0.1)
    assert noise_of(speed) < 0.002
    assert noise_of(np.ones(4)) == 0.0


def test_derivative_is_the_mean_over_the_step_before() -> None:
    speed, a = raw()
    assert derivative(speed, STEP_S)[1:] == pytest.approx(a[1:])
    assert len(derivative(np.zeros(0), STEP_S)) == 0


def test_both_sensors_together_are_better_than_speed_alone_and_ignore_an_offset() -> None:
    speed, a = raw()
    rng = np.random.default_rng(2)
    noisy, sensor = speed + rng.normal(0.0, 0.02, SAMPLES), a + 0.3 + rng.normal(0.0, 0.02, SAMPLES)
    sensor[1000:1040] = np.nan
    both = observed_acceleration(noisy, sensor, STEP_S)
    alone = observed_acceleration(noisy, None, STEP_S)
    inner = np.r_[100:900, 1200:5900]
    assert np.std((both - a)[inner]) < 0.3 * np.std((alone - a)[inner])
    assert abs((both - a)[inner].mean()) < 0.01
    assert np.isfinite(both).all()


def test_the_ends_are_as_good_as_what_is_between() -> None:
    """The last difference of a noisy speed was held for seconds, and called a burst of something unknown."""
    speed, a = raw()
    rng = np.random.default_rng(2)
    sensor = a + rng.normal(0.0, 0.02, SAMPLES)
    ends = np.r_[1:40, SAMPLES - 40 : SAMPLES]
    errors = [
        observed_acceleration(speed + rng.normal(0.0, 0.03, SAMPLES), sensor, STEP_S) - a for _ in range(30)
    ]
    assert np.sqrt(np.mean(np.square(errors)[:, ends])) < 1.5 * np.sqrt(np.mean(np.square(errors)[:, 40:-40]))


def test_a_true_acceleration_passes_unchanged() -> None:
    speed, a = raw()
    assert observed_acceleration(speed, a, STEP_S)[99:-99] == pytest.approx(a[99:-99], abs=1e-6)


@pytest.mark.parametrize(
    ("slope", "offset", "lag"), [(1.0, 0.0, 0), (1.0, 0.2, 0), (0.9, 0.0, 0), (1.0, 0.0, 6)]
)
def test_faults_are_measured(slope: float, offset: float, lag: int) -> None:
    speed, a = raw()
    sensor = slope * np.roll(a, lag) + offset + np.random.default_rng(3).normal(0.0, 0.02, SAMPLES)
    seen = compare(speed, sensor, STEP_S)
    assert seen.slope == pytest.approx(slope, abs=0.03)  # what a lag may pass for
    assert seen.offset == pytest.approx(offset, abs=max(4 * seen.offset_se, 0.005))
    assert seen.lag_s == pytest.approx(lag * STEP_S, abs=max(4 * seen.lag_se, 0.08))


def test_without_an_accelerometer_or_without_motion_nothing_is_claimed() -> None:
    speed, a = raw()
    assert np.isnan(compare(speed, None, STEP_S).slope)
    assert np.isnan(compare(np.full(SAMPLES, 20.0), a, STEP_S).slope)


@pytest.mark.parametrize("lag_s", [0.8, -0.8, 1.5])
def test_a_long_lag_leaves_the_scale_as_it_is(lag_s: float) -> None:
    speed, a = raw()
    late = np.interp(np.arange(SAMPLES) - lag_s / STEP_S, np.arange(SAMPLES), a)
    found = compare(speed, late, STEP_S)
    assert found.lag_s == pytest.approx(lag_s, abs=0.03)
    assert found.slope == pytest.approx(1.0, abs=0.02)


def test_an_accelerometer_that_has_nothing_to_do_with_the_speed_is_compared_all_the_same() -> None:
    for seed in range(60):
        rng = np.random.default_rng(seed)
        speed = 15.0 + np.cumsum(rng.normal(0.0, 0.05, 1200))
        steps, swing = np.repeat(rng.normal(0.0, 0.5, 12), 100), np.sin(np.arange(1200) * STEP_S / 5.0)
        for a in (rng.normal(0.0, 0.3, 1200), steps, swing):
            assert np.isfinite(compare(speed, a, STEP_S).lag_s)


TRUCK = trucks.load("trucksim")
RATIO = 24.0  # rad/m, of a truck with one gear


class OneGear:
    """A truck whose engine turns with its wheels, in one gear."""

    interface, dt = TRUCK.interface, TRUCK.dt

    def __init__(self, *, reports: bool = True) -> None:
        self.reports = reports

    def parameters(self) -> dict[str, float]:
        return {}

    def rollout(self, u: Array, w: Array, y0: Array, recorded: Array) -> Run:
        return Run(recorded, {"engine_speed": RATIO * recorded[:, :, SPEED]} if self.reports else {})


def scaled(scale: float, *, tyres: float = 1.0, positions: bool = False) -> Prepared:
    """Along which speed was recorded so many times too large, and engine speed and positions were not. Its
    tyres are so many times as large as the simulator's."""
    recording = driving_cycles.drive(TRUCK, seconds=400.0, seed=1)
    speed = recording.channels["speed"]
    channels = recording.channels | {"engine_speed": RATIO * speed / tyres, "speed": scale * speed}
    if positions:
        noise = np.random.default_rng(0).normal(0.0, 2.0, len(speed))
        north = np.cumsum(speed) * recording.dt + noise
        channels |= {"latitude": 48.0 + np.degrees(north / 6371e3), "longitude": np.full(len(speed), 11.0)}
    return prepare(replace(recording, name="b0", channels=channels), False)


def test_a_speed_in_another_unit_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"speed of 'b0' is 0\.278 times .* m/s read as km/h"):
        check_speed_unit(OneGear(), [scaled(1 / 3.6)])  # type: ignore[arg-type]


@pytest.mark.parametrize("scale", [1.0, 1.04, 1 / 1.6093, 3.0, 9.80665])
def test_tyres_another_gear_and_what_is_no_unit_are_not(scale: float) -> None:
    check_speed_unit(OneGear(), [scaled(scale)])  # type: ignore[arg-type]


@pytest.mark.parametrize("scale", [0.95, 1.05])
def test_a_scale_without_an_accelerometer_is_found_by_engine_speed(scale: float) -> None:
    (found,) = speed_scale_faults(OneGear(), [scaled(scale)] * 2, Rules())  # type: ignore[arg-type]
    assert found.effect == "speed_scale" and found.value == pytest.approx(scale) and found.se < 1e-3
    assert found.between == ("speed", "engine_speed")
    sound = corrected(scaled(scale).recording, [found])
    np.testing.assert_allclose(sound.channels["speed"], scaled(1.0).recording.channels["speed"])


@pytest.mark.parametrize("scale", [1.0, 1.02, 3.6])
def test_what_tyres_may_be_and_another_unit_are_no_scale(scale: float) -> None:
    assert speed_scale_faults(OneGear(), [scaled(scale)], Rules()) == []  # type: ignore[arg-type]


def test_an_engine_that_slips_or_shifts_otherwise_gives_no_scale() -> None:
    given = scaled(1.05)
    slips = given.recording.channels["engine_speed"] * (1.0 + 0.1 * np.sin(np.arange(len(given.recording))))
    other = given.recording.channels | {"engine_speed": slips}
    slipping = replace(given, recording=replace(given.recording, channels=other))
    assert speed_scale_faults(OneGear(), [slipping], Rules()) == []  # type: ignore[arg-type]
    measured = replace(given, measured_acceleration=True)  # then the accelerometer decides
    assert speed_scale_faults(OneGear(), [measured], Rules()) == []  # type: ignore[arg-type]


def test_positions_tell_the_scale_whatever_tyres_are() -> None:
    truck: Any = OneGear()
    (found,) = speed_scale_faults(truck, [scaled(1.05, tyres=1.05, positions=True)] * 2, Rules())
    assert found.value == pytest.approx(1.05, abs=0.005)
    assert speed_scale_faults(truck, [scaled(1.0, tyres=1.05, positions=True)] * 2, Rules()) == []
    assert speed_scale_faults(truck, [scaled(1.0, tyres=1.05)] * 2, Rules())  # nothing tells the two apart


def test_what_does_not_tell_is_not_asked() -> None:
    bare = scaled(3.6)
    channels = {n: x for n, x in bare.recording.channels.items() if n != "engine_speed"}
    unmeasured = replace(bare, recording=replace(bare.recording, channels=channels))
    check_speed_unit(OneGear(), [unmeasured])  # type: ignore[arg-type]
    check_speed_unit(OneGear(reports=False), [bare])  # type: ignore[arg-type]
    assert speed_scale_faults(OneGear(), [unmeasured], Rules()) == []  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("scale", "cause"), [(3.598, "km/h read as m/s"), (9.79, "accelerometer in g"), (1.04, ""), (3.4, "")]
)
def test_a_factor_is_named_by_its_cause(scale: float, cause: str) -> None:
    said = factor_of(scale, SPEEDS | ACCELEROMETERS)
    assert cause in said and bool(said) == bool(cause)
