"""The corrected truck: a simulator like any other; with terms it is the truck that has those forces."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, SPEED
from deeptruck_model import simulators, trucks
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.mechanisms import saved, variant
from deeptruck_model.mismatch.mechanisms.air_tyres_road import NOBODY_M
from deeptruck_model.mismatch.prepare.prepared import fed
from deeptruck_model.mismatch.residual.components import Shares

BASE = trucks.load("trucksim")
CONSTANT = [saved.to_json(variant("constant"))]
WIND = Term("headwind", (variant("one wind", wind_m_s=4.0),), (1.2,))
MORE = {"drag_area": 0.33, "mass": 0.2}
STEADY = Term("dragging_brake", (variant("constant"),), (0.05,))
SHARES = Shares([0.0, 30.0], [1e-3, 1e-3], [0.02, 0.02], [20.0, 8.0], 2e-4, 0.06, 2e4)


class Drag:
    """A force of -0.05 N per kg of the truck, from its own hook."""

    def reset(self, batch: int) -> None: ...

    def force(self, view: trucks.View, dt: float) -> np.ndarray:
        return np.where(view.speed > 0.05, -0.05 * view.mass, 0.0)


class BlackBox:
    """A physics truck that shows nothing of itself."""

    def __init__(self, truck: trucks.PhysicsTruck) -> None:
        self._truck = truck
        self.interface, self.dt, self.reset, self.step, self.force = (
            truck.interface, truck.dt, truck.reset, truck.step, truck.force,
        )  # fmt: skip

    def inside(self, state: object) -> dict[str, np.ndarray]:
        return {}

    def parameters(self) -> dict[str, float]:
        return {}


Measured = tuple[object, np.ndarray]  # a truck's state, and the response it was last given


class Tracker(BlackBox):
    """Half of the acceleration it answers with is the one it was last given: so do learned trucks."""

    def __init__(self, truck: trucks.PhysicsTruck) -> None:
        super().__init__(truck)
        self.reset, self.step, self.force = self._reset, self._step, self._force

    def _reset(self, y0: np.ndarray) -> Measured:
        return self._truck.reset(y0), y0

    def _step(
        self, state: tuple[object, np.ndarray], u: np.ndarray, w: np.ndarray
    ) -> tuple[object, np.ndarray]:
        inner, given = state
        inner, y = self._truck.step(inner, u, w)
        acceleration = 0.5 * (y[:, ACCELERATION] + given[:, ACCELERATION])
        y = y.copy()
        y[:, SPEED] = given[:, SPEED] + self.dt * acceleration
        y[:, ACCELERATION] = acceleration
        return (self._truck.force(inner, y), y), y

    def _force(self, state: Measured, y: np.ndarray) -> Measured:
        heard = np.where(np.isnan(y), state[1], y)
        return (self._truck.force(state[0], heard), heard)


def inputs(seconds: float = 60.0, batch: int = 2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    n = round(seconds / BASE.dt)
    u = np.zeros((batch, n, 2))
    u[:, :, 0] = 900.0 + 300.0 * np.sin(np.arange(n) / 60.0)
    u[1:, n // 2 :, 0], u[1:, n // 2 :, 1] = 0.0, 8.0
    return u, np.zeros((batch, n, 1)), np.tile([0.0, 15.0, 0.0], (batch, 1))


def test_it_is_a_simulator_and_equals_the_base_without_terms() -> None:
    truck = CorrectedTruck(BASE, [], {}, None, False)
    assert isinstance(truck, simulators.Simulator)
    u, w, y0 = inputs()
    np.testing.assert_array_equal(
        simulators.free_run(truck, u, w, y0).y, simulators.free_run(BASE, u, w, y0).y
    )
    state, y = truck.step(truck.reset(y0), u[:, 0], w[:, 0])
    _, expected = BASE.step(BASE.reset(y0), u[:, 0], w[:, 0])
    assert y == pytest.approx(expected) and truck.inside(state).keys() == BASE.inside(BASE.reset(y0)).keys()


def test_a_known_term_acts_as_the_force_on_the_truck() -> None:
    u, w, y0 = inputs()
    plain = simulators.free_run(BASE, u, w, y0).y[..., SPEED]
    true = simulators.free_run(BASE.with_forces([Drag()]), u, w, y0).y[..., SPEED]
    corrected = simulators.free_run(CorrectedTruck(BASE, [STEADY], {}, None, False), u, w, y0).y[..., SPEED]
    assert np.abs(true - plain).max() > 2.0
    assert np.abs(corrected - true).max() < 0.03 * np.abs(true - plain).max()


def test_brakes_that_hold_a_deceleration_make_up_for_a_term_too() -> None:
    base = trucks.load("volvo")
    u = np.zeros((1, 100, 2))
    u[:, 30:, 1] = 0.7
    y0, w = np.array([[0.0, 20.0, 0.0]]), np.zeros((1, 100, 1))
    true = simulators.free_run(base.with_forces([Drag()]), u, w, y0).y[..., SPEED]
    corrected = simulators.free_run(CorrectedTruck(base, [STEADY], {}, None, False), u, w, y0).y[..., SPEED]
    without = simulators.free_run(base, u, w, y0).y[..., SPEED]
    assert (without - true)[0, 29] == pytest.approx(0.05 * 2.9, rel=0.1)
    assert (without - true)[0, 99] < 0.22  # and not 0.5
    assert np.abs(corrected - true).max() < 0.03


def test_stepping_keeps_speed_the_integral_of_acceleration_and_old_states_usable() -> None:
    truck = CorrectedTruck(BASE, [STEADY, Term("brake_fade", FADE, (0.1,))], {"mass": 0.1}, None, False)
    u, w, y0 = inputs(20.0)
    y = simulators.free_run(truck, u, w, y0).y
    assert np.diff(y[..., SPEED]) == pytest.approx(truck.dt * y[:, 1:, 0])
    state = truck.reset(y0)
    for k in range(50):
        state, _ = truck.step(state, u[:, k], w[:, k])
    one, two = (truck.step(state, u[:, 50], w[:, 50])[1] for _ in range(2))
    np.testing.assert_array_equal(one, two)


FADE = (variant("above a temperature", cooling_s=120.0, at=0.0),)


def test_where_nothing_is_measured_its_own_response_goes_on() -> None:
    plain = trucks.load("trucksim")
    truck = CorrectedTruck(
        plain,
        (Term("engine_friction", (variant("warm", reference=5.0, order=0),), (0.1,)),),
        {},
        None,
        validated=True,
    )
    u, w = np.array([[600.0, 0.0]]), np.zeros((1, 1))
    state, y = truck.step(truck.reset(np.array([[0.0, 15.0, 5.0]])), u, w)
    without_measurement = truck.force(state, np.full_like(y, np.nan))
    np.testing.assert_allclose(truck.step(without_measurement, u, w)[1], truck.step(state, u, w)[1])


def test_a_command_path_moves_the_command() -> None:
    late = CorrectedTruck(
        BASE, [Term("brake_lag", (variant("lag", side="delay", tau_s=0.5),), (1.0,))], {}, None, False
    )
    u, w, y0 = inputs(10.0, 1)
    u[:, :, 0], u[:, 40:, 1] = 0.0, 30.0
    shifted = u.copy()
    shifted[:, 40:45, 1] = 0.0
    expected = simulators.free_run(BASE, shifted, w, y0).y
    np.testing.assert_allclose(simulators.free_run(late, u, w, y0).y, expected, atol=1e-9)


def test_parameters_that_the_base_has_are_set_in_it() -> None:
    u, w, y0 = inputs()
    mass = BASE.parameters()["mass"]
    truck = CorrectedTruck(BASE, [], {"mass": 0.2}, None, False)
    assert truck.parameters()["mass"] == pytest.approx(1.2 * mass)
    heavy = BASE.with_parameters({"mass": 1.2 * mass})
    np.testing.assert_allclose(simulators.free_run(truck, u, w, y0).y, simulators.free_run(heavy, u, w, y0).y)
    back = truck.with_parameters({"mass": mass})
    np.testing.assert_allclose(simulators.free_run(back, u, w, y0).y, simulators.free_run(BASE, u, w, y0).y)
    with pytest.raises(InputError, match="wheels"):
        truck.with_parameters({"wheels": 18.0})


def test_parameters_a_black_box_has_not_act_as_forces() -> None:
    u, w, y0 = inputs(3.0)
    y0[:, SPEED] = 26.0  # top gear: no shift that comes earlier
    box = BlackBox(BASE)
    more = CorrectedTruck(box, [], {"torque_gain": 0.2}, SHARES, False)
    gained = (
        simulators.free_run(more, u, w, y0).y[0, -1, SPEED]
        - simulators.free_run(box, u, w, y0).y[0, -1, SPEED]
    )
    assert gained == pytest.approx(0.2 * 1e-3 * u[0, :-1, 0].mean() * 3.0, rel=0.1)


def test_a_learned_truck_is_not_given_the_acceleration_that_was_corrected() -> None:
    """Its forces were fitted along recordings of which it heard the speed alone; given the acceleration too,
    it would pass the correction on and have it twice."""
    u, w, y0 = inputs(20.0, 1)
    y0[:, SPEED] = 25.0
    box = Tracker(BASE)
    y = simulators.free_run(CorrectedTruck(box, [STEADY], {}, SHARES, False), u, w, y0).y
    alone = simulators.forced_run(box, u, w, fed(box, y)).y
    np.testing.assert_allclose((y - alone)[0, 1:, ACCELERATION], -0.05, atol=1e-9)


def test_channels_beside_the_protocol_come_from_along() -> None:
    u, w, y0 = inputs(20.0)
    truck = CorrectedTruck(
        BASE,
        [Term("drafting", (variant("exponential", length_m=20.0, usual_m=NOBODY_M),), (0.4,))],
        {},
        None,
        False,
    )
    alone = simulators.free_run(truck, u, w, y0).y
    np.testing.assert_allclose(alone, simulators.free_run(BASE, u, w, y0).y, atol=1e-9)
    gap = np.full(u.shape[:2], 8.0)
    near = simulators.free_run(truck.along({"gap": gap}), u, w, y0).y
    assert (near[:, -1, SPEED] > alone[:, -1, SPEED] + 0.01).all()


def test_a_force_against_motion_does_not_push_a_standing_truck_back() -> None:
    truck = CorrectedTruck(BASE, [STEADY], {}, None, False)
    n = 100
    u = np.tile([0.0, 40.0], (1, n, 1))
    y = simulators.free_run(truck, u, np.zeros((1, n, 1)), np.array([[0.0, 2.0, 0.0]])).y
    assert y[0, -20:, SPEED] == pytest.approx(0.0) and y[..., SPEED].min() >= 0.0


def test_a_term_by_the_gear_goes_with_the_gear_that_is_simulated() -> None:
    """A slipping clutch has no gear ratio, and the gear of a drive at another speed is not this truck's."""
    friction = Term("engine_friction", (variant("warm", reference=1.0, order=0),), (0.02,))
    truck = CorrectedTruck(BASE, [friction], {}, None, False, [20.0])
    u, w, y0 = inputs(20.0)
    y0[:, SPEED] = 0.3
    recorded = {"engine_speed": np.full((1, len(u[0])), 200.0), "ratio": np.full((1, len(u[0])), 150.0)}
    along, alone = truck.along(recorded), truck
    np.testing.assert_array_equal(
        simulators.free_run(along, u, w, y0).y, simulators.free_run(alone, u, w, y0).y
    )
    state, y = BASE.step(BASE.reset(y0), u[:, 0], w[:, 0])
    slipping = truck.step(truck.reset(y0), u[:, 0], w[:, 0])[1][0, ACCELERATION]
    inside = {name: x[0] for name, x in BASE.inside(state).items()}
    overall_ratio = inside["ratio"] / BASE.parameters()["wheel_radius"]
    assert inside["engine_speed"] / y[0, SPEED] > 1.3 * overall_ratio  # the clutch slips
    gain = inside["mass"] / inside["effective_mass"]
    assert slipping - y[0, ACCELERATION] == pytest.approx(-0.02 * overall_ratio * gain)


