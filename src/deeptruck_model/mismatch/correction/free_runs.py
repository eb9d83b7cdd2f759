"""Free runs along recordings, and how much smaller a correction makes their errors.

Many corrections of one simulator run in one batch, because a step of the batch costs little more than a step
of one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.signals import ACCELERATION, SPEED
from deeptruck_model.mismatch.correction.added import Added, TruckWithForces
from deeptruck_model.mismatch.correction.corrected_truck import EXOGENOUS, CorrectedTruck
from deeptruck_model.mismatch.correction.fit_result import Errors, FreeRunErrors, Improvement, Interval
from deeptruck_model.mismatch.mechanisms.own import EXTRA
from deeptruck_model.mismatch.prepare.prepared import Prepared, fed, padded
from deeptruck_model.mismatch.residual import effective_mass
from deeptruck_model.mismatch.residual.evidence import turns
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.simulators import Simulator, run
from deeptruck_model.simulators.running import stepped

BOOTSTRAPS = 1000


@dataclass(frozen=True)
class _Row:
    """A pass along a recording, the recording's index in the list, and the samples at which free runs
    start."""

    prepared: Prepared
    place: int
    starts: list[int]


def free_windows(simulator: Simulator, prepared: Sequence[Prepared], horizon_s: float) -> Errors:
    """Free runs of one simulator; see `free_runs`."""
    return free_runs([(simulator, prepared)], horizon_s)[0]


def free_runs(
    jobs: Sequence[tuple[Simulator, Sequence[Prepared]]], horizon_s: float, *, exogenous: bool = True
) -> list[Errors]:
    """Consecutive free runs of `horizon_s` of each simulator along its recordings, each after a forced
    segment.

    They are repeated with starts shifted by half a run, because the error of a run depends on where it
    starts. Without `exogenous` a corrected simulator gets only channels that the protocol carries. The inner
    state is carried over from window to window, so that slow states (heat, distance) are those of the whole
    drive.
    """
    steps = [round(horizon_s / simulator.dt) for simulator, _ in jobs]
    rows = [_rows(prepared, n) for (_, prepared), n in zip(jobs, steps, strict=True)]
    found = [_errors((), np.zeros((0, 0, 2)), n) for n in steps]
    channels = [_common(own) for own in rows]
    for simulator, members in batches([s for s, _ in jobs], list(map(len, rows)), channels):
        predicted = _run(simulator, [row for k in members for row in rows[k]], steps[members[0]], exogenous)
        ends = np.cumsum([len(rows[k]) for k in members])
        for k, part in zip(members, np.split(predicted, ends[:-1]), strict=True):
            found[k] = _errors(rows[k], part, steps[k])
    return found


def _rows(prepared: Sequence[Prepared], steps: int) -> list[_Row]:
    out = []
    for half in (0, 1):
        for place, p in enumerate(prepared):
            settle = round(Limits.settle_s / p.dt)
            starts = _starts(p, settle, steps, half * (steps + settle) // 2)
            out += [_Row(p, place, starts)] if starts else []
    return out


def _errors(rows: Sequence[_Row], predicted: Array, steps: int) -> Errors:
    """Errors of the windows of `rows`, `steps` long, for predicted responses (rows, T, n_y)."""
    cuts = [(k, slice(s + 1, s + 1 + steps)) for k, row in enumerate(rows) for s in row.starts]
    speed = [predicted[k, cut, SPEED] - rows[k].prepared.y[cut, SPEED] for k, cut in cuts]
    acceleration = [predicted[k, cut, ACCELERATION] - rows[k].prepared.observed[cut] for k, cut in cuts]
    empty = np.zeros((0, steps))
    return Errors(
        np.stack(speed) if cuts else empty,
        np.stack(acceleration) if cuts else empty,
        np.array([rows[k].place for k, _ in cuts], dtype=np.intp),
        np.array([cut.start for _, cut in cuts], dtype=np.intp),
    )


def horizon(prepared: Sequence[Prepared]) -> float:
    """Length of free runs, s: the longest that fits often enough between the gaps of these recordings."""
    for long in Limits.horizons_s:
        runs = sum(len(_starts(p, round(Limits.settle_s / p.dt), round(long / p.dt), 0)) for p in prepared)
        if runs >= Limits.least_runs:
            return long
    return Limits.horizons_s[-1] if prepared else Limits.horizons_s[0]


def _run(simulator: Simulator | TruckWithForces, rows: Sequence[_Row], steps: int, exogenous: bool) -> Array:
    """Responses (rows, T, n_y): free within the windows, forced by the recorded ones outside."""
    length = max(len(row.prepared.recording) for row in rows)
    u, w, y = (np.stack([padded(getattr(r.prepared, f), length) for r in rows]) for f in ("u", "w", "y"))
    free = np.zeros(u.shape[:2], dtype=bool)
    for row, own in enumerate(rows):
        for s in own.starts:
            free[row, s + 1 : s + steps] = True
    base = simulator.base if isinstance(simulator, TruckWithForces) else simulator
    mixed = np.where(free[:, :, None], np.nan, fed(base, y))
    if not isinstance(simulator, TruckWithForces):
        return np.asarray(run(simulator, u, w, y[:, 0], mixed).y)
    simulator = simulator.along(_exogenous(rows, length)) if exogenous else simulator
    return stepped(simulator, u, w, y[:, 0], mixed, inside=False).y


def _common(rows: Sequence[_Row]) -> tuple[str, ...]:
    """Signals beyond the protocol that all these recordings have, among them channels of the user's."""
    each = [row.prepared.recording.channels for row in rows]
    own = [EXTRA + name for name in (each[0] if each else ())]
    return tuple(n for n in (*EXOGENOUS, *own) if all(n.removeprefix(EXTRA) in one for one in each))


