"""Where a benchmark stores what it measured: a section of a page under docs/results."""

from __future__ import annotations

import re
from pathlib import Path

RESULTS = Path(__file__).parents[1] / "docs" / "results"


def store(page: str, text: str) -> None:
    """Put `text`, which begins with its heading (`# ...`), into docs/results/PAGE.md as a section (`## ...`).

    It takes the place of the section with this heading, or comes last; the headings in it move down as well.
    """
    section = re.sub(r"^#", "##", text.strip(), flags=re.M)
    path = RESULTS / f"{page}.md"
    parts = [p.strip() for p in re.split(r"^(?=## )", path.read_text(encoding="utf-8"), flags=re.M)]
    headings = [part.partition("\n")[0] for part in parts]
    heading = section.partition("\n")[0]
    at = headings.index(heading) if heading in headings else len(parts)
    parts[at : at + 1] = [section]
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
