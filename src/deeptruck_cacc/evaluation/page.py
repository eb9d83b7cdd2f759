"""evaluation.html: how a policy drives, its numbers and figures on one page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from deeptruck_cacc.evaluation import overview
from deeptruck_model.pages.document import Picture, Table, document


def page(results: Mapping[str, Any], folder: Path) -> str:
    """All scenes side by side, the numbers of metrics.json, one table a scene, and the folder's figures."""
    scenes = results["sets"]
    first = f"The policy {results['policy']} was driven on {results['simulator']} in {len(scenes)} scenes."
    shield = ["The shield stood before policy and baselines."] if results["shield"] else []
    tables = [Table("All scenes", overview.HEAD, tuple(overview.rows(results)))]
    if platoon := overview.platoon_rows(results):
        tables.append(
            Table("A disturbance grows where the amplification is above 1.", overview.PLATOON, tuple(platoon))
        )
    tables += [_scene(name, numbers) for name, numbers in scenes.items()]
    pictures = [Picture(p.read_bytes(), _words(p.stem)) for p in sorted(folder.glob("*.png"))]
    return document(first, [*shield, overview.MEANS], tables, pictures)


def _scene(name: str, numbers: Mapping[str, Any]) -> Table:
    return Table(_words(name), ("number", "value"), tuple(_rows(numbers)))


def _rows(numbers: Mapping[str, Any], before: str = "") -> list[tuple[str, ...]]:
    """A row a number, those further inside behind the name that holds them."""
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
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _words(name: str) -> str:
    return name.replace("_", " ")