def _exogenous(rows: Sequence[_Row], length: int) -> dict[str, Array]:
    drives = [row.prepared for row in rows]
    out = {
        n: np.stack([padded(p.recording.channels[n.removeprefix(EXTRA)], length) for p in drives])
        for n in _common(rows)
    }
    out["place"] = np.stack([padded(p.place(), length) for p in drives])
    if "engine_speed" in out:
        driven = np.stack([padded(p.y[:, SPEED], length) for p in drives])
        out["ratio"] = turns(out["engine_speed"], driven)
    return out


def _starts(p: Prepared, settle: int, steps: int, more: int) -> list[int]:
    """Samples at which free runs start; the first after each gap is delayed by `more` samples."""
    out, k, after_gap = [], settle, True
    while k + steps + 1 < len(p.recording):
        if p.valid[k : k + steps].mean() <= Limits.least_compared:
            k, after_gap = k + max(1, settle), True
        elif after_gap and more:
            k, after_gap = k + more, False
        else:
            out.append(k)
            k, after_gap = k + steps + settle, False
    return out


def free_run_errors(errors: Mapping[str, Errors]) -> FreeRunErrors | None:
    """RMSE of each simulator by its name in `FreeRunErrors`; None without a free run."""
    if not len(errors["before"].speed):
        return None
    return FreeRunErrors(**{name: e.rmse() for name, e in errors.items()})


def improvement(judged: Mapping[str, Errors]) -> Improvement:
    """Relative improvement in the free runs `judged`, with bootstrap intervals over recordings."""
    before, after, tuned = judged["before"], judged["after"], judged["parameters_only"]
    recordings = len(np.unique(before.recording))
    return Improvement(interval(before, after), interval(tuned, after), recordings)


def interval(old: Errors, new: Errors) -> Interval:
    """95 % interval of 1 - new / old, where old and new are mean speed errors of free runs."""
    rng = np.random.default_rng(0)
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


Group = tuple[Simulator | TruckWithForces, list[int]]


def batches(
    trucks: Sequence[Simulator], rows: Sequence[int], channels: Sequence[tuple[str, ...]]
) -> list[Group]:
    """For each batch: the simulator that runs it, and the trucks whose rows it holds, in order.

    Trucks share a batch if they correct the same simulator along recordings with the same `channels`. Trucks
    with different parameters share a batch only if the simulator accepts parameters per row; trucks that add
    no force have a batch of their own.
    """
    alike: dict[tuple[Any, ...], list[int]] = {}
    for k, truck in enumerate(trucks):
        if rows[k]:
            alike.setdefault((*_kind(truck), channels[k]), []).append(k)
    return [(_together([trucks[k] for k in own], [rows[k] for k in own]), own) for own in alike.values()]


def _kind(truck: Simulator) -> tuple[Any, ...]:
    original, inner = _of(truck)
    apart = () if hasattr(original, "with_batch_parameters") else tuple(sorted(inner.items()))
    adds = isinstance(truck, CorrectedTruck) and truck.adds
    beside = (id(truck.shares), truck.gears) if isinstance(truck, CorrectedTruck) and truck.adds else ()
    return id(original), adds, apart, beside


def _of(truck: Simulator) -> tuple[Simulator, dict[str, float]]:
    """The base simulator of a correction, and its changed parameters."""
    return (truck.original, truck.inner) if isinstance(truck, CorrectedTruck) else (truck, {})


def _together(trucks: Sequence[Simulator], rows: Sequence[int]) -> Simulator | TruckWithForces:
    original, _ = _of(trucks[0])
    base = _base(original, [_of(t)[1] for t in trucks], rows)
    corrected = [t for t in trucks if isinstance(t, CorrectedTruck) and t.adds]
    if not corrected:
        return base
    added = Added.side_by_side([t.added for t in corrected], rows)
    first = corrected[0]
    return TruckWithForces(base, added, effective_mass.holds(original), first.shares, first.gears)


def _base(original: Any, inner: Sequence[dict[str, float]], rows: Sequence[int]) -> Simulator:
    names = sorted(set().union(*inner))
    if not names:
        return original
    if not hasattr(original, "with_batch_parameters"):
        return original.with_parameters(inner[0])
    own = original.parameters()
    return original.with_batch_parameters(
        {name: np.repeat([i.get(name, own[name]) for i in inner], rows) for name in names}
    )
