"""The slope that a learned simulator is not given, from what the forces of a plain truck leave.

A learned truck that gets its own speed follows a slope as it follows every slow force, so that little of it
remains in its residual. A plain truck does not follow it: its engine's force is linear in one recorded
signal, its drag that of its kind. Slope and traction are correlated, and an ordinary fit
confuses them. They differ in their fast changes, as no slope changes within seconds: the engine's gain and
friction are fitted to these. The slow rest is due to the road, the wind or the engine's gain, and the size
that each would need decides which.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import least_squares

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.constants import AIR_DENSITY, GRAVITY
from deeptruck_core.signals import FELT
from deeptruck_core.vehicle_kinds import LARGEST_DERATE, STEEPEST, STRONGEST_WIND
from deeptruck_model.mismatch.mechanisms.families import UNKNOWN
from deeptruck_model.mismatch.posterior.names import Named, Tree
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.components import tractions
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits

OTHER = 0.05  # weight of a slow force that is neither slope, wind nor gain
GAIN_DOUBT = 0.1  # relative error that the engine's fitted gain may have
BRAKE_S, BRAKING = 2.0, 0.02  # braking is left out until it has let go, s and share of the hardest
FAST_S = 8.0  # changes within so long are no road's
SMOOTH_S = 0.7
LAGS_S = (0.5, 1.0)  # of the force behind torque or fuel
SLOWEST = 5.0  # m/s
DOUBTFUL = 2.0  # robust sds from where a sample counts less


def road(regression: Regression) -> Named | None:
    """The slow force along the drives of a regression, (n,) and 0 where it is unknown, by its most probable
    name, for a learned simulator without a recorded slope; None if no force is slow."""
    e = regression.e.everywhere()
    if e.known_physics or e.has("grade") or e.has(FELT):
        return None
    plain = plain_truck(e)
    if plain is None:
        return None
    force, known = _slow_part(e, plain)
    rms, speed = float(np.std(force[known])), np.maximum(e["speed"], 3.0)
    sd = 1.4826 * float(np.median(np.abs(plain.left[plain.used])))
    noise = e.rules.tolerance * sd / np.sqrt(2.0 * np.sqrt(np.pi) * FAST_S / e.dt)  # of the smoothed rest
    doubt = GAIN_DOUBT * float(np.std(plain.engine[plain.used]))
    if rms < max(float(np.hypot(e.rules.slow_force, doubt)), noise):
        return None
    # the force of one unit of each cause, and the largest rms that it can have
    causes = {
        "road_grade": (np.full(len(e), GRAVITY), STEEPEST),
        "headwind": (2.0 * e["drag"] / speed, STRONGEST_WIND),
        "torque_derate": (np.maximum(plain.engine, 0.0), LARGEST_DERATE),
    }
    offered = {m.effect for m in regression.library}
    weight = {
        name: float(np.exp(-0.5 * (2.0 * _needed(force, unit, known) / most) ** 2))
        for name, (unit, most) in causes.items()
        if name in offered
    } | {UNKNOWN: OTHER}
    tree = Tree({name: w / sum(weight.values()) for name, w in weight.items()})
    return Named(tree.first, tree, 0.0, force)


def _needed(force: Array, unit: Array, known: Mask) -> float:
    """Rms size of a cause with the effect `unit` that makes the force (n,), where it has any effect."""
    acts = known & (unit > 0.3 * float(np.mean(unit[known])))
    if not acts.any():
        return float("inf")
    return float(np.sqrt(np.mean(force[acts] ** 2) / np.mean(unit[acts] ** 2)))


def _slow_part(e: Evidence, plain: PlainTruck) -> tuple[Array, Mask]:
    """The slow part (n,) of what a plain truck leaves, less its mean and 0 where unknown, and where it is
    known (n,)."""
    width = FAST_S / e.dt
    amount = gaussian_filter1d(plain.used.astype(float), width)
    smooth = gaussian_filter1d(np.where(plain.used, plain.left, 0.0), width) / np.maximum(amount, 1e-3)
    known = e.valid & (amount > 0.2 * float(np.median(amount[e.valid])))
    return np.where(known, smooth - float(np.mean(smooth[known])), 0.0), known


@dataclass(frozen=True)
class PlainTruck:
    """The engine's force per mass of a plain truck (n,), the acceleration (n,) that its forces leave, m/s^2,
    and the rows used (n,)."""

    engine: Array
    left: Array
    used: Mask


def plain_truck(e: Evidence) -> PlainTruck | None:
    """The plain truck along the drives whose engine's force explains the fast changes best; None if none
    does, or no engine signal was recorded."""
    speed = e["speed"]
    observed = np.concatenate([[0.0], np.diff(speed)]) / e.dt
    used = e.valid & (speed > SLOWEST) & ~e.starts & np.isfinite(observed)
    if e.has("brake_command"):
        command = np.nan_to_num(e["brake_command"])
        used &= e.lag(command, BRAKE_S) < BRAKING * max(float(command.max(initial=0.0)), 1e-9)
    if used.sum() * e.dt < Limits.line_s:
        return None
    friction = np.nan_to_num(e.signals.get("engine_speed", 0 * speed)) / np.maximum(speed, 3.0)
    y, slows = _fast(e, observed)[used], -_fast(e, friction)[used]
    fits = (_fitted(y, np.stack([_fast(e, x)[used], slows], axis=1), x, friction) for x in _pulls(e))
    r2, engine = max(fits, key=lambda fit: fit[0], default=(0.0, speed))
    if r2 <= Limits.line_r2:
        return None
    left = observed - engine + 0.5 * AIR_DENSITY * e.vehicle.drag_area / e.mass * speed**2
    return PlainTruck(engine, left - np.median(left[used]), used)


def _pulls(e: Evidence) -> Iterator[Array]:
    """Signals (n,) that the engine's force at the wheels may be proportional to."""
    one_gear = [e["engine_command"]] if "engine_command" in e.signals else []
    for pull in (*(x for x, _ in tractions(e.signals, np.maximum(e["speed"], 3.0))), *one_gear):
        if np.isfinite(pull[e.valid]).mean() >= 0.5:
            yield np.nan_to_num(pull)
            yield from (e.lag(pull, lag_s) for lag_s in LAGS_S)


