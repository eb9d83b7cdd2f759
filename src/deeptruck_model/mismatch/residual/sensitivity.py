"""Sensitivity of the simulated acceleration to the simulator's parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION
from deeptruck_model.mismatch.prepare.prepared import Prepared, fill, widen
from deeptruck_model.mismatch.prepare.runs import forced
from deeptruck_model.mismatch.residual import components
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.forced import Grid
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.simulators import Run, Simulator

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

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
