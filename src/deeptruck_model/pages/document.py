"""A page that is read: one sentence on top, tables, and pictures with what they show. One file, offline."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass

from jinja2 import Environment, StrictUndefined

from deeptruck_model.pages import DARK, STYLE, shared


@dataclass(frozen=True)
class Table:
    """Rows of text under a head; numbers are aligned to the right from the second column on."""

    says: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A picture (PNG) and what it shows, which stands below it and is read where it cannot be seen."""

    png: bytes
    says: str

    @property
    def source(self) -> str:
        return "data:image/png;base64," + base64.b64encode(self.png).decode()


def document(
    first: str, more: Sequence[str] = (), tables: Sequence[Table] = (), pictures: Sequence[Picture] = ()
) -> str:
    """The page as HTML: `first` is its title and first sentence. Nothing in it is fetched from elsewhere."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(shared("document.html.jinja")).render(
        style=shared(STYLE) + shared(DARK), first=first, more=more, tables=tables, pictures=pictures
    )
