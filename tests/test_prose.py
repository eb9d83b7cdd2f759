"""The documents can be read once: sentences of at most 30 words, pages of a length that is read."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    ROOT / "examples" / "README.md",
    *sorted(DOCS.rglob("*.md")),
]
LONGEST = 30  # words of a sentence
MOST = {  # words of a page, tables and code among them
    "mismatch.md": 1200,
    "mismatch_method.md": 1500,
    "cacc.md": 1500,
    "deep_model.md": 1500,
    "results/mismatch.md": 1000,
}
LINES_OF_THE_SCOREBOARD = 120
STARTS = re.compile(r"([-*]|\d+\.) ")  # of an entry in a list


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def paragraphs(text: str) -> Iterator[str]:
    """Running text: no code, formulas, tables or headings; each entry of a list by itself."""
    for pattern in (r"^```.*?^```", r"<!--.*?-->", r"\$\$.*?\$\$"):
        text = re.sub(pattern, "", text, flags=re.S | re.M)
    held: list[str] = []
    for line in [*text.splitlines(), ""]:
        bare = line.removeprefix(">").strip()
        ends = not bare or bare.startswith(("|", "#")) or line.startswith("    ")
        if ends or STARTS.match(bare):
            if held:
                yield " ".join(held)
            held = []
        if not ends:
            held.append(STARTS.sub("", bare, count=1))


def sentences(text: str) -> Iterator[str]:
    """Sentences of a page. What is code or a formula in them counts as one word."""
    for paragraph in paragraphs(text):
        plain = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", paragraph)
        plain = re.sub(r"`[^`]*`|\$[^$]*\$", "x", plain)
        yield from re.split(r"(?<=[.!?])[\"')*]*\s+(?=\S)", plain)


def words(sentence: str) -> int:
    return sum(bool(re.search(r"\w", word)) for word in sentence.split())


def test_long_sentences_are_seen() -> None:
    text = f"# Title\n\n{'word ' * 31}.\n\n| {'cell ' * 40} |\n\n- {'item ' * 20}\n- {'item ' * 20}\n"
    assert [words(s) > LONGEST for s in sentences(text)] == [True, False, False]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_sentences_are_short(page: Path) -> None:
    found = [s for s in sentences(page.read_text(encoding="utf-8")) if words(s) > LONGEST]
    assert not found


@pytest.mark.parametrize(("page", "most"), MOST.items())
def test_pages_are_short(page: str, most: int) -> None:
    assert len((DOCS / page).read_text(encoding="utf-8").split()) <= most


def test_the_scoreboard_is_short() -> None:
    text = (DOCS / "results" / "mismatch.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= LINES_OF_THE_SCOREBOARD
