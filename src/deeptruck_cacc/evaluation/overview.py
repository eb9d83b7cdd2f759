"""Comparison of all scenes and baselines, one row each, for terminal and page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

Row = tuple[str, ...]

HEAD: Row = (
    "scene",
    "time-gap error (s)",
    "worst",
    "in reach",
    "speed error (m/s)",
    "worst",
    "crashes",
    "min gap (m)",
    "jerk rms (m/s³)",
    "l/100 km",
    "shield %",
)
MEANS = (
    "Time-gap errors count after 10 s, speed errors after 25 s: mean, and the worst of all runs and times. "
    "In reach: the worst time-gap error where the engine could have held the gap. "
    "Shield %: the share of the time in which it acted."
)
BEST: Row = (
    "scene",
    "policy (s)",
    "crashes",
    "best baseline",
    "its error (s)",
    "its crashes",
    "difference (s)",
    "95 % interval",
)
BEST_MEANS = (
    "Against the best baseline of each scene: the mean over rollouts of the worst time-gap error where the "
    "engine could have held the gap. Above zero the policy is worse."
)
PLATOON: Row = ("eight trucks", "speed amplification, worst", "at (Hz)")


def rows(results: Mapping[str, Any]) -> list[Row]:
    """One row per scene for the policy, then for each baseline that was driven."""
    scenes = dict(results["sets"])
    for law, sets in results.get("baselines", {}).items():
        scenes |= {f"{law}: {name}": numbers for name, numbers in sets.items()}
    return [(name, *_cells(numbers)) for name, numbers in scenes.items()]


def _cells(numbers: Mapping[str, Any]) -> Iterator[str]:
    gap, speed = numbers["time_gap_error_after_10s"], numbers["speed_error_after_25s"]
    yield f"{gap['mean']:+z.3f}"
    yield f"{gap['worst_abs']:.3f}"
    yield _number(numbers.get("time_gap_worst_within_reach"), 3)
    yield f"{speed['mean']:+z.3f}"
    yield f"{speed['worst_abs']:.3f}"
    yield str(numbers["crashes"])
    yield f"{numbers['min_gap_m']:.1f}"
    yield f"{numbers['jerk_rms']:.2f}"
    yield _number(numbers["fuel_l_per_100km"], 1)
    yield f"{100 * numbers['shield_share']:.1f}"


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def best_rows(results: Mapping[str, Any]) -> list[Row]:
    """One row per scene: the policy, the best baseline, and by how much the policy is worse."""
    return [
        (
            name,
            f"{row['policy_s']:.3f}",
            str(row["policy_crashes"]),
            row["best"],
            f"{row['best_s']:.3f}",
            str(row["best_crashes"]),
            f"{row['difference_s']:+z.3f}",
            f"{row['low_s']:+z.3f} to {row['high_s']:+z.3f}",
        )
        for name, row in results.get("against_best", {}).items()
    ]


def platoon_rows(results: Mapping[str, Any]) -> list[Row]:
    """For each controller that drives all eight trucks, the largest amplification of speed from one truck to
    the next."""
    out: list[Row] = []
    for driver, run in results.get("platoon", {}).items():
        most = max(run["worst_speed_amplification"])
        at = run["frequency_hz"][run["worst_speed_amplification"].index(most)]
        out.append((driver, f"{most:.3f}", f"{at:.3f}"))
    return out


def table(results: Mapping[str, Any]) -> Any:
    """The rows as a rich table."""
    return _table(f"{results['policy']} on {results['simulator']}", HEAD, rows(results))


def best_table(results: Mapping[str, Any]) -> Any:
    """`best_rows` as a rich table."""
    return _table(BEST_MEANS, BEST, best_rows(results))


def _table(title: str, heads: Row, cells: list[Row]) -> Any:
    from rich.table import Table

    view = Table(title=title)
    for head in heads:
        view.add_column(head, justify="left" if head == heads[0] else "right")
    for row in cells:
        view.add_row(*row)
    return view
