"""What a recording says of itself, and how it looks."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import CHANNELS, TruckInterface
from deeptruck_model.recordings import Recording


def test_a_recording_says_what_it_is_in_a_line() -> None:
    values = np.zeros(600)
    interface = TruckInterface("van", engine_unit="percent", brake_unit=None, grade=False)
    found = Recording("drive#2", 0.1, {"speed": values, "acceleration": values}, interface)
    assert repr(found) == (
        "<Recording 'drive#2': 60.0 s at 10 Hz; speed, acceleration; van (percent, no brake, fuel)>"
    )


def test_a_plot_has_a_row_a_channel_with_its_unit(drive: Recording, tmp_path: Path) -> None:
    unknown = np.where(np.arange(len(drive)) < 100, drive.channels["speed"], np.nan)
    figure = replace(drive, channels=drive.channels | {"speed": unknown}).plot()
    labels = {ax.get_ylabel() for ax in figure.axes}
    assert len(figure.axes) == len(CHANNELS)
    assert len({ax.get_xlim() for ax in figure.axes}) == 1
    assert {"speed\n[m/s]", "acceleration\n[m/s²]", "gear", "brake command\n[bar]"} <= labels
    figure.savefig(tmp_path / "drive.png")
    assert (tmp_path / "drive.png").stat().st_size > 10_000


def test_a_plot_of_some_channels_shows_their_values(drive: Recording) -> None:
    figure = drive.piece(100, 200).plot("gap", "engine_command")
    gap, command = (ax.lines[0] for ax in figure.axes)
    np.testing.assert_array_equal(gap.get_ydata(), drive.channels["gap"][100:200])
    assert (gap.get_drawstyle(), command.get_drawstyle()) == ("default", "steps-post")
    assert np.asarray(gap.get_xdata())[0] == pytest.approx(10.0)
    assert figure.axes[-1].get_xlabel() == "time [s]"


@pytest.mark.parametrize("name", ["fuel_rate", "spee"])
def test_what_is_not_there_is_not_plotted(name: str) -> None:
    values = np.zeros(10)
    found = Recording("drive", 0.1, {"speed": values, "acceleration": values}, TruckInterface("van"))
    with pytest.raises(InputError, match=name):
        found.plot("speed", name)


def test_nothing_is_drawn_before_it_is_asked_for() -> None:
    says = "import sys; from deeptruck_model.recordings import Recording; print('matplotlib' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", says], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout == "False\n"
