"""What is given twice, by mistake or as its own judge, and names that are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import trucks
from deeptruck_model.mismatch.prepare.drives import each_once, same_signals
from deeptruck_model.recordings import Recording
from deeptruck_model.trucks import driving_cycles

TRUCK = trucks.load("trucksim")


@pytest.fixture(scope="module")
def drives() -> list[Recording]:
    return [driving_cycles.drive(TRUCK, seconds=60.0, seed=k, name=f"d{k}") for k in range(3)]


def names(recordings: list[Recording]) -> list[str]:
    return [r.name for r in recordings]


def test_drives_that_differ_stay_as_they_are(drives: list[Recording]) -> None:
    fit, held, said = each_once(drives[:2], drives[2:])
    assert (names(fit), names(held), said) == (["d0", "d1"], ["d2"], [])


def test_a_drive_that_is_fitted_and_held_out_is_held_out(drives: list[Recording]) -> None:
    copy = replace(drives[1], name="copy")
    fit, held, said = each_once([drives[0], drives[0], copy], [drives[1]])
    assert (names(fit), names(held)) == (["d0"], ["d1"])
    assert said == [
        "recording 'd0' is given twice; it is fitted once",
        "recording 'copy' is the same as 'd1', which is held out; it is held out once",
    ]


def test_cruises_at_one_speed_are_distinguished_by_their_commands(drives: list[Recording]) -> None:
    other = drives[0].channels["engine_command"] + 1.0
    uphill = replace(drives[0], name="uphill", channels=drives[0].channels | {"engine_command": other})
    fit, _, said = each_once([drives[0], uphill], [])
    assert (names(fit), said) == (["d0", "uphill"], [])


def test_drives_cannot_be_their_own_judges(drives: list[Recording]) -> None:
    fit, held, said = each_once(drives[:2], drives[:2])
    assert names(fit) == ["d0", "d1"] and held == [] and "give other drives" in said[0]


def test_a_command_that_was_never_valid_is_lacking(drives: list[Recording]) -> None:
    r = drives[0]
    empty = replace(r, channels=r.channels | {"engine_command": np.full(len(r), np.nan)})
    with pytest.raises(InputError, match="'d0' has no valid engine_command"):
        same_signals(TRUCK, [empty])


def test_a_recording_made_by_hand_without_an_acceleration_is_refused(drives: list[Recording]) -> None:
    rest = {name: x for name, x in drives[0].channels.items() if name != "acceleration"}
    with pytest.raises(InputError, match="'d0' has no valid acceleration"):
        same_signals(TRUCK, [replace(drives[0], channels=rest)])


@pytest.mark.parametrize(
    ("dt", "cure"),
    [
        (1.0, "read it with rate_hz=10 if .* else record at 10 Hz, or .* of 1 Hz: 'deeptruck-model train'"),
        (0.01, "read it with rate_hz=10"),
    ],
)
def test_another_rate_names_a_cure_that_there_is(drives: list[Recording], dt: float, cure: str) -> None:
    with pytest.raises(InputError, match=f"the simulator at 10 Hz; {cure}"):
        same_signals(TRUCK, [replace(drives[0], dt=dt)])
