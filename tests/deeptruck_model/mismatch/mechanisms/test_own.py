"""A mechanism of the user's own: found, corrected, kept, and refused if it cannot be used."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.constants import GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_model import simulators, trucks
from deeptruck_model.mismatch import LIBRARY, find_mismatch, write
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import free_run
from deeptruck_model.trucks import driving_cycles

FILE = """
from deeptruck_model.mismatch.expression import Signal
from deeptruck_model.mismatch.mechanisms.record import Form, Mechanism, force

MECHANISMS = (
    Mechanism(
        "crane_drag", "air_tyres_road", "the crane drags while it is up", "F = -F0 while it is up",
        ("extra: crane_up",), ("crane",), "of our own", "coast with the crane up and down",
        {"up": Form(lambda: force(-Signal("extra: crane_up"), 0.1))},
    ),
)
"""
TRUCK = trucks.load("trucksim")


def drive(seed: int, force_n: float = 1800.0) -> Recording:
    """A drive whose crane is up in every other 40 s and takes a force, driven as a slope."""
    r = driving_cycles.drive(TRUCK, seconds=240.0, seed=seed)
    rng = np.random.default_rng(seed)
    n, u, known = len(r), r.interface.u, r.channels
    up = (r.time % 80.0 < 40.0).astype(float)
    steeper = known["grade"] + force_n * up / (TRUCK.parameters()["mass"] * GRAVITY)
    y0 = np.array([[known[name][0] for name in r.interface.y]])
    run = free_run(TRUCK, np.stack([known[name] for name in u], axis=1)[None], steeper[None, :, None], y0)
    own = {name: run.y[0, :, i] for i, name in enumerate(r.interface.y)}
    own["speed"] = own["speed"] + 0.01 * rng.standard_normal(n)
    own["acceleration"] = own["acceleration"] + 0.03 * rng.standard_normal(n)
    shown = {name: known[name] for name in (*u, "grade")}
    return replace(r, name=f"d{seed}", channels=shown | own | {"crane_up": up})


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "ours.py"
    path.write_text(FILE)
    return path


def test_one_of_the_users_is_found_and_kept_and_one_that_was_not_recorded_is_said(
    file: Path, tmp_path: Path
) -> None:
    drives = [drive(k) for k in range(3)]
    head, begin, one = FILE.partition("    Mechanism(\n")
    other = one.replace("crane_drag", "crane_gap").replace('("extra: crane_up",)', '("gap",)')
    file.write_text("".join((head, begin, one.removesuffix(")\n"), begin, other)))
    own = LIBRARY.read(file)
    found = find_mismatch(TRUCK, drives[:2], drives[2:], mechanisms=own)
    assert any("'crane_gap'" in caveat for caveat in found.result.caveats)
    assert found.findings[0].effect == "crane_drag" and found.findings[0].family == "air_tyres_road"
    fit = found.result.fit
    assert fit is not None and fit.errors is not None  # its own channel is fed to the corrected truck
    assert fit.errors.after.speed < 0.3 * fit.errors.before.speed
    write(found, tmp_path / "found")
    again = simulators.load(tmp_path / "found" / "simulator")
    assert "crane_drag" in {term.effect for term in again.terms}  # type: ignore[attr-defined]
    file.write_text(file.read_text().replace("0.1", "0.2"))
    with pytest.raises(InputError, match="has changed since a correction was made with it"):
        simulators.load(tmp_path / "found" / "simulator")
    assert "crane_drag" not in set(LIBRARY), "another comparison does not have it"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"air_tyres_road"', '"wheels"', "has the family 'wheels'"),
        ("crane_drag", "crane drag", "needs a name of letters"),
        ("crane_drag", "headwind", "is a name of the tool"),
        ("crane_drag", "mass", "is a name of the tool"),
        ("MECHANISMS =", "OTHERS =", "has no MECHANISMS"),
        ("Signal(", "Sensor(", "has a form 'up' that cannot be made"),
        ("MECHANISMS = (", "MECHANISMS = (x, ", "cannot be run"),
        ("extra: crane_up", "engine_sped", "'engine_sped', which is no signal; did you mean 'engine_speed'"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_one_line(file: Path, old: str, new: str, says: str) -> None:
    file.write_text(FILE.replace(old, new))
    with pytest.raises(InputError, match=says) as caught:
        find_mismatch(TRUCK, [], mechanisms=LIBRARY.read(file))
    assert "\n" not in str(caught.value)


def test_a_signal_that_nobody_has_is_refused(file: Path) -> None:
    file.write_text(FILE.replace('Signal("extra: crane_up")', 'Signal("extra: crane_upp")'))
    with pytest.raises(InputError, match=r"'crane_drag' asks for 'extra: crane_upp'.*mean 'extra: crane_up'"):
        find_mismatch(TRUCK, [drive(0)], mechanisms=LIBRARY.read(file))
