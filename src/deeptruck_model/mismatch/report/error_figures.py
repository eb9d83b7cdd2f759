"""Open-loop errors on held-out recordings: against time as the paper draws them, by horizon and by regime."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from deeptruck_model.mismatch.report.drawing import BLUE, GREEN, GREY, INK, ORANGE, figure, tidy, words

if TYPE_CHECKING:
    from deeptruck_model.mismatch.correction.improvement import Errors
    from deeptruck_model.mismatch.data.prepared import Prepared

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
