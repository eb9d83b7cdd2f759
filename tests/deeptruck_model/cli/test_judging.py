"""`deeptruck-model evaluate` and `calibrate`: what they write, and what they say of the figures."""

from __future__ import annotations

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


def test_calibrating_keeps_card_and_metrics_and_says_by_what(
    script: Script, simulator: Path, bag: Callable[..., Path], tmp_path: Path
) -> None:
    friday, out = bag("friday", 300.0, seed=5), tmp_path / "calibrated"
    code, _, errors = script("calibrate", simulator, friday, "--out", out)
    assert code == 0 and "warning" not in errors
    assert (out / "metrics.json").read_text() == (simulator / "metrics.json").read_text()
    before, after = ((folder / "MODEL_CARD.md").read_text() for folder in (simulator, out))
    assert "friday (0.08 h)" in after and "friday" not in before
    assert after.split("## Intervals")[0] == before.split("## Intervals")[0]
    assert after.split("## Limits")[1] == before.split("## Limits")[1]


@pytest.mark.usefixtures("undrawn")
def test_a_horizon_that_no_drive_has_is_said(
    script: Script, simulator: Path, monday: Path, tmp_path: Path
) -> None:
    words = ("evaluate", simulator, monday, "--out", tmp_path / "open_loop", "--trials", 5, "--horizon")
    code, _, errors = script(*words, "inf")
    assert code == 2 and "a horizon of inf s is none" in errors
    code, _, errors = script(*words, 5000)
    assert code == 0 and "the runs are 599.9 s" in errors
