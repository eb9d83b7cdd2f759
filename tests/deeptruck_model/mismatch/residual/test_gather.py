"""The residual of a simulator along recordings, its weights and sensitivities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.json_data import from_json, to_json
from deeptruck_model import trucks
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.mechanisms import variant
from deeptruck_model.mismatch.prepare.prepared import prepare
from deeptruck_model.mismatch.residual import components, gather
from deeptruck_model.mismatch.residual.components import Shares
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import REFIT_PARAMETERS, accepted
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import driving_cycles

KNOWN = ("speed", "acceleration", "engine_command", "brake_command", "grade")
TRUCK = trucks.load("trucksim")
MASS = TRUCK.parameters()["mass"]


class BlackBox:
    """A physics truck that shows nothing of itself."""

    def __init__(self, truck: trucks.PhysicsTruck) -> None:
        self.interface, self.dt = truck.interface, truck.dt
        self.reset, self.step, self.force = truck.reset, truck.step, truck.force

    def inside(self, state: object) -> dict[str, np.ndarray]:
        return {}

    def parameters(self) -> dict[str, float]:
        return {}


@pytest.fixture(scope="module")
def drives() -> list[Recording]:
    return [driving_cycles.drive(TRUCK, seconds=200.0, seed=k) for k in range(2)]


@pytest.fixture(scope="module")
def own(drives: list[Recording]) -> Evidence:
    return gather.gather(TRUCK, [prepare(r, False) for r in drives], [False, True])


def test_on_its_own_truck_nothing_is_left(own: Evidence) -> None:
    assert own.dt == pytest.approx(0.2) and len(own.drives) == 2 and own.held_out.sum() == 1000
    sure = own.valid & (own.doubt(0.02) < 1.5)
    assert sure.mean() > 0.4 and np.sqrt(np.mean(own.residual[sure] ** 2)) < 5e-3
    assert own.mass == pytest.approx(MASS)


def test_a_channel_under_a_name_of_its_own_is_shown_beside_the_residual(drives: list[Recording]) -> None:
    heights = {"roof_height": np.full(len(drives[0]), 3.5)}
    high = replace(drives[0], channels=drives[0].channels | heights)
    e = gather.gather(TRUCK, [prepare(high, False)], [False])
    assert np.nanmedian(e["extra: roof_height"]) == 3.5


def test_sensitivities_are_the_answers_of_other_trucks(drives: list[Recording], own: Evidence) -> None:
    heavy = TRUCK.with_parameters({"mass": 1.02 * MASS})
    other = gather.gather(heavy, [prepare(r, False) for r in drives], [False, True])
    sure = own.valid & (own.doubt(0.02) < 1.5) & (other.doubt(0.02) < 1.5)
    expected = -0.02 * own.sensitivity["mass"]
    assert np.corrcoef((other.residual - own.residual)[sure], expected[sure])[0, 1] > 0.99
    assert set(own.sensitivity) == set(REFIT_PARAMETERS)


class Drag(BlackBox):
    """One that has a drag area, of which a physics truck may have 20 m^2 at most."""

    def __init__(self, area: float) -> None:
        super().__init__(TRUCK.with_parameters({"drag_area": area}))
        self.area = area

    def parameters(self) -> dict[str, float]:
        return {"drag_area": self.area}

    def with_parameters(self, values: dict[str, float]) -> Drag:
        return Drag(values["drag_area"])


def test_a_parameter_at_its_bound_is_moved_to_the_other_side_alone(drives: list[Recording]) -> None:
    prepared = [prepare(r, False) for r in drives]
    less, most = (gather.gather(Drag(area), prepared, [False, True]) for area in (19.2, 20.0))
    slope = (most.simulated - less.simulated) / 0.04
    assert most.sensitivity["drag_area"] == pytest.approx(slope, abs=1e-12)


def test_rerun_is_the_change_by_late_commands(own: Evidence) -> None:
    change = own.rerun("delay_all", 0.5)
    assert change.shape == own.residual.shape and 0.01 < change[own.valid].std() < 1.0
    assert np.abs(own.rerun("delay_all", 0.0)).max() < 1e-9


def weighed(recording: Recording, mass_kg: float | None, vehicle: str | None = "truck") -> Recording:
    return replace(recording, interface=replace(recording.interface, mass_kg=mass_kg, vehicle=vehicle))


def test_what_no_channel_shows_is_usual_of_the_kind_of_vehicle(drives: list[Recording]) -> None:
    """No torque and no fuel: its mass is not identifiable."""
    unfuelled = replace(TRUCK.specification, interface=replace(TRUCK.interface, fuel=False))
    box = BlackBox(trucks.PhysicsTruck(unfuelled))
    for vehicle, mass in (("truck", 20000.0), ("car", 1500.0), (None, 20000.0)):
        silent = [replace(r, interface=box.interface) for r in drives]
        silent = [replace(r, channels={k: r.channels[k] for k in KNOWN}) for r in silent]
        e = gather.gather(box, [prepare(weighed(r, None, vehicle), False) for r in silent], [False, True])
        assert e.mass == mass and not e.mass_known and e.vehicle.mass_kg == mass


def test_a_black_box_is_split_into_what_it_is_made_of(drives: list[Recording], own: Evidence) -> None:
    prepared = [prepare(r, False) for r in drives]
    asked = gather.gather(BlackBox(TRUCK), prepared, [False, True])
    assert asked.dt == pytest.approx(1.0) and asked.mass == pytest.approx(MASS, rel=0.3)
    assert not asked.mass_known and own.mass_known
    stated = gather.gather(BlackBox(TRUCK), prepared, [False, True], mass_kg=23456.0)
    assert stated.mass_known and stated.mass == 23456.0
    loaded = [replace(p, recording=weighed(p.recording, 21000.0)) for p in prepared]
    recorded = gather.gather(BlackBox(TRUCK), loaded, [False, True])
    assert recorded.mass_known and recorded.mass == 21000.0
    assert gather.gather(BlackBox(TRUCK), loaded, [False, True], mass_kg=23456.0).mass == 23456.0

    def seconds(x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[s.rows].reshape(-1, 5).mean(axis=1) for s in own.drives])

    for name in ("engine", "brake"):
        assert np.corrcoef(asked[name][asked.valid], seconds(own[name])[asked.valid])[0, 1] > 0.9
    assert set(asked.sensitivity) == set(REFIT_PARAMETERS)


def test_a_truck_whose_brake_was_not_recorded(drives: list[Recording]) -> None:
    """As most loggers leave it: no brake command anywhere, neither in the drives nor in the simulator."""

    box = BlackBox(TRUCK)
    box.step = lambda state, u, w: TRUCK.step(state, np.pad(u, ((0, 0), (0, 1))), w)
    box.interface = replace(TRUCK.interface, brake_unit=None)
    channels = [{k: v for k, v in r.channels.items() if k != "brake_command"} for r in drives]
    unbraked = [
        replace(r, interface=box.interface, channels=c) for r, c in zip(drives, channels, strict=True)
    ]
    prepared = [prepare(r, False) for r in unbraked]
    e = gather.gather(box, prepared, [False, True])
    assert "brake_command" not in e.signals and np.isfinite(e.residual).all()
    steady = CorrectedTruck(
        box, [Term("dragging_brake", (variant("constant"),), (0.05,))], {}, Shares.of(e), True
    )
    p = prepared[0]
    _, y = steady.step(steady.reset(p.y[None, 0]), p.u[None, 0], p.w[None, 0])
    assert np.isfinite(y).all()


def test_less_than_a_block_is_refused(drives: list[Recording]) -> None:
    with pytest.raises(InputError, match="shorter than one block"):
        gather.gather(TRUCK, [prepare(drives[0].piece(0, 1), False)], [False])


def test_a_shift_that_comes_a_little_sooner_is_no_part_of_a_slope() -> None:
    recording = driving_cycles.drive(TRUCK, seconds=600.0, seed=4)
    channels = recording.channels | {"speed": np.round(recording.channels["speed"] * 921.6) / 921.6}
    prepared = prepare(replace(recording, channels=channels), False)
    driven = gather.gather(TRUCK.with_parameters({"mass": 0.7 * MASS}), [prepared], [False])
    slope = driven.sensitivity["rolling_resistance"][driven.valid]
    assert driven["gear"].min() < driven["gear"].max()
    assert np.abs(slope - np.median(slope)).max() < 0.5 * np.abs(np.median(slope))


def test_what_only_the_held_out_recordings_have_stands_for_nothing(drives: list[Recording]) -> None:
    """Another logger recorded these: the truck's own gear and engine speed are known everywhere."""
    lacking = ("gear", "engine_speed", "engine_torque")
    bare = replace(drives[0], channels={n: x for n, x in drives[0].channels.items() if n not in lacking})
    e = gather.gather(TRUCK, [prepare(r, False) for r in (bare, drives[1])], [False, True])
    assert np.isfinite(e["gear"]).all() and np.isfinite(e["ratio"]).all()
    assert "engine_torque" not in e.signals
    turned = gather.gather(TRUCK, [prepare(r, False) for r in (bare, drives[1])], [True, False])
    assert np.isfinite(turned["engine_torque"][~turned.held_out]).all()


