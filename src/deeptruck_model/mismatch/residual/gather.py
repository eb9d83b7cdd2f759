"""Drive the simulator along the recordings and gather what it says, doubts and depends on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.data.prepared import Prepared, fed, fill, padded, quantum, widen
from deeptruck_model.mismatch.residual import components, effective_mass
from deeptruck_model.mismatch.residual.command_path import changed
from deeptruck_model.mismatch.residual.evidence import (
    BLOCK_LEARNED_S,
    BLOCK_S,
    LEAST_EFFECTIVE_MASS_GAIN,
    Evidence,
    Stretch,
)
from deeptruck_model.mismatch.residual.other_gear import believed, other_gear
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.signals import ACCELERATION, SPEED
from deeptruck_model.simulators import Run, Simulator, forced_run

Array = NDArray[np.float64]

ALIKE = 0.8  # of the longest drive's length, for drives that are run at once


def forced(simulator: Simulator, prepared: Sequence[Prepared], us: Sequence[Array]) -> list[Run]:
    """Runs (1, T) along every drive with the commands `us`, each (T, n_u), of one drive each.

    Those of about one length are run at once: what is stepped in Python, as a corrected truck, takes as long
    for many as for one. A shorter one goes on as it ends, which is cut off."""
    runs: dict[int, Run] = {}
    lengths = [len(u) for u in us]
    for together in _alike(lengths):
        longest = lengths[together[0]]
        drives = [(us[i], prepared[i].w, fed(simulator, prepared[i].y)) for i in together]
        u, w, y = (np.stack([padded(x, longest) for x in each]) for each in zip(*drives, strict=True))
        run = forced_run(simulator, u, w, y)
        for row, i in enumerate(together):
            own = (slice(row, row + 1), slice(lengths[i]))
            runs[i] = Run(run.y[own], {name: x[own] for name, x in run.inside.items()})
    return [runs[i] for i in range(len(us))]


def _alike(lengths: Sequence[int]) -> list[list[int]]:
    """Indices in groups of about one length, the longest of each first."""
    groups: list[list[int]] = []
    for i in sorted(range(len(lengths)), key=lambda i: -lengths[i]):
        if groups and lengths[i] > ALIKE * lengths[groups[-1][0]]:
            groups[-1].append(i)
        else:
            groups.append([i])
    return groups


Mask = NDArray[np.bool_]

PARAMETERS = ("mass", "drag_area", "rolling_resistance", "torque_gain", "brake_gain")
JITTER_RUNS = 6
SHIFT_S = 2.0  # around a shift, in which two runs open and close the clutch at different moments
TELLS, FEWEST = 1e-3, 5  # m/s^2 that a sample makes, and rows, to tell how far apart truck and simulator are
STEP = 0.04  # relative step of a parameter for its sensitivity


def gather(
    simulator: Simulator,
    prepared: Sequence[Prepared],
    held_out: Sequence[bool],
    *,
    seed: int = 0,
    moved: Mapping[str, float] | None = None,
    rules: Rules = Rules(),
    mass_kg: float | None = None,
) -> Evidence:
    """Run the simulator forced along every drive, as it is, with jittered inputs and with moved parameters.

    `moved` are relative changes already made to parameters the simulator was given with. `mass_kg` is stated
    for a simulator that does not tell its mass; else the recordings or what taught it may state it.
    """
    runs = forced(simulator, prepared, [p.u for p in prepared])
    dt = prepared[0].dt
    known_physics = bool(simulator.parameters()) or components.tells_forces(runs[0])
    block = max(1, round((BLOCK_S if known_physics else BLOCK_LEARNED_S) / dt))
    grid = _Grid(prepared, held_out, block)
    simulated = grid.stack([r.y[0, :, ACCELERATION] for r in runs])
    observed = grid.stack([p.observed for p in prepared])
    if known_physics:
        other, apart = other_gear(prepared, runs, held_out=held_out)
    else:
        other, apart = other_gear(prepared, believed(simulator, prepared), True, held_out)
    stated = _stated_mass(simulator, prepared, mass_kg)
    signals, mass, mass_known = components.signals(simulator, prepared, runs, grid, stated)
    signals["gear apart"] = grid.any(apart).astype(float)
    turning = _turning(runs, grid)
    valid = grid.valid() & ~grid.any(other)
    sooner = _sooner(simulator, prepared, grid) if known_physics else None
    apart_by = 0.0 if sooner is None else _samples_apart(observed - simulated, sooner, valid)
    evidence = Evidence(
        dt=dt * block,
        stretches=grid.stretches,
        residual=observed - simulated,
        simulated=simulated,
        disagreement=_disagreement(simulator, prepared, grid, seed, apart_by),
        valid=valid,
        other_gear=int(sum(o.sum() for o in other)),
        signals=signals | {"simulated": simulated},
        sensitivity={},
        mass=mass,
        mass_known=mass_known,
        known_physics=known_physics,
        vehicle=prepared[0].recording.interface.kind,
        moved=dict(moved or {}),
        rerun=_rerunner(simulator, prepared, grid, simulated),
        sooner=sooner,
        slow_noise=rules.slow_noise,
        rules=rules,
        command_units={name: simulator.interface.unit(name) for name in simulator.interface.u},
    )
    holds = effective_mass.holds(simulator)
    evidence.signals["effective_mass_gain"] = effective_mass.rows(simulator, evidence, turning, holds)
    left = effective_mass.held(holds).rows(evidence)
    evidence.signals.update(effective_mass.holding(holds, evidence.signals, left))
    sensitivity = _sensitivity(simulator, prepared, grid, evidence)
    evidence = replace(evidence, sensitivity=sensitivity)
    named = {f"sensitivity:{name}": column for name, column in sensitivity.items()}
    gain = {"effective_mass_gain": effective_mass.rows(simulator, evidence, turning, holds)}
    return replace(evidence, signals=evidence.signals | named | gain)


def _stated_mass(simulator: Simulator, prepared: Sequence[Prepared], mass_kg: float | None) -> float | None:
    """Mass (kg) as the user, the recordings or what taught the simulator state it, in this order."""
    recorded = [p.recording.interface.mass_kg for p in prepared]
    known = [m for m in recorded if m is not None]
    if mass_kg is not None or not known:
        return mass_kg or simulator.interface.mass_kg
    return float(np.median(known))


def _turning(runs: Sequence[Run], grid: _Grid) -> Array:
    """What a force gives in each block without brakes, for a force per mass of one."""
    each = [effective_mass.free(run.inside) for run in runs]
    known = [x[0] for x in each if x is not None]
    return grid.stack(known) if len(known) == len(runs) else np.ones(grid.stretches[-1].stop)


class _Grid:
    """Block averages of native samples, stacked over the recordings."""

    def __init__(self, prepared: Sequence[Prepared], held_out: Sequence[bool], block: int) -> None:
        self.block, self.prepared = block, prepared
        stretches, start = [], 0
        for p, out in zip(prepared, held_out, strict=True):
            rows = len(p.recording) // block
            stretches.append(Stretch(p.recording.name, start, start + rows, p.recording.start_s, out))
            start += rows
        if start == 0:
            raise InputError("the recordings are shorter than one block; record at least a few minutes")
        self.stretches = tuple(stretches)

    def stack(self, parts: Sequence[Array]) -> Array:
        """Block means; a block with an invalid sample is NaN only where all are."""
        return np.concatenate([self._blocks(p).mean(axis=1) for p in parts])

    def last(self, parts: Sequence[Array]) -> Array:
        """Last native sample of each block, for gears and other labels."""
        return np.concatenate([self._blocks(p)[:, -1] for p in parts])

    def any(self, parts: Sequence[Mask]) -> Mask:
        """Blocks with a marked sample."""
        return np.concatenate([self._blocks(p).any(axis=1) for p in parts])

    def valid(self) -> Mask:
        return np.concatenate([self._blocks(p.valid).all(axis=1) for p in self.prepared])

    def _blocks(self, x: NDArray[np.generic]) -> NDArray[np.generic]:
        n = len(x) // self.block
        return x[: n * self.block].reshape(n, self.block)


def _accelerations(
    simulator: Simulator, prepared: Sequence[Prepared], grid: _Grid, us: Sequence[Array]
) -> Array:
    return grid.stack([run.y[0, :, ACCELERATION] for run in forced(simulator, prepared, us)])


def _samples_apart(residual: Array, sooner: Array, valid: Mask) -> float:
    """How far speed strays in the doubt, in samples, one at most: the residual beside what a sample sooner
    makes, by a median in which a row counts as much as it tells. So no force behind each shift is taken for
    it. A shift a whole sample sooner tells 2, as `sooner` is the half of two steps: half a sample is the most
    that is told apart."""
    told = valid & (np.abs(sooner) > TELLS)
    if told.sum() < FEWEST:
        return 0.0
    ratio, weight = residual[told] / sooner[told], np.abs(sooner[told])
    order = np.argsort(ratio)
    sums = np.cumsum(weight[order])
    return min(abs(float(ratio[order][np.searchsorted(sums, sums[-1] / 2.0)])), 1.0)


def _disagreement(
    simulator: Simulator, prepared: Sequence[Prepared], grid: _Grid, seed: int, apart_by: float
) -> Array:
    """Sd of the simulated acceleration when the inputs move by their own quantisation and noise, and speed
    by what it changes by in `apart_by` samples: when in these a truck shifts nobody knows."""
    rng = np.random.default_rng(seed)
    parts = []
    for p in prepared:
        n, k = len(p.recording), JITTER_RUNS
        steps = np.array([quantum(column) for column in p.u.T])
        u = p.u + steps * rng.uniform(-0.5, 0.5, (k, n, p.u.shape[1]))
        y = np.repeat(p.y[None], k, axis=0)
        noise = rng.normal(0.0, max(p.speed_noise, 0.003), (k, n))
        drift = rng.normal(0.0, 0.002, (k, 1)) * p.y[None, :, SPEED]
        noise = gaussian_filter1d(noise, 2.0, axis=1) + drift
        y = _at_another_moment(y, apart_by * rng.uniform(-1.0, 1.0, (k, 1)) * p.dt, p.observed)
        y[:, :, SPEED] = np.maximum(y[:, :, SPEED] + noise, 0.0)
        run = forced_run(simulator, u, np.repeat(p.w[None], k, axis=0), fed(simulator, y))
        parts.append(run.y[:, :, ACCELERATION].std(axis=0, ddof=1))
    return grid.stack(parts)


def _at_another_moment(y: Array, later_s: float | Array, acceleration: Array) -> Array:
    """Responses (..., T, n_y) whose speed is that of a moment so much later, with this acceleration (T,)."""
    y = y.copy()
    y[..., SPEED] = np.maximum(y[..., SPEED] + later_s * acceleration, 0.0)
    return y


def _sooner(simulator: Simulator, prepared: Sequence[Prepared], grid: _Grid) -> Array:
    """What the simulated acceleration is more by, (n,), where the truck decides a sample sooner. A truck that
    steps finer than its simulator shifts before it throughout, and that is no missing physics."""
    us = [p.u for p in prepared]
    after, before = (
        _accelerations(
            simulator,
            [replace(p, y=_at_another_moment(p.y, side * p.dt, p.observed)) for p in prepared],
            grid,
            us,
        )
        for side in (1.0, -1.0)
    )
    return (after - before) / 2.0


def _sensitivity(
    simulator: Simulator, prepared: Sequence[Prepared], grid: _Grid, evidence: Evidence
) -> dict[str, Array]:
    """Change of the simulated acceleration for a 100 % change of each parameter, linearised."""
    own = simulator.parameters()
    out: dict[str, Array] = {}
    for name in PARAMETERS:
        if name in own and own[name] != 0.0:
            out[name] = _rerun_slope(simulator, prepared, grid, evidence, name)
        else:
            out[name] = components.sensitivity(evidence, name)
    return {k: v for k, v in out.items() if np.abs(v[evidence.valid]).max(initial=0.0) > 1e-4}


def _rerun_slope(
    simulator: Simulator, prepared: Sequence[Prepared], grid: _Grid, e: Evidence, name: str
) -> Array:
    """The slope between two reruns. Where these shift one may be a little sooner, and the shift is all that
    they tell: there it is the slope of the components, as far off as before and after."""
    value = simulator.parameters()[name]
    us = [p.u for p in prepared]
    low, high = (
        forced(simulator.with_parameters({name: value * (1 + s)}), prepared, us) for s in (-STEP, STEP)
    )
    slope = grid.stack([(b.y - a.y)[0, :, ACCELERATION] for a, b in zip(low, high, strict=True)]) / (2 * STEP)
    if "gear" not in low[0].inside:
        return slope
    dt = prepared[0].dt
    apart = grid.any([_shifts(a, dt) | _shifts(b, dt) for a, b in zip(low, high, strict=True)])
    apart &= e["effective_mass_gain"] > LEAST_EFFECTIVE_MASS_GAIN  # beyond, brakes act and not the engine
    known = np.nan_to_num(components.sensitivity(e, name))
    return known + fill(np.where(apart, np.nan, slope - known))


def _shifts(run: Run, dt: float) -> Mask:
    """Samples (n,) near a shift: the clutch opens before the gear changes."""
    gear, near = run.inside["gear"][0], round(SHIFT_S / dt)
    return widen(np.diff(gear, prepend=gear[0]) != 0, near, near)


def _rerunner(
    simulator: Simulator, prepared: Sequence[Prepared], grid: _Grid, simulated: Array
) -> Callable[[str, float], Array]:
    @lru_cache(maxsize=256)
    def rerun(name: str, amount: float) -> Array:
        us = [changed(p, name, amount) for p in prepared]
        return _accelerations(simulator, prepared, grid, us) - simulated

    return rerun
