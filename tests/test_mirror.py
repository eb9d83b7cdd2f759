"""Tests mirror the source: a folder with source files has a folder of tests of its name."""

from __future__ import annotations

from pathlib import Path

import pytest

TESTS = Path(__file__).parent
SOURCES = (TESTS.parent / "src", TESTS.parent / "exam" / "src")
ELSEWHERE = {  # tested where the folder above is
    "deeptruck_core/pages": "deeptruck_cacc/evaluation/test_evaluation.py",
    "deeptruck_model/deep/kernels": "deeptruck_model/deep/test_network.py",
    "deeptruck_model/mismatch/residual/expression": "deeptruck_model/mismatch/residual/test_expression.py",
    "truck_bridge/safety": "safety/test_frames.py",
    "truck_bridge/vehicles": "truck_bridge/test_vehicles.py",
}


def folders() -> list[str]:
    """Folders of the source with two modules and more."""
    found = []
    for source in SOURCES:
        for init in source.rglob("__init__.py"):
            if len(list(init.parent.glob("[!_]*.py"))) > 1:
                found.append(init.parent.relative_to(source).as_posix())
    return found


@pytest.mark.parametrize("folder", folders())
def test_every_folder_of_the_source_has_tests(folder: str) -> None:
    assert [*TESTS.glob(ELSEWHERE.get(folder, f"{folder}/test_*.py"))]
