"""Locates the mismatch: segments of drives, and regimes of driving."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.tree import DecisionTreeRegressor

from deeptruck_model.mismatch.residual.evidence import DriveRows, Evidence, unit
from deeptruck_model.mismatch.result import Bound, Finding, Regime, Segment
from deeptruck_model.mismatch.strength import acts, visible
from deeptruck_model.signals import Said

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOST_SEGMENTS = 60
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
    cap = float(np.quantile(power, 0.999))
    tree = DecisionTreeRegressor(
        max_leaf_nodes=6, min_samples_leaf=max(40, len(power) // 100), random_state=0
    )
    tree.fit(X, np.minimum(power, cap))
    leaf = tree.apply(X)
    out = []
    for node in np.unique(leaf):
        inside = leaf == node
        share = float(power[inside].sum() / power.sum())
        time = float(inside.mean())
        if share > 1.3 * time:
            ranges = dict(zip(named, np.ptp(X, axis=0), strict=True))
            bounds = _bounds(tree, node, ranges, e.command_units)
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


def _bounds(
    tree: DecisionTreeRegressor, leaf: int, ranges: Mapping[str, float], units: Mapping[str, str]
) -> tuple[Bound, ...]:
    """The bounds on the path to a leaf, one for each signal. `ranges` of the signals, in the tree's order."""
    t, names = tree.tree_, list(ranges)
    bounds: dict[str, list[float]] = {}
    node = 0
    below = {int(n): _under(t, int(n)) for n in range(t.node_count)}
    while t.children_left[node] != -1:
        name, at = names[t.feature[node]], float(t.threshold[node])
        at = at if abs(at) > SMALL * ranges[name] else 0.0
        low_high = bounds.setdefault(name, [-np.inf, np.inf])
        if leaf in below[int(t.children_left[node])]:
            low_high[1] = min(low_high[1], at)
            node = int(t.children_left[node])
        else:
            low_high[0] = max(low_high[0], at)
            node = int(t.children_right[node])
    return tuple(
        Bound(PRINTED.get(name, name.replace("_", " ")), low, high, unit(name, units))
        for name, (low, high) in bounds.items()
    )


def _under(t: Any, node: int) -> set[int]:
    if t.children_left[node] == -1:
        return {node}
    return _under(t, int(t.children_left[node])) | _under(t, int(t.children_right[node]))