def _fitted(y: Array, X: Array, pull: Array, friction: Array) -> tuple[float, Array]:
    """The r2 of fast changes y (m,) by those of traction and friction X (m, 2); the engine's force per mass
    (n,)."""
    size = np.maximum(np.abs(X).mean(axis=0), 1e-12)

    def off(b: Array) -> Array:
        return np.asarray(y - X @ (b / size))

    b, robust = np.full(2, 1e-3), DOUBTFUL * 1.4826 * float(np.median(np.abs(y))) + 1e-9
    for _ in range(2):  # the second time with the noise of what the first one leaves
        b = least_squares(off, b, bounds=(0.0, np.inf), loss="cauchy", f_scale=robust).x
        robust = DOUBTFUL * 1.4826 * float(np.median(np.abs(off(b)))) + 1e-9
    weight = 1.0 / (1.0 + (off(b) / robust) ** 2)
    r2 = 1.0 - float(weight @ off(b) ** 2) / max(float(weight @ y**2), 1e-12)
    return r2, b[0] / size[0] * pull - b[1] / size[1] * friction


def _fast(e: Evidence, x: Array) -> Array:
    """The signal minus its slow part, for each recording."""
    out = np.empty_like(x)
    for s in e.drives:
        part = gaussian_filter1d(np.nan_to_num(x[s.rows]), SMOOTH_S / e.dt, mode="reflect")
        out[s.rows] = part - gaussian_filter1d(part, FAST_S / e.dt, mode="reflect")
    return out
