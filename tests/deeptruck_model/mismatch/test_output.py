"""A folder of results belongs to one run at a time, and holds all of a result or nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.output import reserved


def test_a_second_run_into_the_same_folder_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "found"
    with reserved(out) as replaced:
        assert not replaced
        with pytest.raises(InputError, match="another run is writing"), reserved(out):
            pass
        assert out.is_dir()
    with reserved(out):
        pass


def test_a_run_that_fails_leaves_nothing(tmp_path: Path) -> None:
    out = tmp_path / "found"
    with pytest.raises(InputError, match="bad bag"), reserved(out):
        raise InputError("bad bag")
    assert not out.exists()


def test_an_older_result_is_told_and_stays_where_a_run_fails(tmp_path: Path) -> None:
    (tmp_path / "verdict.json").write_text("{}")
    with pytest.raises(InputError), reserved(tmp_path) as replaced:
        assert replaced
        raise InputError("bad bag")
    assert (tmp_path / "verdict.json").exists()
