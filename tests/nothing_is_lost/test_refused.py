"""Real command lines whose --out holds a file of the user: refused by its name, with --overwrite too."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import deeptruck_cacc.cli
import deeptruck_model.cli
import truck_bridge.cli
from deeptruck_core.errors import InputError
from deeptruck_core.files import MARKER
from deeptruck_exam.folder import CASE, clear
from deeptruck_model import results

FOLDERS = (
    "deeptruck-model import none.csv --columns none.yaml --out out",
    "deeptruck-model coverage none --out out",
    "deeptruck-model train none --out out",
    "deeptruck-model evaluate truck:trucksim none --out out",
    "deeptruck-model calibrate none none --out out",
    "deeptruck-model mismatch --simulator truck:trucksim --recordings none --out out",
    "deeptruck-model apply none --out out",
    "deeptruck-cacc train --simulator truck:trucksim --out out",
    "deeptruck-cacc evaluate baseline:cacc --simulator truck:trucksim --out out",
)
INSIDE = (
    "deeptruck-model coverage bag --out bag/out",
    "deeptruck-model train bag --out bag/out",
    "deeptruck-model evaluate truck:trucksim bag --out bag/out",
    "deeptruck-model calibrate bag none --out bag --overwrite",
    "deeptruck-model train none --from bag --out bag --overwrite",
    "deeptruck-model mismatch --simulator truck:trucksim --recordings bag --out bag/out",
    "deeptruck-model fleet train bag --out bag/out",
    "deeptruck-model apply bag --out bag/out",
    "deeptruck-cacc train --simulator bag --out bag/out",
    "deeptruck-cacc evaluate bag --simulator truck:trucksim --out bag/out",
    "deeptruck-model prove --real bag --out bag/out",
    "deeptruck-model check-simulator bag --json bag/x.json",
    "deeptruck-model export bag --out bag/x.onnx",
    "deeptruck-cacc export bag --out bag/x.onnx",
)
FILES = (
    "deeptruck-model suggest none --out mine.txt",
    "deeptruck-model export none --out mine.txt",
    "deeptruck-cacc export none --out mine.txt",
    "truck-bridge decode none.log --vehicle trucksim --out mine.txt",
    "truck-bridge convert none.log mine.txt",
)
MAIN = {
    "deeptruck-model": deeptruck_model.cli.main,
    "deeptruck-cacc": deeptruck_cacc.cli.main,
    "truck-bridge": truck_bridge.cli.main,
}


@pytest.fixture
def refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[[str], str]:
    """refused(line) -> what a command line says that ends with exit code 2."""

    def _refused(line: str) -> str:
        program, *words = line.split()
        monkeypatch.setattr(sys, "argv", [program, *words])
        with pytest.raises(SystemExit) as end:
            MAIN[program]()
        assert end.value.code == 2
        return " ".join(capsys.readouterr().err.split())

    return _refused


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("line", FOLDERS)
def test_a_folder_with_a_file_of_the_user_is_refused(
    line: str, here: Path, refused: Callable[[str], str]
) -> None:
    """Also if it has the name of a command's."""
    (here / "out").mkdir()
    (here / "out" / "metrics.json").write_text("mine")
    says = refused(line + " --overwrite")
    assert "out holds metrics.json but no .deeptruck.json" in says and "remove it yourself" in says
    assert [p.name for p in here.rglob("*")] == ["out", "metrics.json"]


def test_of_a_case_only_what_is_large_is_removed(here: Path) -> None:
    names = ("recordings/drive_0/metadata.yaml", "found/simulator/simulator.json", "found/verdict.json")
    for name in names:
        (here / "case" / name).parent.mkdir(parents=True, exist_ok=True)
        (here / "case" / name).touch()
    CASE.mark(here / "case")
    clear(here / "case", "recordings", "found/simulator")
    left = {p.relative_to(here / "case").as_posix() for p in (here / "case").rglob("*")}
    assert left == {MARKER, "found", "found/verdict.json"}


@pytest.mark.parametrize("place", ["/dev/shm", "/proc"])
def test_a_mount_point_is_refused_before_anything_is_computed(place: str) -> None:
    """Nothing can be renamed to it, which would only be seen once all is computed."""
    if not os.path.ismount(place):
        pytest.skip(f"{place} is no mount point here")
    with pytest.raises(InputError, match="is a mount point"):
        results.COVERAGE.check(Path(place))


@pytest.mark.parametrize("line", INSIDE)
def test_an_out_inside_what_is_read_is_refused(line: str, here: Path, refused: Callable[[str], str]) -> None:
    (here / "bag").mkdir()
    assert "is bag or inside it, which is read here" in refused(line)


@pytest.mark.parametrize("line", FILES)
def test_a_file_that_is_there_is_not_written(line: str, here: Path, refused: Callable[[str], str]) -> None:
    (here / "mine.txt").write_text("mine")
    refused(line)
    assert (here / "mine.txt").read_text() == "mine" and len(list(here.iterdir())) == 1
