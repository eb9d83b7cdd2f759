"""The page of a fleet: a row for each truck, with what its command said. It decides nothing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, StrictUndefined

from deeptruck_core import pages
from deeptruck_core.reading import typed

REPORTS = {"mismatch": "report.html", "train": "MODEL_CARD.md"}
HEAD = {
    "import": (),
    "train": ("speed error on held-out driving, m/s",),
    "mismatch": ("speed error on held-out driving, m/s", "of the offered simulator, m/s"),
}


def page(done: Mapping[str, Mapping[str, Any]], out: Path) -> str:
    """The page of the jobs in fleet.json of the folder `out`; those that failed come first."""
    rows = sorted(
        (_row(name, job, out) for name, job in done.items()), key=lambda r: (not r["failed"], r["name"])
    )
    failed = sum(bool(row["failed"]) for row in rows)
    commands = sorted({row["command"] for row in rows})
    title = f"{', '.join(commands)}: {len(rows) - failed} of {len(rows)} done"
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = resources.files(__package__).joinpath("fleet.html.jinja").read_text(encoding="utf-8")
    return environment.from_string(template).render(
        style=pages.shared(pages.STYLE, pages.DOCUMENT, pages.DARK),
        title=title + (f", {failed} failed" if failed else ""),
        head=max((HEAD[command] for command in commands), key=len),
        rows=rows,
    )


def _row(name: str, job: Mapping[str, Any], out: Path) -> dict[str, Any]:
    command, failed = job["words"][0], job["failed"]
    report = f"{name}/{REPORTS.get(command, '')}"
    says, errors = next(iter(job["says"]), ""), list[float | None]()
    if command == "mismatch" and not failed:
        verdict = json.loads((out / name / "verdict.json").read_text())
        says, fit = verdict["headline"], verdict["fit"]
        offered = {"as_given": "before", "correction": "after"}.get(fit.get("offered"), "parameters_only")
        errors = [fit.get(which, {}).get("speed_rmse") for which in ("before", offered)]
    elif command == "train" and not failed:
        metrics = json.loads((out / name / "metrics.json").read_text())
        errors = [metrics["speed"]["mean_abs"]]
    return {
        "command": command,
        "name": name,
        "report": quote(report) if (out / report).is_file() else "",
        "failed": failed,
        "says": failed or says,
        "typed": " ".join(["deeptruck-model", *map(typed, job["words"])]),
        "errors": ["" if error is None else f"{error:.3f}" for error in errors],
    }
