"""Rows that are not compared: the simulator drives in another gear, or a brake acts that was not recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_dilation, binary_opening
from scipy.stats import norm
from scipy.stats import t as student_t

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.signals import SPEED
from deeptruck_core.vehicle_kinds import CLUTCH_CLOSED, GEARS_APART
from deeptruck_model.mismatch.prepare.drives import NotRecorded, PreparedDrives, Rejection
from deeptruck_model.mismatch.prepare.prepared import BRAKING as SLOWS_BY_BRAKES
from deeptruck_model.mismatch.prepare.prepared import Prepared, fed, padded, widen
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.simulators import Run, Simulator
from deeptruck_model.trucks.compiled import entry

OTHER_GEAR_S = 1.5  # shorter differences of engine speed, or from a predicted gear, are slip or an error
SAMPLES_APART = 3  # from which on recorded gears differ: a shift a sample sooner or later is a nuisance term
NEAR_S = 0.5  # around a different gear, while the engine changes its speed
RETURNS_S = 2.0  # after a shift, until the pull is back


def gears_apart(
    prepared: Sequence[Prepared],
    runs: Sequence[Run],
    numbered_alike: bool = False,
    held_out: Sequence[bool] = (),
) -> tuple[list[Mask], list[Mask]]:
    """Native samples (n,) of each recording in which the simulator drives in another gear, and those near
    which truck and simulator shift at different moments: their gears differ for however short, or did until a
    moment ago.

    Compared by the recorded gear, else by the recorded engine speed. If neither is recorded, none is another
    gear, and a shift may be at another moment at every change of the simulated gear. A truck that rolls in
    neutral (recorded gear 0) differs from a simulator that is in gear. The force of another gear says nothing
    of missing physics: a simulator that is set to the recorded speed of every sample may shift late by a
    whole shift where the truck shifts between two samples and slows down.
    """
    inside, dt = runs[0].inside, prepared[0].dt
    apart = _by_label(prepared, runs, numbered_alike) if "gear" in inside else None
    at_once, known = apart is not None and not numbered_alike, apart is not None
    if apart is None and "engine_speed" in inside:
        apart = [_by_engine_speed(p, run) for p, run in zip(prepared, runs, strict=True)]
        known = all("engine_speed" in p.recording.channels for p in prepared)
    shifting = apart
    if not known and "gear" in inside:
        shifting = [np.diff(run.inside["gear"][0], prepend=run.inside["gear"][0, :1]) != 0.0 for run in runs]
    if shifting is None or _never_alike(shifting, ()):
        shifting = [np.zeros(len(p.recording), dtype=bool) for p in prepared]
    neutral = [_rolls_in_neutral(p, run) for p, run in zip(prepared, runs, strict=True)]
    if apart is None or _never_alike([a[~n] for a, n in zip(apart, neutral, strict=True)], held_out):
        apart, at_once = neutral, False
    else:
        apart = [a | n for a, n in zip(apart, neutral, strict=True)]
    lasting = np.ones(SAMPLES_APART if at_once else round(OTHER_GEAR_S / dt) + 1, dtype=bool)
    near = np.ones(2 * round(NEAR_S / dt) + 1, dtype=bool)
    near[: len(near) // 2] = not at_once  # before it
    return (
        [binary_dilation(binary_opening(a, lasting), near) if a.any() else a for a in apart],
        [widen(a, round(NEAR_S / dt), round(RETURNS_S / dt)) for a in shifting],
    )


def _never_alike(apart: Sequence[Mask], held_out: Sequence[bool]) -> bool:
    """Whether gears differ in more than half of the samples, so that they cannot be compared.

    Checked for all recordings and for the fitted ones, because the two may be from different loggers.
    """
    fitted = [a for a, out in zip(apart, held_out or [False] * len(apart), strict=True) if not out]
    parts = (np.concatenate(part) for part in (apart, fitted))
    return any(part.size and part.mean() > 0.5 for part in parts)


def _rolls_in_neutral(p: Prepared, run: Run) -> Mask:
    """Where the recorded gear is 0 (neutral) at speed, and the simulator is in gear.

    False if it states no gear, or if the engine speed shows that 0 is the number of a gear.
    """
    nowhere = np.zeros(len(p.recording), dtype=bool)
    if "gear" not in p.recording.channels or "gear" not in run.inside:
        return nowhere
    recorded, simulated = p.recording.channels["gear"], np.round(run.inside["gear"][0])
    neutral = (np.round(recorded) == 0.0) & (simulated != 0.0) & (p.y[:, SPEED] > CLUTCH_CLOSED)
    if "engine_speed" in p.recording.channels and "engine_speed" in run.inside and neutral.any():
        return neutral if _by_engine_speed(p, run)[neutral].mean() > 0.5 else nowhere
    return neutral if np.ptp(simulated) > 0.0 else nowhere


def with_predicted_gears(simulator: Simulator, prepared: Sequence[Prepared]) -> list[Run]:
    """Runs that include a learned simulator's predicted gear and engine speed, if it was trained on these.
    Most of its error arises in the wrong gear."""
    outputs = getattr(simulator, "auxiliary_outputs", None)
    longest = max(len(p.recording) for p in prepared)
    parts = [(p.u, p.w, fed(simulator, p.y)) for p in prepared]
    u, w, y = (np.stack([padded(x[i], longest) for x in parts]) for i in range(3))
    inside = {} if outputs is None else outputs(u, w, y)
    return [
        Run(p.y[None], {name: x[i : i + 1, : len(p.recording)] for name, x in inside.items()})
        for i, p in enumerate(prepared)
    ]


def _by_label(prepared: Sequence[Prepared], runs: Sequence[Run], numbered_alike: bool) -> list[Mask] | None:
    """Unless gears are numbered alike, each recorded gear is mapped to the simulated one with which it
    coincides most."""
    if not all("gear" in p.recording.channels for p in prepared):
        return None
    recorded = [np.round(p.recording.channels["gear"]) for p in prepared]
    simulated = [np.round(run.inside["gear"][0]) for run in runs]
    r, s = np.concatenate(recorded), np.concatenate(simulated)
    gears = np.unique(r[np.isfinite(r)])
    meets = {g: g if numbered_alike else _mode(s[r == g]) for g in gears}
    return [
        np.array([g in meets and meets[g] != k for g, k in zip(rec, sim, strict=True)])
        for rec, sim in zip(recorded, simulated, strict=True)
    ]


def _mode(x: Array) -> float:
    values, counts = np.unique(x, return_counts=True)
    return float(values[np.argmax(counts)])


def _by_engine_speed(p: Prepared, run: Run) -> Mask:
    if "engine_speed" not in p.recording.channels:
        return np.zeros(len(p.recording), dtype=bool)
    recorded, simulated = p.recording.channels["engine_speed"], run.inside["engine_speed"][0]
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = np.abs(np.log(recorded / simulated)) > GEARS_APART
    return apart & (p.y[:, SPEED] > CLUTCH_CLOSED) & np.isfinite(recorded)


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
    seen_s = sum(p.left_out.get(SLOWS_BY_BRAKES, 0) for p in drives.prepared) * drives.prepared[0].dt
    e, missing = braking(e, drives.missing, seen_s)
    drives = replace(drives, missing=missing)
    if e.other_gear:
        drives = replace(drives, rejected=(*drives.rejected, Rejection(OTHER_GEAR, e.other_gear)))
    braked_s = 0.0 if e.hidden is None else float(e.hidden.sum()) * e.dt
    if braked_s:
        found = Rejection(BRAKES_ACT, round(braked_s / drives.prepared[0].dt))
        drives = replace(drives, rejected=(*drives.rejected, found))
    seconds = float((e.valid & ~e.held_out).sum()) * e.dt
    if seconds < Limits.least_driving_s:
        lost = {CHECK_GEAR: e.other_gear * drives.prepared[0].dt, RECORD_BRAKE: braked_s}
        why = max(lost, key=lambda cure: lost[cure]) if any(lost.values()) else RECORD_MORE
        drives = replace(drives, unusable_because=f"only {seconds:.0f} s of driving {why}")
    return drives, e


def braking(
    e: Evidence, missing: Sequence[NotRecorded] = (), seen_s: float = 0.0
) -> tuple[Evidence, tuple[NotRecorded, ...]]:
    """The evidence without the rows in which an unrecorded brake acts, and the missing inputs with the share
    of time in which it does, `seen_s` of braking that was left out before among it, and the gain in nats of
    two hidden states over one.

    It is sought where no engine torque is demanded, unless the brake was recorded or the engine's command was
    not; no row is left out if the gain is too small.
    """
    if "engine_command" not in e.signals or "brake_command" in e.signals:
        return e, tuple(missing)
    on, gain = _braking(e)
    share = (float(on.sum()) * e.dt + seen_s) / max(float((e.valid | on).sum()) * e.dt + seen_s, e.dt)
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
