"""evaluation.html: numbers and figures of an evaluation on one page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from deeptruck_cacc.evaluation import overview
from deeptruck_core.pages.document import Folded, Picture, Table, document
from deeptruck_core.signals import sensible

FIRST = "long_following"  # the picture to begin with
PICTURES = {
    "long_following": "Behind a moving leader on hills, as in the paper's field run.",
    "gap_closing": "Closing a gap, as in the paper's field run.",
    "learning_curve": "Learning curve.",
    "string_stability": "Amplification along a platoon of eight trucks.",
}


def page(results: Mapping[str, Any], folder: Path) -> str:
    """The page: three numbers and a picture first, then all scenes in a table, and each scene with its
    figure, collapsed."""
    scenes = results["sets"]
    about = f"Policy {results['policy']} on {results['simulator']}."
    shield = ["The shield stood before policy and baselines."] if results["shield"] else []
    pictures = {
        p.stem: Picture(p.read_bytes(), PICTURES.get(p.stem, f"Errors in '{_words(p.stem)}' over time."))
        for p in sorted(folder.glob("*.png"))
    }
    first = [pictures.pop(FIRST)] if FIRST in pictures else []
    tables = [Table("All scenes, and baselines in them", overview.HEAD, tuple(overview.rows(results)))]
    if best := overview.best_rows(results):
        tables.insert(0, Table(overview.BEST_MEANS, overview.BEST, tuple(best)))
    if platoon := overview.platoon_rows(results):
        tables.append(
            Table("A disturbance grows where the amplification is above 1.", overview.PLATOON, tuple(platoon))
        )
    folded = [
        Folded(
            f"Scene: {_words(name)}",
            [_scene(name, numbers), *([pictures.pop(name)] if name in pictures else [])],
        )
        for name, numbers in scenes.items()
    ]
    rest = [Folded(picture.says.rstrip("."), [picture]) for picture in pictures.values()]
    return document(judgement(results), [about, *shield, overview.MEANS], [*first, *tables, *folded, *rest])


def judgement(results: Mapping[str, Any]) -> str:
    """One sentence on time-gap error, smallest gap and crashes over all scenes, compared with the ACC
    baseline."""
    scenes = results["sets"]
    gap = f"{_mean_error(scenes):.3f} s"
    baseline = results.get("baselines", {}).get("acc")
    by_acc = ""
    if baseline and baseline.keys() == scenes.keys():
        gap += f" (ACC: {_mean_error(baseline):.3f} s)"
    elif baseline:
        shared = {name: scenes[name] for name in baseline if name in scenes}
        ours, theirs = _mean_error(shared), _mean_error(baseline)
        by_acc = f" In the {len(shared)} scenes driven by ACC too: {ours:.3f} s, and {theirs:.3f} s with ACC."
    crashes = sum(x["crashes"] for x in scenes.values())
    count = {0: "no crash", 1: "1 crash"}.get(crashes, f"{crashes} crashes")
    least = min(x["min_gap_m"] for x in scenes.values())
    return f"Mean time-gap error {gap}, smallest gap {least:.1f} m, {count}.{by_acc}"


def _mean_error(scenes: Mapping[str, Any]) -> float:
    """Mean magnitude of the time-gap error, each scene with equal weight, s."""
    each = [x["time_gap_error_after_10s"]["mean_abs"] for x in scenes.values()]
    return float(sum(each) / len(each))


def _scene(name: str, numbers: Mapping[str, Any]) -> Table:
    return Table(_words(name), ("number", "value"), tuple(_rows(numbers)))


def _rows(numbers: Mapping[str, Any], before: str = "") -> list[tuple[str, ...]]:
    """One row for each number; nested numbers are prefixed with the name of their group."""
    out: list[tuple[str, ...]] = []
    for name, value in numbers.items():
        if isinstance(value, Mapping):
            out += _rows(value, f"{before}{_words(name)}: ")
        elif not isinstance(value, list):
            out.append((before + _words(name), _text(value)))
    return out


def _text(value: Any) -> str:
    if value is None:
        return "not known"
    return sensible(value) if isinstance(value, float) else str(value)


def _words(name: str) -> str:
    return name.replace("_", " ")
