"""Would a manoeuvre tell two explanations apart? The truck is driven through it under each of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch.correction.recipes import corrected
from deeptruck_model.mismatch.finding import Finding
from deeptruck_model.mismatch.mechanisms import LIBRARY, Variant
from deeptruck_model.mismatch.posterior.causes import Explanation
from deeptruck_model.mismatch.posterior.penalties import enough
from deeptruck_model.mismatch.posterior.search import FREE, Model, Search
from deeptruck_model.mismatch.posterior.windows import ENDS
from deeptruck_model.mismatch.report.findings import TOLD_BY
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.mismatch.result import SmallestVisible
from deeptruck_model.mismatch.sentence import Named, Part
from deeptruck_model.signals import SPEED
from deeptruck_model.simulators import Simulator, free_run

Array = NDArray[np.float64]

SECONDS = 60.0
ROLLING = 1.0  # m/s; below it a truck stands, and nothing differs
MANOEUVRE_SPEED = 0.1  # m/s: a manoeuvre tells two names apart if speeds differ by more than this ...
MANOEUVRE_DRIFT = 0.01  # m/s^2: ... and this for each second since it began


@dataclass(frozen=True)
class Manoeuvre:
    """From a speed (m/s), shares of the largest usual commands, held for `every_s` one after another."""

    words: str
    speed: float
    engine: tuple[float, ...]
    brake: tuple[float, ...]
    every_s: float = SECONDS


MANOEUVRES = (
    Manoeuvre("coast down from 22 m/s", 22.0, (0.0,), (0.0,)),
    Manoeuvre("coast down from 10 m/s", 10.0, (0.0,), (0.0,)),
    Manoeuvre("full pull from 3 m/s", 3.0, (1.0,), (0.0,)),
    Manoeuvre("half pull from 3 m/s", 3.0, (0.5,), (0.0,)),
    Manoeuvre("pull and let go every 4 s from 15 m/s", 15.0, (0.9, 0.0), (0.0, 0.0), 4.0),
    Manoeuvre("a light brake held from 22 m/s", 22.0, (0.0,), (0.15,)),
    Manoeuvre("short brakes from 22 m/s, 2 s on and 4 s off", 22.0, (0.0, 0.0, 0.0), (0.5, 0.0, 0.0), 2.0),
    Manoeuvre("three stops of one pressure, full pull between", 15.0, (0.0, 1.0), (0.4, 0.0), 10.0),
)


@dataclass(frozen=True)
class Separation:
    """By how much two explanations differ at the best moment of the best manoeuvre; `telling` above 1."""

    words: str
    apart: float  # m/s
    after_s: float
    telling: float


def checked(found: Finding, simulator: Simulator, e: Evidence, model: Model) -> Finding:
    """The finding with what its manoeuvre would show, where it can be simulated: on a physics truck, for a
    law."""
    cause = found.cause
    if cause is None or not simulator.parameters():
        return found
    model = cause.whole or model
    group = found.cannot_be_told_from
    rivals = [(name, other) for name, other in cause.alternatives if name in group and _law(other)]
    if not rivals or not _law(model):
        return found
    first, *more = [_said(name, separation(simulator, e, model, other)) for name, other in rivals]
    others = f"of {len(MANOEUVRES)} others, simulated on a flat road, "
    words = found.would_be_told_by.and_then(others, *first)
    for said in more:
        words = words.and_then(*said)
    return replace(found, would_be_told_by=words)


def separation(simulator: Simulator, e: Evidence, one: Model, other: Model) -> Separation:
    """The manoeuvre of MANOEUVRES in which two explanations differ most."""
    u, w, y0 = _commands(simulator, e)
    speeds = [free_run(corrected(simulator, e, m), u, w, y0).y[:, :, SPEED] for m in (one, other)]
    time = np.arange(u.shape[1]) * simulator.dt
    apart = np.abs(speeds[0] - speeds[1]) * (np.minimum(*speeds) > ROLLING)
    telling = apart / (MANOEUVRE_SPEED + MANOEUVRE_DRIFT * time)
    i, k = np.unravel_index(int(np.argmax(telling)), telling.shape)
    return Separation(MANOEUVRES[i].words, float(apart[i, k]), float(time[k]), float(telling[i, k]))


def _said(rival: str, s: Separation) -> tuple[Part, ...]:
    if s.telling < 1.0:
        return "none tells it from ", Named(rival), f" ({s.apart:.2f} m/s at most)"
    return f"{s.words} tells it from ", Named(rival), f": {s.apart:.1f} m/s apart after {s.after_s:.0f} s"


def _law(model: Model) -> bool:
    """Whether an explanation acts alike on every drive: nothing time-varying, no fault of a sensor."""
    kinds = {n.mechanism.kind for n in model.named}
    once = any(_of_these_drives(n.variant) for n in model.named)
    return kinds <= {"missing_physics"} and not once


def _of_these_drives(variant: Variant) -> bool:
    passing = variant.varies_in_time or variant.acts_in_windows or variant.comes_again
    return passing or variant.per_recording


def _commands(simulator: Simulator, e: Evidence) -> tuple[Array, Array, Array]:
    """Every manoeuvre: commands (m, T, n_u), a flat road (m, T, n_w) and the start (m, n_y)."""
    n = round(SECONDS / simulator.dt)
    time = np.arange(n) * simulator.dt
    u = np.zeros((len(MANOEUVRES), n, len(simulator.interface.u)))
    for m, manoeuvre in enumerate(MANOEUVRES):
        phase = (time / manoeuvre.every_s).astype(int)
        for i, channel in enumerate(simulator.interface.u):
            shares = np.array(manoeuvre.brake if channel.startswith("brake") else manoeuvre.engine)
            u[m, :, i] = shares[phase % len(shares)] * _usual(e, channel)
    y0 = np.zeros((len(MANOEUVRES), len(simulator.interface.y)))
    y0[:, SPEED] = [manoeuvre.speed for manoeuvre in MANOEUVRES]
    return u, np.zeros((len(MANOEUVRES), n, len(simulator.interface.w))), y0


def _usual(e: Evidence, channel: str) -> float:
    """The largest usual command."""
    x: Any = e[channel][e.valid]
    return float(np.nanquantile(x, 0.98)) if len(x) else 0.0


RARE = 0.02  # of the time: a force that acts so seldom
STEP, STEPS, HALVINGS = 1.5, 9, 3  # by which a hidden force is enlarged, how often, and made finer


def with_manoeuvres(found: Sequence[Finding]) -> list[Finding]:
    """Findings whose `would_be_told_by` names the manoeuvre that separates the nearest rival."""
    out = []
    for f in found:
        if group := f.cannot_be_told_from:
            rival = LIBRARY[group[0]].told_by if group[0] in LIBRARY else TOLD_BY.get(group[0], "")
            if rival and rival not in str(f.would_be_told_by):
                f = replace(f, would_be_told_by=f.would_be_told_by.and_then(rival))
        out.append(f)
    return out


def smallest_visible(e: Evidence, x: Explanation) -> SmallestVisible:
    """The relative error of each parameter, and the steady force, that would have been reported: each is
    hidden in the recordings and enlarged until it costs the simulator as given as much as a finding takes."""
    search = Search(e)
    hidden = _Hidden(search, search.model((), frozenset(), x.null.fit))
    parameters = {}
    for p, column in e.sensitivity.items():
        size = hidden.least(column, e.rules.nearly_right, enough(search), e.rules.nearly_right)
        parameters[p] = round(min(size, most_tried(p)), 4)
    always = hidden.least(np.ones(len(e)), e.rules.least_force, enough(search))
    nats = enough(search) + e.rules.least_gain + ENDS * e.rules.temper
    rarely = hidden.least(_a_part(e, RARE), e.rules.least_force, nats)
    return SmallestVisible(parameters, always, rarely, e.mass if e.mass_known else None)


def most_tried(parameter: str) -> float:
    """The largest relative error of a parameter that is hidden: twice its prior standard deviation."""
    return 2 * FREE[parameter]


@dataclass(frozen=True)
class _Hidden:
    """Forces hidden in recordings, and what they cost a model that does not have them."""

    search: Search
    model: Model

    def least(self, column: Array, size: float, nats: float, surely: float = 0.0) -> float:
        """The size of a force (n,), from `size` on, that costs `nats` and is surely above `surely`."""
        e = self.search.e
        acting = np.abs(column[e.valid])
        size = max(size, max(e.rules.least_force, e.model_discrepancy) / max(_rms(acting[acting > 0]), 1e-9))
        if self._seen(column, size, nats, surely):
            return size
        for _ in range(STEPS):
            size *= STEP
            if self._seen(column, size, nats, surely):
                break
        below = size / STEP
        for _ in range(HALVINGS):
            middle = 0.5 * (below + size)
            below, size = (below, middle) if self._seen(column, middle, nats, surely) else (middle, size)
        return size

    def _seen(self, column: Array, size: float, nats: float, surely: float) -> bool:
        cost = -self.search.gain_of_given(self.model, -size * column)
        sd = size * np.sqrt(self.search.rules.temper / max(2.0 * cost, 1e-9))
        return cost > nats and size - Z95 * sd > surely and not self._as_a_zero(column, size, cost)

    def _as_a_zero(self, column: Array, size: float, cost: float) -> bool:
        """Whether an ordinary zero of the slope sensor would do nearly as well."""
        e = self.search.e
        zero = size * float(np.mean(column[e.valid]))
        rest = cost * (1.0 - zero**2 / max(size * _rms(column[e.valid]), 1e-9) ** 2)
        return (
            abs(zero) < e.rules.slope_zero * GRAVITY
            and rest < enough(self.search)
            and cost < e.rules.slope_zero_gain
        )


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2))) if len(x) else 0.0


def _a_part(e: Evidence, share: float) -> Array:
    """One in the middle of what is valid for a share of it, else zero."""
    rows = np.flatnonzero(e.valid)
    first = int(len(rows) * (0.5 - share / 2))
    out = np.zeros(len(e))
    out[rows[first : first + max(1, round(share * len(rows)))]] = 1.0
    return out
