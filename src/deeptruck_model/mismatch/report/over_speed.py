"""The figure of what is missing over speed, while the truck pulls and while it coasts."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.signals import speed_unit
from deeptruck_model.mismatch.correction.strength import visible
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.verdict.wording import digits

Array = NDArray[np.float64]

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
    for shown in range(0, int(per * fastest) + 1, step):
        x, _ = at(shown / per, low).split(",")
        out.append(f'<text x="{x}" y="{HEIGHT - BELOW + 18.0:.0f}" text-anchor="middle">{shown}</text>')
    out.append(f'<text x="{WIDTH - 10.0:.0f}" y="{HEIGHT - 4.0:.0f}" text-anchor="end">speed, {units}</text>')
    size = f'viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}"'
    says = f"Missing force in {e.unit.name} over speed, pulling and coasting"
    return f'<svg class="over" {size} role="img" aria-label="{says}">{"".join(out)}</svg>'


def _rows(e: Evidence) -> dict[str, NDArray[np.bool_]]:
    """Rows (n,) in which the engine pulls, and in which neither pedal is pressed."""
    engine, brake = (_pressed(e, name) for name in ("engine_command", "brake_command"))
    return {"pulling": visible(e) & engine & ~brake, "coasting": visible(e) & ~engine & ~brake}


def _pressed(e: Evidence, command: str) -> NDArray[np.bool_]:
    x = np.nan_to_num(e.signals.get(command, np.zeros(len(e))))
    return np.asarray(x > PRESSED * max(float(np.quantile(x, 0.98)), 1e-9))


def _binned(e: Evidence, rows: NDArray[np.bool_]) -> Iterator[tuple[float, float, float, float]]:
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
