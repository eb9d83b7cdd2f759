"""What was not recorded: said, found where it acts, and behind no accepted name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from small_drives import BRAKE_COMMAND, TRUCK, drives, evidence

from deeptruck_model.mismatch import unrecorded
from deeptruck_model.mismatch.rules import Rules


def braked(e, times=12, seconds=6.0):
    """The residual with braking at moments in which the engine is idle, and the rows of it."""
    on = np.zeros(len(e), dtype=bool)
    rows = round(seconds / e.dt)
    for start in np.linspace(300, len(e) - 300, times).astype(int):
        on[start : start + rows] = True
    command = np.where(on, 0.0, e["engine_command"] + 0.2)
    signals = {k: v for k, v in e.signals.items() if k != BRAKE_COMMAND} | {"engine_command": command}
    return replace(e, residual=e.residual - 0.8 * on, signals=signals), on


def test_unrecorded_braking_is_found_where_it_acts() -> None:
    e, on = braked(evidence())
    found, gain = unrecorded.braking(e, Rules())
    assert gain > Rules().parameter_gain
    assert found[on].mean() > 0.8
    assert found[~on].mean() < 0.02


def test_a_truck_whose_pedal_is_never_released_does_not_brake() -> None:
    e, _ = braked(evidence())
    e = replace(e, signals=e.signals | {"engine_command": e["engine_command"] + 0.5})
    assert not unrecorded.braking(e, Rules())[0].any()


def test_noise_alone_is_no_braking() -> None:
    e = evidence()
    e = replace(e, signals={k: v for k, v in e.signals.items() if k != BRAKE_COMMAND})
    found, _ = unrecorded.braking(e, Rules())
    assert not found.any()


def test_where_the_brake_was_recorded_none_is_hidden() -> None:
    e, _ = braked(evidence())
    e = replace(e, signals=e.signals | {BRAKE_COMMAND: np.zeros(len(e))})
    found, gain = unrecorded.braking(e, Rules())
    assert not found.any()
    assert gain == 0.0


def test_a_name_of_the_brakes_is_said_with_the_brake_that_was_not_recorded() -> None:
    missing = [unrecorded.NotRecorded("brake", "hides", "signal")]
    recorded = drives(TRUCK, 1, 30.0)
    assert unrecorded.names_behind(recorded, missing)["dragging_brake"] == "brake"
    assert not unrecorded.names_behind(recorded, [])


def test_a_brake_command_that_never_moves_while_the_truck_brakes_was_not_recorded() -> None:
    other, recorded = drives(TRUCK, 2)
    stuck = replace(other, name="stuck", channels=other.channels | {BRAKE_COMMAND: np.zeros(len(other))})
    assert "brake" not in [m.input for m in unrecorded.inputs([recorded, other])]
    missing = unrecorded.inputs([recorded, stuck])
    assert "brake" in [m.input for m in missing]
    assert "engine_brake" in unrecorded.names_behind([recorded, stuck], missing)


def test_a_recorded_engine_speed_gives_the_gear() -> None:
    missing = [unrecorded.NotRecorded("gear", "hides", "signal")]
    (drive,) = drives(TRUCK, 1, 30.0)
    bare = replace(drive, channels={n: x for n, x in drive.channels.items() if n != "engine_speed"})
    assert "driveline_loss" in unrecorded.names_behind([bare], missing)
    assert not unrecorded.names_behind([drive], missing)
