"""Inputs that were not recorded or not obeyed: the consequence, the rows affected, and the names that each
may explain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from scipy.stats import t as student_t

from deeptruck_core.json_data import HIDDEN, stored
from deeptruck_model.mismatch.fit_result import Interval
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.others import PARAMETER_ERRORS
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.not_recorded import not_recorded as lacking
from deeptruck_model.trucks.compiled import entry

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ENGINE_SPEED = "engine_speed"
BRAKING, BRAKING_SD = -0.8, 0.6  # m/s^2 that service brakes add, and its spread
TAIL = 4.0  # degrees of freedom of the residual without braking
OFF_S, ON_S = 90.0, 6.0  # mean time between applications, and of one
BEGIN = np.exp(-4.0)  # odds of braking at the begin of a drive
NEVER = -60.0  # log density of braking while the engine is asked to pull
BLOCK_S, LEAST_S = 1.0, 30.0
IDLE = 0.05  # of the command's range above zero, or above its lowest below it: the pedal is released


@dataclass(frozen=True)
class NotRecorded:
    """An input that was not recorded or not obeyed: what it `hides`, the `signal` to record, the share of the
    compared time in which it acts (None if not searched), and the gain in nats."""

    input: str
    hides: str
    signal: str
    share_of_time: float | None = field(default=None, metadata=stored(digits=4, sparse=True))
    gain: float = field(default=0.0, metadata=HIDDEN)


def inputs(recordings: Sequence[Recording], *, mass_known: bool = False) -> tuple[NotRecorded, ...]:
    """Inputs that at least one recording lacks; a mass that the simulator or the user states counts as
    recorded."""
    return tuple(
        NotRecorded(m.input.name, m.input.hides, m.signal)
        for m in lacking(recordings)
        if not (mass_known and m.input.name == "mass")
    )


def contradicted_mass(recordings: Sequence[Recording], mass_kg: float, ci95_kg: Interval) -> Iterator[str]:
    """Remarks on recorded masses outside the interval `ci95_kg` that the drives give, kg."""
    low, high = ci95_kg
    for r in recordings:
        if r.interface.mass_kg is not None and not low <= r.interface.mass_kg <= high:
            yield (
                f"{r.name} states a mass of {r.interface.mass_kg / 1000:.1f} t, and the drives show "
                f"{mass_kg / 1000:.1f} t ({low / 1000:.1f} to {high / 1000:.1f}, 95 %)"
            )
            return


def names_behind(recordings: Sequence[Recording], missing: Sequence[NotRecorded]) -> dict[str, str]:
    """For each mechanism whose effect an input that was not recorded may explain as well: that input. The
    gear counts as recorded if every recording has the engine speed, which determines it."""
    known = {"gear"} if all(ENGINE_SPEED in r.channels for r in recordings) else set()
    asked = {m.input for m in missing} - known
    behind = {m.effect: m.mistaken_for for m in (*LIBRARY.values(), *LIBRARY.own.values())}
    behind |= {p.name: p.mistaken_for for p in PARAMETER_ERRORS.values() if p.mistaken_for}
    return {name: lacks for name, lacks in behind.items() if lacks in asked}


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
