"""Common style of the figures on pages: size, colours and text."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from importlib import resources
from io import BytesIO
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

if TYPE_CHECKING:
    from matplotlib.axis import Axis
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


def plain_log(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers: 0.2, not 2×10^-1. Call it after plotting.

    If the axis covers less than two decades 1, 2 and 5 of each are labelled, else only the decades.
    """
    low, high = sorted(axis.get_view_interval())
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)))
    plain = FuncFormatter(lambda x, _: np.format_float_positional(float(f"{x:.6g}"), trim="-"))
    axis.set_major_formatter(plain)
    axis.set_minor_formatter(NullFormatter())
