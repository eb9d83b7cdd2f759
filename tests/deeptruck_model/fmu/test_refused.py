"""What cannot be used is one line, before anything is written."""

from __future__ import annotations

import builtins
import zipfile
from pathlib import Path
from typing import Any

import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import checks


@pytest.mark.parametrize(
    ("mapping", "says"),
    [
        ("engine: x\n", "the mapping: unknown key 'engine'"),
        ("inputs: {engine_comand: x}\n", "did you mean engine_command"),
        ("inputs: {engine_command: throttle}\n", "has no variable 'throttle'"),
        (
            "inputs: {engine_command: {variable: engine_command, unit: furlong}}\n",
            "unit 'furlong' does not fit",
        ),
        (
            "inputs: {engine_command: {variable: engine_command, scale: 2}}\n",
            "engine_command: unknown key 'scale'",
        ),
        ("inputs: {engine_command: speed}\n", "is a output and no input"),
        ("inputs: {engine_command: null}\n", "no variable that is known as inputs: engine_command"),
        ("outputs: {speed: null}\n", "no variable that is known as outputs: speed"),
        ("start: {speed: null}\n", "no variable that is known as start: speed"),
        ("dt: 0.1\nstep: 0.03\n", "is no whole number of the FMU's steps"),
        ("dt: -1\n", "dt: -1 is less than .* give s"),
        ("parameters: {drag_area: {variable: drag_area, unit: ft2}}\n", r"is in ft2, ours is in m\^2"),
        ("set: {mass: heavy}\n", "set.mass: 'heavy' is not of type 'number'"),
        ("- a\n", "must hold 'key: value' pairs"),
    ],
)
def test_a_map_that_does_not_fit(own: Path, tmp_path: Path, mapping: str, says: str) -> None:
    file = tmp_path / "map.yaml"
    file.write_text(mapping)
    with pytest.raises(InputError, match=says) as caught:
        checks.simulator(f"fmu:{own}:{file}")
    assert "\n" not in str(caught.value)


def test_files_that_are_no_fmu_or_run_elsewhere(own: Path, tmp_path: Path) -> None:
    text, empty, other = (tmp_path / f"{name}.fmu" for name in ("text", "empty", "other"))
    text.write_text("no zip")
    zipfile.ZipFile(empty, "w").close()
    with zipfile.ZipFile(own) as source, zipfile.ZipFile(other, "w") as target:
        for name in source.namelist():
            if "linux" not in name:
                target.writestr(name, source.read(name))
    for file, says in (
        (text, "it is no zip archive"),
        (empty, "it holds no modelDescription.xml"),
        (other, "runs on x86_64-windows and not on"),
        (tmp_path / "none.fmu", "it does not exist"),
    ):
        with pytest.raises(InputError, match=says):
            checks.simulator(f"fmu:{file}")


def test_without_fmpy_the_extra_is_named(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def lacking(name: str, *rest: Any) -> Any:
        if name.startswith("fmpy"):
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", lacking)
    with pytest.raises(InputError, match=r"pip install 'deeptruck\[fmu\]'"):
        checks.simulator(f"fmu:{own}")


def test_a_truck_that_starts_at_another_speed(own: Path, tmp_path: Path) -> None:
    from deeptruck_model import simulators
    from deeptruck_model.simulators import protocol_check

    file = tmp_path / "map.yaml"
    file.write_text("start: {speed: {variable: initial_speed, unit: km/h}}\n")
    with pytest.raises(InputError, match=r"starts at .* where it was to start at 20"):
        protocol_check.start(simulators.load(f"fmu:{own}:{file}"), 20.0)
