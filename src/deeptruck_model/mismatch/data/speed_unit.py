"""Speed beside recorded engine speed: of another unit, by the gear of a simulator that tells its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.data import units
from deeptruck_model.mismatch.data.prepared import Prepared, fed
from deeptruck_model.signals import SPEED
from deeptruck_model.simulators import Simulator, forced_run
from deeptruck_model.vehicle_kinds import CLUTCH_CLOSED

GEARS_AT_MOST = 2.0  # a simulator may drive a gear or two apart, which is no unit


def check(simulator: Simulator, prepared: Sequence[Prepared]) -> None:
    """Raises InputError where speed and engine speed of the first drive with both are a unit apart. Other
    factors are no proof: tyres and axles differ."""
    told = next((p for p in prepared if "engine_speed" in p.recording.channels), None)
    scale = _scale(simulator, told) if told is not None else None
    if told is None or scale is None or 1.0 / GEARS_AT_MOST < scale < GEARS_AT_MOST:
        return
    if unit := units.likely(scale, units.SPEEDS):
        raise InputError(
            f"speed of '{told.recording.name}' is {scale:.3g} times what its engine speed tells by the "
            f"simulator's gear; {unit}"
        )


def _scale(simulator: Simulator, p: Prepared) -> float | None:
    """By how much speed is too large; None where the simulator or the recording does not tell."""
    run = forced_run(simulator, p.u[None], p.w[None], fed(simulator, p.y)[None])
    if "engine_speed" not in run.inside:
        return None
    simulated, recorded = run.inside["engine_speed"][0], p.recording.channels["engine_speed"]
    use = p.valid & (p.y[:, SPEED] > CLUTCH_CLOSED) & (recorded > 0.0)
    return float(np.median(simulated[use] / recorded[use])) if use.any() else None
