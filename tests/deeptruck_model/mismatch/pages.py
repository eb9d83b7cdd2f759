"""A page as its reader has it."""

from __future__ import annotations

import io
from html.parser import HTMLParser

import matplotlib.image
import numpy as np


class Page(HTMLParser):
    """Visible text in order, images, and everything that could be fetched."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.text: list[str] = []
        self.fetched: list[str] = []
        self.images: list[str] = []
        self.tags: list[str] = []
        self._hidden = 0
        self.feed(source)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self._hidden += tag in ("style", "title", "script")
        for name, value in attributes:
            if name in ("src", "href", "srcset", "data", "action", "poster", "background"):
                (self.images if tag == "img" and name == "src" else self.fetched).append(value or "")

    def handle_endtag(self, tag):
        self._hidden -= tag in ("style", "title", "script")

    def handle_data(self, data):
        if data.strip() and not self._hidden:
            self.text.append(" ".join(data.split()))


def pixels(png: bytes) -> np.ndarray:
    return matplotlib.image.imread(io.BytesIO(png), format="png")
