"""Shared parts of HTML pages: style, and a canvas with axes. Pages fetch nothing from elsewhere."""

from importlib import resources

STYLE, DOCUMENT, DARK, PLOT = "page.css", "document.css", "dark.css", "plot.js"


def shared(name: str) -> str:
    """The text of one of these files, for inclusion in a page."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
