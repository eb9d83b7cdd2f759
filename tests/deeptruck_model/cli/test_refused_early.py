"""What is said before anything is computed."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.cli.simulators import _stated_mass
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.several import check_paths_apart
from deeptruck_model.recordings.tables.columns import load_columns


def test_a_drive_is_fitted_or_held_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"a: among the recordings and held out; hold out drives"):
        check_paths_apart(["a", "b"], [tmp_path / "a"])
    check_paths_apart([Path("a")], [Path("b")])


@pytest.mark.parametrize(("stated_kg", "said"), [(24000.0, True), (18500.0, False), (None, False)])
def test_a_stated_mass_that_drives_contradict_is_said(stated_kg: float | None, said: bool) -> None:
    mass = SimpleNamespace(name="mass", value=18200.0, ci95=(14900.0, 21500.0))
    channels = {"speed": np.zeros(9), "acceleration": np.zeros(9)}
    drive = Recording("monday", 0.1, channels, TruckInterface("t", mass_kg=stated_kg))
    lines = list(_stated_mass(SimpleNamespace(parameters=[mass]), [drive]))  # type: ignore[arg-type]
    expected = "note: monday states a mass of 24.0 t, and the drives show 18.2 t (14.9 to 21.5, 95 %)"
    assert lines == ([expected] if said else [])


def test_a_misspelt_channel_is_suggested() -> None:
    columns = {"name": "x", "time": {"rate_hz": 1.0}, "channels": {"sped": {"column": "v"}}}
    with pytest.raises(InputError, match=r"channels: unknown key 'sped'; did you mean speed"):
        load_columns(columns)
