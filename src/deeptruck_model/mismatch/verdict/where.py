"""Where findings act along the drives, in which regimes the error is, and which channels predict it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from deeptruck_core.arrays import Array, Indices, Mask
from deeptruck_core.signals import FELT, FELT_SD, Said
from deeptruck_model.mismatch.correction.fit_result import acts, visible
from deeptruck_model.mismatch.mechanisms.families import EACH_DRIVE, SLOW
from deeptruck_model.mismatch.posterior.budget import Budget
from deeptruck_model.mismatch.posterior.events import Event
from deeptruck_model.mismatch.posterior.posterior import SLOW_S
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.residual.evidence import DriveRows, Evidence, Grid, unit
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.mismatch.verdict.result import Bound, Finding, Regime, Segment, Witness
from deeptruck_model.recordings import Recording

MOST_SEGMENTS, MOST_REGIMES = 60, 6
SMALL = 1e-3  # of the range of a signal: a border so near zero is at zero to whoever reads it
PRINTED = {  # of a signal in a sentence, where its name is not the word
    "elapsed": "time since the start",
    "engine": "engine force per mass",
    "engine over 3 s": "engine force per mass, mean of about 3 s",
    "engine over 60 s": "engine force per mass, mean of about 60 s",
    "brake": "brake force per mass",
    "ratio": "engine speed per speed",
    "simulated": "simulated acceleration",
    "acceleration over 2 s": "simulated acceleration, mean of about 2 s",
}
RATIO_STEP = 0.05  # relative; gears are farther apart


def located(e: Evidence, found: Sequence[Finding]) -> tuple[tuple[Segment, ...], tuple[Regime, ...]]:
    """Where the forces of findings act along the drives, and in which regimes of driving the error is."""
    forces = {i: f.force for i, f in enumerate(found) if f.force is not None}
    error = np.sum(list(forces.values()), axis=0) if forces else e.residual
    return tuple(segments(e, forces)), tuple(regimes(e, error))


def segments(e: Evidence, forces: Mapping[int, Array]) -> list[Segment]:
    """Segments of drives in which each force (n,), given by the index of its finding, is large while the
    truck moves and is compared; most important first."""
    out: list[Segment] = []
    for i, force in forces.items():
        seen = visible(e)
        on = acts(force, seen, e.dt)
        for s in e.drives:
            out += [_segment(e, force, i, s, a, b, seen) for a, b in _runs(on[s.rows], e.dt)]
    out.sort(key=lambda s: -s.energy)
    return out[:MOST_SEGMENTS]


def _segment(e: Evidence, force: Array, finding: int, s: DriveRows, a: int, b: int, seen: Mask) -> Segment:
    rows = slice(s.start + a, s.start + b)
    part = force[rows][seen[rows]]
    at = s.start_s + np.array([a, b]) * e.dt
    energy = float((part**2).sum())
    return Segment(
        s.name,
        float(at[0]),
        float(at[1]),
        finding,
        float(e.newtons(force)[rows][seen[rows]].mean()) if e.mass_known else None,
        rows.start,
        rows.stop,
        energy,
    )


def _runs(on: Mask, dt: float) -> list[tuple[int, int]]:
    """Runs of True; those less than 2 s apart are joined, those shorter than half a second are dropped."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], on.astype(int), [0]])))
    runs: list[tuple[int, int]] = []
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        if runs and (a - runs[-1][1]) * dt < 2.0:
            runs[-1] = (runs[-1][0], int(b))
        else:
            runs.append((int(a), int(b)))
    return [(a, b) for a, b in runs if (b - a) * dt >= 0.5]


