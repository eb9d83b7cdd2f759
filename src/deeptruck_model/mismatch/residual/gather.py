"""Runs the simulator along the recordings and collects residual, uncertainty and sensitivities."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.ndimage import gaussian_filter1d

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, SPEED
from deeptruck_core.vehicle_kinds import IMPOSSIBLE_ACCELERATION
from deeptruck_model.mismatch.prepare.prepared import Prepared, fed, fill, forced, quantum, widen
from deeptruck_model.mismatch.residual import components, effective_mass
from deeptruck_model.mismatch.residual.commands import RUNS, command_response
from deeptruck_model.mismatch.residual.evidence import BLOCK_LEARNED_S, BLOCK_S, Evidence, Grid
from deeptruck_model.mismatch.residual.left_out import gears_apart, with_predicted_gears
from deeptruck_model.mismatch.residual.timing import at_another_moment, of_a_sample_sooner, samples_apart
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.simulators import Run, Simulator, forced_run

JITTER_RUNS = 6
COMPARING = "comparing every mechanism with what the simulator is off by"
DRIVING = "driving the simulator along the recordings{about}, {share:.0%}"
SLOW_S = 30.0  # of driving, from which its length is said beforehand
IMPOSSIBLE = (
    "the simulator answers with more than {most:g} m/s^2 in {share:.2g} % of samples, as no vehicle does; "
    "see 'deeptruck-model check-simulator'"
)


def gather(
    simulator: Simulator,
    prepared: Sequence[Prepared],
    held_out: Sequence[bool],
    *,
    seed: int = 0,
    moved: Mapping[str, float] | None = None,
    rules: Rules = Rules(),
    mass_kg: float | None = None,
    as_given: Evidence | None = None,
    say: Callable[[str], None] = lambda step: None,
) -> Evidence:
    """Run the simulator forced along every drive: as given, with perturbed inputs, and with changed
    parameters.

    `moved` are relative changes already made to the parameters, `as_given` the evidence before them, whose
    spread under perturbed inputs is kept. `mass_kg` is stated for a simulator that does not report its mass;
    otherwise the recordings or its training data may. Other command paths are run when they are first asked
    for. `say` is called with the share that is done. Raises InputError for accelerations that no vehicle has.
    """
    progress = _Progress(say, passes(simulator) - (3 if as_given else 0))
    driven = _driven(simulator, prepared, held_out)
    progress.more(1)
    evidence = _compared(driven, held_out, seed, rules, mass_kg, as_given, progress)
    return _with_parameters(driven, replace(evidence, moved=dict(moved or {})), progress)


def driven_at(simulator: Simulator, prepared: Sequence[Prepared], e: Evidence) -> Evidence:
    """The evidence of the same rows with the simulator at other parameters, or along other commands, by one
    run: sensitivities and what depends on them stay those of `e`."""
    d = _driven(simulator, prepared, [s.held_out for s in e.drives])
    residual, simulated = d.residual()
    if not e.reports_forces:  # its forces are estimates, of the simulator as it was
        return replace(
            e, residual=residual, simulated=simulated, signals=e.signals | {"simulated": simulated}
        )
    signals, mass, _ = components.signals(simulator, prepared, d.runs, d.grid, None)
    signals["effective_mass_gain"] = effective_mass.rows(simulator, e, d.turning(), "holds" in e.signals)
    signals = e.signals | signals | {"simulated": simulated}
    return replace(e, residual=residual, simulated=simulated, signals=signals, mass=mass)


def passes(simulator: Simulator) -> int:
    """How often `gather` drives a simulator along a recording: as given, a sample sooner and later, with
    perturbed inputs (several rows in one batch), with each parameter lower and higher, and with every command
    changed."""
    own = simulator.parameters()
    moved = sum(bool(own.get(name)) for name in REFIT_PARAMETERS)
    return 4 + 2 * moved + len(RUNS) * len(simulator.interface.u)


class _Progress:
    """Says how much of the driving is done, and beforehand how long it takes, by the second passes: the first
    may compile."""

    def __init__(self, say: Callable[[str], None], total: int) -> None:
        self._say, self._total, self._done = say, total, 0
        self._ended: list[float] = []
        self._about = ""

    def more(self, count: int) -> None:
        """So many passes more are done."""
        self._ended.append(time.monotonic())
        self._done = min(self._done + count, self._total)
        if len(self._ended) == 2:
            seconds = (self._ended[1] - self._ended[0]) / count * self._total
            self._about = f" for about {seconds:.0f} s" if seconds > SLOW_S else ""
        driven = self._done < self._total
        self._say(DRIVING.format(about=self._about, share=self._done / self._total) if driven else COMPARING)


@dataclass(frozen=True)
class _Driven:
    """A simulator and its runs, forced along drives; rows are the blocks of `grid`."""

    simulator: Simulator
    prepared: Sequence[Prepared]
    runs: Sequence[Run]
    known_physics: bool
    grid: Grid

    def residual(self) -> tuple[Array, Array]:
        """Observed minus simulated acceleration (n,), and the simulated one."""
        simulated = self.grid.stack([r.y[0, :, ACCELERATION] for r in self.runs])
        return self.grid.stack([p.observed for p in self.prepared]) - simulated, simulated

    def gears_apart(self, held_out: Sequence[bool]) -> tuple[list[Mask], list[Mask]]:
        """Native samples of each drive in which the simulator drives in another gear, and those near which it
        shifts at another moment."""
        runs = self.runs if self.known_physics else with_predicted_gears(self.simulator, self.prepared)
        return gears_apart(self.prepared, runs, not self.known_physics, held_out)

    def turning(self) -> Array:
        """Acceleration without brakes for a unit force per mass, in each block."""
        each = [effective_mass.free(run.inside) for run in self.runs]
        known = [x[0] for x in each if x is not None]
        return self.grid.stack(known) if len(known) == len(self.runs) else np.ones(len(self.grid))


def _driven(simulator: Simulator, prepared: Sequence[Prepared], held_out: Sequence[bool]) -> _Driven:
    runs = forced(simulator, prepared, [p.u for p in prepared])
    known_physics = bool(simulator.parameters()) or components.reports_forces(runs[0])
    block = max(1, round((BLOCK_S if known_physics else BLOCK_LEARNED_S) / prepared[0].dt))
    return _Driven(simulator, prepared, runs, known_physics, Grid(prepared, held_out, block))


def _compared(
    d: _Driven,
    held_out: Sequence[bool],
    seed: int,
    rules: Rules,
    mass_kg: float | None,
    as_given: Evidence | None,
    progress: _Progress,
) -> Evidence:
    """Simulated acceleration and residual along the drives, with the simulator's uncertainty."""
    simulator, prepared, grid = d.simulator, d.prepared, d.grid
    stated = _stated_mass(simulator, prepared, mass_kg)
    signals, mass, mass_known = components.signals(simulator, prepared, d.runs, grid, stated)
    residual, simulated = d.residual()
    apart, shifting = d.gears_apart(held_out)
    valid = grid.valid() & ~grid.any(apart)
    beyond = float(np.mean(np.abs(simulated[valid]) > IMPOSSIBLE_ACCELERATION)) if valid.any() else 0.0
    if beyond > Limits.no_vehicle:
        raise InputError(IMPOSSIBLE.format(most=IMPOSSIBLE_ACCELERATION, share=100.0 * beyond))
    response = command_response(simulator, prepared, d.runs, lambda: progress.more(1))
    if as_given is not None:
        sooner, disagreement = as_given.sooner, as_given.disagreement
    else:
        sooner = of_a_sample_sooner(simulator, prepared, grid) if d.known_physics else None
        apart_by = 0.0 if sooner is None else samples_apart(residual, sooner, valid)
        progress.more(2)
        disagreement = _disagreement(simulator, prepared, grid, seed, apart_by)
        progress.more(1)
    return Evidence(
        dt=prepared[0].dt * grid.block,
        drives=grid.drives,
        residual=residual,
        simulated=simulated,
        disagreement=disagreement,
        valid=valid,
        other_gear=int(sum(samples.sum() for samples in apart)),
        other_shift=grid.any(shifting),
        signals=signals | {"simulated": simulated},
        sensitivity={},
        mass=mass,
        mass_known=mass_known,
        reports_forces=components.reports_forces(d.runs[0]),
        known_physics=d.known_physics,
        vehicle=prepared[0].recording.interface.kind,
        rerun=lru_cache(maxsize=256)(lambda name, amount: grid.stack(response(name, amount))),
        sooner=sooner,
        rules=rules,
        user_mechanisms=() if as_given is None else as_given.user_mechanisms,
        command_units={name: simulator.interface.unit(name) for name in simulator.interface.u},
    )


