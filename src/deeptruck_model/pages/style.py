"""The one style of the figures on pages: size, colours and text."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from importlib import resources
from io import BytesIO
from typing import TYPE_CHECKING

import matplotlib as mpl

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE_FILE = "figure.mplstyle"
WIDTH_IN = 6.4  # of every figure, in inches
RECORDED, MODELLED, GUIDE = "0.15", "#0072B2", "0.6"  # a measurement, a simulation, a line to read against


@contextlib.contextmanager
def styled() -> Iterator[None]:
    """Draw in the style of the pages; a context, or `@styled()` above a function that draws."""
    place = resources.files(__package__).joinpath(STYLE_FILE)
    with resources.as_file(place) as path, mpl.rc_context(fname=path):
        yield


@styled()
def png(figure: Figure) -> bytes:
    """A figure as PNG, in the resolution of the pages."""
    picture = BytesIO()
    figure.savefig(picture, format="png")
    return picture.getvalue()
