"""demo/index.html: what was done, in pictures and figures."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure

from deeptruck_core import files, pages
from deeptruck_core.pages import style
from deeptruck_core.signals import sensible
from examples.demo import figures, following
from examples.demo.steps import ROOT, Step

HELD_ENOUGH = 0.8  # of the points, by intervals that were to hold 90 %
ERRORS = {
    "before": "simulator as given",
    "parameters_only": "all parameters refitted, no finding",
    "after": "corrected by the findings",
}


def write(out: Path, steps: Sequence[Step], took: Mapping[str, float], seconds: float) -> Path:
    """Draw what is still to be drawn and write the page; `took` are the seconds of each step, by name."""
    (out / "figures").mkdir(exist_ok=True)
    coverage = json.loads((out / "coverage" / "coverage.json").read_text())
    content: dict[str, Any] = {
        "graph": (ROOT / "docs" / "figures" / "node_graph.svg").read_text(encoding="utf-8"),
        "steps": steps,
        "took": took,
        "commands": {step.name: step.typed for step in steps},
        "minutes": seconds / 60,
        "docs": os.path.relpath(ROOT / "docs", out),
        "style": pages.shared(pages.STYLE, pages.DOCUMENT, pages.DARK),
        "hours": coverage["duration_s"] / 3600,
        "learning": _save(figures.learning_figure(out / "simulator", out / "policy"), out, "learning.png"),
        "open_loop": _open_loop(out / "open_loop"),
        "following": _following(out / "following"),
        "mismatch": _mismatch(out),
    }
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["sensible"] = sensible
    text = environment.get_template("page.html.jinja").render(content)
    files.write(out / "index.html", text.encode())
    return out / "index.html"


def _save(figure: Figure, out: Path, name: str) -> str:
    files.write(out / "figures" / name, style.png(figure))
    return f"figures/{name}"


def _open_loop(folder: Path) -> dict[str, Any]:
    """The metrics of `deeptruck-model evaluate`, and the rows of its table."""
    metrics: dict[str, Any] = json.loads((folder / "metrics.json").read_text())
    units = {"speed": "m/s", "acceleration": "m/s²", "fuel_rate": "cm³/s"}
    rows = [(name.replace("_", " "), unit, metrics[name]) for name, unit in units.items()]
    return {
        "rows": rows,
        "trials": metrics["trials"],
        "horizon": metrics["horizon_s"],
        "says": _intervals(rows),
    }


def _intervals(rows: Sequence[tuple[str, str, Mapping[str, float]]]) -> str:
    """What share of the points the 90 % intervals hold, and what that means."""
    shares = [100 * m["inside_90"] for _, _, m in rows]
    says = f"90 % intervals hold {min(shares):.0f} to {max(shares):.0f} % of the points"
    if min(shares) > 100 * HELD_ENOUGH:
        return says
    return f"{says}: they are too narrow here; 'deeptruck-model calibrate' sets them by more drives"


def _following(folder: Path) -> dict[str, Any]:
    runs = [following.load(folder / "simulation", "simulation"), following.load(folder / "can", "over CAN")]
    measured = [run.figures() for run in runs]
    return {
        "picture": _save(figures.following_figure(runs), folder.parent, "following.png"),
        "rows": [(name, [m[name] for m in measured]) for name in measured[0]],
        "losses": following.losses(folder / "can"),
    }


def _mismatch(out: Path) -> dict[str, Any]:
    """What the tool found and what was hidden from it: words for the page, tables and a picture."""
    verdict: dict[str, Any] = json.loads((out / "mismatch" / "verdict.json").read_text())
    hidden: dict[str, Any] = yaml.safe_load((out / "drives" / "hidden.yaml").read_text())
    force = np.genfromtxt(out / "drives" / "hidden.csv", delimiter=",", names=True)
    drive = max("abc", key=lambda name: float(np.abs(force[name]).sum()))  # where it shows best
    segments = [s for s in verdict["segments"] if s["recording"] == drive]
    fit = verdict["fit"]
    return {
        "hidden": hidden["says"],
        "headline": verdict["headline"],
        "rows": _beside(hidden, verdict["findings"]),
        "errors": [(says, fit[key]) for key, says in ERRORS.items() if key in fit],
        "horizon_s": fit.get("horizon_s"),
        "picture": _save(figures.hidden_figure(force["time"], force[drive], segments), out, "hidden.png"),
        "drive": drive,
    }


def _beside(
    hidden: Mapping[str, Any], findings: Sequence[Mapping[str, Any]]
) -> list[tuple[str, str, str, str]]:
    """Rows of name, probability and mean force while it acts: the truth, then each finding."""
    rows = [("hidden", _words(hidden["effect"]), "", _kilonewton(hidden["mean_force_n"]))]
    for f in findings:
        strength = f.get("strength") or {}
        force = _kilonewton(strength["value"]) if strength.get("unit") == "N" else ""
        rows.append(("found", _words(f["effect"]), f"{100 * f['probability']:.0f} %", force))
    return rows


def _words(name: str) -> str:
    return name.replace("_", " ")


def _kilonewton(newton: float) -> str:
    return f"{abs(newton) / 1000:.1f} kN {'against' if newton < 0 else 'with'} the motion"
