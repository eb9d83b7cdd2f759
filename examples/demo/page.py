"""demo/index.html: what was done, in pictures and figures."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure

from deeptruck_model.recordings import read
from examples.demo import figures, following
from examples.demo.runner import Progress
from examples.demo.steps import ROOT

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
    partial = out / ".index.html"
    partial.write_text(text, encoding="utf-8")
    partial.replace(out / "index.html")
    return out / "index.html"


def _save(figure: Figure, out: Path, name: str) -> str:
    figure.savefig(out / "figures" / name, dpi=110)
    return f"figures/{name}"


def _recording(out: Path) -> dict[str, Any]:
    picture = _save(figures.recording_figure(read(out / "drives" / "cycle")[0]), out, "recording.png")
    coverage = json.loads((out / "coverage" / "coverage.json").read_text())
    return {"picture": picture, "hours": coverage["duration_s"] / 3600}


def _learning(out: Path) -> dict[str, Any]:
    picture = _save(figures.learning_figure(out / "simulator", out / "policy"), out, "learning.png")
    return {"picture": picture}


def _open_loop(out: Path) -> dict[str, Any]:
    return _errors(out / "open_loop")


def _errors(folder: Path) -> dict[str, Any]:
    """The metrics of `deeptruck-model evaluate`, and the rows of its table."""
    metrics: dict[str, Any] = json.loads((folder / "metrics.json").read_text())
    units = {"speed": "m/s", "acceleration": "m/s²", "fuel_rate": "cm³/s"}
    rows = [(name.replace("_", " "), unit, metrics[name]) for name, unit in units.items() if name in metrics]
    return {"rows": rows, "trials": metrics["trials"], "horizon": metrics["horizon_s"]}


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
    verdict: dict[str, Any] = json.loads((out / "mismatch" / "verdict.json").read_text())
    return {
        "verdict": verdict["verdict"].replace("_", " "),
        "says": [finding["says"] for finding in verdict["findings"]],
        "fit": verdict["fit"] if "before" in verdict["fit"] else None,
    }


def _real(out: Path) -> dict[str, Any]:
    training = json.loads((out / "real" / "simulator" / "simulator.json").read_text())["training"]
    errors = _errors(out / "real" / "open_loop")
    errors["rows"] = [row for row in errors["rows"] if row[0] != "fuel rate"]  # there it is the command
    return {**errors, "hours": training["hours"]}


SECTIONS: tuple[tuple[str, tuple[str, ...], Callable[[Path], dict[str, Any]]], ...] = (
    ("recording", ("drive", "coverage"), _recording),
    ("learning", ("train", "policy"), _learning),
    ("open_loop", ("evaluate",), _open_loop),
    ("following", ("simulate", "can"), _following),
    ("mismatch", ("mismatch",), _mismatch),
    ("real", ("check",), _real),
)
