"""Which names were weighed against each other, and by how much one won."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from deeptruck_model.mismatch.posterior.penalties import ENOUGH
from deeptruck_model.mismatch.report.drawing import BLUE, GREEN, GREY, INK, ORANGE, SKY, figure, tidy, words
from deeptruck_model.mismatch.report.page_words import spoken

if TYPE_CHECKING:
    from deeptruck_model.mismatch.posterior.causes import Explanation

MOST_NAMES = 14
PALE = "#cccccc"
KINDS = {
    BLUE: "stated",
    SKY: "not told apart from it",
    PALE: "rejected",
    GREY: "parameters only, over the simulator as given",
    ORANGE: "what is left, by a free model",
}
ROOM_BELOW = 0.08  # of the width, for the numbers beside bars below zero
ROOM = 1.5  # a longer bar than this many times the longest name's is cut


def ranking(x: Explanation) -> Figure:
    """Evidence of each name over parameters alone, of those over the simulator as given, and of what is left.

    Parameters alone may gain far more than what matters between names, so long bars are cut at the edge.
    """
    first = next((c for c in x.causes if c.shape is not None), None)
    group = set(first.not_told_from) if first else set()
    bars: list[tuple[str, float, str]] = []
    tuned = x.parameters_only.score - x.null.score
    stated = {c.effect for c in x.causes if c.shape is not None}
    moved = {c.effect for c in x.causes if c.kind == "parameter_error"}
    bars.append((_parameters(x), tuned, BLUE if moved == x.parameters_only.free and moved else GREY))
    for name, gain in sorted(x.ranking, key=lambda named: -named[1])[:MOST_NAMES]:
        bars.append((spoken(name), gain, BLUE if name in stated else SKY if name in group else PALE))
    bars.append(("anything that is left", x.left_over_gain, ORANGE))
    made = figure(10.0, 1.3 + 0.27 * len(bars))
    height = made.get_size_inches()[1]
    ax = made.add_axes((0.30, 0.55 / height, 0.66, (height - 1.0) / height))
    _bars(ax, bars)
    used = {tone for _, _, tone in bars}
    made.legend(
        handles=[Patch(color=tone, label=text) for tone, text in KINDS.items() if tone in used],
        loc="upper left", ncols=5, fontsize=8, frameon=False,
    )  # fmt: skip
    return made


def _parameters(x: Explanation) -> str:
    free = ", ".join(words(p) for p in sorted(x.parameters_only.free)) or "none moves"
    return f"parameters only ({free})" if len(free) < 22 else "parameters only (several)"


def _ends(gains: Sequence[float]) -> tuple[float, float]:
    """Where bars are cut: well beyond the names, and not so far below zero that the others are squeezed."""
    limit = ROOM * max(*gains, 2 * ENOUGH)
    return min(0.0, max(min(gains), -limit)), limit


def _number(ax: Axes, k: int, gain: float, low: float, limit: float) -> None:
    """A bar's size beyond its end; within it, with an arrow, where it is cut."""
    step = 0.008 * (limit - low)
    if gain > limit:
        at, text, side = limit - step, f"{gain:.0f} →", "right"
    elif gain < low:
        at, text, side = low + step, f"← {gain:.0f}", "left"
    else:
        at, text = gain + (step if gain >= 0.0 else -step), f"{gain:.1f}"
        side = "left" if gain >= 0.0 else "right"
    cut = not low <= gain <= limit
    tint = "white" if gain > limit else INK
    box = None if cut else {"fc": "white", "ec": "none", "pad": 0.5}
    ax.text(at, k, text, bbox=box, va="center", ha=side, fontsize=8, color=tint)


def _bars(ax: Axes, bars: list[tuple[str, float, str]]) -> None:
    low, limit = _ends([gain for _, gain, _ in bars[1:]])
    for k, (_, gain, tone) in enumerate(bars):
        ax.barh(k, min(max(gain, low), limit), color=tone, height=0.7)
        _number(ax, k, gain, low, limit)
    ax.axvline(0, color=INK, lw=0.8)
    ax.axvline(ENOUGH, color=GREEN, lw=1, ls="--")
    ax.text(ENOUGH, -0.75, " needed to be stated", fontsize=8, color=GREEN, va="bottom")
    tidy(ax)
    ax.grid(axis="y", visible=False)
    ax.set_xlim(low - (ROOM_BELOW * (limit - low) if low < 0.0 else 0.0), limit)
    ax.set_ylim(len(bars) - 0.4, -0.9)
    ax.set_yticks(range(len(bars)), [name for name, _, _ in bars], fontsize=9)
    ax.set_xlabel("evidence, nats (names: beyond parameters only)", fontsize=9)
