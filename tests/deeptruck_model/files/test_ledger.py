"""What changed since a result was written, or came to it, is never taken for its own."""

from __future__ import annotations

from pathlib import Path

import pytest
from result_kit import KIND, publish

from deeptruck_model import files
from deeptruck_model.errors import InputError


def test_a_file_that_changed_since_refuses_by_its_name(tmp_path: Path) -> None:
    publish(tmp_path / "out", a="old", b="old")
    (tmp_path / "out" / "b").write_text("own")  # as long as ours
    with pytest.raises(InputError, match="holds b, which has changed since this command wrote it"):
        publish(tmp_path / "out", overwrite=True, a="new")
    assert (tmp_path / "out" / "b").read_text() == "own"


def test_a_file_that_this_tool_changed_is_told_to_every_ledger_above(tmp_path: Path) -> None:
    inner = files.Result("an inner result")
    with KIND.replacing(tmp_path / "out") as draft, inner.replacing(draft / "inner") as deeper:
        (deeper / "a").write_text("old")
    changed = tmp_path / "out" / "inner" / "a"
    changed.write_text("new")
    files.renew(changed)
    assert inner.check(tmp_path / "elsewhere") is False
    publish(tmp_path / "out", overwrite=True, a="new")


def test_a_part_of_another_result_is_not_replaced(tmp_path: Path) -> None:
    with KIND.replacing(tmp_path / "out") as draft:
        publish(draft / "part", a="old")
    with pytest.raises(InputError, match=r"out/part is part of a test result, .*out; choose another"):
        publish(tmp_path / "out" / "part", overwrite=True, a="new")


def test_a_ledger_inside_that_changed_since_refuses_too(tmp_path: Path) -> None:
    with KIND.replacing(tmp_path / "out") as draft:
        publish(draft / "part", a="old")
    (tmp_path / "out" / "part" / files.LEDGER).write_text('{"mine": 1}')
    with pytest.raises(InputError, match=r"holds part/.deeptruck.json, which has changed"):
        publish(tmp_path / "out", overwrite=True, a="new")


def test_a_file_that_comes_into_the_draft_is_never_the_commands(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    named = files.Result("a named result", ("a",))
    with named.replacing(tmp_path / "out") as draft:
        (draft / "a").write_text("1")
        (draft / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match=r"holds mine\.txt, which is no part of a named result"):
        named.check(tmp_path / "out", overwrite=True)
    with pytest.raises(RuntimeError), named.replacing(tmp_path / "other") as draft:
        (draft / "a").write_text("half")
        (draft / "mine.txt").write_text("mine")
        raise RuntimeError
    assert [path.name for path in draft.iterdir()] == ["mine.txt"]
    assert f"{draft} keeps what this command did not write" in capsys.readouterr().err


def test_nothing_new_is_put_into_a_finished_result(tmp_path: Path) -> None:
    publish(tmp_path / "out", a="old")
    with pytest.raises(
        InputError, match=r"out/sub would lie in .*out, a test result, which holds nothing else"
    ):
        files.Result("another result").check(tmp_path / "out" / "sub")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        '{"what": 1}',
        '{"what": "a test result", "files": {"a": 3}}',
        '{"what": "x", "files": ["a"]}',
    ],
)
def test_a_damaged_ledger_is_none(tmp_path: Path, text: str) -> None:
    publish(tmp_path / "out", a="old")
    (tmp_path / "out" / files.LEDGER).write_text(text)
    with pytest.raises(InputError, match=r"holds a but no \.deeptruck\.json that can be read"):
        publish(tmp_path / "out", overwrite=True, a="new")
    assert (tmp_path / "out" / "a").read_text() == "old"
