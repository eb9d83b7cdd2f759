"""The page: report.html, one file that opens offline. It shows a result and decides nothing."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined

from deeptruck_core import pages
from deeptruck_core.signals import Said, Speed, shown, speed_unit
from deeptruck_model.mismatch import folders
from deeptruck_model.mismatch.correction.fit_result import Errors
from deeptruck_model.mismatch.mechanisms.families import LEFT_OVER, ROOT, UNKNOWN
from deeptruck_model.mismatch.posterior.budget import Part
from deeptruck_model.mismatch.report import explorer_data, lines
from deeptruck_model.mismatch.report.found import Mismatch
from deeptruck_model.mismatch.report.pictures import picture
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.mismatch.verdict.result import Finding, Verdict
from deeptruck_model.mismatch.verdict.wording import opened, percent, spoken

LEAST_SHARE = 0.005  # of the budget: a smaller part has no row
ROWS = {"before": "as given", "parameters_only": "parameters refitted alone", "after": "corrected"}


def write(found: Mismatch, path: Path, command: str = "", units: str = "m/s") -> None:
    """Write the page with speeds in `units`; `command` is the one that applies the correction. Raises OSError
    if it cannot be written."""
    path.write_text(html(found, command, units=units), encoding="utf-8")


def html(found: Mismatch, command: str = "", *, units: str = "m/s") -> str:
    """The page as one text."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        finalize=lambda text: shown(text, units),
    )  # fmt: skip
    return environment.from_string(_file("report.html.jinja")).render(_content(found, command, units))


def _file(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _content(found: Mismatch, command: str, units: str) -> dict[str, Any]:
    v, e = found.result, found.evidence
    worst = explorer_data.worst(found)
    parts = v.budget.parts if v.budget is not None else ()
    return {
        "style": pages.shared(pages.STYLE, pages.DARK, pages.CHART_STYLE) + _file("report.css"),
        "script": pages.shared(*pages.CHARTS) + _file("explorer.js"),
        "units": units,
        "per": speed_unit(units),
        "headline": lines.headline(v),
        "sizes": [*lines.contains(v), *filter(None, [lines.sizes(v)])],
        "not_recorded": [*lines.doubtful(v), *lines.not_recorded(v)],
        "what": list(lines.what(v)),
        "how_probable": list(lines.how_probable(v)) or [opened(v.kind.replace("_", " "))],
        "what_to_do": list(lines.what_to_do(v)),
        "command": command if v.validated and not v.data.doubts else "",
        "advice": [(lines.QUESTIONS[name], a) for name, a in v.advice.items()],
        "where": worst.says if worst is not None else "",
        "has_data": e is not None,
        "data": explorer_data.text(found, e, worst) if e is not None else "",
        "findings": [_finding(found, f, units) for f in v.findings],
        "picture": None if v.findings else picture(found, None, units),
        "budget": [_part(p) for p in parts if p.share >= LEAST_SHARE or p.part == LEFT_OVER],
        "notable": Limits.notable,
        "errors": [_errors(ROWS[key], x) for key, x in found.errors.items() if key in ROWS and len(x.speed)],
        "errors_say": errors_say(v),
        "tree": [
            (spoken(n.node), percent(n.probability), n.parent != ROOT)
            for n in v.tree
            if n.probability >= LEAST_SHARE
        ],
        "rejected": [(r.rule, f"{r.samples:,}", percent(x)) for r, x in lines.shares_rejected(v)],
        "caveats": v.caveats,
    }


def _errors(name: str, x: Errors) -> tuple[str, ...]:
    each = (x.rmse().speed, float(np.abs(x.speed).mean()))
    return (name, *(Said(Speed(one, 3, with_unit=False)) for one in each))


def _part(p: Part) -> dict[str, Any]:
    most = sorted(p.drives, key=lambda d: -d.share)[:2] if len(p.drives) > 1 else []
    return {
        "name": spoken(p.part),
        "rest": p.part == LEFT_OVER,
        "width": f"{100.0 * max(p.share, 0.0):.2f}",
        "share": lines.share_of(p).partition(" (")[0],
        "interval": f"{100.0 * p.low:.0f} to {100.0 * p.high:.0f} %",
        "time": percent(p.time_share) if p.part != LEFT_OVER else "",
        "drives": ", ".join(f"{d.recording} {percent(d.share)}" for d in most if d.share > LEAST_SHARE),
    }


def _finding(found: Mismatch, f: Finding, units: str) -> dict[str, Any]:
    rows = {
        "probability": lines.cause(f),
        "size": lines.size(f),
        "force": f"acts in {percent(f.strength.share_of_time)} of the time" if f.strength is not None else "",
        "equation": f.equation,
        "in the fitted drives": ", ".join(f.in_drives),
        "mostly where": f.in_condition,
        "each name alone would need": Said.joined(
            "; ",
            [Said(f"{spoken(a.name)} ", lines.sized(a.size, sign=True)) for a in f.alternatives if a.size],
        ),
        "to confirm it": f.separating_manoeuvre,
    }
    named = f.stated != ROOT and f.effect != UNKNOWN
    return {
        "title": opened(spoken(f.stated if named else f.effect)),
        "says": opened(f.says) + ".",
        "rows": {name: text for name, text in rows.items() if text},
        "picture": picture(found, f, units),
    }


def errors_say(v: Verdict) -> str:
    """The change of the held-out error, and whether it is validated; empty without free runs."""
    if v.fit is None or v.fit.improvement is None:
        return ""
    drives = f"{len(v.fit.held_out)} held-out drive{'s' * (len(v.fit.held_out) != 1)}"
    runs = f"{v.fit.windows} free runs of {v.fit.horizon_s:.0f} s on {drives}."
    if not v.fit.corrected:
        return f"{runs} Nothing was corrected."
    low, high = (100.0 * x for x in v.fit.improvement.ci95)
    if low > 0.0:
        change = f"falls by {low:.0f} to {high:.0f} %"
    elif high > 0.0:
        change = f"is between {high:.0f} % lower and {-low:.0f} % higher"
    else:
        change = f"rises by {-high:.0f} to {-low:.0f} %"
    together = " by all drives together, the fitted ones left out in turn" if low <= 0.0 else ""
    if v.fit.validated:
        passed = f"validated{together}"
    elif low <= 0.0 < high:
        passed = f"{folders.NOT_SIGNIFICANT}; not validated"
    else:
        passed = "not validated" + (f", for the reason at '{lines.QUESTIONS['apply']}'" if low > 0.0 else "")
    return f"{runs} There the mean error {change} (95 % interval): {passed}."
