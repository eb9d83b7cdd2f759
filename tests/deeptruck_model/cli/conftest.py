"""The console script without a process of its own, and bags of a truck."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from deeptruck_model import cli, driving_cycles, trucks
from deeptruck_model.recordings import write_bag

Script = Callable[..., tuple[int, str, str]]


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Script:
    """script(words) -> (exit code, output, errors) of `deeptruck-model`."""

    def _script(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["deeptruck-model", *map(str, words)])
        with pytest.raises(SystemExit) as caught:
            cli.main()
        return (int(caught.value.code or 0), *capsys.readouterr())

    return _script


@pytest.fixture(scope="session")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """bag(name, seconds, seed=) -> a bag of a drive of `trucksim`."""

    def _bag(name: str, seconds: float, seed: int = 0) -> Path:
        drive = driving_cycles.drive(trucks.load("trucksim"), seconds=seconds, seed=seed, name=name)
        return write_bag(tmp_path_factory.mktemp("bags") / name, [drive], interface=drive.interface)

    return _bag