@pytest.mark.parametrize("shares", [None, SHARES])
def test_saved_and_loaded_it_is_the_same(tmp_path: Path, shares: Shares | None) -> None:
    terms = [
        STEADY,
        Term("brake_fade", FADE, (0.1,)),
        Term("command_delay", (variant("delay", which="all", tau_s=0.2),), (1.0,)),
    ]
    truck = CorrectedTruck(BASE, terms, {"mass": 0.1}, shares, True, [7.0, 28.0])
    truck.save(tmp_path / "sim")
    loaded = simulators.load(tmp_path / "sim")
    assert isinstance(loaded, CorrectedTruck) and loaded.validated and loaded.terms == truck.terms
    assert loaded.gears == (7.0, 28.0)
    u, w, y0 = inputs(20.0)
    np.testing.assert_array_equal(
        simulators.free_run(loaded, u, w, y0).y, simulators.free_run(truck, u, w, y0).y
    )


def test_a_damaged_directory_is_one_clear_line(tmp_path: Path) -> None:
    CorrectedTruck(BASE, [STEADY], {}, None, False).save(tmp_path / "sim")
    path = tmp_path / "sim" / simulators.MANIFEST
    manifest = json.loads(path.read_text())
    for change, says in (
        ({"terms": [{"effect": "magic", "variants": [{}], "coefficients": []}]}, "does not know: magic"),
        ({"terms": [{"effect": "dragging_brake", "variants": [{}], "coefficients": [1.0]}]}, "is damaged"),
        ({"terms": [{"effect": "headwind", "variants": CONSTANT, "coefficients": [1.0]}]}, "is damaged"),
        ({"shares": {"speed": []}}, "is damaged"),
        ({"validated": None, "terms": None}, "is damaged"),
    ):
        path.write_text(json.dumps(manifest | change))
        with pytest.raises(InputError, match=says):
            simulators.load(tmp_path / "sim")


@pytest.mark.parametrize("version", [1, 2, 4, 6])
def test_a_truck_corrected_by_another_version_is_refused(tmp_path: Path, version: int) -> None:
    """Its coefficients were fitted to other forces, or its terms are kept in another form."""
    CorrectedTruck(BASE, [STEADY], {}, None, True).save(tmp_path / "old")
    file = tmp_path / "old" / simulators.MANIFEST
    file.write_text(json.dumps(json.loads(file.read_text()) | {"schema": version}))
    with pytest.raises(InputError, match="run the mismatch tool again"):
        simulators.load(tmp_path / "old")


def test_a_correction_is_the_same_once_it_was_written(tmp_path: Path) -> None:
    CorrectedTruck(BASE, [WIND], MORE, None, True).save(tmp_path / "sim")
    read = simulators.load(tmp_path / "sim")
    assert isinstance(read, CorrectedTruck) and read.moved == MORE and read.terms == (WIND,)
