"""What the simulated acceleration is made of, and the overall gear ratio the engine has."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from deeptruck_core.arrays import Array
from deeptruck_core.constants import GRAVITY
from deeptruck_core.signals import ACCELERATION, SPEED, TruckInterface
from deeptruck_model.mismatch.prepare.prepared import prepare
from deeptruck_model.mismatch.residual import components
from deeptruck_model.mismatch.residual.evidence import Grid, overall_ratio
from deeptruck_model.mismatch.residual.expression import Stream
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Run, Simulator, forced_run


def test_traction_is_taken_from_torque_command_and_fuel_in_this_order() -> None:
    speed, one = np.full(3, 10.0), np.ones(3)
    known = {"engine_torque": 3 * one, "engine_speed": 100 * one, "engine_command": 2 * one, "fuel_rate": one}
    (measured, driveline), (commanded, unknown), (burnt, efficiency) = components.tractions(known, speed)
    assert measured == pytest.approx(30.0) and driveline == components.DRIVELINE
    assert commanded == pytest.approx(20.0) and unknown == 0.0
    assert burnt == pytest.approx(0.1) and efficiency > 1e4
    assert not list(components.tractions({}, speed))


def test_a_simulator_reports_the_overall_ratio_of_a_slipping_clutch() -> None:
    ratio, gears = np.array([12.0, 60.0, 30.0]), (12.0, 24.0)
    assert overall_ratio(ratio, gears).tolist() == [12.0, 24.0, 24.0]
    assert overall_ratio(ratio, gears, np.array([11.9, 48.0, 24.1])).tolist() == [12.0, 48.0, 24.1]


class BlackBox:
    """Answers at once, and reports nothing of what acts inside it."""

    def rollout(self, u: Array, w: Array, y0: Array, recorded: Array) -> Run:
        y = recorded.copy()
        speed, grade = recorded[..., SPEED], w[..., 0]
        drive = 0.001 * u[..., 0] - 0.02 * u[..., 1]
        y[..., ACCELERATION] = drive - 5e-4 * speed**2 - 0.09 - GRAVITY * grade
        return Run(y, {})

    def parameters(self) -> dict[str, float]:
        return {}


def ratios(speed: Array, engine_speed: Array) -> dict[str, Array]:
    """The signals of a black box along a drive with this engine speed."""
    channels = {"speed": speed, "acceleration": 0.0 * speed, "engine_speed": engine_speed}
    channels |= {"engine_command": 500.0 + 0.0 * speed, "brake_command": 0.0 * speed, "grade": 0.0 * speed}
    prepared = [prepare(Recording("drive", 0.1, channels, TruckInterface("box", fuel=False)), False)]
    box = cast(Simulator, BlackBox())
    runs = [forced_run(box, p.u[None], p.w[None], p.y[None]) for p in prepared]
    return components.signals(box, prepared, runs, Grid(prepared, [False], 1))[0]


def test_a_slipping_clutch_is_no_gear() -> None:
    """First gear turns 28 times a metre; at a launch the engine idles over a truck that hardly moves."""
    speed = np.concatenate([[0.0, 0.2, 0.5], np.linspace(1.8, 20.0, 400)])
    turns = np.where(speed < 6.0, 28.0, 7.0)
    out = ratios(speed, np.maximum(turns * speed, 50.0))
    assert out["ratio"][:3] == pytest.approx([100.0, 100.0, 100.0])
    assert out["overall_ratio"][:3] == pytest.approx([28.0, 28.0, 28.0], rel=0.01)
    assert (out["overall_ratio"] <= out["ratio"]).all()
    assert out["overall_ratio"][speed > 8.0] == pytest.approx(7.0)


def test_the_noise_of_two_sensors_moves_no_gear() -> None:
    rng = np.random.default_rng(3)
    speed = np.linspace(4.0, 20.0, 2000)
    out = ratios(speed * rng.normal(1.0, 0.01, 2000), np.where(speed < 9.0, 12.0, 6.0) * speed)
    assert np.unique(out["overall_ratio"]) == pytest.approx([6.0, 12.0], rel=0.01)
    assert out["engine_speed"] == pytest.approx(out["overall_ratio"] * out["speed"])


def test_a_black_box_without_engine_speed_and_fuel_is_split_by_its_answers_to_silence() -> None:
    t = 0.1 * np.arange(900)
    channels = {
        "speed": 12.0 + 4.0 * np.sin(t / 10.0),
        "acceleration": 0.4 * np.cos(t / 10.0),
        "engine_command": 500.0 + 400.0 * np.sin(t / 3.0),
        "brake_command": np.where(np.sin(t / 7.0) > 0.8, 20.0, 0.0),
        "grade": 0.01 * np.sin(t / 15.0),
    }
    prepared = [prepare(Recording("drive", 0.1, channels, TruckInterface("box", fuel=False)), False)]
    box = cast(Simulator, BlackBox())
    runs = [forced_run(box, p.u[None], p.w[None], p.y[None]) for p in prepared]
    out, _, mass_is_known = components.signals(box, prepared, runs, Grid(prepared, [False], 1))
    assert not mass_is_known
    np.testing.assert_allclose(out["engine"], 0.001 * channels["engine_command"])
    np.testing.assert_allclose(out["brake"], 0.02 * channels["brake_command"])
    np.testing.assert_allclose(out["drag"], 5e-4 * out["speed"] ** 2)
    np.testing.assert_allclose(out["rolling"], 0.09)

    forces = zip(components.FORCES, (3000.0, -500.0, 200.0, 100.0, 1000.0), strict=True)
    reports = {name: np.full((1, len(t)), x) for name, x in forces}
    direct_drive = [Run(run.y, reports) for run in runs]  # of a truck without gears and engine speed
    out, mass, mass_is_known = components.signals(box, prepared, direct_drive, Grid(prepared, [False], 1))
    assert mass_is_known and mass == 1000.0 and not out.keys() & {"gear", "engine_speed", "ratio"}
    assert (out["engine"][0], out["brake"][0]) == (3.0, 0.5)


@pytest.mark.parametrize(("unit", "of_the_brake"), [("percent", 2.0), ("m/s^2", 0.0)])
def test_more_mass_weakens_brakes_that_are_a_force_but_not_a_deceleration(
    unit: str, of_the_brake: float
) -> None:
    stream = Stream([components.force_of("mass", unit)])
    now = {"engine": np.ones(1), "brake": np.full(1, 2.0), "drag": np.full(1, 0.5)}
    (more,), _ = stream.step(stream.begin(1), now, 0.1)
    assert more == pytest.approx(of_the_brake + 0.5 - 1.0)