def _with_parameters(d: _Driven, e: Evidence, progress: _Progress) -> Evidence:
    """The evidence with the sensitivities to parameters and the effective-mass gain.

    Brakes that hold a deceleration respond to more rolling resistance as to any force, so that their gain is
    computed last.
    """
    holds, turning = e.has("brake_command") and effective_mass.holds(d.simulator), d.turning()
    e.signals["effective_mass_gain"] = effective_mass.rows(d.simulator, e, turning, holds)
    left = effective_mass.held(holds).rows(e)
    e.signals.update(effective_mass.holding(holds, e.signals, left))
    columns = sensitivities(d.simulator, d.prepared, d.grid, e, lambda: progress.more(2))
    if not e.reports_forces:
        e.signals.update(components.as_large_as_they_act(e, columns, d.simulator.parameters()))
    e = replace(e, sensitivity=columns)
    named = {f"sensitivity:{name}": column for name, column in columns.items()}
    gain = {"effective_mass_gain": effective_mass.rows(d.simulator, e, turning, holds)}
    return replace(e, signals=e.signals | named | gain)


def _stated_mass(simulator: Simulator, prepared: Sequence[Prepared], mass_kg: float | None) -> float | None:
    """Mass (kg) stated by the user, the recordings or the simulator's training data, in this order."""
    recorded = [p.recording.interface.mass_kg for p in prepared]
    known = [m for m in recorded if m is not None]
    if mass_kg is not None or not known:
        return mass_kg or simulator.interface.mass_kg
    return float(np.median(known))