def test_what_is_decided_sooner_shows_at_shifts_alone(own: Evidence) -> None:
    assert own.sooner is not None
    shifts = np.flatnonzero(np.diff(own["gear"]) != 0)
    near = np.abs(np.arange(len(own))[:, None] - shifts).min(axis=1) <= 12  # rows, 2.4 s
    square = own.sooner**2
    assert square.sum() > 0.0 and square[near & own.valid].sum() > 0.8 * square[own.valid].sum()


def test_a_simulator_that_may_be_learned_decides_at_no_moment(drives: list[Recording]) -> None:
    e = gather.gather(BlackBox(TRUCK), [prepare(r, False) for r in drives], [False, True])  # type: ignore[arg-type]
    assert e.sooner is None


def test_estimated_forces_are_as_large_as_the_simulator_s_own_parameters_show(own: Evidence) -> None:
    less = replace(own, signals=own.signals | {n: own[n] * 0.4 for n in ("drag", "brake", "engine")})
    shown = {n: own.sensitivity[n] for n in ("drag_area", "brake_gain", "torque_gain")}
    found = components.as_large_as_they_act(less, shown, {"drag_area": 6.0, "torque_gain": 1.0})
    assert found.keys() == {"drag", "engine"}  # it has no brake_gain of its own
    assert found["drag"][own.valid] == pytest.approx(own["drag"][own.valid], rel=0.02)
    assert found["engine"] == pytest.approx(own["engine"], rel=0.15)  # whose friction no gain changes


