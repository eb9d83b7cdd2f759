"""Inputs that were not recorded or not obeyed: the consequence, the rows affected, and the names that each
may explain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student_t

from deeptruck_model.mismatch.prepare import checks
from deeptruck_model.mismatch.prepare.drives import NotRecorded, PreparedDrives
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.trucks.compiled import entry

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BRAKING, BRAKING_SD = -0.8, 0.6  # m/s^2 that service brakes add, and its spread
TAIL = 4.0  # degrees of freedom of the residual without braking
OFF_S, ON_S = 90.0, 6.0  # mean time between applications, and of one
BEGIN = np.exp(-4.0)  # odds of braking at the begin of a drive
NEVER = -60.0  # log density of braking while the engine is asked to pull
BLOCK_S, LEAST_S = 1.0, 30.0
IDLE = 0.05  # of the command's range above zero, or above its lowest below it: the pedal is released
BRAKES_ACT = "the truck is off the simulator as by brakes, which were not recorded"
OTHER_GEAR = (
    "the simulator drives in another gear than was recorded or follows from the engine speed, or is in gear "
    "where the truck rolls in neutral"
)
CHECK_GEAR = (
    "in the gear that was recorded: look whether gear and engine_speed are recorded in the right units, or "
    "record more in gear; neutral, which is gear 0, cannot be compared with a simulator that is in gear"
)
RECORD_BRAKE = "without braking that was not recorded: record the brake, or more driving without it"
RECORD_MORE = "that can be compared: record at least several minutes above walking pace"


def left_to_compare(drives: PreparedDrives, e: Evidence) -> tuple[PreparedDrives, Evidence]:
    """The evidence without rows in which an unrecorded brake acts, and the drives: samples in which the
    simulator drives in another gear count as rejected, and if too little is left, they are unusable."""
    e, missing = braking(e, drives.missing)
    drives = replace(drives, missing=missing)
    if e.other_gear:
        drives = replace(drives, rejected=(*drives.rejected, checks.Rejection(OTHER_GEAR, e.other_gear)))
    braked_s = 0.0 if e.hidden is None else float(e.hidden.sum()) * e.dt
    if braked_s:
        found = checks.Rejection(BRAKES_ACT, round(braked_s / drives.prepared[0].dt))
        drives = replace(drives, rejected=(*drives.rejected, found))
    seconds = float((e.valid & ~e.held_out).sum()) * e.dt
    if seconds < Limits.least_driving_s:
        lost = {CHECK_GEAR: e.other_gear * drives.prepared[0].dt, RECORD_BRAKE: braked_s}
        why = max(lost, key=lambda cure: lost[cure]) if any(lost.values()) else RECORD_MORE
        drives = replace(drives, unusable_because=f"only {seconds:.0f} s of driving {why}")
    return drives, e


def braking(e: Evidence, missing: Sequence[NotRecorded] = ()) -> tuple[Evidence, tuple[NotRecorded, ...]]:
    """The evidence without the rows in which an unrecorded brake acts, and the missing inputs with the share
    of time in which it does and the gain in nats of two hidden states over one.

    It is sought where no engine torque is demanded, unless the brake was recorded or the engine's command was
    not; no row is left out if the gain is too small.
    """
    if "engine_command" not in e.signals or "brake_command" in e.signals:
        return e, tuple(missing)
    on, gain = _braking(e)
    share = float(on.sum() / max((e.valid | on).sum(), 1))
    found = (replace(m, share_of_time=share, gain=gain) if m.input == "brake" else m for m in missing)
    return e.without(on), tuple(found)


def _braking(e: Evidence) -> tuple[Mask, float]:
    """Rows (n,) in which a brake acts, and the gain, nats."""
    on, gain = np.zeros(len(e), dtype=bool), 0.0
    ok = e.valid & np.isfinite(e.residual)
    per = max(1, round(BLOCK_S / e.dt))
    command = e["engine_command"]
    low, high = np.nanquantile(command[ok], [0.02, 0.98]) if ok.any() else (0.0, 1.0)
    low = min(float(low), 0.0)  # a pedal that never comes near zero is never released
    idle = np.nan_to_num(command, nan=high) <= low + IDLE * (high - low)
    for s in e.drives:
        rows = np.arange(s.start, s.stop)[ok[s.rows]]
        blocks = rows[: len(rows) // per * per].reshape(-1, per)
        if len(blocks) * per * e.dt < LEAST_S:
            continue
        r = e.residual[blocks].mean(axis=1)
        may = (idle[blocks].mean(axis=1) > 0.5) & (e["speed"][blocks].mean(axis=1) > Limits.braking_speed)
        p, nats = _two_states(r, may, per * e.dt)
        gain += nats
        on[blocks[p > 0.5].ravel()] = True
    return (on & ok, gain) if gain > e.rules.parameter_gain else (np.zeros(len(e), dtype=bool), gain)


def _two_states(r: Array, may: Mask, dt: float) -> tuple[Array, float]:
    """Posterior probability (n,) of braking, and the gain over no braking at all, nats."""
    sigma = max(1.4826 * float(np.median(np.abs(r - np.median(r)))), 0.02)
    off = student_t.logpdf(r / sigma, TAIL) - np.log(sigma)
    on = np.where(may & (r < 0), norm.logpdf(r, BRAKING, np.hypot(BRAKING_SD, sigma)), NEVER)
    stay_off, stay_on = np.exp(-dt / OFF_S), np.exp(-dt / ON_S)
    change = np.log(np.array([[stay_off, 1 - stay_off], [1 - stay_on, stay_on]]))
    states = np.stack([off, on], axis=1)
    forward, backward = _passes(states, change, float(np.log(BEGIN)))
    both = forward + backward
    gain = float(np.logaddexp(*forward[-1]) - off.sum())
    return np.exp(both[:, 1] - np.logaddexp(both[:, 0], both[:, 1])), gain


@entry
def _passes(states: Array, change: Array, begin: float) -> tuple[Array, Array]:
    """Forward and backward log probabilities (n, 2) of a chain of two states (Rabiner, Proc. IEEE 77)."""
    n = len(states)
    forward, backward = np.empty((n, 2)), np.zeros((n, 2))
    forward[0, 0], forward[0, 1] = states[0, 0], states[0, 1] + begin
    for k in range(1, n):
        for j in range(2):
            a, b = forward[k - 1, 0] + change[0, j], forward[k - 1, 1] + change[1, j]
            forward[k, j] = max(a, b) + np.log1p(np.exp(-abs(a - b))) + states[k, j]
    for k in range(n - 2, -1, -1):
        for i in range(2):
            a = backward[k + 1, 0] + states[k + 1, 0] + change[i, 0]
            b = backward[k + 1, 1] + states[k + 1, 1] + change[i, 1]
            backward[k, i] = max(a, b) + np.log1p(np.exp(-abs(a - b)))
    return forward, backward