def _disagreement(
    simulator: Simulator, prepared: Sequence[Prepared], grid: Grid, seed: int, apart_by: float
) -> Array:
    """Sd of the simulated acceleration when inputs are perturbed by their quantisation and noise, and speed
    by its change over `apart_by` samples, within which the time of a shift is unknown."""
    rng = np.random.default_rng(seed)
    parts = []
    for p in prepared:
        n, k = len(p.recording), JITTER_RUNS
        steps = np.array([quantum(column) for column in p.u.T])
        u = p.u + steps * rng.uniform(-0.5, 0.5, (k, n, p.u.shape[1]))
        y = np.repeat(p.y[None], k, axis=0)
        noise = rng.normal(0.0, max(p.speed_noise, Limits.speed_noise), (k, n))
        drift = rng.normal(0.0, 0.002, (k, 1)) * p.y[None, :, SPEED]
        noise = gaussian_filter1d(noise, 2.0, axis=1) + drift
        y = at_another_moment(y, apart_by * rng.uniform(-1.0, 1.0, (k, 1)) * p.dt, p.observed)
        y[:, :, SPEED] = np.maximum(y[:, :, SPEED] + noise, 0.0)
        run = forced_run(simulator, u, np.repeat(p.w[None], k, axis=0), fed(simulator, y))
        parts.append(run.y[:, :, ACCELERATION].std(axis=0, ddof=1))
    return grid.stack(parts)


