"""The page: a figure, tables, and for each effect and recipe whether the correction had a benefit."""

from __future__ import annotations

import json
import textwrap
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from benchmarks.benefit.effects import STOPS
from benchmarks.benefit.plan import FIGURES, PAGE, PICTURE

mpl.use("Agg")
import matplotlib.pyplot as plt

KINDS = ("old", "corrected", "true")
COLOURS = {"old": "tab:red", "corrected": "tab:blue", "true": "0.45"}
CLEARLY, WORTH_S = 0.9, 0.005  # a ratio of medians above, or seconds below, are no difference worth a word
FOUND = ("effect", "the truck has", "the tool found", "free-run speed error: old, re-tuned, corrected (m/s)")
FOLLOWED = (
    *("effect", "recipe", "time-gap error, rms (s)", "benefit", "its mean (s)", "benefit"),
    *("speed, rms (m/s)", "jerk, rms (m/s³)", "brake (%)"),
)
STOPPED = ("effect", "recipe", "runs that end below 2 m", "least gap (m)", "benefit", "brake (%)")
UNITS = {"time_gap_rms_s": "time-gap error, rms [s]", "min_gap_m": "least gap [m]"}

Kinds = dict[str, list[dict[str, Any]]]  # old, corrected, true: for each seed, what it did in each scene


def write(results: dict[str, Any], out: Path) -> None:
    """Write benefit.json, benefit.md and benefit.png under `out`."""
    (out / FIGURES).write_text(json.dumps(results, indent=1) + "\n")
    _draw(results, out / PICTURE)
    (out / PAGE).write_text(page(results))


def page(results: dict[str, Any]) -> str:
    """The tables in Markdown; three numbers are the medians over the seeds for the old, corrected and true
    simulator."""
    found = [_found(name, row) for name, row in results.items()]
    cases = [
        (name, recipe, kinds)
        for name, row in results.items()
        for recipe, kinds in row["recipes"].items()
        if all(kind in kinds for kind in KINDS)
    ]
    followed = [_followed(*case) for case in cases]
    stopped = [_stopped(*case) for case in cases if _stop(case[2])]
    return "\n".join(
        [*_table(FOUND, found), "", *_table(FOLLOWED, followed), "", *_table(STOPPED, stopped), ""]
    )


