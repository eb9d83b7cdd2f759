"""Finds samples in which a simulator uses another gear than was recorded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, binary_opening

from deeptruck_core.signals import SPEED
from deeptruck_core.vehicle_kinds import CLUTCH_CLOSED, GEARS_APART
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.prepare.runs import fed
from deeptruck_model.simulators import Run, Simulator

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

OTHER_GEAR_S = 1.5  # shorter differences of engine speed, or from a predicted gear, are slip or an error
SAMPLES_APART = 3  # from which on recorded gears differ: a shift a sample sooner or later is a nuisance term
NEAR_S = 0.5  # around a different gear, while the engine changes its speed


def other_gear(
    prepared: Sequence[Prepared],
    runs: Sequence[Run],
    numbered_alike: bool = False,
    held_out: Sequence[bool] = (),
) -> list[Mask]:
    """Native samples (n,) of each recording in which the simulator drives in another gear.

    Compared by the recorded gear, else by the recorded engine speed; all False if neither is recorded. A
    truck that rolls in neutral (recorded gear 0) differs from a simulator that is in gear. The force of
    another gear says nothing of missing physics: a simulator that is set to the recorded speed of every
    sample may shift late by a whole shift where the truck shifts between two samples and slows down.
    """
    apart = _by_label(prepared, runs, numbered_alike) if "gear" in runs[0].inside else None
    at_once = apart is not None and not numbered_alike
    if apart is None and "engine_speed" in runs[0].inside:
        apart = [_by_engine_speed(p, run) for p, run in zip(prepared, runs, strict=True)]
    neutral = [_rolls_in_neutral(p, run) for p, run in zip(prepared, runs, strict=True)]
    if apart is None or _never_alike([a[~n] for a, n in zip(apart, neutral, strict=True)], held_out):
        apart, at_once = neutral, False
    else:
        apart = [a | n for a, n in zip(apart, neutral, strict=True)]
    dt = prepared[0].dt
    lasting = np.ones(SAMPLES_APART if at_once else round(OTHER_GEAR_S / dt) + 1, dtype=bool)
    near = np.ones(2 * round(NEAR_S / dt) + 1, dtype=bool)
    near[: len(near) // 2] = not at_once  # before it
    return [binary_dilation(binary_opening(a, lasting), near) if a.any() else a for a in apart]


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
    u, w, y = (np.stack([_longer(x[i], longest) for x in parts]) for i in range(3))
    inside = {} if outputs is None else outputs(u, w, y)
    return [
        Run(p.y[None], {name: x[i : i + 1, : len(p.recording)] for name, x in inside.items()})
        for i, p in enumerate(prepared)
    ]


def _longer(x: Array, n: int) -> Array:
    return np.pad(x, ((0, n - len(x)), (0, 0)), mode="edge")


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
