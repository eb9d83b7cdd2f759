"""What pages share: their style, and a canvas with axes. Nothing on a page is fetched from elsewhere."""

from importlib import resources

STYLE, DOCUMENT, DARK, PLOT = "page.css", "document.css", "dark.css", "plot.js"


def shared(name: str) -> str:
    """The text of one of these files, to stand within a page."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
