"""What is not compared: another gear, and braking that was not recorded."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from small_drives import BRAKE_COMMAND, TRUCK, braked, drives, evidence

from deeptruck_core.signals import TruckInterface
from deeptruck_model.mismatch.prepare.drives import NotRecorded, inputs
from deeptruck_model.mismatch.residual.left_out import (
    braking,
    gears_apart,
    with_predicted_gears,
)
from deeptruck_model.mismatch.verdict.findings import names_behind
from deeptruck_model.recordings import Recording

N, DT = 400, 0.1
SPEED = np.full(N, 15.0)


def drive(**channels: np.ndarray[Any, Any]) -> Any:
    """As much of a prepared recording as is looked at."""
    whole = Recording("drive", DT, {"speed": SPEED, **channels}, TruckInterface("truck", "N m"))
    return SimpleNamespace(recording=whole, y=np.stack([np.zeros(N), SPEED], axis=1), dt=DT)


def run(gear: np.ndarray[Any, Any], engine_speed: np.ndarray[Any, Any]) -> Any:
    return SimpleNamespace(inside={"gear": gear[None], "engine_speed": engine_speed[None]})


GEAR = np.where(np.arange(N) < 250, 7.0, 8.0)
ENGINE_SPEED = np.where(np.arange(N) < 250, 150.0, 115.0)
LATER = np.where(np.arange(N) < 300, 7.0, 8.0)
FASTER = np.where(np.arange(N) < 300, 150.0, 115.0)


@pytest.mark.parametrize("recorded", [{"gear": GEAR + 1.0}, {"engine_speed": ENGINE_SPEED}])
def test_where_the_simulator_shifts_later(recorded: dict[str, np.ndarray[Any, Any]]) -> None:
    """Gears numbered from another one on are the same gears."""
    (marked,), _ = gears_apart([drive(**recorded)], [run(LATER, FASTER)])
    assert marked[250:300].all() and not marked[:244].any() and not marked[306:].any()


def test_a_simulator_that_shifts_a_little_later_is_left_out_until_it_has_shifted() -> None:
    """Engine speeds differ in every shift, and say nothing for as short a time."""
    soon = np.where(np.arange(N) < 254, 7.0, 8.0)
    (marked,), _ = gears_apart([drive(gear=GEAR)], [run(soon, ENGINE_SPEED)])
    assert marked[250:259].all() and not marked[:250].any() and not marked[259:].any()
    (marked,), _ = gears_apart([drive(gear=GEAR)], [run(soon, ENGINE_SPEED)], numbered_alike=True)
    assert not marked.any()
    sooner = np.where(np.arange(N) < 252, 7.0, 8.0)  # within what the nuisance terms of shifts allow
    (marked,), _ = gears_apart([drive(gear=GEAR)], [run(sooner, ENGINE_SPEED)])
    assert not marked.any()


@pytest.mark.parametrize("recorded", [{"gear": GEAR}, {"engine_speed": ENGINE_SPEED}, {}])
def test_nothing_is_marked_where_gears_agree_or_none_is_recorded(
    recorded: dict[str, np.ndarray[Any, Any]],
) -> None:
    (marked,), _ = gears_apart([drive(**recorded)], [run(GEAR, ENGINE_SPEED)])
    assert not marked.any()


@pytest.mark.parametrize("recorded", [{"gear": GEAR + 1.0}, {"engine_speed": ENGINE_SPEED}])
def test_a_shift_at_another_moment_is_marked_until_the_pull_is_back(
    recorded: dict[str, np.ndarray[Any, Any]],
) -> None:
    soon = np.where(np.arange(N) < 252, 7.0, 8.0)
    faster = np.where(np.arange(N) < 252, 150.0, 115.0)
    _, (marked,) = gears_apart([drive(**recorded)], [run(soon, faster)])
    assert marked[245:272].all() and not marked[:245].any() and not marked[272:].any()
    _, (marked,) = gears_apart([drive(**recorded)], [run(GEAR, ENGINE_SPEED)])
    assert not marked.any()


def test_any_simulated_shift_may_be_at_another_moment_where_none_was_recorded() -> None:
    _, (marked,) = gears_apart([drive()], [run(GEAR, ENGINE_SPEED)])
    assert marked[250:270].all() and not marked[:245].any() and not marked[271:].any()
    _, (marked,) = gears_apart([drive()], [SimpleNamespace(inside={})])
    assert not marked.any()


def test_a_truck_with_other_ratios_is_not_rejected_as_a_whole() -> None:
    (marked,), _ = gears_apart([drive(engine_speed=2.0 * ENGINE_SPEED)], [run(GEAR, ENGINE_SPEED)])
    assert not marked.any()


def test_gears_numbered_alike_are_compared_as_they_are() -> None:
    """A truck that learned the recorded numbers may hold another gear than the recorded one throughout."""
    (marked,), _ = gears_apart([drive(gear=GEAR + 1.0)], [run(GEAR, ENGINE_SPEED)], numbered_alike=True)
    assert not marked.any()  # all of the time: then nothing decides
    seldom = np.where(np.arange(N) < 300, GEAR, GEAR + 1.0)
    (marked,), _ = gears_apart([drive(gear=seldom)], [run(GEAR, ENGINE_SPEED)], numbered_alike=True)
    assert marked[300:].all() and not marked[:294].any()


IDLE = np.full(N, 63.0)
NEUTRAL = np.where(np.arange(N) < 100, 0.0, GEAR)  # for the first 10 s


@pytest.mark.parametrize("engine", [{}, {"engine_speed": np.where(NEUTRAL == 0.0, IDLE, ENGINE_SPEED)}])
def test_rolling_in_neutral_is_marked_beside_a_simulator_in_gear(
    engine: dict[str, np.ndarray[Any, Any]],
) -> None:
    """Also where the truck rolls in neutral all of the time, as in a coast-down."""
    (marked,), _ = gears_apart([drive(gear=NEUTRAL, **engine)], [run(GEAR, ENGINE_SPEED)])
    assert marked[:100].all() and not marked[106:].any()
    coasting = {"engine_speed": IDLE} if engine else {}
    (marked,), _ = gears_apart([drive(gear=0.0 * GEAR, **coasting)], [run(GEAR, ENGINE_SPEED)])
    assert marked.all()


def test_gears_numbered_from_zero_are_no_neutral() -> None:
    numbered = drive(gear=GEAR - 7.0, engine_speed=ENGINE_SPEED)
    (marked,), _ = gears_apart([numbered], [run(GEAR, ENGINE_SPEED)])
    assert not marked.any()


class Predictor:
    """Gives the last command of each row as its gear; `rows` is how many it was asked about."""

    def __init__(self) -> None:
        self.rows = 0

    def parameters(self) -> dict[str, float]:
        return {}

    def auxiliary_outputs(self, u: Any, w: Any, y: Any) -> dict[str, Any]:
        self.rows = len(u)
        return {"gear": np.repeat(u[:, -1:, 0], u.shape[1], axis=1)}


def test_recordings_of_any_length_are_asked_about_at_once() -> None:
    parts = []
    for length, gear in ((N, 5.0), (N // 2, 6.0)):
        p = drive()
        p.u, p.w, p.y = np.full((length, 2), gear), np.zeros((length, 1)), np.zeros((length, 3))
        p.recording = [None] * length
        parts.append(p)
    truck: Any = Predictor()
    runs = with_predicted_gears(truck, parts)
    assert truck.rows == 2
    assert [r.inside["gear"].shape for r in runs] == [(1, N), (1, N // 2)]
    assert [float(r.inside["gear"][0, 0]) for r in runs] == [5.0, 6.0]


def test_a_simulator_without_auxiliary_outputs_predicts_no_gear() -> None:
    p = drive()
    p.u, p.w, p.y = np.zeros((N, 2)), np.zeros((N, 1)), np.zeros((N, 3))
    truck: Any = SimpleNamespace(parameters=dict)
    assert with_predicted_gears(truck, [p])[0].inside == {}


def test_a_logger_with_another_engine_speed_leaves_something_to_fit() -> None:
    """Of two recordings the one to be fitted has rpm for rad/s; the one held out is of another logger."""
    parts = [drive(engine_speed=ENGINE_SPEED / 9.55), drive(engine_speed=ENGINE_SPEED)]
    runs = [run(GEAR, ENGINE_SPEED)] * 2
    marked, _ = gears_apart(parts, runs, held_out=[False, True])
    assert not np.concatenate(marked).any()
    marked, _ = gears_apart(parts, runs, held_out=[True, False])
    assert marked[0].all() and not marked[1].any()


BRAKE = NotRecorded("brake", "hides", "signal")


def test_unrecorded_braking_is_found_where_it_acts() -> None:
    e, on = braked(evidence())
    left, (brake,) = braking(e, [BRAKE])
    assert left.hidden is not None and not (left.valid & left.hidden).any()
    assert left.hidden[on].mean() > 0.8
    assert left.hidden[~on].mean() < 0.02
    assert brake.gain > e.rules.parameter_gain
    assert brake.share_of_time == pytest.approx(left.hidden.mean())


def test_a_truck_whose_pedal_is_never_released_does_not_brake() -> None:
    e, _ = braked(evidence())
    e = replace(e, signals=e.signals | {"engine_command": e["engine_command"] + 0.5})
    assert braking(e)[0].valid.all()


def test_noise_alone_is_no_braking() -> None:
    e = evidence()
    e = replace(e, signals={k: v for k, v in e.signals.items() if k != BRAKE_COMMAND})
    assert braking(e)[0].valid.all()


def test_where_the_brake_was_recorded_none_is_hidden() -> None:
    e, _ = braked(evidence())
    e = replace(e, signals=e.signals | {BRAKE_COMMAND: np.zeros(len(e))})
    assert braking(e, [BRAKE]) == (e, (BRAKE,))


def test_a_name_of_the_brakes_is_said_with_the_brake_that_was_not_recorded() -> None:
    recorded = drives(TRUCK, 1, 30.0)
    assert names_behind(recorded, [BRAKE])["dragging_brake"] == "brake"
    assert not names_behind(recorded, [])


def test_a_brake_command_that_never_moves_while_the_truck_brakes_was_not_recorded() -> None:
    other, recorded = drives(TRUCK, 2)
    stuck = replace(other, name="stuck", channels=other.channels | {BRAKE_COMMAND: np.zeros(len(other))})
    assert "brake" not in [m.input for m in inputs([recorded, other])]
    missing = inputs([recorded, stuck])
    assert "brake" in [m.input for m in missing]
    assert "engine_brake" in names_behind([recorded, stuck], missing)


def test_a_recorded_engine_speed_gives_the_gear() -> None:
    missing = [NotRecorded("gear", "hides", "signal")]
    (drive,) = drives(TRUCK, 1, 30.0)
    bare = replace(drive, channels={n: x for n, x in drive.channels.items() if n != "engine_speed"})
    assert "driveline_loss" in names_behind([bare], missing)
    assert not names_behind([drive], missing)
