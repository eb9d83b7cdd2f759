"""A report page: one sentence, then tables and pictures, with collapsed details. One file, offline."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from jinja2 import Environment, StrictUndefined

from deeptruck_core.pages import DARK, DOCUMENT, STYLE, shared


@dataclass(frozen=True)
class Table:
    """Rows of text under a header; columns are aligned to the right from the second one on."""

    says: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    kind: ClassVar[str] = "table"


@dataclass(frozen=True)
class Picture:
    """A picture (PNG) with its caption, which is also its text alternative."""

    png: bytes
    says: str
    kind: ClassVar[str] = "picture"

    @property
    def source(self) -> str:
        return "data:image/png;base64," + base64.b64encode(self.png).decode()


@dataclass(frozen=True)
class Folded:
    """Details that are collapsed under a title."""

    says: str
    parts: Sequence[Part]
    kind: ClassVar[str] = "folded"


Part = Table | Picture | Folded


def document(first: str, more: Sequence[str] = (), parts: Sequence[Part] = ()) -> str:
    """The page as HTML: `first` is its title and first sentence. It fetches nothing from elsewhere."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(shared("document.html.jinja")).render(
        style=shared(STYLE, DOCUMENT, DARK), first=first, more=more, parts=parts
    )
