"""The marker of a result: which command wrote which files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from result_kit import publish

from deeptruck_core import files
from deeptruck_core.errors import InputError


def test_nothing_new_is_put_into_a_finished_result(tmp_path: Path) -> None:
    publish(tmp_path / "out", a="old")
    with pytest.raises(InputError, match=r"out/sub would lie in .*out, a test result; choose"):
        files.Result("another result").check(tmp_path / "out" / "sub")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        '{"what": 1}',
        '{"what": "a test result", "files": 3}',
    ],
)
def test_a_damaged_marker_is_none(tmp_path: Path, text: str) -> None:
    publish(tmp_path / "out", a="old")
    (tmp_path / "out" / files.MARKER).write_text(text)
    with pytest.raises(InputError, match=r"holds a but no \.deeptruck\.json that can be read"):
        publish(tmp_path / "out", overwrite=True, a="new")
    assert (tmp_path / "out" / "a").read_text() == "old"


def test_what_an_earlier_version_wrote_is_known(tmp_path: Path) -> None:
    """It listed size and hash of each file."""
    publish(tmp_path / "out", a="old")
    old = {"what": "a test result", "files": {"a": {"bytes": 3, "sha256": "0"}}}
    (tmp_path / "out" / files.MARKER).write_text(json.dumps(old))
    publish(tmp_path / "out", overwrite=True, b="new")
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"b", files.MARKER}


def test_a_marker_that_lists_files_elsewhere_removes_none_of_them(tmp_path: Path) -> None:
    publish(tmp_path / "out", a="old")
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "out" / files.MARKER).write_text('{"what": "a test result", "files": ["a", "../mine"]}')
    publish(tmp_path / "out", overwrite=True, a="new")
    assert (tmp_path / "mine").read_text() == "mine"
