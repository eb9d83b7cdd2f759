"""The scripts and the style of the explorer, read from the files beside this one."""

from __future__ import annotations

from importlib import resources

from deeptruck_model import pages

SCRIPTS = ("views.js", "explorer.js")  # in this order, behind `pages.PLOT`: each uses those before it


def script() -> str:
    """What the page runs."""
    return "\n".join([pages.shared(pages.PLOT), *map(_read, SCRIPTS)])


def style() -> str:
    """How its part of the page looks."""
    return _read("explorer.css")


def dark() -> str:
    """How it looks where the reader's screen is dark: drawings stay on white paper."""
    return _read("explorer_dark.css")


def _read(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
