"""What was not recorded: said, found where it acts, and behind no accepted name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_drives import BRAKE_COMMAND, TRUCK, braked, drives, evidence

from deeptruck_model.mismatch.prepare.drives import NotRecorded, inputs
from deeptruck_model.mismatch.residual.left_out import braking
from deeptruck_model.mismatch.verdict.findings import names_behind

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