def _table(heads: tuple[str, ...], rows: list[list[str]]) -> list[str]:
    return [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|", *(f"| {' | '.join(r)} |" for r in rows)]


def _found(name: str, row: dict[str, Any]) -> list[str]:
    errors = ", ".join("-" if e is None else f"{e:.2f}" for e in row["free_run_speed_rmse"].values())
    found = (", ".join(row["found"]) or "nothing") + ("" if row["applied"] else ", refused")
    return [name, row["says"], found, errors]


def _followed(name: str, recipe: str, kinds: Kinds) -> list[str]:
    scene = next(iter(kinds["old"][0]))
    cells: list[str] = []
    for key, form in (("time_gap_rms_s", "{:.3f}"), ("time_gap_mean_s", "{:+.3f}")):
        cells += [_three(kinds, scene, key, form), paid(kinds, scene, key)]
    cells += [_three(kinds, scene, *what) for what in (("speed_rms", "{:.2f}"), ("jerk_rms", "{:.2f}"))]
    return [name, recipe, *cells, _three(kinds, scene, "brake_share", "{:.1f}", 100.0)]


def _stopped(name: str, recipe: str, kinds: Kinds) -> list[str]:
    scene = _stop(kinds)
    below = [sum(int(seed[scene]["below_safety"]) for seed in kinds[kind]) for kind in KINDS]
    runs = sum(int(seed[scene]["rollouts"]) for seed in kinds["old"])
    counts = f"{', '.join(map(str, below))} of {runs}"
    says = "yes" if below[1] < below[0] else "no" if below[1] > below[0] else "no difference"
    brake = _three(kinds, scene, "brake_share", "{:.1f}", 100.0)
    return [name, recipe, counts, _least(kinds, scene), says, brake]


def _stop(kinds: Kinds) -> str:
    """The case's scene with a stop, or an empty text."""
    return next((scene for scene in kinds["old"][0] if scene in STOPS), "")


def _least(kinds: Kinds, scene: str) -> str:
    return ", ".join(f"{min(values(kinds[kind], scene, 'min_gap_m')):.1f}" for kind in KINDS)


def _three(kinds: Kinds, scene: str, key: str, form: str, factor: float = 1.0) -> str:
    return ", ".join(form.format(factor * np.median(values(kinds[kind], scene, key))) for kind in KINDS)


def values(seeds: list[dict[str, Any]], scene: str, key: str) -> list[float]:
    """One figure of every seed."""
    return [float(seed[scene][key]) for seed in seeds]


def paid(kinds: Kinds, scene: str, key: str) -> str:
    """Whether the policies of the corrected simulator have the smaller error, and the ratio of the medians.

    'yes' if every seed beats every seed of the old simulator, 'no' if every seed is worse; 'unclear'
    otherwise.
    """
    old, corrected = (np.abs(values(kinds[kind], scene, key)) for kind in ("old", "corrected"))
    ratio = float(np.median(corrected) / np.median(old))
    if CLEARLY < ratio < 1 / CLEARLY or abs(np.median(corrected) - np.median(old)) < WORTH_S:
        word = "no difference"
    elif max(corrected) < min(old):
        word = "yes"
    else:
        word = "no" if min(corrected) > max(old) else "unclear"
    return f"{word}, x {ratio:.2f}"


def _draw(results: dict[str, Any], path: Path) -> None:
    """One row for each recipe with errors of following, and one for the stop; a column for each effect."""
    recipes = list(dict.fromkeys(recipe for row in results.values() for recipe in row["recipes"]))
    size = 2.3 * len(results) + 1.2, 2.0 * (len(recipes) + 1) + 0.6
    figure, axes = plt.subplots(
        len(recipes) + 1, len(results), figsize=size, squeeze=False, layout="constrained"
    )
    for axis, (name, row) in zip(axes.T, results.items(), strict=True):
        says = textwrap.fill(row["says"], 28)
        axis[0].set_title(f"{name.replace('_', ' ')}\n{says}", fontsize="small")
        kinds = [row["recipes"].get(recipe, {}) for recipe in recipes]
        for i, of_recipe in enumerate(kinds):
            _panel(axis[i], of_recipe, 0, "time_gap_rms_s")
        _panel(axis[-1], _together(kinds), 1, "min_gap_m")
    for i, label in enumerate(
        [*(f"{r}\n{UNITS['time_gap_rms_s']}" for r in recipes), f"stop, all\n{UNITS['min_gap_m']}"]
    ):
        axes[i, 0].set_ylabel(label, fontsize="small")
    figure.suptitle(
        "Trained on each simulator, driven on the true truck; dots are seeds (x: mean error), lines medians",
        fontsize=10,
    )
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _together(kinds: list[Kinds]) -> Kinds:
    """The figures of all recipes' seeds."""
    return {
        kind: [seed for k in kinds for seed in k.get(kind, [])]
        for kind in KINDS
        if any(kind in k for k in kinds)
    }


def _panel(axis: Any, kinds: Kinds, scene: int, key: str) -> None:
    """Dots for every kind in the case's first (following) or second (stop) scene; empty where it has none."""
    shown = [kind for kind in KINDS if kinds.get(kind) and len(kinds[kind][0]) > scene]
    if not shown:
        axis.set(xticks=[], yticks=[], frame_on=False)
        return
    name = list(kinds[shown[0]][0])[scene]
    columns = [values(kinds[kind], name, key) for kind in shown]
    for x, (kind, column) in enumerate(zip(shown, columns, strict=True)):
        axis.plot([x] * len(column), column, "o", ms=5, color=COLOURS[kind], alpha=0.7)
        if key == "time_gap_rms_s":
            shift = np.abs(values(kinds[kind], name, "time_gap_mean_s"))
            axis.plot([x + 0.2] * len(column), shift, "x", ms=4, color=COLOURS[kind], alpha=0.7)
    axis.plot(range(len(shown)), [np.median(column) for column in columns], "k-", lw=0.8)
    axis.set_xticks(range(len(shown)), shown, fontsize="small")
    axis.set_xlim(-0.5, len(shown) - 0.5)
    axis.grid(axis="y", color="0.9")
    if key == "min_gap_m":
        axis.axhline(2.0, color="tab:red", lw=0.8, ls="--")
    else:
        axis.set_ylim(0.0, 1.15 * max(max(column) for column in columns))
