"""Units that were taken for others are found by their factor, and by recorded engine speed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from deeptruck_core.errors import InputError
from deeptruck_core.signals import SPEED
from deeptruck_model import trucks
from deeptruck_model.mismatch.prepare.prepared import Prepared, prepare
from deeptruck_model.mismatch.prepare.sensors import check_speed_unit, corrected, speed_scale_faults
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.recordings.consistency.agreement import ACCELEROMETERS, SPEEDS, factor_of
from deeptruck_model.simulators import Run
from deeptruck_model.trucks import driving_cycles

Array = NDArray[np.float64]
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


def drive(scale: float, *, tyres: float = 1.0, positions: bool = False) -> Prepared:
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
        check_speed_unit(OneGear(), [drive(1 / 3.6)])  # type: ignore[arg-type]


@pytest.mark.parametrize("scale", [1.0, 1.04, 1 / 1.6093, 3.0, 9.80665])
def test_tyres_another_gear_and_what_is_no_unit_are_not(scale: float) -> None:
    check_speed_unit(OneGear(), [drive(scale)])  # type: ignore[arg-type]


@pytest.mark.parametrize("scale", [0.95, 1.05])
def test_a_scale_without_an_accelerometer_is_found_by_engine_speed(scale: float) -> None:
    (found,) = speed_scale_faults(OneGear(), [drive(scale)] * 2, Rules())  # type: ignore[arg-type]
    assert found.effect == "speed_scale" and found.value == pytest.approx(scale) and found.se < 1e-3
    assert found.between == ("speed", "engine_speed") and "accelerometer" not in found.equation
    sound = corrected(drive(scale).recording, [found])
    np.testing.assert_allclose(sound.channels["speed"], drive(1.0).recording.channels["speed"])


@pytest.mark.parametrize("scale", [1.0, 1.02, 3.6])
def test_what_tyres_may_be_and_another_unit_are_no_scale(scale: float) -> None:
    assert speed_scale_faults(OneGear(), [drive(scale)], Rules()) == []  # type: ignore[arg-type]


def test_an_engine_that_slips_or_shifts_otherwise_gives_no_scale() -> None:
    given = drive(1.05)
    slips = given.recording.channels["engine_speed"] * (1.0 + 0.1 * np.sin(np.arange(len(given.recording))))
    other = given.recording.channels | {"engine_speed": slips}
    slipping = replace(given, recording=replace(given.recording, channels=other))
    assert speed_scale_faults(OneGear(), [slipping], Rules()) == []  # type: ignore[arg-type]
    measured = replace(given, measured_acceleration=True)  # then the accelerometer decides
    assert speed_scale_faults(OneGear(), [measured], Rules()) == []  # type: ignore[arg-type]


def test_positions_tell_the_scale_whatever_tyres_are() -> None:
    truck: Any = OneGear()
    (found,) = speed_scale_faults(truck, [drive(1.05, tyres=1.05, positions=True)] * 2, Rules())
    assert found.value == pytest.approx(1.05, abs=0.005) and "positions" in found.says
    assert speed_scale_faults(truck, [drive(1.0, tyres=1.05, positions=True)] * 2, Rules()) == []
    (blind,) = speed_scale_faults(truck, [drive(1.0, tyres=1.05)] * 2, Rules())
    assert "tyres and axles" in blind.says  # nothing distinguishes the two there


def test_what_does_not_tell_is_not_asked() -> None:
    bare = drive(3.6)
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
