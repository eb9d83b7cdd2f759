"""Inputs that never vary teach nothing, and that is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deeptruck_model.deep import train
from deeptruck_model.deep.data.unexcited_inputs import untaught
from deeptruck_model.signals import TruckInterface


def test_a_drive_in_which_all_varies_is_not_remarked_on(drive):
    assert untaught([drive(60)], TruckInterface("toy")) == ()


def test_inputs_that_never_vary_are_named(drive):
    still = drive(60)
    for name, value in (("engine_command", 300.0), ("brake_command", 0.0), ("grade", 0.01)):
        still.channels[name][:] = value
    engine, brake, grade = untaught([still], still.interface)
    assert engine == "engine command never varies: how the truck answers the engine is not learned from it"
    assert brake.startswith("the brake is never used") and grade.startswith("grade never varies")
    other = replace(still, channels={**still.channels, "engine_command": np.full(len(still), 800.0)})
    assert len(untaught([still, other], still.interface)) == 2


def test_the_card_says_so(drive, small, tmp_path):
    interface = TruckInterface("plain", brake_unit=None)
    train([drive(60, interface=interface)], tmp_path / "sim", replace(small, updates=6))
    card = (tmp_path / "sim" / "MODEL_CARD.md").read_text()
    assert "- Braking is not recorded: how it brakes is not learned from it." in card
