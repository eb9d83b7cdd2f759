"""Components of the simulated acceleration: reported by a physics truck, estimated for a learned one.

A learned truck does not report components. Its responses are split by regression on recorded signals; if none
of these gives the engine's force, the engine command of the last LOOK_BACK_S is set to zero, and the change
of the response is the engine's share.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from deeptruck_core.arrays import Array
from deeptruck_core.constants import AIR_DENSITY, DIESEL_J_PER_CM3, GRAVITY
from deeptruck_core.signals import ACCELERATION, CHANNELS, FELT, FELT_SD, SPEED
from deeptruck_model.mismatch.prepare.places import NEAR_M
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.residual.effective_mass import HELD_UNIT, with_effective_mass
from deeptruck_model.mismatch.residual.evidence import Evidence, Grid, gears, overall_ratio, turns
from deeptruck_model.mismatch.residual.expression import Expression, Signal, maximum
from deeptruck_model.simulators import Run, Simulator, forced_run
from deeptruck_model.simulators.protocol_check import FORCES

KNOTS = 7
ENGINE_S = 0.4  # by which an engine's force follows its command


@dataclass(frozen=True)
class Shares:
    """Maps over speed knots (m/s): force = command * gain(speed); engine angle per distance; drag; rolling
    resistance."""

    speed: list[float]
    engine_gain: list[float]
    brake_gain: list[float]
    ratio: list[float] | None
    drag_per_square: float
    rolling: float
    mass: float

    @classmethod
    def if_unreported(cls, e: Evidence) -> Shares | None:
        """The maps of a simulator that does not report its forces; None if it does."""
        return None if e.reports_forces else cls.of(e)

    @classmethod
    def of(cls, e: Evidence) -> Shares:
        """Fit the maps to the evidence by least squares on linear splines of speed."""
        speed = e["speed"]
        knots = np.linspace(0.0, max(float(np.quantile(speed[e.valid], 0.99)), 5.0), KNOTS)
        basis = np.maximum(1.0 - np.abs(speed[:, None] - knots) / (knots[1] - knots[0]), 0.0)

        def gain(command: str, share: Array, late_s: float) -> list[float]:
            if not e.has(command):
                return [0.0] * KNOTS
            X = (basis * np.nan_to_num(e.lag(e[command], late_s))[:, None])[e.valid]
            H = X.T @ X + np.eye(KNOTS) * 1e-3 * max(np.trace(X.T @ X) / KNOTS, 1e-9)
            return np.linalg.solve(H, X.T @ np.nan_to_num(share[e.valid])).tolist()

        ratio = None
        if e.has("ratio"):
            near = basis * np.isfinite(e["ratio"])[:, None] * e.valid[:, None]
            ratio = (
                (near * np.nan_to_num(e["ratio"])[:, None]).sum(0) / np.maximum(near.sum(0), 1e-9)
            ).tolist()
        square = float(np.median(e["drag"][e.valid] / np.maximum(speed[e.valid], 1.0) ** 2))
        rolling = float(np.median(e["rolling"][e.valid]))
        return cls(
            knots.tolist(),
            gain("engine_command", e["engine"], ENGINE_S),
            gain("brake_command", e["brake"], 0.0),  # which was taken as proportional to it
            ratio,
            square,
            rolling,
            e.mass,
        )

    def now(self, speed: Array, u: Array) -> dict[str, Array]:
        """The signals that mechanisms need, at this speed (batch,) and these commands (batch, n_u)."""
        out = {
            "engine": np.interp(speed, self.speed, self.engine_gain) * u[:, 0],
            "brake": np.interp(speed, self.speed, self.brake_gain) * u[:, 1]
            if u.shape[1] > 1
            else np.zeros(len(speed)),
            "drag": self.drag_per_square * speed**2,
            "rolling": np.full(len(speed), self.rolling),
        }
        if self.ratio is not None:
            out["engine_speed"] = np.interp(speed, self.speed, self.ratio) * speed
        return out


LOOK_BACK_S = 2.0
WARM_UP_S = 8.0
ASK_EVERY_S = 0.4
ALIKE = 0.05  # of the engine's acceleration, rms
EFFICIENCY = 0.40  # of a diesel at the wheels' side of the clutch
DRIVELINE = 0.93
ENGINE, BRAKE, DRAG = Signal("engine"), Signal("brake"), Signal("drag")
PER_PARAMETER: dict[str, Expression] = {  # for simulators without parameters of their own
    "mass": BRAKE + DRAG - ENGINE,
    "drag_area": -DRAG,
    "rolling_resistance": -Signal("rolling"),
    "torque_gain": maximum(ENGINE, 0.0),
    "brake_gain": -BRAKE,
}
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
    FELT,
    FELT_SD,
)


def signals(
    simulator: Simulator,
    prepared: Sequence[Prepared],
    runs: Sequence[Run],
    grid: Grid,
    mass_kg: float | None = None,
) -> tuple[dict[str, Array], float, bool]:
    """The stacked signals that mechanisms need, the mass (kg) that converts specific forces to N, and whether
    it is known: stated, or reported by the simulator."""
    out: dict[str, Array] = {
        "speed": grid.stack([p.y[:, SPEED] for p in prepared]),
        "acceleration": grid.stack([p.observed for p in prepared]),
        "time": grid.stack([p.recording.time for p in prepared]),
        "elapsed": grid.stack([p.recording.time - p.recording.start_s for p in prepared]),
        "distance": grid.stack([p.distance() for p in prepared]),
        "place": _places(grid, [p.place() for p in prepared]),
    }
    interface = prepared[0].recording.interface
    for x in ("u", "w"):
        for name in getattr(interface, x):
            of = [getattr(p.recording.interface, x).index(name) for p in prepared]
            out[name] = grid.stack([getattr(p, x)[:, k] for p, k in zip(prepared, of, strict=True)])
    fitted = [p.recording.channels for p, s in zip(prepared, grid.drives, strict=True) if not s.held_out]
    for name in RECORDED:  # by fitted drives; those held out alone would replace what a simulator reports
        if any(np.isfinite(channels.get(name, np.nan)).any() for channels in fitted):
            take = grid.last if name == "gear" else grid.stack
            out[name] = take(
                [p.recording.channels.get(name, np.full(len(p.recording), np.nan)) for p in prepared]
            )
    ours = {*CHANNELS, *RECORDED}
    for name in dict.fromkeys(n for p in prepared for n in p.recording.channels if n not in ours):
        unknown = [np.full(len(p.recording), np.nan) for p in prepared]
        out[f"extra: {name}"] = grid.stack(
            [p.recording.channels.get(name, nan) for p, nan in zip(prepared, unknown, strict=True)]
        )
    if reports_forces(runs[0]):
        mass, is_known = _from_inside(out, simulator, runs, grid), True
    else:
        known = simulator.parameters().get("mass", mass_kg)
        mass, is_known = _from_questions(out, simulator, prepared, runs, grid, known), known is not None
    _ratio(out)
    return out, mass, is_known


def _places(grid: Grid, parts: Sequence[Array]) -> Array:
    """Block means of positions; the last sample's position in blocks that contain the end of one road and
    the start of another."""
    mean, last = grid.stack(parts), grid.last(parts)
    return np.where(np.abs(mean - last) < NEAR_M, mean, last)


def reports_forces(run: Run) -> bool:
    """Whether a simulator reports its forces, which shows that its physics was modelled and not learned."""
    return run.inside.keys() >= set(FORCES)


def force_of(parameter: str, brake_unit: str | None) -> Expression:
    """The acceleration due to +100 % of a parameter, m/s^2. A brake command that is a deceleration is a force
    per mass, which does not change with the mass."""
    by_mass = parameter == "mass" and brake_unit == HELD_UNIT
    return with_effective_mass(DRAG - ENGINE if by_mass else PER_PARAMETER[parameter])


def sensitivity(e: Evidence, name: str) -> Array:
    """Change of acceleration for +100 % of a parameter, from the components (used if the simulator cannot be
    run with it)."""
    return force_of(name, e.command_units.get("brake_command")).rows(e)


PARAMETER_OF = {
    "engine": "torque_gain",
    "brake": "brake_gain",
    "drag": "drag_area",
    "rolling": "rolling_resistance",
}


def as_large_as_they_act(
    e: Evidence, columns: Mapping[str, Array], own: Mapping[str, float]
) -> dict[str, Array]:
    """The estimated forces of a simulator, each as large as its response to its own parameter shows:
    `columns` are changes of the acceleration (n,) for +100 % of each."""
    out = {}
    for name, parameter in PARAMETER_OF.items():
        if parameter in columns and own.get(parameter):
            estimate, shown = (x[e.valid] for x in (sensitivity(e, parameter), columns[parameter]))
            power = float(estimate @ estimate)
            times = float(estimate @ shown) / power if power > 0.0 else 1.0
            out[name] = e[name] * (times if times > 0.0 else 1.0)
    return out


def _from_inside(out: dict[str, Array], simulator: Simulator, runs: Sequence[Run], grid: Grid) -> float:
    """Specific forces reported by a physics truck; also its gear and engine speed, if it has them and they
    are not recorded."""

    def inside(name: str) -> list[Array]:
        return [r.inside[name][0] for r in runs]

    mass = float(np.median(inside("mass")[0]))
    out["engine"] = grid.stack(inside("traction_force")) / mass
    for name, force in (("brake", "brake_force"), ("drag", "drag_force"), ("rolling", "rolling_force")):
        out[name] = np.abs(grid.stack(inside(force))) / mass
    for name, take in (("gear", grid.last), ("engine_speed", grid.stack)):
        if name in runs[0].inside:
            out.setdefault(name, take(inside(name)))
    radius = simulator.parameters().get("wheel_radius")
    if radius and "ratio" in runs[0].inside:
        out["ratio in gear"] = grid.stack(inside("ratio")) / radius
    return mass


def _from_questions(
    out: dict[str, Array],
    simulator: Simulator,
    prepared: Sequence[Prepared],
    runs: Sequence[Run],
    grid: Grid,
    known_mass: float | None,
) -> float:
    """Specific forces of a black-box simulator, and its mass: the known one, else an estimate.

    The simulated acceleration is split by non-negative least squares into traction, brake, drag and rolling
    resistance, with a known grade. Traction is the first of these that is available: power over speed from
    measured torque, from commanded torque, from fuel; without engine speed or fuel, the response to
    counterfactual runs. A mass that the simulator reports is used.
    """
    simulated = grid.stack([r.y[0, :, ACCELERATION] for r in runs])
    speed = np.maximum(out["speed"], 1.0)
    traction, per_mass = next(tractions(out, speed), (None, 0.0))
    if traction is None:
        traction = grid.stack([_asked(simulator, p) for p in prepared])
    kind = prepared[0].recording.interface.kind
    brake = np.nan_to_num(out["brake_command"]) if "brake_command" in out else np.zeros_like(speed)
    known = simulated + GRAVITY * np.nan_to_num(out.get("grade", np.zeros_like(speed)))
    X = np.stack([traction, -brake, -(speed**2), -np.ones_like(speed)], axis=1)
    use = grid.valid() & np.isfinite(X).all(axis=1) & np.isfinite(known) & (np.abs(known) < 6.0)
    scale = np.maximum(np.abs(X[use]).mean(axis=0), 1e-12) if use.any() else np.ones(4)
    share = nnls(X[use] / scale, known[use])[0] / scale if use.sum() > 20 else np.zeros(4)
    mass = known_mass or (
        float(np.clip(per_mass / share[0], kind.least_mass_kg, kind.most_mass_kg))
        if per_mass and share[0] > 0
        else kind.mass_kg
    )
    out["engine"], out["brake"] = share[0] * np.nan_to_num(traction), share[1] * brake
    drag = share[2] if share[2] > 1e-6 else 0.5 * AIR_DENSITY * kind.drag_area / mass
    out["drag"] = drag * out["speed"] ** 2
    out["rolling"] = np.full_like(speed, max(share[3], kind.rolling_resistance * GRAVITY))
    return mass


def tractions(out: Mapping[str, Array], speed: Array) -> Iterator[tuple[Array, float]]:
    """Signals proportional to the engine's force at the wheels, the best first; their factors times mass (0:
    unknown)."""
    if "engine_torque" in out and "engine_speed" in out:
        yield out["engine_torque"] * out["engine_speed"] / speed, DRIVELINE
    if "engine_speed" in out:
        yield out["engine_command"] * out["engine_speed"] / speed, 0.0
    if "fuel_rate" in out:
        yield out["fuel_rate"] / speed, EFFICIENCY * DIESEL_J_PER_CM3


def _asked(simulator: Simulator, p: Prepared) -> Array:
    """Acceleration (n,) due to the engine command: the change of the response if it is set to zero.

    At some times the last LOOK_BACK_S are set to zero, so that the truck stays in its gear. If a drive
    without any engine command gives the same response there, it is used for every step in between too.
    """
    back, warm = max(1, round(LOOK_BACK_S / p.dt)), round(WARM_UP_S / p.dt)
    length = warm + back + 1
    ends = np.arange(length, len(p.recording), max(1, round(ASK_EVERY_S / p.dt)))
    if len(ends) < 2:
        return np.zeros(len(p.recording))
    index = ends[:, None] + np.arange(-length + 1, 1)[None]
    part = _missed(simulator, p.u[index], p.w[index], p.y[index], back + 1)[:, -1]
    whole = _missed(simulator, p.u[None], p.w[None], p.y[None], len(p.u))[0]
    if np.mean((whole[ends] - part) ** 2) < ALIKE**2 * np.mean(part**2):
        return whole
    return np.interp(np.arange(len(p.recording)), ends, part)


def _missed(simulator: Simulator, u: Array, w: Array, y: Array, last: int) -> Array:
    """Change of the response (batch, T) without the engine command of the `last` steps; negative (braking)
    commands are kept."""
    silent = u.copy()
    silent[:, -last:, 0] = np.minimum(silent[:, -last:, 0], 0.0)
    asked, lacking = (forced_run(simulator, commands, w, y).y[:, :, ACCELERATION] for commands in (u, silent))
    return asked - lacking


def _ratio(out: dict[str, Array]) -> None:
    """Adds engine angle per distance (rad/m), if engine speed is known; the overall gear ratio, without slip
    and noise, and the corresponding engine speed."""
    if "engine_speed" not in out:
        return
    ratio = out["ratio"] = turns(out["engine_speed"], out["speed"])
    known = gears(ratio, out["speed"])
    out["overall_ratio"] = overall_ratio(ratio, known, out.pop("ratio in gear", None))
    out["engine_speed"] = np.where(
        np.isin(out["overall_ratio"], known), out["overall_ratio"] * out["speed"], out["engine_speed"]
    )
