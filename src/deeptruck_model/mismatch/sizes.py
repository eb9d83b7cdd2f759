"""Sizes of a finding: fitted parameters with their intervals, and the selected constants."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import truncnorm

from deeptruck_model.mismatch.expression import Rerun
from deeptruck_model.mismatch.mechanisms import CandidateTerm, Column, carriers
from deeptruck_model.mismatch.mechanisms.courses import EachDrive
from deeptruck_model.mismatch.posterior.regression import Model, changed_by
from deeptruck_model.mismatch.residual.evidence import Evidence, unit
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.mismatch.result import Size

Array = NDArray[np.float64]

PER_MASS = ("N", "N m", "W")  # units of constants that are specific
MAIN_PARAMETERS = 12  # a profile along the road has hundreds; people get the ones that matter


def picked(term: CandidateTerm, e: Evidence) -> dict[str, Size]:
    """Selected constants as sizes without an interval; of two with one name, the first."""
    out: dict[str, Size] = {}
    for name, value, of in term.settings():
        if of in PER_MASS:
            out.setdefault(name, Size(value * e.unit.scale, e.unit.of(of)))
        else:
            out.setdefault(name, Size(value, unit(of, e.command_units) if of.endswith("_command") else of))
    return out


def sizes_of(term: CandidateTerm, model: Model, e: Evidence) -> dict[str, Size]:
    """The main sizes by name. Columns of one name, from a merged term, add up to one size.

    An effect that acts on held-out recordings only was not fitted, and has no size. A delay is not known
    better than the arrival time of a command within a sample.
    """
    values, covariance = model.coefficients(term.mechanism.effect), model.covariance(term.mechanism.effect)
    acts = np.abs(term.columns[e.to_fit().valid]).max(axis=0, initial=0.0) > 0.0
    by = carriers.factors(e.moved, {p: e.total_change(p, model.moved(p)) for p in sorted(model.free)})
    weights: dict[str, Array] = {}
    columns: dict[str, Column] = {}
    for k, part in enumerate(term.parts):
        for name, weight in part.course or ((part.name, 1.0),):
            factor = weight * part.factor * (e.unit.scale if part.per_mass else 1.0)
            factor *= carriers.ratio(part, e, by) if e.moved else 1.0
            weights.setdefault(name, np.zeros(len(term.parts)))[k] = factor
            columns[name] = part
    sizes: dict[str, tuple[float, float, str]] = {
        name: (
            float(g @ values),
            float(np.sqrt(max(float(g @ covariance @ g), 0.0) + timing(columns[name], e))),
            e.unit.of(columns[name].unit) if columns[name].per_mass else columns[name].unit,
        )
        for name, g in weights.items()
        if acts[g != 0.0].any()
    }
    gain = e.signals.get("effective_mass_gain")
    turning = 1.0 if gain is None else float(np.median(gain[e.valid]))
    main = sorted(sizes, key=lambda n: -abs(sizes[n][0]) / max(sizes[n][1], 1e-12))[:MAIN_PARAMETERS]
    of_drive = all(isinstance(v.course, EachDrive) for v in term.variants)
    return {
        name: bounded(columns[name], value, sd, unit, e, turning, of_drive=of_drive)
        for name, (value, sd, unit) in sizes.items()
        if name in main
    }


def bounded(
    part: Column, value: float, sd: float, unit: str, e: Evidence, turning: float, *, of_drive: bool = False
) -> Size:
    """A size with its 95 % interval within physical limits, at which its distribution is truncated.

    A mass acts nonlinearly (`changed_by`); `turning` is the share of it that does not rotate. A mass
    `of_drive` is relative to the simulator as given and not as refitted, whose mass may itself be wrong by
    `nearly_right`.
    """
    ends = np.array([-Z95, 0.0, Z95]) * sd + value
    shift = 0.0
    if unit in ("kg", "1") and part.unit == "kg":
        whole = e.mass if e.unit.scale > 1.0 else 1.0
        least, middle, most = (whole * changed_by("mass", x / whole, turning) for x in ends)
        own = e.rules.nearly_right * whole if of_drive else 0.0
        ends = middle + np.array([-np.hypot(middle - least, own), 0.0, np.hypot(most - middle, own)])
        low, high = (whole * x for x in e.vehicle.possible("mass"))
        shift = whole - whole / (1.0 + e.moved.get("mass", 0.0)) if of_drive else 0.0
    else:
        low, high = -part.most, part.most
    if sd and np.isfinite([low, high]).any():
        mean, wide = float(ends[1]), max(float(ends[2] - ends[0]) / (2.0 * Z95), 1e-12)
        cut = truncnorm((low - mean) / wide, (high - mean) / wide, mean, wide)
        ends = np.array(cut.ppf([0.025, 0.5, 0.975]))
    ends = ends + shift
    return Size(float(ends[1]), unit, (float(ends[0]), float(ends[2])) if sd else None)


def timing(part: Column, e: Evidence) -> float:
    """Variance (s^2) of a time because the arrival of a command is known only to a quarter of a row."""
    return (e.dt / 4) ** 2 / 3 if part.unit == "s" and isinstance(part.expression, Rerun) else 0.0
