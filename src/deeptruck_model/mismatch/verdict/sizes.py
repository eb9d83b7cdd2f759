"""Sizes of a finding: fitted parameters with their intervals, and the selected constants."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import truncnorm

from deeptruck_core.arrays import Array, Mask
from deeptruck_model.mismatch.mechanisms import CandidateTerm, Column
from deeptruck_model.mismatch.mechanisms.record import Form, Variant
from deeptruck_model.mismatch.posterior.exact import Fitted
from deeptruck_model.mismatch.posterior.posterior import Posterior
from deeptruck_model.mismatch.posterior.regression import changed_by
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import Rerun
from deeptruck_model.mismatch.residual.noise import Z95
from deeptruck_model.mismatch.verdict.result import Size

PER_MASS = ("N", "N m", "W")  # units of constants that are specific
MAIN_PARAMETERS = 12  # a profile along the road has hundreds; people get the ones that matter


def fitted_sizes(fitted: Fitted, name: str) -> dict[str, Size]:
    """The sizes of a mechanism that was fitted by exact runs, and the constants of its form that have units,
    with their intervals; of those whose interval holds zero none, unless it is that of one drive."""
    e, out, step_s = fitted.e, {}, fitted.of.prepared[0].dt
    gain = e.signals.get("effective_mass_gain")
    turning = 1.0 if gain is None else float(np.median(gain[e.valid]))
    sds = np.sqrt(np.maximum(np.diag(fitted.covariance), 0.0))
    acts = np.abs(fitted.slopes[fitted.of.rows]).max(axis=0, initial=0.0) > 0.0  # along fitted drives
    for i, part in enumerate(fitted.setting.parts):
        if part.mechanism.effect != name:
            continue
        form = part.mechanism.forms[part.variant.form]
        units = form.units if isinstance(form, Form) else {}
        at = [j for j, u in enumerate(fitted.of.unknown) if u.part == i]
        own = {fitted.of.unknown[j].of: (float(fitted.x[j]), float(sds[j])) for j in at}
        elsewhere = {fitted.of.unknown[j].of for j in at if not acts[j]}
        constants = {n: x for n, x in own.items() if isinstance(n, str)}
        sized: dict[str, tuple[Column, float, float]] = {}
        for k, column in enumerate(part.columns):
            if k in elsewhere:
                continue
            if k in own:
                for of, weight in column.course or ((column.name, 1.0),):
                    factor = weight * column.factor * (e.unit.scale if column.per_mass else 1.0)
                    _, value, sd = sized.get(of, (column, 0.0, 0.0))
                    sized[of] = (column, value + factor * own[k][0], float(np.hypot(sd, factor * own[k][1])))
            elif column.unit == "s" or not part.paths:  # a constant is its size
                wide = max((sd for _, sd in constants.values()), default=0.0)
                sized[column.name] = (column, column.factor, abs(column.factor) * wide)
        surest = sorted(sized, key=lambda of: sized[of][2] / max(abs(sized[of][1]), 1e-12))[:MAIN_PARAMETERS]
        for of, (column, value, sd) in ((of, sized[of]) for of in sized if of in surest):
            unit_of = e.unit.of(column.unit) if column.per_mass else column.unit
            drive, wide = _drive(part.variant, of), float(np.sqrt(sd**2 + timing(column, step_s)))
            x = bounded(column, value, wide, unit_of, e, turning, of_drive=bool(drive))
            if drive or x.ci95 is None or x.ci95[0] * x.ci95[1] > 0.0:
                out[of] = replace(x, drive=drive)
        for n, (z, sd) in constants.items():
            if n in units and not part.paths:
                value, ends = np.exp(z), np.exp(z + Z95 * sd * np.array([-1.0, 1.0]))
                scale = e.unit.scale if units[n] in PER_MASS else 1.0
                of = e.unit.of(units[n]) if units[n] in PER_MASS else units[n]
                out.setdefault(
                    n, Size(float(scale * value), of, (float(scale * ends[0]), float(scale * ends[1])))
                )
    return out


def sizes_of(term: CandidateTerm, p: Posterior, given: Mask) -> dict[str, Size]:
    """The main sizes of a form by name, with the intervals of the `given` draws: coefficients whose force is
    nearest to that of each draw. Columns of one name, from a merged term, add up to one size.

    An effect that acts on held-out recordings only was not fitted, and has no size. A delay is not known
    better than the arrival time of a command within a sample. A size whose interval holds zero is not
    identified, and left out, unless it is that of one drive.
    """
    e, name = p.regression.e, term.mechanism.effect
    if not given.any():
        return {}
    drawn = p.on_columns(name, term.columns, given)
    acts = np.abs(term.columns[e.to_fit().valid]).max(axis=0, initial=0.0) > 0.0
    weights: dict[str, Array] = {}
    columns: dict[str, Column] = {}
    for k, part in enumerate(term.parts):
        for of, weight in part.course or ((part.name, 1.0),):
            factor = weight * part.factor * (e.unit.scale if part.per_mass else 1.0)
            weights.setdefault(of, np.zeros(len(term.parts)))[k] = factor
            columns[of] = part
    sizes: dict[str, tuple[float, float, str]] = {
        of: (
            float((drawn @ g).mean()),
            float(np.sqrt(np.var(drawn @ g) + timing(columns[of], e.dt))),
            e.unit.of(columns[of].unit) if columns[of].per_mass else columns[of].unit,
        )
        for of, g in weights.items()
        if acts[g != 0.0].any()
    }
    gain = e.signals.get("effective_mass_gain")
    turning = 1.0 if gain is None else float(np.median(gain[e.valid]))
    main = sorted(sizes, key=lambda n: -abs(sizes[n][0]) / max(sizes[n][1], 1e-12))[:MAIN_PARAMETERS]
    out = {}
    for of in (n for n in sizes if n in main):
        value, sd, unit = sizes[of]
        drive = next(filter(None, (_drive(v, of) for v in term.variants)), "")
        x = bounded(columns[of], value, sd, unit, e, turning, of_drive=bool(drive))
        if drive or x.ci95 is None or x.ci95[0] * x.ci95[1] > 0.0:
            out[of] = replace(x, drive=drive)
    return out


def _drive(v: Variant, of: str) -> str:
    """The drive of which a size is, by its name; empty if it is of all."""
    return next((n for n in getattr(v.course, "names", ()) if of.endswith(f"[{n}]")), "")


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


def timing(part: Column, step_s: float) -> float:
    """Variance (s^2) of a time because the arrival of a command is known only to a quarter of a step."""
    return (step_s / 4) ** 2 / 3 if part.unit == "s" and isinstance(part.expression, Rerun) else 0.0
