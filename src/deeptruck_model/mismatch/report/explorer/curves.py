"""The curve of a finding: its force against its own variable, and what the drives show of it.

The line is the fitted force, its band what the sizes may be (95 %). The points are what is left of the
residual when everything else that was found is taken away (a component-plus-residual plot): a form that does
not fit shows where points leave the line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.finding import Finding
from deeptruck_model.mismatch.mechanisms import law_signal
from deeptruck_model.mismatch.mechanisms.laws import NEEDS, VARIABLES
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.free_law import features
from deeptruck_model.mismatch.report.drawing import label
from deeptruck_model.mismatch.report.regime_figure import LEAST_S, edges, place
from deeptruck_model.mismatch.report.sizes import timing
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import Z95

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

PERIOD_S = 1.0
PLACE, PLACE_M = "place on the road", 25.0  # what belongs to a place is drawn along the road, in such bins
OWN_TELLS = 0.2  # share of how a force varies that its own variable must tell, to be drawn against it
EVEN, QUANTILES = 8, 14  # bins: some of even width, and some of as much driving each
SIGNALS_OF = {  # what the library calls its variables -> signals that can be drawn against
    "time": ("elapsed",),
    "time since start": ("elapsed",),
    "distance along the road": ("distance",),
    "brake command rate": ("change of brake_command",),
    "rate of engine command": ("change of engine_command",),
    "command rate": ("change of engine_command", "change of brake_command"),
    "engine command": ("engine_command",),
    "engine speed": ("engine_speed",),
    "engine torque": ("engine",),
    "sign of engine torque": ("engine",),
    "traction force": ("engine",),
    "sustained load": ("engine over 60 s",),
    "ambient temperature": ("ambient_temperature",),
    "time since gear change": ("time since a shift",),
    "acceleration": ("simulated",),
    "acceleration history": ("acceleration over 2 s",),
    "mass": ("simulated",),
    "drag_area": ("speed",),
    "rolling_resistance": ("speed",),
    "torque_gain": ("engine",),
    "brake_gain": ("brake",),
}


@dataclass(frozen=True)
class Curve:
    """Means in bins of the variable `by` (m,). `low` and `high` are None where no size was fitted."""

    by: str  # with its unit
    share: float  # of how the force varies, that this one variable tells
    x: Array
    force: Array
    low: Array | None
    high: Array | None
    seen: Array  # what the drives show
    seen_error: Array  # two standard errors of it


def curve(e: Evidence, x: Explanation, finding: Finding, left: Array, scale: Array) -> Curve | None:
    """Of one finding. `left` (n,) is the residual that nothing explains, m/s^2; `scale` (n,) turns m/s^2 into
    the unit that is drawn. None for a fault between sensors, and where too little was driven.
    """
    cause = finding.cause
    rows = _periods(e)
    if _by_place(cause):
        rows = rows[e["place"][rows].min(axis=1) >= 0.0]
    if cause is None or len(rows) < 60:
        return None
    law = (cause.force * scale)[rows].mean(axis=1)
    by, share, variable, bins = _against(e, finding, law, rows)
    kept = [k for k in np.unique(bins) if (bins == k).sum() * PERIOD_S >= LEAST_S]
    if not by or len(kept) < 2:
        return None
    columns, covariance = _sizes(e, x, cause, scale, rows)
    seen = law + (left * scale)[rows].mean(axis=1)
    at, force, error, shown, doubt = np.array(
        [_bin(bins == k, variable, law, columns, covariance, seen) for k in kept]
    ).T
    band = covariance is not None
    return Curve(
        label(by, e.command_units) if by not in ("distance", PLACE) else f"{by}, m", share, at, force,
        force - error if band else None, force + error if band else None, shown, doubt,
    )  # fmt: skip


def _by_place(cause: Cause | None) -> bool:
    return cause is not None and cause.term is not None and cause.term.variant.comes_again


def _against(e: Evidence, finding: Finding, law: Array, rows: Indices) -> tuple[str, float, Array, Indices]:
    """What a force (periods,) is drawn against, the share of how it varies that this tells, its values and
    their bins (periods,); no name where there is nothing."""
    if _by_place(finding.cause):
        along = e["place"][rows].mean(axis=1)
        bins = (along / PLACE_M).astype(np.intp)
        return PLACE, _share(law, bins), along, bins
    signals = {n: s[rows].mean(axis=1) for n, s in _signals(e, finding).items()}
    by, share = _telling(law, signals, _own(finding))
    variable = signals.get(by, law)
    return by, share, variable, _bins(variable)


def _bin(
    own: NDArray[np.bool_], x: Array, law: Array, columns: Array, covariance: Array | None, seen: Array
) -> tuple[float, float, float, float, float]:
    """Where a bin lies, the force there and how far it may be off, what is seen there and how surely."""
    mean = columns[own].mean(axis=0)
    off = 0.0 if covariance is None else Z95 * float(np.sqrt(max(mean @ covariance @ mean, 0.0)))
    spread = float(seen[own].std(ddof=1)) if own.sum() > 1 else 0.0
    return (
        float(x[own].mean()),
        float(law[own].mean()),
        off,
        float(seen[own].mean()),
        2.0 * spread / float(np.sqrt(own.sum())),
    )


def _periods(e: Evidence) -> Indices:
    """Rows of the seconds that are compared throughout and lie within one recording, (periods, rows each)."""
    per = max(1, round(PERIOD_S / e.dt))
    parts = [
        np.arange(s.start, s.start + (s.stop - s.start) // per * per).reshape(-1, per) for s in e.stretches
    ]
    rows = np.concatenate(parts)
    out: Indices = rows[e.valid[rows].all(axis=1)]
    return out


def _own(finding: Finding) -> list[str]:
    """The signals a finding is known to depend on."""
    words = (*finding.depends_on, finding.effect)
    return [n for w in words for n in SIGNALS_OF.get(w, (w,))]


def _signals(e: Evidence, finding: Finding) -> dict[str, Array]:
    """What a force may be drawn against, (n,) each, by name."""
    out = features(e) | {"distance": e["distance"]}
    for name in _own(finding):
        known = name in VARIABLES and (name not in NEEDS or e.has(NEEDS[name]))
        if name not in out and known and law_signal(name).signals() <= set(e.signals):
            out[name] = law_signal(name).rows(e)
    return {n: np.nan_to_num(x) for n, x in out.items()}


def _bins(x: Array) -> Indices:
    """The bin of each value, (n,): as many as its places, else finer where more was driven."""
    even = edges(x)
    if len(even) - 1 == len(np.unique(np.round(x))):  # gears
        return place(x, even)
    low, high = even[0], even[-1]
    between = x[(x > low) & (x < high)]  # none of what is switched on and off
    often = np.quantile(between, np.linspace(0, 1, QUANTILES + 1)) if len(between) else even
    apart = (high - low) / 100
    ends = np.unique(np.concatenate([np.linspace(low, high, EVEN + 1), often]))
    kept = [ends[0]]
    for end in ends[1:]:
        if end - kept[-1] > apart:
            kept.append(end)
    return place(x, np.array(kept))


def _telling(law: Array, signals: dict[str, Array], own: list[str]) -> tuple[str, float]:
    """The signal a force depends on, or else the one whose bins tell most of it; and what share of its
    variance that tells."""
    shares = {n: _share(law, _bins(s)) for n, s in signals.items() if len(edges(s)) > 2 and np.ptp(s) > 0}
    best = max(shares, key=lambda n: shares[n], default="")
    known = max((n for n in own if n in shares), key=lambda n: shares[n], default=best)
    chosen = known if shares.get(known, 0.0) >= OWN_TELLS else best
    return chosen, max(shares.get(chosen, 0.0), 0.0)


def _share(law: Array, bins: Indices) -> float:
    _, bins = np.unique(bins, return_inverse=True)
    count = np.bincount(bins)
    means = np.bincount(bins, weights=law) / count
    left = float(np.sum((law - means[bins]) ** 2)) / max(len(law) - len(count), 1)
    return 1.0 - left / max(float(np.var(law, ddof=1)), 1e-12)


def _sizes(
    e: Evidence, x: Explanation, cause: Cause, scale: Array, rows: Indices
) -> tuple[Array, Array | None]:
    """What each fitted size gives per unit of it (periods, k), and how sure the sizes are (k, k)."""
    none = np.zeros((len(rows), 1))
    model = x.model
    if cause.term is not None and cause.acts_as in model.effects:
        columns = cause.term.columns * scale[:, None]
        late = [timing(part, e) / part.factor**2 for part in cause.term.parts]
        covariance = model.covariance(cause.acts_as)
        if not columns.shape[1] == len(covariance) == len(late):
            return none, None
        return columns[rows].mean(axis=1), covariance + np.diag(late)
    if cause.kind == "parameter_error" and cause.effect in e.sensitivity:
        column = (e.sensitivity[cause.effect] * scale)[rows].mean(axis=1)
        return column[:, None], np.array([[model.change_sd(cause.effect) ** 2]])
    return none, None


__all__ = ["Curve", "curve"]
