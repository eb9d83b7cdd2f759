"""Simulates a plan: drives the true truck with its hidden effects along its roads."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam import worlds
from deeptruck_exam.cases.gates import CONDITIONS, Windows, draw_windows, gate
from deeptruck_exam.cases.plan import MINUTES, Plan, draw_plan
from deeptruck_exam.laws.catalogue import Planted
from deeptruck_exam.laws.law import Setting
from deeptruck_exam.worlds import roads as road_maker
from deeptruck_exam.worlds import speeds, trucks
from deeptruck_exam.worlds.drive import Drives, leader_way, simulate
from deeptruck_exam.worlds.drivers import Driver
from deeptruck_exam.worlds.roads import Roads
from deeptruck_model.trucks import PhysicsTruck

DT = 0.1
MOTION_SD = 0.04  # m/s2, of a one-second mean: what J1939 sensors leave unsure
ATTEMPTS = 5  # each draws nearer to the upper end of the ranges


@dataclass(frozen=True)
class Built:
    """A driven world. `extra` (batch, n) is the acceleration that the effects caused, m/s2; `nats` the
    information in the part of it that a refit cannot absorb, for a detector that knows its shape, in the
    recordings to fit; `oracle` the truck with all effects."""

    plan: Plan
    drives: Drives
    oracle: PhysicsTruck
    truck: SimpleNamespace
    faults: Planted
    sizes: tuple[dict[str, float], ...]
    extra: Array
    nats: float
    nats_left: float  # of `nats`, what no change of the simulator's tunable parameters explains
    leader_m: Array
    roads: Roads


def build_case(
    level: str,
    seed: int,
    effect: str | None = None,
    simulator: str = "physics",
    minutes: float = MINUTES,
) -> Built:
    """Draw truck, roads and sizes until the effects matter in these drives (at most `ATTEMPTS` times), and
    drive."""
    best: Built | None = None
    for attempt in range(ATTEMPTS):
        built = build(draw_plan(level, seed, effect, simulator, minutes, attempt))
        if best is None or built.nats_left > best.nats_left:
            best = built
        if matters(built):
            return built
    assert best is not None
    return best


def build(plan: Plan) -> Built:
    """Simulate the plan."""
    flat = not plan.grade and not any(e.key == "slope_not_recorded" for e in plan.effects)
    world = worlds.values()
    roads = road_maker.draw(plan.rng_of_drives(1), plan.drives, world["roads"], flat)
    n = round(plan.minutes * 60.0 / DT)
    profiles = plan.rng_of_drives(2)
    target = np.stack([speeds.profile(profiles, kind, world["speeds"], n, DT) for kind in plan.drives])
    leader_m = leader_way(target, [s == "acc" for s in plan.styles], plan.headway_s, DT)
    nominal = trucks.make(plan.truck, plan.values)
    setting = _setting(plan, nominal, roads, leader_m, n)
    return _drive(plan, nominal, setting, roads, target, leader_m)


def _setting(plan: Plan, nominal: PhysicsTruck, roads: Roads, leader_m: Array, n: int) -> Setting:
    return Setting(
        trucks.namespace(nominal),
        len(plan.drives),
        n * DT,
        DT,
        plan.effect_seed,
        roads.start_m,
        roads.direction,
        roads.route,
        leader_m,
    )


def _drive(
    plan: Plan,
    nominal: PhysicsTruck,
    setting: Setting,
    roads: Roads,
    target: Array,
    leader_m: Array,
) -> Built:
    sizes = tuple(e.draw(plan.rng(10 + k), 1.0 + plan.attempt) for k, e in enumerate(plan.effects))
    planted = [e.build(setting, SimpleNamespace(**s)) for e, s in zip(plan.effects, sizes, strict=True)]
    if plan.condition:
        planted = [gate(p, CONDITIONS[plan.condition]) for p in planted]

    values, styles = worlds.values()["drivers"], np.array(plan.styles)

    def run(parts: list[Planted]) -> tuple[Drives, PhysicsTruck, Array]:
        truck = _plant(nominal, parts)
        driver = Driver(setting.truck, styles, target, plan.headway_s, DT, plan.rng_of_drives(3), values)
        drives = simulate(truck, roads, driver, leader_m, DT)
        return drives, truck, drives.y[:, :, 0] - accelerations(nominal, drives)

    drives, oracle, extra = run(planted)
    if plan.level == "rare":
        windows: Windows = draw_windows(plan.rng(4), extra, DT, len(plan.drives) - plan.fit)
        planted = [gate(p, windows) for p in planted]
        drives, oracle, extra = run(planted)
    nats = information(extra[: plan.fit], MOTION_SD)
    left = information(unexplained(nominal, drives, extra)[: plan.fit], MOTION_SD)
    faults = Planted(
        faults=tuple(f for p in planted for f in p.faults),
        withheld=tuple(c for p in planted for c in p.withheld),
    )
    return Built(plan, drives, oracle, setting.truck, faults, sizes, extra, nats, left, leader_m, roads)


def _plant(nominal: PhysicsTruck, parts: list[Planted]) -> PhysicsTruck:
    parameters = {name: value for p in parts for name, value in p.parameters.items()}
    truck = nominal.with_parameters(parameters) if parameters else nominal
    return truck.with_forces([f for p in parts for f in p.forces], [f for p in parts for f in p.filters])


def accelerations(truck: PhysicsTruck, drives: Drives) -> Array:
    """Acceleration (batch, n) of another truck along the same drives, m/s^2."""
    return truck.rollout(drives.u, drives.w, drives.y[:, 0], drives.y, inside=False).y[:, :, 0]


def information(extra: Array, sd: float) -> float:
    """Mean log-likelihood ratio (nats) to 'no effect' of a detector that knows the effect's shape, at noise
    sd (m/s2) of 1 s means."""
    return float(0.5 * np.sum((second_means(extra) / sd) ** 2))


def second_means(x: Array) -> Array:
    """Means of (batch, n) over whole seconds, (batch, seconds)."""
    samples = round(1.0 / DT)
    seconds = x.shape[1] // samples
    return x[:, : samples * seconds].reshape(len(x), seconds, samples).mean(axis=2)


def unexplained(nominal: PhysicsTruck, drives: Drives, extra: Array) -> Array:
    """`extra` minus its least-squares fit by the sensitivities of the nominal truck to its tunable
    parameters."""
    base = accelerations(nominal, drives)
    values, step = nominal.parameters(), 0.02
    sensitivity = [
        accelerations(nominal.with_parameters({n: values[n] * (1.0 + step)}), drives) - base
        for n in trucks.TUNABLE
    ]
    x = np.stack([s.ravel() for s in sensitivity], axis=1) / step
    coefficients = np.linalg.lstsq(x, extra.ravel(), rcond=None)[0]
    return extra - (x @ coefficients).reshape(extra.shape)


def matters(built: Built) -> bool:
    """Whether the effect noticeably changes the recordings of this truck; a rare effect may carry little
    information."""
    if not built.plan.effects:
        return True
    if any(e.kind == "measurement_fault" or e.key == "slope_not_recorded" for e in built.plan.effects):
        return True
    if built.plan.level == "rare":
        return built.nats > 25.0
    imitated = any(set(e.accepts) & set(trucks.TUNABLE) for e in built.plan.effects)
    parameter = any(e.kind == "parameter_error" for e in built.plan.effects)
    nats = built.nats if imitated or parameter else built.nats_left
    return nats > 150.0 and information(built.extra[built.plan.fit :], MOTION_SD) > 40.0
