from __future__ import annotations

import math

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import BRAKE_UNITS, CHANNELS, ENGINE_UNITS
from deeptruck_model.recordings.units import conversion, known_units, metres_per_degree


@pytest.mark.parametrize(
    ("channel", "unit", "value", "expected", "canonical"),
    [
        ("speed", "m/s", 3.0, 3.0, "m/s"),
        ("speed", "km/h", 36.0, 10.0, "m/s"),
        ("speed", "mph", 100.0, 44.704, "m/s"),
        ("acceleration", "m/s^2", -2.0, -2.0, "m/s^2"),
        ("acceleration", "m/s²", -2.0, -2.0, "m/s^2"),
        ("acceleration", "g", 1.0, 9.80665, "m/s^2"),
        ("engine_command", "N m", 900.0, 900.0, "N m"),
        ("engine_command", "Nm", 900.0, 900.0, "N m"),
        ("engine_command", "percent", 40.0, 40.0, "percent"),
        ("engine_command", "ratio", 0.4, 40.0, "percent"),
        ("engine_command", "g/s", 5.0, 5.0, "g/s"),
        ("engine_command", "cm3/s", 5.0, 5.0, "cm^3/s"),
        ("brake_command", "%", 40.0, 40.0, "percent"),
        ("brake_command", "m/s^2", 2.0, 2.0, "m/s^2"),
        ("brake_command", "kPa", 500.0, 5.0, "bar"),
        ("grade", "percent", 4.0, 0.04, "ratio"),
        ("grade", "deg", 45.0, 1.0, "ratio"),
        ("grade", "rad", math.pi / 4, 1.0, "ratio"),
        ("fuel_rate", "l/h", 36.0, 10.0, "cm^3/s"),
        ("fuel_rate", "cm^3/s", 10.0, 10.0, "cm^3/s"),
        ("engine_speed", "rpm", 60.0, 2 * math.pi, "rad/s"),
        ("elevation", "ft", 1000.0, 304.8, "m"),
        ("ambient_temperature", "K", 273.15, 0.0, "degC"),
        ("ambient_temperature", "degF", 212.0, 100.0, "degC"),
        ("latitude", "rad", math.pi, 180.0, "deg"),
    ],
)
def test_units_become_canonical(
    channel: str, unit: str, value: float, expected: float, canonical: str
) -> None:
    convert = conversion(channel, unit)
    assert convert(np.array([value]))[0] == pytest.approx(expected, abs=1e-9)
    assert convert.unit == canonical


@pytest.mark.parametrize("density", [0.85, 850.0])
def test_fuel_by_mass_needs_a_density_in_either_unit(density: float) -> None:
    assert conversion("fuel_rate", "g/s", density)(np.array([8.5]))[0] == pytest.approx(10.0)


@pytest.mark.parametrize("density", [0.0, 20.0, "heavy", True])
def test_an_impossible_density_is_refused(density: object) -> None:
    with pytest.raises(InputError, match="density"):
        conversion("fuel_rate", "g/s", density)  # type: ignore[arg-type]


def test_nan_stays_nan() -> None:
    for channel in CHANNELS:
        for unit in known_units(channel):
            assert np.isnan(conversion(channel, unit)(np.array([np.nan]))[0])


def test_every_channel_knows_its_own_unit() -> None:
    for channel, meaning in CHANNELS.items():
        own = {"engine_command": ENGINE_UNITS, "brake_command": BRAKE_UNITS}.get(channel, (meaning.unit,))
        for unit in own:
            assert conversion(channel, unit)(np.array([7.0]))[0] == 7.0


@pytest.mark.parametrize(
    ("channel", "unit"), [("speed", "rpm"), ("grade", "m"), ("gear", "m/s"), ("gap", "s")]
)
def test_a_unit_that_does_not_fit_is_named_with_those_that_do(channel: str, unit: str) -> None:
    with pytest.raises(InputError, match=rf"unit '{unit}' does not fit channel '{channel}'; use one of: \S"):
        conversion(channel, unit)


def test_an_unknown_channel_is_named() -> None:
    with pytest.raises(InputError, match="unknown channel 'velocity'"):
        conversion("velocity", "m/s")


@pytest.mark.parametrize(
    ("latitude", "east_m", "north_m"),
    # a degree of longitude and of latitude, as tables of WGS84 give it
    [(0.0, 111319.5, 110574.3), (45.0, 78846.8, 111131.8), (60.0, 55800.0, 111412.3)],
)
def test_a_degree_has_the_metres_of_the_ellipsoid(latitude: float, east_m: float, north_m: float) -> None:
    east, north = metres_per_degree(latitude)
    assert float(east) == pytest.approx(east_m, rel=2e-6) and float(north) == pytest.approx(north_m, rel=2e-6)
    assert metres_per_degree(np.full(3, latitude))[1].shape == (3,)
