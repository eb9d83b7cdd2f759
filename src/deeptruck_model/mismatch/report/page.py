"""The page: report.html, one file that opens offline. It shows a result and decides nothing."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined

from deeptruck_core import pages
from deeptruck_core.arrays import Mask
from deeptruck_core.signals import Said, Speed, shown, speed_unit
from deeptruck_model.mismatch import folders
from deeptruck_model.mismatch.correction.fit_result import visible
from deeptruck_model.mismatch.mechanisms.families import LEFT_OVER, UNKNOWN
from deeptruck_model.mismatch.posterior.budget import Part
from deeptruck_model.mismatch.report import explorer_data, lines
from deeptruck_model.mismatch.report.found import Mismatch
from deeptruck_model.mismatch.residual.evidence import Evidence, unit
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.mismatch.verdict.result import Finding, Verdict
from deeptruck_model.mismatch.verdict.wording import ROOT, digits, opened, percent, spoken

LEAST_SHARE = 0.005  # of the budget: a smaller part has no row
ROWS = {"before": "as given", "parameters_only": "parameters refitted alone", "after": "corrected"}


def write(found: Mismatch, path: Path, command: str = "", units: str = "m/s") -> None:
    """Write the page with speeds in `units`; `command` is the one that applies the correction. Raises OSError
    if it cannot be written."""
    path.write_text(html(found, command, units=units), encoding="utf-8")


def html(found: Mismatch, command: str = "", *, units: str = "m/s") -> str:
    """The page as one text."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    content = _in_units(_content(found, command, units), units)
    return environment.from_string(_file("report.html.jinja")).render(content)


def _in_units(content: dict[str, Any], units: str) -> dict[str, Any]:
    """The content with speeds in other units: sentences, errors, and the picture's speed."""
    per = speed_unit(units)
    sentences = (
        "headline",
        "contains",
        "sizes",
        "errors_say",
        "what",
        "how_probable",
        "what_to_do",
        "caveats",
        "not_recorded",
        "where",
    )
    said = {
        name: shown(text, units) if isinstance(text, str) else [shown(line, units) for line in text]
        for name, text in content.items()
        if name in sentences
    }
    answers = [one._replace(reason=shown(one.reason, units)) for one in content["lights"]]
    findings = [
        {**f, "rows": [[shown(cell, units) for cell in row] for row in f["rows"]]}
        for f in content["findings"]
    ]
    errors = [(name, *(f"{per * float(x):.3f}" for x in cells)) for name, *cells in content["errors"]]
    changed = {"lights": answers, "errors": errors, "findings": findings}
    return {**content, **said, **changed, "units": units, "per": per}


