"""Does the fit improve? Open-loop error on recordings that were not used for the fit, before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.correction.corrected_truck import EXOGENOUS, CorrectedTruck
from deeptruck_model.mismatch.data.prepared import Prepared, fed, padded
from deeptruck_model.mismatch.fit_result import Compared, Errors, Improvement, Interval
from deeptruck_model.mismatch.residual.evidence import turns
from deeptruck_model.signals import ACCELERATION, SPEED
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]

HORIZONS_S = (40.0, 20.0, 10.0)  # of free runs: what is slow adds up, and what helps 20 s may harm 40
ENOUGH = 4  # runs one after another, to take such long ones
SETTLE_S = 6.0  # forced along the recording before each free window
BOOTSTRAPS = 1000


def free_windows(
    simulator: Simulator, prepared: Sequence[Prepared], horizon_s: float, *, alone: bool = False
) -> Errors:
    """Free runs of `horizon_s` one after another along each recording, with a forced stretch before each, and
    once more from halfway between their beginnings: what a run tells hangs on where it happens to begin.

    `alone`: a corrected simulator is told no channel that the protocol does not carry.
    The inner state goes on from window to window, so slow memories (heat, distance) are those of the whole
    drive.
    """
    dt = simulator.dt
    settle, horizon = round(SETTLE_S / dt), round(horizon_s / dt)
    halfway = (horizon + settle) // 2
    found = [(i, _starts(p, settle, horizon, more)) for more in (0, halfway) for i, p in enumerate(prepared)]
    used, starts = [i for i, s in found if s], [s for _, s in found if s]
    if not used:
        empty = np.zeros((0, horizon))
        none = np.zeros(0, dtype=np.intp)
        return Errors(empty, empty, none, none)
    length = max(len(prepared[i].recording) for i in used)
    u, w, y, observed = (
        np.stack([padded(getattr(prepared[i], f), length) for i in used]) for f in ("u", "w", "y", "observed")
    )
    predicted = _run(simulator, u, w, y, starts, horizon, [] if alone else prepared, used, length)
    speed, acceleration, owner, begin = [], [], [], []
    for row, i in enumerate(used):
        for s in starts[row]:
            cut = slice(s + 1, s + 1 + horizon)
            speed.append(predicted[row, cut, SPEED] - y[row, cut, SPEED])
            acceleration.append(predicted[row, cut, ACCELERATION] - observed[row, cut])
            owner.append(i)
            begin.append(s + 1)
    return Errors(np.stack(speed), np.stack(acceleration), np.array(owner), np.array(begin))


def horizon(prepared: Sequence[Prepared]) -> float:
    """Length of free runs along these recordings, s: the longest of which enough fit between their gaps."""
    for long in HORIZONS_S:
        runs = sum(len(_starts(p, round(SETTLE_S / p.dt), round(long / p.dt), 0)) for p in prepared)
        if runs >= ENOUGH:
            return long
    return HORIZONS_S[-1] if prepared else HORIZONS_S[0]


def joined(parts: Sequence[Errors]) -> Errors:
    """The free runs of all of them, as along recordings one after the other."""
    first = np.cumsum([0] + [int(p.recording.max(initial=-1)) + 1 for p in parts])
    return Errors(
        np.concatenate([p.speed for p in parts]),
        np.concatenate([p.acceleration for p in parts]),
        np.concatenate([p.recording + k for p, k in zip(parts, first, strict=False)]),
        np.concatenate([p.start for p in parts]),
    )


def _run(
    simulator: Simulator,
    u: Array,
    w: Array,
    y: Array,
    starts: Sequence[Sequence[int]],
    horizon: int,
    prepared: Sequence[Prepared],
    used: Sequence[int],
    length: int,
) -> Array:
    free = np.zeros(u.shape[:2], dtype=bool)
    for row, own in enumerate(starts):
        for s in own:
            free[row, s + 1 : s + horizon] = True
    if isinstance(simulator, CorrectedTruck):
        exogenous = _exogenous(prepared, used, length)
        simulator = simulator.along(exogenous) if simulator.adds else simulator.base
    state, known = simulator.reset(y[:, 0]), fed(simulator, y)
    out = y.copy()
    for k in range(length - 1):
        state, response = simulator.step(state, u[:, k], w[:, k])
        out[:, k + 1] = response
        if not free[:, k + 1].all():
            mixed = np.where(free[:, k + 1, None], response, known[:, k + 1])
            state = simulator.force(state, mixed)
    return out


def _exogenous(prepared: Sequence[Prepared], used: Sequence[int], length: int) -> dict[str, Array]:
    out = {}
    for name in EXOGENOUS if prepared else ():
        if all(name in prepared[i].recording.channels for i in used):
            out[name] = np.stack([padded(prepared[i].recording.channels[name], length) for i in used])
    if "engine_speed" in out:
        driven = np.stack([padded(prepared[i].y[:, SPEED], length) for i in used])
        out["ratio"] = turns(out["engine_speed"], driven)
    return out


def _starts(p: Prepared, settle: int, horizon: int, more: int) -> list[int]:
    """Where runs begin; after each gap the first is `more` samples later than it could be."""
    out, k, after_gap = [], settle, True
    while k + horizon + 1 < len(p.recording):
        if p.valid[k : k + horizon].mean() <= 0.9:
            k, after_gap = k + max(1, settle), True
        elif after_gap and more:
            k, after_gap = k + more, False
        else:
            out.append(k)
            k, after_gap = k + horizon + settle, False
    return out


def compared(errors: Mapping[str, Errors]) -> Compared | None:
    """RMSE of each simulator by its name in `Compared`; None without a free run."""
    if not len(errors["before"].speed):
        return None
    return Compared(**{name: e.rmse() for name, e in errors.items()})


def improvement(judged: Mapping[str, Errors], seed: int = 0) -> Improvement:
    """Bootstrap intervals over recordings of the relative improvement, over the free runs in `judged`."""
    before, after, tuned = judged["before"], judged["after"], judged["parameters_only"]
    recordings = len(np.unique(before.recording))
    return Improvement(interval(before, after, seed), interval(tuned, after, seed), recordings)


def interval(old: Errors, new: Errors, seed: int = 0) -> Interval:
    """95 % interval of 1 - new / old, of the mean speed error of a free run (`Errors.of_a_run`)."""
    rng = np.random.default_rng(seed)
    owners = np.unique(old.recording)
    a, b = old.of_runs(), new.of_runs()
    groups = [np.flatnonzero(old.recording == o) for o in owners]
    if len(owners) < 3:
        groups = [np.array([i]) for i in range(len(a))]  # too few recordings: windows
    gains = []
    for _ in range(BOOTSTRAPS):
        pick = np.concatenate([groups[i] for i in rng.integers(0, len(groups), len(groups))])
        gains.append(1.0 - b[pick].mean() / a[pick].mean())
    low, high = np.quantile(gains, [0.025, 0.975])
    return float(low), float(high)
