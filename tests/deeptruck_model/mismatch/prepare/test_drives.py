"""Which of two sensors is wrong is decided by the commands, even where the simulator is wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_drives import TRUCK, LazyBrake, braked, drives, evidence

from deeptruck_core.errors import InputError
from deeptruck_model import trucks
from deeptruck_model.mismatch.prepare.drives import (
    LEFT_OUT,
    NotRecorded,
    PreparedDrives,
    Rejection,
    Span,
    each_once,
    prepare_drives,
    same_signals,
)
from deeptruck_model.mismatch.prepare.sensors import sensor_faults
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.gather import gather
from deeptruck_model.mismatch.residual.left_out import OTHER_GEAR, left_to_compare
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import PhysicsTruck, driving_cycles

HEAVIER = TRUCK.with_parameters({"mass": 1.2 * TRUCK.parameters()["mass"]})
LAZY = TRUCK.with_forces([], [LazyBrake()])


def shifted(r: Recording, channel: str, late_s: float) -> Recording:
    n = np.arange(len(r), dtype=float)
    late = np.interp(n - late_s / r.dt, n, r.channels[channel])
    return replace(r, channels=r.channels | {channel: late})


@pytest.mark.parametrize("truck", [HEAVIER, LAZY])
@pytest.mark.parametrize("channel", ["speed", "acceleration"])
def test_the_late_sensor_is_found_though_the_simulator_is_wrong(truck: PhysicsTruck, channel: str) -> None:
    recorded = [shifted(r, channel, 0.6) for r in drives(truck, 2)]
    found = prepare_drives(TRUCK, recorded, [], Rules())
    (lag,) = (f for f in found.faults if f.is_lag)
    assert lag.channel == channel
    sign = 1.0 if channel == "acceleration" else -1.0
    assert sign * lag.value == pytest.approx(0.6, abs=0.1)


@pytest.mark.parametrize("truck", [HEAVIER, LAZY])
@pytest.mark.parametrize("channel", ["speed", "acceleration"])
def test_the_scaled_sensor_is_found_though_the_simulator_is_wrong(truck: PhysicsTruck, channel: str) -> None:
    recorded = [
        replace(r, channels=r.channels | {channel: 1.05 * r.channels[channel]}) for r in drives(truck, 2)
    ]
    found = prepare_drives(TRUCK, recorded, [], Rules())
    (scale,) = (f for f in found.faults if f.is_scale)
    assert scale.channel == channel
    assert scale.value == pytest.approx(1.05 if channel == "speed" else 1 / 1.05, abs=0.01)
    assert not sensor_faults([p.recording for p in found.prepared], Rules())


def test_a_sensor_on_time_has_no_lag() -> None:
    assert not prepare_drives(TRUCK, drives(LAZY, 2), [], Rules()).faults


def test_rows_left_out_do_not_count_and_are_counted() -> None:
    """Of the drive that is named alone, seconds from the start of its bag; all of it is still driven."""
    recorded = drives(LAZY, 2)
    all_of, part = (
        prepare_drives(TRUCK, recorded, [], Rules(), without=spans).prepared
        for spans in ((), [Span(recorded[0].name, 60.0, 90.0)])
    )
    marked = (recorded[0].time >= 60.0) & (recorded[0].time <= 90.0)
    at = next(k for k, p in enumerate(part) if p.recording.name == recorded[0].name)
    assert not part[at].valid[marked].any()
    assert np.array_equal(part[at].valid[~marked], all_of[at].valid[~marked])
    assert np.array_equal(part[1 - at].valid, all_of[1 - at].valid)
    assert len(part[at].u) == len(all_of[at].u)
    found = prepare_drives(TRUCK, recorded, [], Rules(), without=[Span(recorded[0].name, 60.0, 90.0)])
    (rule,) = (r for r in found.rejected if r.rule == LEFT_OUT)
    assert rule.samples == int(all_of[at].valid[marked].sum())


def test_of_many_drives_some_are_set_aside_whole() -> None:
    held_out = prepare_drives(TRUCK, drives(TRUCK, 5, 60.0), [], Rules()).held_out
    assert len(held_out) == 5 and sum(held_out) == 2


def test_a_truck_that_follows_the_recorded_gear_is_compared_in_it() -> None:
    """Its own shift speeds are wrong; the recorded gears, stamped where a change begins, are taken."""
    p, recorded = TRUCK.parameters(), []
    for r in drives(TRUCK, 2):
        gear = r.channels["gear"]
        begins = np.append(
            gear[round(p["shift_time"] / r.dt) :], np.full(round(p["shift_time"] / r.dt), gear[-1])
        )
        recorded.append(replace(r, channels=r.channels | {"gear": begins}))
    chooses = TRUCK.with_parameters({n: 1.25 * p[n] for n in ("upshift_low", "upshift_high")})
    off = {}
    for truck in (chooses, chooses.with_recorded_gear()):
        found = prepare_drives(truck, recorded, [], Rules())
        e = gather(truck, found.prepared, found.held_out, seed=0, rules=Rules())
        off[truck.interface.gear] = float(np.sqrt(np.nanmean(e.residual**2)))
    assert off[True] < 0.4 * off[False], off


def as_simulated_or_wrong(name: str) -> tuple[PhysicsTruck, list[PhysicsTruck]]:
    """A simulator, and trucks that are as it or have another mass, torque, brake lag or delay."""
    own = trucks.load(name)
    p = own.parameters()
    wrong = [{"mass": 1.2 * p["mass"]}, {"mass": 0.9 * p["mass"]}, {"torque_gain": 0.85 * p["torque_gain"]}]
    others = [own.with_parameters(one) for one in wrong]
    return own, [own, *others, own.with_forces([], [LazyBrake()]), own.with_forces([], [LateCommands()])]


class LateCommands:
    """Commands arrive 0.4 s late."""

    def reset(self, batch: int) -> None:
        self.queue: list[np.ndarray] = []

    def filter(self, u: np.ndarray, time: float, dt: float) -> np.ndarray:
        n = round(0.4 / dt)
        self.queue = [u, *(self.queue or [u] * n)][: n + 1]
        return self.queue[-1]


LAGS = [(c, s) for c in ("speed", "acceleration") for s in (0.45, 0.8, -0.5)]
SCALES = [(c, s) for c in ("speed", "acceleration") for s in (0.95, 1.05)]


@pytest.mark.long
def test_how_often_the_wrong_sensor_is_found() -> None:
    """The figures of docs/mismatch_method.md."""
    right: dict[str, list[bool]] = {"lag": [], "scale": []}
    another = 0  # fault that is not there, reported beside the one that is
    for name in ("trucksim", "volvo", "freightliner"):
        simulator, driven = as_simulated_or_wrong(name)
        for truck in driven:
            recorded = drives(truck, 2, 300.0)
            wrong = [("lag", c, [shifted(r, c, s) for r in recorded]) for c, s in LAGS]
            wrong += [
                ("scale", c, [replace(r, channels=r.channels | {c: s * r.channels[c]}) for r in recorded])
                for c, s in SCALES
            ]
            for kind, channel, bad in wrong:
                faults = prepare_drives(simulator, bad, [], Rules()).faults
                own = [f.channel for f in faults if (f.is_lag if kind == "lag" else f.is_scale)]
                right[kind].append(own == [channel])
                another += len(faults) > 1
    print({kind: (sum(each), len(each)) for kind, each in right.items()}, another)
    assert np.mean(right["lag"]) > 0.9 and np.mean(right["scale"]) > 0.9
    assert another == 0


def left_of(e: Evidence) -> tuple[PreparedDrives, Evidence]:
    """What is left to compare along one drive whose brake was not recorded."""
    brake = NotRecorded("brake", "hides", "signal")
    whole = prepare_drives(TRUCK, drives(TRUCK, 1), [], Rules())
    return left_to_compare(replace(whole, missing=(brake,)), e)


def test_hidden_braking_is_left_out_before_what_is_left_is_judged() -> None:
    """115 s count, 72 s of them with unrecorded braking."""
    e, on = braked(evidence())
    enough, _ = left_of(e)
    assert enough.unusable_because is None
    assert enough.missing[0].share_of_time == pytest.approx(on.mean(), abs=0.02)
    near = np.convolve(on, np.ones(19), "same") > 0
    short = replace(e, valid=near)
    assert near.sum() * e.dt > Limits.least_driving_s > (near & ~on).sum() * e.dt
    found, left = left_of(short)
    assert found.unusable_because is not None
    assert not (left.valid & on).mean() > 0.01


def test_too_little_driving_is_not_judged() -> None:
    e = replace(evidence(), valid=np.arange(len(evidence())) < 250)
    plain, _ = left_of(e)
    assert "50 s" in str(plain.unusable_because)
    other, _ = left_of(replace(e, other_gear=3000))
    assert "gear" in str(other.unusable_because) and other.rejected[-1] == Rejection(OTHER_GEAR, 3000)


def test_pedals_that_are_swapped_are_doubted_and_what_the_simulator_is_not_driven_with_is_not() -> None:
    sound = drives(TRUCK, 2)
    pedals = [
        {"engine_command": r.channels["brake_command"], "brake_command": r.channels["engine_command"]}
        for r in sound
    ]
    swapped = [replace(r, channels=r.channels | own) for r, own in zip(sound, pedals, strict=True)]
    assert len(prepare_drives(TRUCK, swapped, [], Rules()).doubts) == 1
    assert prepare_drives(TRUCK, sound, [], Rules()).doubts == ()


TRUCK = trucks.load("trucksim")


@pytest.fixture(scope="module")
def pieces() -> list[Recording]:
    return [driving_cycles.drive(TRUCK, seconds=60.0, seed=k, name=f"d{k}") for k in range(3)]


def names(recordings: list[Recording]) -> list[str]:
    return [r.name for r in recordings]


def test_a_drive_that_is_fitted_and_held_out_is_held_out(pieces: list[Recording]) -> None:
    copy = replace(pieces[1], name="copy")
    fit, held, said = each_once([pieces[0], pieces[0], copy], [pieces[1]])
    assert (names(fit), names(held)) == (["d0"], ["d1"])
    assert len(said) == 2
    fit, held, said = each_once(pieces[:2], pieces[2:])
    assert (names(fit), names(held), said) == (["d0", "d1"], ["d2"], [])


def test_cruises_at_one_speed_are_distinguished_by_their_commands(pieces: list[Recording]) -> None:
    other = pieces[0].channels["engine_command"] + 1.0
    uphill = replace(pieces[0], name="uphill", channels=pieces[0].channels | {"engine_command": other})
    fit, _, said = each_once([pieces[0], uphill], [])
    assert (names(fit), said) == (["d0", "uphill"], [])


def test_drives_cannot_be_their_own_judges(pieces: list[Recording]) -> None:
    fit, held, said = each_once(pieces[:2], pieces[:2])
    assert names(fit) == ["d0", "d1"] and held == [] and said


def test_a_command_that_was_never_valid_is_lacking(pieces: list[Recording]) -> None:
    r = pieces[0]
    empty = replace(r, channels=r.channels | {"engine_command": np.full(len(r), np.nan)})
    with pytest.raises(InputError, match="'d0' has no valid engine_command"):
        same_signals(TRUCK, [empty])
    rest = {name: x for name, x in r.channels.items() if name != "acceleration"}
    with pytest.raises(InputError, match="'d0' has no valid acceleration"):
        same_signals(TRUCK, [replace(r, channels=rest)])


@pytest.mark.parametrize(
    ("dt", "cure"),
    [
        (1.0, "read it with rate_hz=10 if .* else record at 10 Hz, or .* of 1 Hz: 'deeptruck-model train'"),
        (0.01, "read it with rate_hz=10"),
    ],
)
def test_another_rate_names_a_cure_that_there_is(pieces: list[Recording], dt: float, cure: str) -> None:
    with pytest.raises(InputError, match=f"the simulator at 10 Hz; {cure}"):
        same_signals(TRUCK, [replace(pieces[0], dt=dt)])