def _file(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _content(found: Mismatch, command: str, units: str) -> dict[str, Any]:
    v, e = found.result, found.evidence
    return {
        "style": pages.shared(pages.STYLE, pages.DARK, pages.CHART_STYLE) + _file("report.css"),
        "script": pages.shared(*pages.CHARTS) + _file("explorer.js"),
        "headline": lines.headline(v),
        "contains": list(lines.contains(v)),
        "sizes": lines.sizes(v),
        "kind": opened(v.kind.replace("_", " ")),
        "not_recorded": [*lines.doubtful(v), *lines.not_recorded(v)],
        "what": list(lines.what(v)),
        "how_probable": [*lines.how_probable(v), *lines.refitted(v)],
        "what_to_do": list(lines.what_to_do(v)),
        "command": command if v.validated and not v.data.doubts else "",
        "lights": lines.lights(v),
        "budget": [_part(p) for p in v.budget.parts if p.share >= LEAST_SHARE or p.part == LEFT_OVER]
        if v.budget is not None
        else [],
        "notable": Limits.notable,
        "drives": len(v.budget.parts[0].drives) if v.budget is not None and v.budget.parts else 0,
        "findings": [_finding(f) for f in v.findings],
        "errors": [
            (name, found.errors[key].rmse().speed, np.abs(found.errors[key].speed).mean())
            for key, name in ROWS.items()
            if key in found.errors and len(found.errors[key].speed)
        ],
        "errors_say": errors_say(v),
        "tree": [
            (spoken(n.node), percent(n.probability), n.parent != ROOT)
            for n in v.tree
            if n.probability >= LEAST_SHARE
        ],
        "rejected": [(r.rule, f"{r.samples:,}", percent(x)) for r, x in lines.shares_rejected(v)],
        "caveats": v.caveats,
        "where": _where(v),
        "events": bool(v.events),
        "has_data": e is not None,
        "over_speed": force_over_speed(e, units) if e is not None else "",
        "force_unit": e.unit.name if e is not None else "",
        "data": explorer_data.text(found, e) if e is not None else "",
    }


def _part(p: Part) -> dict[str, Any]:
    most = sorted(p.drives, key=lambda d: -d.share)[:2]
    return {
        "name": spoken(p.part),
        "rest": p.part == LEFT_OVER,
        "width": f"{100.0 * max(p.share, 0.0):.2f}",
        "share": percent(p.share),
        "interval": f"{100.0 * p.low:.0f} to {100.0 * p.high:.0f} %",
        "time": percent(p.time_share) if p.part != LEFT_OVER else "",
        "drives": ", ".join(
            f"{d.recording} ({percent(d.share)} of its error)" for d in most if d.share > LEAST_SHARE
        ),
    }


def _finding(f: Finding) -> dict[str, Any]:
    rows = [("probability", lines.cause(f))]
    if f.equation:
        rows.append(("equation", f.equation))
    for name, size in f.parameters.items():
        if size.value == 0.0 and size.ci95 is None:
            continue  # a form without this point or part
        rows.append((_point(name) or name.replace("_", " "), lines.interval(size, 1.0, size.unit)))
    if f.strength is not None:
        rows.append(("force", lines.acting(f.strength)))
    if f.in_drives:
        rows.append(("in the fitted drives", ", ".join(f.in_drives)))
    if f.in_condition:
        rows.append(("mostly where", f.in_condition))
    if f.separating_manoeuvre:
        rows.append(("manoeuvre", f.separating_manoeuvre))
    return {
        "title": opened(spoken(f.effect if f.stated == ROOT or f.effect == UNKNOWN else f.stated)),
        "says": opened(f.says) + ".",
        "rows": rows,
        "curve": any(map(_point, f.parameters)),
    }


def _point(name: str) -> Said | None:
    """The name of a point of a curve with its unit, 'at speed 12.8 m/s' for 'at speed 12.8'; None for another
    parameter."""
    at, _, where = name.rpartition(" ")
    if not at.startswith("at ") or not where.lstrip("+-").replace(".", "", 1).isdecimal():
        return None
    by = unit(at.removeprefix("at "), {})
    return Said(at, " ", Speed(float(where), 3)) if by == "m/s" else Said(name, f" {by}" if by else "")


def errors_say(v: Verdict) -> str:
    """The change of the held-out error, and whether it is validated; empty without free runs."""
    if v.fit is None or v.fit.improvement is None:
        return ""
    if not v.fit.corrected:
        return f"{v.fit.windows} free runs of {v.fit.horizon_s:.0f} s. Nothing was corrected."
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
    drives = f"{len(v.fit.held_out)} held-out drive{'s' * (len(v.fit.held_out) != 1)}"
    return (
        f"{v.fit.windows} free runs of {v.fit.horizon_s:.0f} s on {drives}. There the mean error {change} "
        f"(95 % interval): {passed}."
    )


def _where(v: Verdict) -> str:
    """The segment shown first, and the regime that holds most of the error."""
    out = []
    if v.segments:
        s = v.segments[0]
        out.append(f"Largest in {s.recording}, {s.start_s:.0f} to {s.end_s:.0f} s.")
    regime = next((r for r in v.regimes if r.bounds), None)
    if regime is not None:
        out.append(
            Said(
                f"{percent(regime.share_of_error)} of the squared error is in "
                f"{percent(regime.share_of_time)} of the time, where ",
                regime.where,
                ".",
            )
        )
    return Said.joined(" ", out)


PRESSED = 0.05  # of a command's 98 % quantile
BINS, LEAST_S = 12, 10.0  # of speed, and the driving without which a bin is not drawn
MEAN_S = 2.0  # of driving in a bin, over which the force is averaged: below is sensor noise
WIDTH, HEIGHT, LEFT, BELOW, ABOVE = 640.0, 240.0, 70.0, 40.0, 12.0  # px
TICKS, MOST_TICKS = (1, 2, 5, 10, 20, 50, 100), 7
SERIES = {"pulling": "explained", "coasting": "observed"}  # the class that colours it


def force_over_speed(e: Evidence, units: str = "m/s") -> str:
    """Median and quartiles of the force that is missing, as means over MEAN_S, in bins of speed, as SVG; ''
    where nothing is compared. Forces are in `e.unit`, speeds in `units`."""
    binned = {name: list(_binned(e, rows)) for name, rows in _rows(e).items()}
    ends = [x for bins in binned.values() for _, *quartiles in bins for x in quartiles]
    if not ends:
        return ""
    low, high = min(0.0, *ends), max(0.0, *ends)
    fastest = max(speed for bins in binned.values() for speed, *_ in bins)
    wide, tall = (WIDTH - LEFT - 10.0) / (1.05 * fastest), (HEIGHT - BELOW - ABOVE) / max(high - low, 1e-9)

    def at(speed: float, force: float) -> str:
        return f"{LEFT + wide * speed:.1f},{HEIGHT - BELOW - tall * (force - low):.1f}"

    out = [f'<path class="axis" d="M{at(0.0, 0.0)} L{at(1.05 * fastest, 0.0)}"/>']
    for name, bins in binned.items():
        upper, lower = ([at(speed, q[k]) for speed, *q in bins] for k in (2, 0))
        middle = [at(speed, median) for speed, _, median, _ in bins]
        out.append(f'<polygon class="band {SERIES[name]}" points="{" ".join([*upper, *lower[::-1]])}"/>')
        out.append(f'<polyline class="line {SERIES[name]}" points="{" ".join(middle)}"/>')
        for x, y in (place.split(",") for place in middle):  # of a single bin there is no line
            out.append(f'<circle class="{SERIES[name]}" cx="{x}" cy="{y}" r="3"/>')
    for force in {low, 0.0, high}:
        x, y = at(0.0, force).split(",")
        out.append(f'<text x="{float(x) - 6.0:.0f}" y="{y}" text-anchor="end">{digits(force)}</text>')
    per = speed_unit(units)
    step = next(x for x in TICKS if per * fastest / x <= MOST_TICKS)
    for speed in range(0, int(per * fastest) + 1, step):
        x, _ = at(speed / per, low).split(",")
        out.append(f'<text x="{x}" y="{HEIGHT - BELOW + 18.0:.0f}" text-anchor="middle">{speed}</text>')
    out.append(f'<text x="{WIDTH - 10.0:.0f}" y="{HEIGHT - 4.0:.0f}" text-anchor="end">speed, {units}</text>')
    size = f'viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}"'
    says = f"Missing force in {e.unit.name} over speed, pulling and coasting"
    return f'<svg class="over" {size} role="img" aria-label="{says}">{"".join(out)}</svg>'


def _rows(e: Evidence) -> dict[str, Mask]:
    """Rows (n,) in which the engine pulls, and in which neither pedal is pressed."""
    engine, brake = (_pressed(e, name) for name in ("engine_command", "brake_command"))
    return {"pulling": visible(e) & engine & ~brake, "coasting": visible(e) & ~engine & ~brake}


def _pressed(e: Evidence, command: str) -> Mask:
    x = np.nan_to_num(e.signals.get(command, np.zeros(len(e))))
    return np.asarray(x > PRESSED * max(float(np.quantile(x, 0.98)), 1e-9))


def _binned(e: Evidence, rows: Mask) -> Iterator[tuple[float, float, float, float]]:
    """Speed, and lower quartile, median and upper quartile of the force, of each bin that is driven."""
    speed, force = e["speed"][rows], (e.newtons(e.residual) / e.mass * e.unit.scale)[rows]
    per = max(1, round(MEAN_S / e.dt))
    edges = np.linspace(0.0, float(e["speed"][e.valid].max(initial=1.0)), BINS + 1)
    for low, high in pairwise(edges):
        own = force[(speed >= low) & (speed < high) & np.isfinite(force)]
        if len(own) * e.dt >= LEAST_S:
            means = own[: len(own) // per * per].reshape(-1, per).mean(axis=1)
            q = np.quantile(means, [0.25, 0.5, 0.75])
            yield 0.5 * float(low + high), float(q[0]), float(q[1]), float(q[2])
