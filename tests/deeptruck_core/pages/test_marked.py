"""What a program writes stands between its marks, and nothing else on the page changes."""

from __future__ import annotations

from pathlib import Path

from deeptruck_core.pages.marked import put_between_marks


def test_a_part_is_replaced_between_its_marks(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- a: begin -->\nstale\n<!-- a: end -->\nafter\n<!-- b: begin -->\nkept\n")
    assert put_between_marks(page, "a", "new") and not put_between_marks(page, "a", "new")
    assert page.read_text() == (
        "before\n<!-- a: begin -->\nnew\n<!-- a: end -->\nafter\n<!-- b: begin -->\nkept\n"
    )
