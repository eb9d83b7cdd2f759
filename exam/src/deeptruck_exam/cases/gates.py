"""Effects that act only under a driving condition, or in a few short time windows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.catalogue import Planted
from deeptruck_model.trucks import CommandFilter, Force, View

Open = Callable[[View], Array]


@dataclass
class GatedForce:
    """A force times an opening 0..1; its state is updated also while the gate is closed."""

    inner: Force
    opening: Open
    on_bus_nm: Array | float = 0.0

    def reset(self, batch: int) -> None:
        self.inner.reset(batch)

    def force(self, view: View, dt: float) -> Array:
        opening = self.opening(view)
        newtons = self.inner.force(view, dt) * opening
        self.on_bus_nm = getattr(self.inner, "on_bus_nm", 0.0) * opening
        return np.asarray(newtons)


@dataclass
class GatedFilter:
    """A command filter that acts only inside time windows."""

    inner: CommandFilter
    windows: Windows

    def reset(self, batch: int) -> None:
        self.inner.reset(batch)

    def filter(self, u: Array, time: float, dt: float) -> Array:
        return np.where(self.windows.at(time)[:, None] > 0.5, self.inner.filter(u, time, dt), u)


@dataclass(frozen=True)
class Windows:
    """Per recording the starts and ends (batch, m) s; unused ones start at infinity."""

    start_s: Array
    end_s: Array

    def at(self, time: float) -> Array:
        inside = (self.start_s <= time) & (time < self.end_s)
        return np.asarray(inside.any(axis=1).astype(float))

    def __call__(self, view: View) -> Array:
        return self.at(view.time)

    def __deepcopy__(self, memo: object) -> Windows:
        return self


def _soft(x: Array) -> Array:
    return np.asarray(np.clip(x, 0.0, 1.0))


CONDITIONS: dict[str, Open] = {
    "uphill": lambda v: _soft(v.grade / 0.005 - 0.5),
    "above 17 m/s": lambda v: _soft((v.speed - 16.5) / 1.0),
    "below 11 m/s": lambda v: _soft((11.5 - v.speed) / 1.0),
    "half load or more": lambda v: _soft((v.engine_torque - 600.0) / 100.0),
}


def gate(planted: Planted, opening: Open | Windows) -> Planted:
    """The same effects behind a gate. Filters can only be gated by windows."""
    filters = planted.filters
    if isinstance(opening, Windows):
        filters = tuple(GatedFilter(f, opening) for f in planted.filters)
    return Planted(
        tuple(GatedForce(f, opening) for f in planted.forces),
        filters,
        planted.parameters,
        planted.faults,
        planted.withheld,
    )


def draw_windows(rng: np.random.Generator, activity: Array, dt: float, held_out: int) -> Windows:
    """Three to six windows of 5 to 8 s, under 2 % of the time, at times when the effect would have been
    active (`activity` (batch, n), any unit); at least one in the held-out recordings, which come last."""
    batch, n = activity.shape
    length = rng.uniform(5.0, 8.0)
    width = round(length / dt)
    budget = max(3, min(6, int(0.0195 * batch * n * dt / length)))
    kernel = np.ones(width) / width
    smooth = np.stack([np.convolve(np.abs(row), kernel, mode="valid") for row in activity])
    start = np.full((batch, budget), np.inf)
    free = smooth >= np.quantile(smooth, 0.8)
    for w in range(budget):
        rows = (
            np.arange(batch - held_out, batch) if w == 0 else np.arange(batch - held_out if w < 3 else batch)
        )
        pick = np.argwhere(free[rows])
        if not len(pick):
            pick = np.argwhere(smooth[rows] >= np.quantile(smooth[rows], 0.9))
        row, at = pick[rng.integers(len(pick))]
        start[rows[row], w] = at * dt
        free[rows[row], max(0, at - 2 * width) : at + 2 * width] = False
    return Windows(start, start + length)