def regimes(e: Evidence, error: Array) -> list[Regime]:
    """Regions of the driving signals with a disproportionate share of the squared `error` (n,), by a small
    decision tree."""
    named = _features(e)
    X = np.stack(list(named.values()), axis=1)[e.valid]
    power = error[e.valid] ** 2
    if len(power) < 200 or power.sum() <= 0:
        return []
    capped = np.minimum(power, float(np.quantile(power, 0.999)))
    ranges = np.ptp(X, axis=0)
    out = []
    for rows, box in _boxes(X, capped, max(40, len(power) // 100)):
        share, time = float(power[rows].sum() / power.sum()), len(rows) / len(power)
        if share > 1.3 * time:
            bounds = tuple(_bound(name, *box[k], ranges[k], e) for k, name in enumerate(named) if k in box)
            where = Said.joined(" and ", map(str, bounds)) or "everywhere"
            out.append(Regime(where, share, time, bounds))
    return sorted(out, key=lambda r: -r.share_of_error)


def _features(e: Evidence) -> dict[str, Array]:
    """Signals and short-term memories of them, (n,) each."""
    out = {name: e[name] for name in ("speed", "engine", "brake")}
    for name in (
        "grade",
        "gear",
        "gap",
        "ambient_temperature",
        "elevation",
        "elapsed",
    ):
        if e.has(name):
            out[name] = e[name]
    if e.has("ratio"):
        # engine speed and speed are not sampled at one moment, so that their ratio shows the acceleration
        coarse = np.log(np.maximum(np.nan_to_num(e["ratio"]), 1e-3)) / RATIO_STEP
        out["ratio"] = np.exp(np.round(coarse) * RATIO_STEP)
        out["engine_speed"] = out["ratio"] * e["speed"]
    for name in ("engine_command", "brake_command"):
        if e.has(name):
            out[name] = e[name]
            out[f"change of {name}"] = e[name] - e.lag(e[name], 1.0)
    pull, power = np.maximum(e["engine"], 0.0), e["brake"] * e["speed"]
    out["engine over 3 s"], out["engine over 60 s"] = e.lag(pull, 3.0), e.lag(pull, 60.0, "zero")
    if e.model_discrepancy == 0.0:  # what a learned simulator learned badly is in its acceleration too
        out["simulated"], out["acceleration over 2 s"] = e["simulated"], e.lag(e["simulated"], 2.0)
    if power.max(initial=0.0) > 0:
        out["braking power over 60 s"], out["braking power over 300 s"] = (
            e.lag(power, 60.0, "zero"),
            e.lag(power, 300.0, "zero"),
        )
        out["time since braking"] = np.minimum(e.since(e["brake"] > 0.1), 300.0)
    return out


def with_channels(prepared: Sequence[Prepared], happened: Sequence[Event]) -> tuple[Event, ...]:
    """The events with the recorded channels, besides the motion, that move in them as in few other spans of
    the same length along that drive: much more, or not at all."""
    of = {p.recording.name: p.recording for p in prepared}
    return tuple(replace(x, channels=tuple(_unusual(of[x.recording], x))) for x in happened)


def _unusual(r: Recording, x: Event) -> Iterator[str]:
    begin, end = np.searchsorted(r.time, (x.start_s, x.end_s)).tolist()
    length = end - begin
    every = range(0, len(r) - length + 1, max(1, length // 2))
    starts = [a for a in every if abs(a - begin) >= length]
    for name in sorted(r.channels.keys() - {"speed", "acceleration"}):
        own, *others = (float(np.ptp(r.channels[name][a : a + length])) for a in (begin, *starts))
        known = np.array(others)[np.isfinite(others)]
        if np.isfinite(own) and np.mean(known >= own if own else known == 0.0) <= Limits.seldom:
            yield name


Box = dict[int, tuple[float, float]]  # lower and upper bound of a column


def _boxes(X: Array, power: Array, least: int) -> list[tuple[Indices, Box]]:
    """Rows and bounds of the leaves of a regression tree of `power` (n,) on the columns of X (n, k), grown
    best first; no leaf has fewer rows than `least`. Breiman et al. (1984), Classification and Regression
    Trees."""
    leaves = [(np.arange(len(power)), Box())]
    cuts = [_best_cut(X, power, least)]
    for _ in range(MOST_REGIMES - 1):
        k = int(np.argmax([gain for gain, *_ in cuts]))
        (rows, box), (gain, column, at) = leaves.pop(k), cuts.pop(k)
        if gain <= 0.0:
            return [*leaves, (rows, box)]
        low, high = box.get(column, (-np.inf, np.inf))
        below = X[rows, column] <= at
        for part, bound in ((rows[below], (low, at)), (rows[~below], (at, high))):
            leaves.append((part, {**box, column: bound}))
            cuts.append(_best_cut(X[part], power[part], least))
    return leaves


def _best_cut(X: Array, power: Array, least: int) -> tuple[float, int, float]:
    """The cut that explains most of the variance: the fall of the sum of squares, its column and value."""
    best, n = (0.0, 0, 0.0), len(power)
    if n < 2 * least:
        return best
    left = np.arange(1, n)
    for column, values in enumerate(X.T):
        order = np.argsort(values, kind="stable")  # what is unknown comes last, and is above every cut
        x, total = values[order], np.cumsum(power[order])
        gain = total[:-1] ** 2 / left + (total[-1] - total[:-1]) ** 2 / (n - left) - total[-1] ** 2 / n
        gain[~(x[1:] > x[:-1])] = 0.0
        gain[: least - 1] = gain[n - least :] = 0.0
        if gain.max() > best[0]:
            k = int(gain.argmax())
            best = (float(gain[k]), column, float(x[k] + x[k + 1]) / 2.0)
    return best


def _bound(name: str, low: float, high: float, extent: float, e: Evidence) -> Bound:
    low, high = (0.0 if abs(at) <= SMALL * extent else at for at in (low, high))
    return Bound(PRINTED.get(name, name.replace("_", " ")), low, high, unit(name, e.command_units))


LEAST_DRIVES = {EACH_DRIVE: Limits.witness_drives, SLOW: Limits.witness_drives_slow}


def witnesses(regression: Regression, prepared: Sequence[Prepared], found: Budget) -> tuple[Witness, ...]:
    """The channels that predict a constant per drive or a slow drift, best first, if that part has a share of
    at least `rules.witness`."""
    e, rules = regression.e, regression.rules
    taken = {"speed", "acceleration", FELT, FELT_SD}
    for p in prepared:
        taken |= {*p.recording.interface.u, *p.recording.interface.w}
    names = {n for p in prepared for n, x in p.recording.channels.items() if np.isfinite(x).any()} - taken
    block = max(1, round(e.dt / prepared[0].dt))
    grid = Grid(prepared, [s.held_out for s in e.drives], block)
    out = []
    for part in (EACH_DRIVE, SLOW):
        force = found.force(part, e.residual)
        if found.share(part) < rules.witness:
            continue
        for name in sorted(names):
            x = grid.stack(
                [p.recording.channels.get(name, np.full(len(p.recording), np.nan)) for p in prepared]
            )
            share = _predicted(regression, force, x, part)
            if share > rules.witness:
                out.append(Witness(name, part, share))
    return tuple(sorted(out, key=lambda w: -w.share))


def _predicted(regression: Regression, force: Array, x: Array, part: str) -> float:
    """Share of the variance of a force's means (n,) that a linear function of a channel (n,) predicts,
    each drive by a fit to the others; zero where too few drives have the channel."""
    e, used = regression.e, np.zeros(len(regression.e), dtype=bool)
    used[regression.rows] = True
    means, owner = [], []
    for i, s in enumerate(e.drives):
        length = s.stop - s.start if part == EACH_DRIVE else max(1, round(SLOW_S / e.dt))
        for begin in range(s.start, s.stop - length + 1, max(length, 1)):
            rows = np.arange(begin, begin + length)
            rows = rows[used[rows] & np.isfinite(x[rows])]
            if len(rows) >= Limits.witness_known * length:
                means.append((float(x[rows].mean()), float(force[rows].mean())))
                owner.append(i)
    drives = np.unique(owner)
    if len(drives) < LEAST_DRIVES[part]:
        return 0.0
    a, b, of = *np.array(means).T, np.array(owner)
    error = np.zeros(len(b))
    for i in drives:
        here, there = of == i, of != i
        spread = float(np.var(a[there]))
        if spread <= 0.0:
            return 0.0
        slope = float(np.mean((a[there] - a[there].mean()) * (b[there] - b[there].mean()))) / spread
        error[here] = b[here] - b[there].mean() - slope * (a[here] - a[there].mean())
    total = float(np.sum((b - b.mean()) ** 2))
    return 1.0 - float(np.sum(error**2)) / total if total > 0.0 else 0.0
