"""Open-loop errors on held-out recordings: against time as the paper draws them, by horizon and by regime."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from deeptruck_model.mismatch.data.prepared import Prepared
from deeptruck_model.mismatch.fit_result import Errors
from deeptruck_model.mismatch.posterior.causes import Explanation
from deeptruck_model.mismatch.report.drawing import BLUE, GREEN, GREY, INK, ORANGE, SKY, figure, tidy, words
from deeptruck_model.mismatch.report.wording import spoken

MOST_NAMES = 14
PALE = "#cccccc"
KINDS = {
    BLUE: "stated",
    SKY: "not distinguishable from it",
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
    group = {name for c in x.causes for name in c.not_told_from}
    bars: list[tuple[str, float, str]] = []
    tuned = x.parameters_only.score - x.null.score
    stated = {c.effect for c in x.causes if c.term is not None}
    moved = {c.effect for c in x.causes if c.kind == "parameter_error"}
    bars.append((_parameters(x), tuned, BLUE if moved == x.parameters_only.free and moved else GREY))
    for name, gain in sorted(x.ranking, key=lambda named: -named[1])[:MOST_NAMES]:
        bars.append((spoken(name), gain, BLUE if name in stated else SKY if name in group else PALE))
    bars.append(("anything that is left", x.left_over_gain, ORANGE))
    made = figure(10.0, 1.3 + 0.27 * len(bars))
    height = made.get_size_inches()[1]
    ax = made.add_axes((0.30, 0.55 / height, 0.66, (height - 1.0) / height))
    _bars(ax, bars, x.model.rules.least_gain)
    used = {tone for _, _, tone in bars}
    made.legend(
        handles=[Patch(color=tone, label=text) for tone, text in KINDS.items() if tone in used],
        loc="upper left", ncols=5, fontsize=8, frameon=False,
    )  # fmt: skip
    return made


def _parameters(x: Explanation) -> str:
    free = ", ".join(words(p) for p in sorted(x.parameters_only.free)) or "none moves"
    return f"parameters only ({free})" if len(free) < 22 else "parameters only (several)"


def _ends(gains: Sequence[float], least: float) -> tuple[float, float]:
    """Where bars are cut: well beyond the names, and not so far below zero that the others are squeezed."""
    limit = ROOM * max(*gains, 2 * least)
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


def _bars(ax: Axes, bars: list[tuple[str, float, str]], least: float) -> None:
    low, limit = _ends([gain for _, gain, _ in bars[1:]], least)
    for k, (_, gain, tone) in enumerate(bars):
        ax.barh(k, min(max(gain, low), limit), color=tone, height=0.7)
        _number(ax, k, gain, low, limit)
    ax.axvline(0, color=INK, lw=0.8)
    ax.axvline(least, color=GREEN, lw=1, ls="--")
    ax.text(least, -0.75, " least evidence of a name", fontsize=8, color=GREEN, va="bottom")
    tidy(ax)
    ax.grid(axis="y", visible=False)
    ax.set_xlim(low - (ROOM_BELOW * (limit - low) if low < 0.0 else 0.0), limit)
    ax.set_ylim(len(bars) - 0.4, -0.9)
    ax.set_yticks(range(len(bars)), [name for name, _, _ in bars], fontsize=9)
    ax.set_xlabel("evidence, nats (names: beyond parameters only)", fontsize=9)


Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TONES = {"before": GREY, "parameters_only": ORANGE, "after": BLUE, "free_model": GREEN}
SMOOTH_S = 1.0
LEAST_S = 10.0  # of driving for a regime to be drawn


def against_time(errors: Mapping[str, Errors], dt: float) -> Figure:
    """Mean and standard deviation of speed and acceleration error against time, one column a simulator."""
    made = figure(10.0, 4.6)
    axes = made.subplots(2, len(errors), sharex=True, sharey="row", squeeze=False)
    made.subplots_adjust(left=0.08, right=0.985, top=0.9, bottom=0.11, wspace=0.08, hspace=0.1)
    for column, (name, e) in enumerate(errors.items()):
        time = dt * np.arange(1, e.speed.shape[1] + 1)
        for row, values in enumerate((e.speed, e.acceleration)):
            ax = axes[row, column]
            mean, sd = values.mean(axis=0), values.std(axis=0)
            ax.fill_between(time, mean - sd, mean + sd, color=TONES[name], alpha=0.3, lw=0, label="mean ± sd")
            ax.plot(time, mean, color=INK, lw=1, label="mean")
            ax.axhline(0, color=GREY, lw=0.6)
            tidy(ax)
        axes[0, column].set_title(words(name), fontsize=10, fontweight="bold", loc="left")
        axes[1, column].set_xlabel("time since the free run began, s", fontsize=9)
    axes[0, 0].set_ylabel("speed error, m/s", fontsize=9)
    axes[1, 0].set_ylabel("acceleration error, m/s²", fontsize=9)
    axes[0, 0].legend(fontsize=8, frameon=False, loc="upper left")
    return made


def by_horizon_and_regime(errors: Mapping[str, Errors], held_out: Sequence[Prepared]) -> Figure:
    """RMSE of speed against horizon, and of acceleration (means over 1 s) under different conditions."""
    dt = held_out[0].dt
    made = figure(10.0, 3.9)
    left = made.add_axes((0.07, 0.14, 0.38, 0.76))
    right = made.add_axes((0.62, 0.14, 0.36, 0.76))
    for name, e in errors.items():
        time = dt * np.arange(1, e.speed.shape[1] + 1)
        left.plot(time, np.sqrt(np.mean(e.speed**2, axis=0)), color=TONES[name], lw=1.8, label=words(name))
    tidy(left)
    left.set_ylim(bottom=0)
    left.set_xlabel("horizon, s", fontsize=9)
    left.set_title("speed error, rms, m/s", fontsize=10, loc="left")
    left.legend(fontsize=8, frameon=False)
    _regime_bars(right, errors, held_out, dt)
    return made


def _regime_bars(ax: Axes, errors: Mapping[str, Errors], held_out: Sequence[Prepared], dt: float) -> None:
    smooth = max(1, round(SMOOTH_S / dt))
    any_errors = next(iter(errors.values()))
    masks = {n: k for n, k in _conditions(any_errors, held_out).items() if k.sum() * dt >= LEAST_S}
    width = 0.8 / len(errors)
    for j, (name, e) in enumerate(errors.items()):
        power = uniform_filter1d(e.acceleration, smooth, axis=1) ** 2
        size = [float(np.sqrt(power[mask].mean())) for mask in masks.values()]
        ax.barh(np.arange(len(size)) + (j + 0.5) * width - 0.4, size, height=width, color=TONES[name])
    tidy(ax)
    ax.grid(axis="y", visible=False)
    ax.set_yticks(range(len(masks)), list(masks), fontsize=9)
    ax.invert_yaxis()
    ax.set_title("acceleration error over 1 s, rms, m/s²", fontsize=10, loc="left")


def _conditions(e: Errors, held_out: Sequence[Prepared]) -> dict[str, Mask]:
    """Conditions of driving as masks over the windows, (windows, steps) each."""

    def along(name: str) -> Array:
        steps = np.arange(e.speed.shape[1])
        rows = [
            held_out[i].recording.channels[name][s + steps] for i, s in zip(e.recording, e.start, strict=True)
        ]
        return np.nan_to_num(np.stack(rows))

    names = set.intersection(*(set(p.recording.channels) for p in held_out))
    speed = along("speed")
    slow, fast = 10.0, 18.0
    out = {
        f"below {slow:g} m/s": speed < slow,
        f"{slow:g} to {fast:g} m/s": (speed >= slow) & (speed < fast),
        f"above {fast:g} m/s": speed >= fast,
    }
    braking = along("brake_command") > 0.0 if "brake_command" in names else np.zeros_like(speed, dtype=bool)
    if "engine_command" in names:
        engine = along("engine_command")
        pulling = (engine > 0.1 * float(np.quantile(engine, 0.99))) & ~braking
        out |= {"engine pulls": pulling, "coasting": ~pulling & ~braking}
    out["braking"] = braking
    if "grade" in names:
        grade = along("grade")
        out |= {"uphill > 1 %": grade > 0.01, "level": np.abs(grade) <= 0.01, "downhill > 1 %": grade < -0.01}
    return out