REFIT_PARAMETERS = ("mass", "drag_area", "rolling_resistance", "torque_gain", "brake_gain")
STEP = 0.04  # relative step of a parameter for its sensitivity
HALVINGS = 12  # of a change that a simulator refuses
SHIFT_S = 2.0  # around a shift, in which two runs open and close the clutch at different moments


def accepted(simulator: Simulator, changes: Mapping[str, float], near: float = 0.0) -> dict[str, float]:
    """The relative changes, each halved until the simulator accepts the value, and values `near` it on both
    sides (relative)."""
    return {name: _accepted(simulator, name, change, near) for name, change in changes.items()}


def _accepted(simulator: Simulator, name: str, change: float, near: float) -> float:
    own = simulator.parameters().get(name)
    if own is None:
        return change  # not its own; a force stands for it
    for _ in range(HALVINGS):
        try:
            for value in (own * (1.0 + change) * (1.0 + side) for side in (-near, near)):
                simulator.with_parameters({name: value})
        except InputError:
            change /= 2.0
        else:
            return change
    return 0.0


def sensitivities(
    simulator: Simulator,
    prepared: Sequence[Prepared],
    grid: Grid,
    evidence: Evidence,
    ran: Callable[[], None] = lambda: None,
) -> dict[str, Array]:
    """Change of the simulated acceleration for a 100 % change of each parameter, linearised. `ran` is called
    after the two runs of a parameter."""
    out: dict[str, Array] = {}
    for name in REFIT_PARAMETERS:
        below, above = _steps(simulator, name)
        if below < above:
            out[name] = _rerun_slope(simulator, prepared, grid, evidence, name, below, above)
            ran()
        else:
            out[name] = components.sensitivity(evidence, name)
    return {
        k: v for k, v in out.items() if np.abs(v[evidence.valid]).max(initial=0.0) > Limits.least_sensitivity
    }


def _steps(simulator: Simulator, name: str) -> tuple[float, float]:
    """Relative changes to either side of a parameter, smaller or 0 if its bound is nearer than STEP; both 0
    for a parameter that the simulator lacks or that cannot be scaled."""
    if simulator.parameters().get(name, 0.0) == 0.0:
        return 0.0, 0.0
    return _accepted(simulator, name, -STEP, 0.0), _accepted(simulator, name, STEP, 0.0)


def _rerun_slope(
    simulator: Simulator,
    prepared: Sequence[Prepared],
    grid: Grid,
    e: Evidence,
    name: str,
    below: float,
    above: float,
) -> Array:
    """The slope between two reruns. Near gear shifts, which occur at different samples in the two, it is
    replaced by the slope of the components plus its interpolated offset."""
    value = simulator.parameters()[name]
    us = [p.u for p in prepared]
    low, high = (
        forced(simulator.with_parameters({name: value * (1 + s)}), prepared, us) for s in (below, above)
    )
    change = grid.stack([(b.y - a.y)[0, :, ACCELERATION] for a, b in zip(low, high, strict=True)])
    slope = change / (above - below)
    if "gear" not in low[0].inside:
        return slope
    dt = prepared[0].dt
    apart = grid.any([_shifts(a, dt) | _shifts(b, dt) for a, b in zip(low, high, strict=True)])
    apart &= (
        e["effective_mass_gain"] > Limits.least_effective_mass_gain
    )  # below it the brakes hold, not the engine
    known = np.nan_to_num(components.sensitivity(e, name))
    return known + fill(np.where(apart, np.nan, slope - known))


def _shifts(run: Run, dt: float) -> Mask:
    """Samples (n,) near a shift; the clutch opens before the gear changes."""
    gear, near = run.inside["gear"][0], round(SHIFT_S / dt)
    return widen(np.diff(gear, prepend=gear[0]) != 0, near, near)
