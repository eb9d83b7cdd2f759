"""What the simulated acceleration is made of: read from a physics truck, asked of a deep one.

A deep truck cannot be opened. It is asked instead: the last LOOK_BACK_S of a command are replaced by nothing and the
change of its answer is that command's share.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.evidence import GRAVITY, Evidence
from deeptruck_model.signals import ACCELERATION, SPEED
from deeptruck_model.simulators import Run, Simulator, forced_run

if TYPE_CHECKING:
    from deeptruck_model.mismatch.residual import Prepared

Array = NDArray[np.float64]

LOOK_BACK_S = 2.0
WARM_UP_S = 8.0
ASK_EVERY_S = 0.4
AIR_DENSITY = 1.2  # kg/m^3
TYPICAL_DRAG_AREA = 6.0  # m^2, SuperTruck-era tractor-trailer to unaided box: 5-7 (NACFE)
TYPICAL_ROLLING = 0.006  # SAE J1269-class truck tyres 0.005-0.008
DIESEL_J_PER_CM3 = 35.8e3
DIESEL_J_PER_G = 42.8e3
BRAKE_EFFICIENCY = 0.40
TYPICAL_MASS = 20000.0
RECORDED = (
    "gear",
    "engine_speed",
    "engine_torque",
    "elevation",
    "gap",
    "leader_speed",
    "ambient_temperature",
    "latitude",
    "longitude",
    "fuel_rate",
)


def signals(
    simulator: Simulator, prepared: Sequence[Prepared], runs: Sequence[Run], grid: Any
) -> tuple[dict[str, Array], float]:
    """The stacked signals mechanisms are made of, and the mass (kg) that turns specific forces into N."""
    out: dict[str, Array] = {
        "speed": grid.stack([p.y[:, SPEED] for p in prepared]),
        "acceleration": grid.stack([p.observed for p in prepared]),
        "time": grid.stack([p.recording.time for p in prepared]),
        "elapsed": grid.stack([p.recording.time - p.recording.start_s for p in prepared]),
        "distance": grid.stack([np.cumsum(p.y[:, SPEED]) * p.dt for p in prepared]),
    }
    for name in (*prepared[0].recording.interface.u, *prepared[0].recording.interface.w):
        out[name] = grid.stack([_column(p, name) for p in prepared])
    for name in RECORDED:
        if any(name in p.recording.channels for p in prepared):
            take = grid.last if name == "gear" else grid.stack
            out[name] = take(
                [p.recording.channels.get(name, np.full(len(p.recording), np.nan)) for p in prepared]
            )
    if "traction_force" in runs[0].inside:
        mass = _from_inside(out, runs, grid)
    else:
        mass = _from_questions(out, simulator, prepared, grid)
    _ratio(out)
    return out, mass


def sensitivity(e: Evidence, name: str) -> Array:
    """Change of acceleration for +100 % of a parameter, from the components (used where it cannot be run)."""
    if name == "mass":
        return -(e["engine"] - e["brake"] - e["drag"])
    if name == "torque_gain":
        return np.maximum(e["engine"], 0.0)
    return {"drag_area": -e["drag"], "rolling_resistance": -e["rolling"], "brake_gain": -e["brake"]}[name]


def _column(p: Prepared, name: str) -> Array:
    interface = p.recording.interface
    return p.u[:, interface.u.index(name)] if name in interface.u else p.w[:, interface.w.index(name)]


def _from_inside(out: dict[str, Array], runs: Sequence[Run], grid: Any) -> float:
    """Specific forces of a physics truck; also its gear and engine speed where the recording has none."""

    def inside(name: str) -> list[Array]:
        return [r.inside[name][0] for r in runs]

    mass = float(np.median(inside("mass")[0]))
    out["engine"] = grid.stack(inside("traction_force")) / mass
    for name, force in (("brake", "brake_force"), ("drag", "drag_force"), ("rolling", "rolling_force")):
        out[name] = np.abs(grid.stack(inside(force))) / mass
    out.setdefault("gear", grid.last(inside("gear")))
    out.setdefault("engine_speed", grid.stack(inside("engine_speed")))
    out["modelled_torque"] = grid.stack(inside("engine_torque"))
    return mass


def _from_questions(
    out: dict[str, Array], simulator: Simulator, prepared: Sequence[Prepared], grid: Any
) -> float:
    """Specific forces of a black box by counterfactual runs, and a mass from power where power is recorded."""
    names = simulator.interface.u
    engine, brake = [], []
    for p in prepared:
        base, shares = _ask(simulator, p)
        engine.append(base - shares[0])
        brake.append(np.maximum(shares[1] - base, 0.0) if len(names) > 1 else np.zeros(len(base)))
    out["engine"], out["brake"] = grid.stack(engine), grid.stack(brake)
    mass = _mass(out)
    out["drag"] = 0.5 * AIR_DENSITY * TYPICAL_DRAG_AREA / mass * out["speed"] ** 2
    out["rolling"] = np.full_like(out["speed"], TYPICAL_ROLLING * GRAVITY)
    return mass


def _ask(simulator: Simulator, p: Prepared) -> tuple[Array, list[Array]]:
    """Simulated acceleration (n,) with the commands as recorded, and with each command silent for LOOK_BACK_S."""
    back, warm = max(1, round(LOOK_BACK_S / p.dt)), round(WARM_UP_S / p.dt)
    length = warm + back + 1
    every = max(1, round(ASK_EVERY_S / p.dt))
    ends = np.arange(length, len(p.recording), every)
    if len(ends) < 2:
        zero = np.zeros(len(p.recording))
        return zero, [zero] * p.u.shape[1]
    index = ends[:, None] + np.arange(-length + 1, 1)[None]
    u, w, y = p.u[index], p.w[index], p.y[index]

    def answer(commands: Array) -> Array:
        last = forced_run(simulator, commands, w, y).y[:, -1, ACCELERATION]
        return np.interp(np.arange(len(p.recording)), ends, last)

    silent = []
    for i in range(p.u.shape[1]):
        changed = u.copy()
        changed[:, -back - 1 :, i] = np.minimum(changed[:, -back - 1 :, i], 0.0) if i == 0 else 0.0
        silent.append(answer(changed))
    return answer(u), silent


def _mass(out: dict[str, Array]) -> float:
    """Power at the wheels over specific power, the median where the engine clearly pulls; a typical mass otherwise."""
    pulling = (out["engine"] > 0.15) & (out["speed"] > 5.0)
    if "engine_torque" in out and "engine_speed" in out:
        power = 0.93 * out["engine_torque"] * out["engine_speed"]
    elif "fuel_rate" in out:
        power = BRAKE_EFFICIENCY * DIESEL_J_PER_CM3 * out["fuel_rate"]
    else:
        return TYPICAL_MASS
    ratio = (power / np.maximum(out["engine"] * out["speed"], 1e-3))[pulling]
    ratio = ratio[np.isfinite(ratio)]
    return float(np.clip(np.median(ratio), 800.0, 60000.0)) if len(ratio) > 50 else TYPICAL_MASS


def _ratio(out: dict[str, Array]) -> None:
    """Engine turns per metre (rad/m) and whether the driveline is closed, where engine speed is known."""
    if "engine_speed" not in out:
        return
    speed = np.maximum(out["speed"], 0.5)
    ratio = out["engine_speed"] / speed
    out["ratio"] = np.where(np.isfinite(ratio), np.clip(ratio, 0.0, 150.0), np.nan)
