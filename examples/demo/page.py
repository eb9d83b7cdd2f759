"""demo/index.html: what was done, in pictures and figures."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure

from deeptruck_model import files
from deeptruck_model.mismatch.report import headline, page, validation, wording
from deeptruck_model.mismatch.result import Verdict
from deeptruck_model.recordings import read
from examples.demo import figures, following
from examples.demo.runner import Progress
from examples.demo.steps import ROOT

HELD_ENOUGH = 0.8  # of the points, by intervals that were to hold 90 %
HERE = Path(__file__).parent


def write(out: Path, progress: Sequence[Progress], seconds: float) -> Path:
    """Draw what is still to be drawn and write the page; sections whose steps did not run are left out."""
    done = {p.step.name for p in progress if p.state in ("done", "kept")}
    (out / "figures").mkdir(exist_ok=True)
    content: dict[str, Any] = {
        "graph": (ROOT / "docs" / "figures" / "node_graph.svg").read_text(encoding="utf-8"),
        "steps": [p for p in progress if p.step.name in done],
        "commands": {p.step.name: p.step.typed for p in progress},
        "minutes": seconds / 60,
        "pages": os.path.relpath(ROOT / "docs", out),
    }
    for name, needs, section in SECTIONS:
        content[name] = section(out) if done.issuperset(needs) else None
    environment = Environment(
        loader=FileSystemLoader(HERE), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    text = environment.get_template("page.html.jinja").render(content)
    _put(out, "index.html", text.encode())
    return out / "index.html"


def _save(figure: Figure, out: Path, name: str) -> str:
    picture = BytesIO()
    figure.savefig(picture, format="png", dpi=110)
    _put(out, f"figures/{name}", picture.getvalue())
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
    picture = _save(figures.recording_figure(read(out / "drives" / "cycle")[0]), out, "recording.png")
    coverage = json.loads((out / "coverage" / "coverage.json").read_text())
    return {"picture": picture, "hours": coverage["duration_s"] / 3600}


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
    """What is to be known of the figures beside the page, a line each."""
    judged = {"evaluate": ("the deep truck", _open_loop), "check": ("the real truck's model", _real)}
    found = [
        (name, _intervals(section(out)))
        for step, (name, section) in judged.items()
        if step in progress and progress[step].state in ("done", "kept")
    ]
    return [f"{name}: its {says}" for name, says in found if says]


def _following(out: Path) -> dict[str, Any]:
    runs = [
        following.load(out / "following" / "simulation", "simulation: deep truck, lock-step"),
        following.load(out / "following" / "can", "over CAN: physics truck behind its ECUs, real time"),
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
    verdict = Verdict.read(json.loads((out / "mismatch" / "verdict.json").read_text()))
    fit = verdict.fit
    return {
        "sentence": headline.text(verdict),
        "says": [wording.prose(finding.says) for finding in verdict.findings],
        "fit": fit.to_json() if fit is not None and fit.errors is not None else None,
        "validation": validation.said(fit),
        "names": page.ROWS,
    }


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
