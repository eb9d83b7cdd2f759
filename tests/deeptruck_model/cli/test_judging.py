"""`deeptruck-model evaluate` and `calibrate`: what they write, and what they say of the figures."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from deeptruck_model import cli

Script = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def monday(bag: Callable[..., Path]) -> Path:
    return bag("monday", 600.0)


@pytest.fixture(scope="module")
def trained_once(monday: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("trained") / "sim"
    words = ["deeptruck-model", "train", str(monday), "--out", str(out), "--budget", "60"]
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as ended:
        patch.setattr(sys, "argv", words)
        cli.main()
    assert not ended.value.code
    return out


@pytest.fixture
def simulator(trained_once: Path, tmp_path: Path) -> Path:
    """A simulator that was trained on `monday`; each test has a copy of its own."""
    return Path(shutil.copytree(trained_once, tmp_path / "sim"))


def test_the_card_names_the_recordings(simulator: Path) -> None:
    card = (simulator / "MODEL_CARD.md").read_text()
    assert "that was held out: monday (0.17 h)." in card
    assert "| acceleration | m/s² | response |" in card and "m/s^2" not in card


def test_calibrating_keeps_card_and_metrics_and_says_by_what(
    script: Script, simulator: Path, bag: Callable[..., Path], tmp_path: Path
) -> None:
    friday, out = bag("friday", 300.0, seed=5), tmp_path / "calibrated"
    code, _, errors = script("calibrate", simulator, friday, "--out", out)
    assert code == 0 and "warning" not in errors
    assert (out / "metrics.json").read_text() == (simulator / "metrics.json").read_text()
    before, after = ((folder / "MODEL_CARD.md").read_text() for folder in (simulator, out))
    assert "The held-out part above sets the 90 % intervals" in before
    says = "The 90 % intervals were set by `deeptruck-model calibrate` on friday (0.08 h)."
    assert says in after and "held-out part above sets" not in after
    assert after.split("## Intervals")[0] == before.split("## Intervals")[0]
    assert after.split("## Limits")[1] == before.split("## Limits")[1]


def test_a_card_of_an_older_version_gets_the_chapter_and_of_its_own_recordings_is_warned(
    script: Script, simulator: Path, monday: Path, tmp_path: Path
) -> None:
    (simulator / "MODEL_CARD.md").write_text("# Deep truck: old\n")
    (simulator / "metrics.json").unlink()
    code, _, errors = script("calibrate", simulator, monday, "--out", tmp_path / "calibrated")
    assert code == 0
    assert "warning: the truck was trained on monday: intervals that it sets come out too narrow" in errors
    card = (tmp_path / "calibrated" / "MODEL_CARD.md").read_text()
    assert card.startswith("# Deep truck: old\n\n## Intervals\n\nThe 90 % intervals were set by")


@pytest.mark.usefixtures("undrawn")
def test_overlapping_runs_are_noted(
    script: Script, simulator: Path, bag: Callable[..., Path], tmp_path: Path
) -> None:
    short = bag("short", 120.0, seed=3)
    code, _, errors = script("evaluate", simulator, short, "--out", tmp_path / "open_loop")
    assert code == 0
    assert "note: 90 runs of 40 s from 120 s of driving overlap: they count as about 3 independent" in errors


@pytest.mark.usefixtures("undrawn")
def test_enough_of_the_same_driving_is_not_remarked_on(
    script: Script, simulator: Path, bag: Callable[..., Path], tmp_path: Path
) -> None:
    same, out = bag("same", 600.0, seed=8), tmp_path / "open_loop"
    code, _, errors = script("evaluate", simulator, same, "--out", out, "--trials", 10)
    held = json.loads((tmp_path / "open_loop" / "metrics.json").read_text())
    assert code == 0 and "overlap" not in errors and "another truck" not in errors, held


@pytest.mark.usefixtures("undrawn")
def test_a_horizon_that_no_drive_has_is_said(
    script: Script, simulator: Path, monday: Path, tmp_path: Path
) -> None:
    words = ("evaluate", simulator, monday, "--out", tmp_path / "open_loop", "--trials", 5, "--horizon")
    code, _, errors = script(*words, "inf")
    assert code == 2 and "a horizon of inf s is none" in errors
    code, _, errors = script(*words, 5000)
    assert code == 0 and "is 5000 s long: the runs are 599.9 s" in errors


def test_calibrating_says_what_is_little_and_what_got_lost(
    script: Script, simulator: Path, bag: Callable[..., Path], tmp_path: Path
) -> None:
    (simulator / "metrics.json").unlink()
    code, _, errors = script("calibrate", simulator, bag("few", 72.0, seed=5), "--out", tmp_path / "cal")
    assert code == 0 and "note: 1.2 min of driving are about 2 independent runs" in errors
    assert "sim has lost its metrics.json" in errors
