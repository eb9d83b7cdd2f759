"""A folder of results belongs to one run at a time, is whole or not there, and is replaced when asked for."""

from __future__ import annotations

from pathlib import Path

import pytest

from deeptruck_core.errors import InputError
from deeptruck_model.mismatch.folders import APPLIED, applicable, check_road
from deeptruck_model.results import FOUND


def test_files_without_a_marker_are_the_users(tmp_path: Path) -> None:
    """They may bear a result's names: without a marker nobody knows who wrote them."""
    for name in ("verdict.json", "report.html", "profiles.csv"):
        (tmp_path / name).write_text("{}")
    for overwrite in (False, True):
        with pytest.raises(InputError, match=r"but no \.deeptruck\.json"):
            FOUND.check(tmp_path, overwrite=overwrite)


def test_one_kind_of_result_does_not_replace_another(tmp_path: Path) -> None:
    with FOUND.replacing(tmp_path / "found") as draft:
        (draft / "verdict.json").write_text("{}")
    with pytest.raises(InputError, match="a mismatch result, which is no part of a corrected simulator"):
        APPLIED.check(tmp_path / "found", overwrite=True)


def test_what_is_not_there_is_to_be_found_first(tmp_path: Path) -> None:
    for check in (applicable, check_road):
        with pytest.raises(InputError, match="nowhere does not exist; run 'deeptruck-model mismatch' first"):
            check(tmp_path / "nowhere")
