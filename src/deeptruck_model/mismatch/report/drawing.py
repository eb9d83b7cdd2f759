"""How the figures of the report look, and how they become PNG."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from itertools import pairwise

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from deeptruck_model.mismatch.residual.evidence import Evidence, unit

Array = NDArray[np.float64]

DPI = 110
MOSTLY, WIDER = 0.9, 2.5  # of the residual is far within its panel, whatever spikes do: 4 sd of noise
NEARLY_ALL, ROOM = 0.98, 1.5  # of what is explained is in it, with room above
# Okabe and Ito's colours, distinguishable by all kinds of colour vision
INK, GREY, BLUE, ORANGE, GREEN = "#222222", "#999999", "#0072B2", "#E69F00", "#009E73"
VERMILION, PURPLE, SKY = "#D55E00", "#CC79A7", "#56B4E9"
WINE, MINT = "#882255", "#80CEB9"  # Tol's, a thin line that is seen on a wide pale one
FINDINGS = (ORANGE, SKY, GREEN, PURPLE, VERMILION, BLUE)

WORDS = {
    "simulated": "simulated acceleration",
    "engine": "engine force per mass",
    "brake": "brake force per mass",
    "elapsed": "time since the recording began",
    "ratio": "overall gear ratio",
    "lever": "overall gear ratio",
}


MEMORY = re.compile(r"(?<!simulated )\b(engine|acceleration|braking power) over (\d+) s\b")
REMEMBERED = {
    "engine": "engine force per mass",
    "acceleration": "simulated acceleration",
    "braking power": "braking power per mass",
}
# the command beyond its lag of a second: a change and no rate, in the unit of the command
CHANGE = re.compile(r"\bchange of (?:the )?(\w+)_command\b")


def words(name: str) -> str:
    """A signal's or effect's name as people say it."""
    return WORDS.get(name) or remembered(name).replace("_", " ")


def remembered(text: str) -> str:
    """The text with short memories of signals in words: 'engine over 60 s', 'change of brake_command'."""
    text = MEMORY.sub(lambda found: f"{REMEMBERED[found[1]]} over {found[2]} s", text)
    return CHANGE.sub(r"change of the \1 command within about 1 s", text)


def label(name: str, commands: Mapping[str, str]) -> str:
    """An axis label: the name in words and its unit, on a truck with these units of its commands."""
    measured_in = unit(name, commands)
    return f"{words(name)}, {measured_in}" if measured_in else words(name)


def colour(finding: int) -> str:
    """The colour a finding has in every figure and in the page."""
    return FINDINGS[finding % len(FINDINGS)]


def figure(width: float, height: float) -> Figure:
    """An empty figure (inches) that draws without a screen."""
    made = Figure(figsize=(width, height), dpi=DPI)
    FigureCanvasAgg(made)
    return made


def tidy(ax: Axes) -> None:
    """Only the lines that are read."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=8, colors="#444444", labelcolor=INK)
    ax.grid(color="#e6e6e6", lw=0.6)
    ax.set_axisbelow(True)


def png(made: Figure) -> bytes:
    """The figure as PNG."""
    buffer = io.BytesIO()
    with mpl.rc_context({"font.size": 9}):
        made.savefig(buffer, format="png", dpi=DPI, facecolor="white")
    return buffer.getvalue()


def strips(picture: bytes, ends: Sequence[float]) -> tuple[bytes, ...]:
    """A tall PNG cut across at `ends` (inches from its top), so that paper can break between the parts."""
    out = []
    with Image.open(io.BytesIO(picture)) as whole:
        edges = [0, *(min(round(end * DPI), whole.height) for end in ends)]
        for top, bottom in pairwise(edges):
            buffer = io.BytesIO()
            whole.crop((0, top, whole.width, bottom)).save(buffer, format="png")
            out.append(buffer.getvalue())
    return tuple(out)


def drawn(e: Evidence, force: Array) -> tuple[Array, str]:
    """A force per mass (m/s^2) as it is drawn, and its unit: kN where the mass is known."""
    return (force * e.mass / 1000.0, "kN") if e.mass_known else (force, "m/s²")


def usual_reach(residual: Sequence[Array], explained: Sequence[Array]) -> float:
    """Half the height of a panel of forces, from those of every drive, (n,) each: one scale for all, and no
    spike at a gear change sets it. Zero where there is nothing to see."""
    seen, stated = (np.abs(np.concatenate([*x, np.zeros(0)])) for x in (residual, explained))
    seen, acts = seen[np.isfinite(seen)], stated[stated > 0.0]
    usual = float(np.quantile(seen, MOSTLY)) if len(seen) else 0.0
    return max(WIDER * usual, ROOM * float(np.quantile(acts, NEARLY_ALL)) if len(acts) else 0.0)
