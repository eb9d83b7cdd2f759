"""Shared parts of HTML pages: style, and charts by uPlot. Pages fetch nothing from elsewhere."""

from importlib import resources

STYLE, DOCUMENT, DARK = "page.css", "document.css", "dark.css"
CHART_STYLE, CHARTS = "uplot.css", ("uplot.js", "charts.js")  # uPlot 1.6.32 from npm, its licence at its head


def shared(*names: str) -> str:
    """The text of these files, for inclusion in a page."""
    folder = resources.files(__package__)
    return "".join(folder.joinpath(name).read_text(encoding="utf-8") for name in names)
