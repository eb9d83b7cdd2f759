"""demo/index.html: what was done, in pictures and figures."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
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
from examples.demo.runner import Progress
from examples.demo.steps import ROOT

HELD_ENOUGH = 0.8  # of the points, by intervals that were to hold 90 %
HERE = Path(__file__).parent
UNJUDGED = "One truck through the whole loop"


def write(out: Path, progress: Sequence[Progress], seconds: float) -> Path:
    """Draw what is still to be drawn and write the page; sections whose steps did not run are left out."""
    done = {p.step.name for p in progress if p.state in ("done", "kept")}
    (out / "figures").mkdir(exist_ok=True)
    content: dict[str, Any] = {
        "graph": (ROOT / "docs" / "figures" / "node_graph.svg").read_text(encoding="utf-8"),
        "steps": [p for p in progress if p.step.name in done],
        "commands": {p.step.name: p.step.typed for p in progress},
        "minutes": seconds / 60,
        "docs": os.path.relpath(ROOT / "docs", out),
        "style": pages.shared(pages.STYLE, pages.DOCUMENT, pages.DARK),
    }
    for name, needs, section in SECTIONS:
        content[name] = section(out) if done.issuperset(needs) else None
    content["title"] = content["mismatch"]["title"] if content["mismatch"] else UNJUDGED
    environment = Environment(
        loader=FileSystemLoader(HERE), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["sensible"] = sensible
    text = environment.get_template("page.html.jinja").render(content)
    _put(out, "index.html", text.encode())
    return out / "index.html"


def _save(figure: Figure, out: Path, name: str) -> str:
    _put(out, f"figures/{name}", style.png(figure))
    return f"figures/{name}"


def _put(out: Path, name: str, content: bytes) -> None:
    """Write a part of the page. What the user made of an older one is set aside first, and said."""
    place, known = out / name, out / "logs" / "page.json"
    prints = json.loads(known.read_text()) if known.is_file() else {}
    if place.is_file() and place.read_bytes() != content and prints.get(name) != _print(place.read_bytes()):
        kept = files.aside(place.with_name(f"{place.name}.before"))
        place.rename(kept)
        print(f"note: {place} was changed since the demo wrote it; it is kept as {kept}", file=sys.stderr)
    files.write(place, content)
    files.write(known, json.dumps({**prints, name: _print(content)}).encode())


def _print(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _recording(out: Path) -> dict[str, Any]:
    coverage = json.loads((out / "coverage" / "coverage.json").read_text())
    return {"hours": coverage["duration_s"] / 3600}


def _learning(out: Path) -> dict[str, Any]:
    picture = _save(figures.learning_figure(out / "simulator", out / "policy"), out, "learning.png")
    return {"picture": picture}


def _open_loop(out: Path) -> dict[str, Any]:
    errors = _errors(out / "open_loop")
    return {**errors, "says": _intervals(errors)}


def _errors(folder: Path) -> dict[str, Any]:
    """The metrics of `deeptruck-model evaluate`, and the rows of its table."""
    metrics: dict[str, Any] = json.loads((folder / "metrics.json").read_text())
    units = {"speed": "m/s", "acceleration": "m/s²", "fuel_rate": "cm³/s"}
    rows = [(name.replace("_", " "), unit, metrics[name]) for name, unit in units.items() if name in metrics]
    return {
        "rows": rows,
        "trials": metrics["trials"],
        "horizon": metrics["horizon_s"],
        "intervals": any("inside_90" in m for _, _, m in rows),
    }


def _intervals(errors: dict[str, Any]) -> str:
    """What share of the points the 90 % intervals hold, and what that means; empty where there are none."""
    shares = [100 * m["inside_90"] for _, _, m in errors["rows"] if "inside_90" in m]
    if not shares:
        return ""
    says = f"90 % intervals hold {min(shares):.0f} to {max(shares):.0f} % of the points"
    if min(shares) > 100 * HELD_ENOUGH:
        return says
    return f"{says}: they are too narrow here; 'deeptruck-model calibrate' sets them by more drives"


def remarks(out: Path, progress: Mapping[str, Progress]) -> list[str]:
    """What is to be known of the figures next to the page, a line each."""
    judged = {"evaluate": ("the deep truck", _open_loop), "check": ("the real truck's model", _real)}
    found = [
        (name, _intervals(section(out)))
        for step, (name, section) in judged.items()
        if step in progress and progress[step].state in ("done", "kept")
    ]
    return [f"{name}: its {says}" for name, says in found if says]


def _following(out: Path) -> dict[str, Any]:
    runs = [
        following.load(out / "following" / "simulation", "simulation"),
        following.load(out / "following" / "can", "over CAN"),
    ]
    picture = _save(figures.following_figure(runs), out, "following.png")
    measured = [run.figures() for run in runs]
    warnings = [
        f"Over CAN the bridge handed control back ({reason}), twice: the figures of that run mean nothing. "
        "Where the machine was busy, repeat it: python demo.py --again can"
        for reason in following.losses(out / "following" / "can")
    ]
    rows = [(name, [m[name] for m in measured]) for name in measured[0]]
    return {"picture": picture, "rows": rows, "warnings": warnings}


def _mismatch(out: Path) -> dict[str, Any]:
    """What the tool found and what was hidden from it: words for the page, a table and a picture."""
    verdict: dict[str, Any] = json.loads((out / "mismatch" / "verdict.json").read_text())
    hidden: dict[str, Any] = yaml.safe_load((out / "drives" / "hidden.yaml").read_text())
    force = np.genfromtxt(out / "drives" / "hidden.csv", delimiter=",", names=True)
    drive = max("abc", key=lambda name: float(np.abs(force[name]).sum()))  # where it shows best
    segments = [s for s in verdict["segments"] if s["recording"] == drive]
    picture = _save(figures.hidden_figure(force["time"], force[drive], segments), out, "hidden.png")
    errors = _fit_rows(verdict["fit"])
    return {
        "title": _result(hidden, verdict),
        "hidden": hidden["says"],
        "rows": _beside(hidden, verdict["findings"]),
        "errors": errors,
        "horizon_s": verdict["fit"].get("horizon_s"),
        "picture": picture,
        "drive": drive,
    }


def _result(hidden: Mapping[str, Any], verdict: Mapping[str, Any]) -> str:
    """The first sentence of the page: whether what was hidden was found, and what the correction brings."""
    name = _words(hidden["effect"])
    findings = verdict["findings"]
    if any(f["effect"] == hidden["effect"] for f in findings):
        found = f"The hidden {name} was found"
    elif any(hidden["effect"] in f["cannot_be_told_from"] for f in findings):
        found = f"The hidden {name} is one of several causes that were found possible"
    else:
        found = f"The hidden {name} was not found"
    fit = verdict["fit"]
    if "before" not in fit:
        return f"{found}, and no held-out drive shows the effect of a correction"
    before, after = fit["before"]["speed_rmse"], fit["after"]["speed_rmse"]
    change = f"the speed error of the simulator from {before:.2f} to {after:.2f} m/s"
    if fit["validated"]:
        return f"{found}, and its correction reduces {change}"
    return f"{found}; the correction changes {change}, which did not pass validation"


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


ERRORS = {
    "before": "simulator as given",
    "parameters_only": "all parameters refitted, no finding",
    "after": "corrected by the findings",
}


def _fit_rows(fit: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    return [
        (says, f"{fit[key]['speed_rmse']:.2f}", f"{fit[key]['acceleration_rmse']:.2f}")
        for key, says in ERRORS.items()
        if key in fit
    ]


def _words(name: str) -> str:
    return name.replace("_", " ")


def _kilonewton(newton: float) -> str:
    return f"{abs(newton) / 1000:.1f} kN {'against' if newton < 0 else 'with'} the motion"


def _real(out: Path) -> dict[str, Any]:
    training = json.loads((out / "real" / "simulator" / "simulator.json").read_text())["training"]
    errors = _errors(out / "real" / "open_loop")
    errors["rows"] = [row for row in errors["rows"] if row[0] != "fuel rate"]  # there it is the command
    return {**errors, "hours": training["hours"], "says": _intervals(errors)}


SECTIONS: tuple[tuple[str, tuple[str, ...], Callable[[Path], dict[str, Any]]], ...] = (
    ("recording", ("drive", "coverage"), _recording),
    ("learning", ("train", "policy"), _learning),
    ("open_loop", ("evaluate",), _open_loop),
    ("following", ("simulate", "can"), _following),
    ("mismatch", ("mismatch",), _mismatch),
    ("real", ("check",), _real),
)
