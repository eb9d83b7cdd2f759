"""The table of an evaluation, for the terminal, and evaluation.html with it and the figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from deeptruck_core.pages.document import Picture, Table, document

HEAD = (
    "scene",
    "time-gap error (s)",
    "worst",
    "in reach",
    "speed error (m/s)",
    "worst",
    "crashes",
    "min gap (m)",
    "jerk rms (m/s³)",
    "brake pulses/h",
    "l/100 km",
    "shield %",
)
MEANS = (
    "Time-gap errors count after 10 s, speed errors after 25 s: mean, and the worst of all runs and times. "
    "In reach: the worst time-gap error where the engine could have held the gap. "
    "Shield %: the share of the time in which it acted."
)
FIRST = "long_following"  # the picture to begin with
PICTURES = {
    FIRST: "Behind a moving leader on hills, as in the paper's field run.",
    "gap_closing": "Closing a gap, as in the paper's field run.",
    "learning_curve": "Learning curve.",
    "string_stability": "Amplification along a platoon of eight trucks.",
}


def rows(results: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """One row per scene for the policy, then for each baseline that was driven."""
    scenes = dict(results["sets"])
    for law, sets in results["baselines"].items():
        scenes |= {f"{law}: {name}": numbers for name, numbers in sets.items()}
    return [(name, *_cells(numbers)) for name, numbers in scenes.items()]


def _cells(numbers: Mapping[str, Any]) -> tuple[str, ...]:
    gap, speed = numbers["time_gap_error_after_10s"], numbers["speed_error_after_25s"]
    reach, litres = numbers.get("time_gap_worst_within_reach"), numbers["fuel_l_per_100km"]
    return (
        f"{gap['mean']:+z.3f}",
        f"{gap['worst_abs']:.3f}",
        "-" if reach is None else f"{reach:.3f}",
        f"{speed['mean']:+z.3f}",
        f"{speed['worst_abs']:.3f}",
        str(numbers["crashes"]),
        f"{numbers['min_gap_m']:.1f}",
        f"{numbers['jerk_rms']:.2f}",
        f"{numbers['brake_pulses_per_h']:.0f}",
        "-" if litres is None else f"{litres:.1f}",
        f"{100 * numbers['shield_share']:.1f}",
    )


def table(results: Mapping[str, Any]) -> Any:
    """The rows as a rich table."""
    from rich.table import Table as RichTable

    view = RichTable(title=f"{results['policy']} on {results['simulator']}")
    for k, head in enumerate(HEAD):
        view.add_column(head, justify="right" if k else "left")
    for row in rows(results):
        view.add_row(*row)
    return view


def page(results: Mapping[str, Any], folder: Path) -> str:
    """The page: three numbers and a picture first, then all scenes in a table and the figures in `folder`."""
    about = f"Policy {results['policy']} on {results['simulator']}."
    shield = ["The shield stood before policy and baselines."] if results["shield"] else []
    pictures = {
        p.stem: Picture(p.read_bytes(), PICTURES.get(p.stem, f"Errors in '{p.stem}' over time."))
        for p in sorted(folder.glob("*.png"))
    }
    first = pictures.pop(FIRST)
    tables = [Table("All scenes, and baselines in them", HEAD, tuple(rows(results)))]
    if platoon := results.get("platoon"):
        amplified = []  # for each controller that drives all eight trucks
        for driver, run in platoon.items():
            most, at = max(zip(run["worst_speed_amplification"], run["frequency_hz"], strict=True))
            amplified.append((driver, f"{most:.3f}", f"{at:.3f}"))
        head = ("eight trucks", "speed amplification, worst", "at (Hz)")
        says = "A disturbance grows where the amplification is above 1."
        tables.append(Table(says, head, tuple(amplified)))
    return document(_judgement(results), [about, *shield, MEANS], [first, *tables, *pictures.values()])


def _judgement(results: Mapping[str, Any]) -> str:
    """One sentence on time-gap error, smallest gap and crashes over all scenes, compared with the ACC
    baseline."""
    scenes, acc = results["sets"], results["baselines"].get("acc")
    gap = f"{_mean_error(scenes):.3f} s" + (f" (ACC: {_mean_error(acc):.3f} s)" if acc else "")
    crashes = sum(x["crashes"] for x in scenes.values())
    count = {0: "no crash", 1: "1 crash"}.get(crashes, f"{crashes} crashes")
    least = min(x["min_gap_m"] for x in scenes.values())
    return f"Mean time-gap error {gap}, smallest gap {least:.1f} m, {count}."


def _mean_error(scenes: Mapping[str, Any]) -> float:
    """Mean magnitude of the time-gap error, each scene with equal weight, s."""
    each = [x["time_gap_error_after_10s"]["mean_abs"] for x in scenes.values()]
    return float(sum(each) / len(each))
