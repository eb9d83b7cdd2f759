"""Generated parts of Markdown pages."""

from __future__ import annotations

from pathlib import Path


def put_between_marks(page: Path, name: str, content: str) -> bool:
    """Replace the text between `<!-- NAME: begin -->` and `<!-- NAME: end -->`. Returns whether the page has
    changed."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition(begin)
    new = f"{before}{begin}\n{content}\n{end}{rest.partition(end)[2]}"
    page.write_text(new, encoding="utf-8")
    return new != text