def test_what_a_truck_may_have_stays_as_it_is() -> None:
    asked = {"mass": 0.3, "drag_area": -0.2, "brake_gain": 0.25, "unheard_of": 7.0}
    assert accepted(TRUCK, asked, near=0.02) == asked


@pytest.mark.parametrize("near", [0.0, 0.02])
def test_a_truck_heavier_than_any_on_a_road_is_taken_nearer(near: float) -> None:
    change = accepted(TRUCK, {"mass": 282866.0 / MASS - 1.0}, near)["mass"]
    assert 0.5 < change < 249999.0 / MASS - 1.0
    TRUCK.with_parameters({"mass": MASS * (1.0 + change) * (1.0 + near)})


@pytest.fixture
def shares(nothing_missing: Evidence) -> Shares:
    """A truck whose engine gives 2 m/s^2 at full command at low speed and half of it at 20 m/s."""
    e = nothing_missing
    slow = e.lag(e["engine_command"], 0.4)
    signals = e.signals | {"engine": slow * (2.0 - 0.05 * e["speed"]), "ratio": np.full(len(e), 8.0)}
    return Shares.of(replace(e, signals=signals))


def test_forces_are_read_from_speed_and_command(shares: Shares) -> None:
    now = shares.now(np.array([16.0, 20.0]), np.array([[0.5, 0.0], [0.5, 0.4]]))
    assert now["engine"] == pytest.approx([0.6, 0.5], rel=0.05)
    assert now["brake"] == pytest.approx([0.0, 0.4], rel=0.2)
    assert now["drag"] == pytest.approx([1e-4 * 256, 1e-4 * 400])
    assert now["rolling"] == pytest.approx([0.06, 0.06])
    assert now["engine_speed"] == pytest.approx([128.0, 160.0], rel=0.01)


def test_a_truck_without_brake_command_has_no_brake_share(shares: Shares) -> None:
    assert shares.now(np.array([16.0]), np.array([[0.5]]))["brake"] == pytest.approx([0.0])


def test_maps_are_plain_data(shares: Shares) -> None:
    assert from_json(Shares, to_json(shares)) == shares
