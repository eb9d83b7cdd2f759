"""The picture of a finding: what is missing over its law's own variable, the law through it, its rival."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import lsq_linear

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.signals import printed, speed_unit
from deeptruck_model.mismatch.correction.fit_result import visible
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.terms import candidate_terms
from deeptruck_model.mismatch.report.found import Mismatch
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.mismatch.verdict.result import Finding
from deeptruck_model.mismatch.verdict.wording import digits, spoken

BINS, LEAST_ROWS, BLOCKS = (
    14,
    20,
    8,
)  # of the variable; in a bin; of a bin, by which its standard error is known
TAIL = 0.02  # of the rows at either end of the variable, which are not drawn
PRESSED = 0.1  # m/s^2 of the brakes
WIDTH, HEIGHT, LEFT, BELOW, ABOVE = 640.0, 240.0, 74.0, 40.0, 12.0  # px


@dataclass(frozen=True)
class Picture:
    """An SVG with what it shows in words: the force, its variable, and the rival that is drawn, if any."""

    svg: str
    force: str
    over: str
    law: str
    rival: str


def picture(found: Mismatch, f: Finding | None, units: str = "m/s") -> Picture | None:
    """The picture of a finding, or of all that is missing over speed without one; None where nothing is
    compared or the finding has no force. Speeds are in `units`."""
    e = found.evidence
    if e is None or (f is not None and f.force is None):
        return None
    name, x = _variable(e, f)
    use = visible(e) & np.isfinite(x)
    others = [one.force for one in found.findings if one is not f and one.force is not None]
    missing = e.residual - (np.sum(others, axis=0) if f is not None and others else 0.0)
    rival = next(iter(f.rivals), "") if f is not None else ""
    fitted = _fitted(e, rival, missing, use) if rival else None
    curves = {"explained": f.force if f is not None else None, "rival": fitted}
    drawn = _drawn(e, x * (speed_unit(units) if name == "speed" else 1.0), missing, curves, use)
    if not drawn:
        return None
    over = f"{name}, {units if name == 'speed' else VARIABLES[name][0]}".rstrip(", ")
    size = f'viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" role="img" aria-label="Missing force over {over}"'
    end = f'<text x="{WIDTH - 10.0:.0f}" y="{HEIGHT - 4.0:.0f}" text-anchor="end">{over}</text>'
    return Picture(
        f'<svg class="over" {size}>{drawn}{end}</svg>',
        printed(e.unit.name),
        over,
        spoken(f.effect) if f is not None else "",
        spoken(rival) if fitted is not None else "",
    )


VARIABLES: Mapping[str, tuple[str, Callable[[Evidence], Array]]] = {  # that are drawn over, with their units
    "speed": ("", lambda e: e["speed"]),
    "gap": ("m", lambda e: e["gap"]),
    "gear": ("", lambda e: e["gear"]),
    "elevation": ("m", lambda e: e["elevation"]),
    "engine speed": ("rad/s", lambda e: e["engine_speed"]),
    "engine force per mass": ("m/s²", lambda e: e["engine"]),
    "brake force per mass": ("m/s²", lambda e: e["brake"]),
    "simulated acceleration": ("m/s²", lambda e: e["simulated"]),
    "distance along the road": ("m", lambda e: e["place"]),
    "change of the engine command per second": ("", lambda e: e.difference(e["engine_command"])),
    "change of the brake command per second": ("", lambda e: e.difference(e["brake_command"])),
    "time since start": ("s", lambda e: e["elapsed"]),
    "time since standing": ("s", lambda e: e.since(e["speed"] < Limits.standing_m_s)),
    "time since braking": ("s", lambda e: e.since(e["brake"] > PRESSED)),
    "time since gear change": ("s", lambda e: e.since(e.difference(e["gear"]) != 0.0)),
}
DEPENDS_ON = {  # what a mechanism depends on, or a parameter: and the variable that shows it
    "mass": "simulated acceleration",
    "torque_gain": "engine force per mass",
    "brake_gain": "brake force per mass",
    "recording": "time since start",
    "sustained load": "time since start",
    "engine torque": "engine force per mass",
    "engine command": "engine force per mass",
    "traction force": "engine force per mass",
    "sign of engine torque": "engine force per mass",
    "brake": "brake force per mass",
    "acceleration": "simulated acceleration",
    "acceleration history": "simulated acceleration",
    "command rate": "change of the engine command per second",
    "rate of engine command": "change of the engine command per second",
    "brake command rate": "change of the brake command per second",
}


def _variable(e: Evidence, f: Finding | None) -> tuple[str, Array]:
    """The first variable on which a finding depends and that is known here, (n,); else the speed."""
    for of in (f.effect, *f.depends_on) if f is not None else ():
        name = DEPENDS_ON.get(of, of)
        with suppress(KeyError):  # no variable, or not recorded
            return name, VARIABLES[name][1](e)
    return "speed", e["speed"]


def _fitted(e: Evidence, name: str, missing: Array, use: Mask) -> Array | None:
    """The force (n,), m/s^2, of a parameter or mechanism in the form and size nearest to what is missing."""
    if name in e.sensitivity:
        forms = [(np.nan_to_num(e.sensitivity[name])[:, None], np.zeros(1))]
    elif name in LIBRARY:
        terms = [t for t in candidate_terms(LIBRARY[name], e) if not t.varies_in_time]
        forms = [(np.nan_to_num(t.columns), t.prior.sign) for t in terms]
    else:
        return None
    best, least = None, np.inf
    for columns, sign in forms:
        fit = lsq_linear(columns[use], missing[use], (np.where(sign > 0, 0.0, -np.inf), np.inf))
        if fit.cost < least:
            best, least = columns @ fit.x, fit.cost
    return best


def binned(x: Array, force: Array, use: Mask) -> Iterator[tuple[Mask, float, float, float]]:
    """Rows (n,) of each bin of x that has enough, the mean of x, and that of the force with two standard
    errors."""
    known = x[use]
    values = np.unique(known)
    if len(values) <= BINS:
        edges = [*values, np.inf]
    else:
        edges = [*np.linspace(np.quantile(known, TAIL), np.quantile(known, 1.0 - TAIL), BINS + 1)]
    for low, high in pairwise(edges):
        rows = use & (x >= low) & (x < high)
        if rows.sum() >= LEAST_ROWS:
            blocks = [part.mean() for part in np.array_split(force[rows], BLOCKS)]
            error = 2.0 * float(np.std(blocks, ddof=1)) / np.sqrt(BLOCKS)
            yield rows, float(x[rows].mean()), float(force[rows].mean()), error


def _drawn(e: Evidence, x: Array, missing: Array, curves: Mapping[str, Array | None], use: Mask) -> str:
    """Dots of what is missing over x, and lines of the curves' means; empty without bins."""
    unit = e.unit.scale / e.mass
    bins = list(binned(x, unit * e.newtons(missing), use))
    if not bins:
        return ""
    at, middle, error = np.array([numbers for _, *numbers in bins]).T
    forces = {n: unit * e.newtons(y) for n, y in curves.items() if y is not None}
    lines = {n: np.array([y[rows].mean() for rows, *_ in bins]) for n, y in forces.items()}
    ends = np.concatenate([middle - error, middle + error, *lines.values(), [0.0]])
    low, high, first, last = ends.min(), ends.max(), at.min(), at.max()

    def px(value: float) -> float:
        return LEFT + (WIDTH - LEFT - 20.0) * (value - first) / max(last - first, 1e-9)

    def py(value: float) -> float:
        return ABOVE + (HEIGHT - BELOW - ABOVE) * (high - value) / max(high - low, 1e-9)

    out = [f'<path class="axis" d="M{LEFT} {py(0.0):.1f} L{WIDTH - 10.0} {py(0.0):.1f}"/>']
    for a, y, wide in zip(at, middle, error, strict=True):
        out.append(f'<path class="observed" d="M{px(a):.1f} {py(y - wide):.1f} V{py(y + wide):.1f}"/>')
        out.append(f'<circle class="observed" cx="{px(a):.1f}" cy="{py(y):.1f}" r="3.5"/>')
    for n, line in lines.items():
        points = " ".join(f"{px(a):.1f},{py(y):.1f}" for a, y in zip(at, line, strict=True))
        out.append(f'<polyline class="line {n}" points="{points}"/>')
    for value in dict.fromkeys((low, 0.0, high)):
        out.append(
            f'<text x="{LEFT - 6.0}" y="{py(value) + 4.0:.1f}" text-anchor="end">{digits(value)}</text>'
        )
    for value in dict.fromkeys((first, 0.5 * (first + last), last)):
        place = f'x="{px(value):.1f}" y="{HEIGHT - BELOW + 18.0}" text-anchor="middle"'
        out.append(f"<text {place}>{digits(value)}</text>")
    return "".join(out)
