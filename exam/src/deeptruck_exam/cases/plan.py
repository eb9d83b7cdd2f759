"""The plan of a case: everything drawn before the simulation."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from deeptruck_exam import worlds
from deeptruck_exam.cases.gates import CONDITIONS
from deeptruck_exam.cases.levels import SLOPE_OR_WIND, choose, hidden_input, mark
from deeptruck_exam.laws import Effect
from deeptruck_exam.laws.catalogue import DRIVES, POOL
from deeptruck_exam.worlds import trucks

WRONG = {  # relative standard deviation of the simulator's parameters at level wrong_parameters
    "mass": 0.06,
    "drag_area": 0.08,
    "rolling_resistance": 0.10,
    "torque_gain": 0.03,
    "brake_gain": 0.08,
}
FIT, HELD_OUT = 6, 2  # recordings
MINUTES = 4.0  # of each
DEEP_TRUCKS = 2  # of each kind: training takes minutes, so that cases share them
WITHHELD = {"gear": 0.2, "engine_speed": 0.15, "engine_torque": 0.25, "elevation": 0.4}  # chances


@dataclass(frozen=True)
class Plan:
    """Everything drawn for a case. `values` are the truck's true parameters, `simulator_values` those of
    the simulator."""

    level: str
    seed: int
    simulator: str
    truck: str
    values: dict[str, float]
    simulator_values: dict[str, float]
    effects: tuple[Effect, ...]
    drives: list[str]
    minutes: float
    grade: bool
    condition: str = ""
    excluded: tuple[str, ...] = ()
    withheld: tuple[str, ...] = ()
    hidden_input: str = ""
    styles: list[str] = field(default_factory=list)
    headway_s: float = 1.8
    attempt: int = 0
    further: int = 0  # which other drives of the same truck; 0 are those of the case

    fit = FIT

    def rng(self, salt: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, mark(self.level), salt, self.attempt])

    def rng_of_drives(self, salt: int) -> np.random.Generator:
        """Random numbers for roads, speeds and drivers, which differ between the drives of a truck."""
        further = [self.further] if self.further else []
        return np.random.default_rng([self.seed, mark(self.level), salt, self.attempt, *further])

    @property
    def effect_seed(self) -> int:
        """Seed of the random series within the effects."""
        return self.seed + mark(self.level)


def draw_plan(
    level: str, seed: int, effect: str | None, simulator: str, minutes: float, attempt: int = 0
) -> Plan:
    """Draw a case. `effect` is a key or a name; None lets the seed select one of the suitable effects in
    turn. A later `attempt` draws truck, roads and drivers again, with the same effects.

    Raises InputError for an unknown level or effect.
    """
    chosen, excluded = choose(level, seed, effect)
    rng = np.random.default_rng([seed, mark(level), 0, attempt])
    pool = POOL.split()
    suited = [t for t in pool if all(t in e.trucks for e in chosen)]
    truck = suited[rng.integers(len(suited))]
    member = np.random.default_rng([77, pool.index(truck), int(rng.integers(DEEP_TRUCKS))])
    values = trucks.draw(truck, worlds.values()["trucks"], member if simulator == "deep" else rng)
    needs_grade = any({"descent", "hills"} & set(e.drives) or e.name.startswith("grade") for e in chosen)
    slopeless = level in SLOPE_OR_WIND or any(e.key == "slope_not_recorded" for e in chosen)
    grade = not slopeless and (
        truck != "freightliner" or needs_grade or simulator == "deep" or rng.random() < 0.5
    )
    leader = any(e.leader for e in chosen)
    count = FIT + HELD_OUT
    return Plan(
        level,
        seed,
        simulator,
        truck,
        values,
        _simulator_values(level, values, rng),
        chosen,
        _drives(chosen, count, rng),
        minutes,
        grade,
        condition=_condition(chosen, rng) if level == "one_condition" else "",
        excluded=excluded,
        withheld=tuple(name for name, chance in WITHHELD.items() if rng.random() < chance),
        hidden_input=hidden_input(level, seed),
        styles=_styles(level, leader, count, rng),
        headway_s=float(rng.uniform(0.7, 1.1) if leader else rng.uniform(1.4, 2.2)),
        attempt=attempt,
    )


def _simulator_values(level: str, values: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    """The simulator's parameters: exact, slightly wrong, or clearly wrong."""
    spread = {"wrong_parameters": 1.0, "absorbed": 1.0, "only_parameters": 1.0}.get(level, 0.0)
    if level == "nothing_missing" and rng.random() < 0.5:
        spread = 0.01 / 0.06
    drawn = dict(values)
    for name, sd in WRONG.items():
        own = min(spread * sd, 0.006 if level == "nothing_missing" else 1.0)
        if own:
            true = values.get(name, 1.0)
            drawn[name] = float(true * (1.0 + np.clip(own * rng.standard_normal(), -2 * own, 2 * own)))
    return drawn


def _drives(chosen: tuple[Effect, ...], count: int, rng: np.random.Generator) -> list[str]:
    """Kinds of the drives. In two thirds of them, and in all held-out ones, the effect can act."""
    out = []
    for k in range(count):
        among: tuple[str, ...] = DRIVES
        if chosen and (k >= count - HELD_OUT or rng.random() < 0.67):
            among = chosen[k % len(chosen)].drives
        out.append(str(among[rng.integers(len(among))]))
    return out


def _condition(chosen: tuple[Effect, ...], rng: np.random.Generator) -> str:
    """A driving condition in which the effect can still act."""
    where = {n for e in chosen for n in e.drives}
    possible = [c for c in CONDITIONS if not (c.startswith("above") and where <= {"suburban", "descent"})]
    possible = [c for c in possible if not (c == "below 11 m/s" and "suburban" not in where)]
    if any(e.name in ("brake_fade", "brake_lag", "dragging_brake", "engine_brake") for e in chosen):
        possible = [c for c in possible if c not in ("uphill", "half load or more")] or ["above 17 m/s"]
    return str(possible[rng.integers(len(possible))])


def _styles(level: str, leader: bool, count: int, rng: np.random.Generator) -> list[str]:
    if leader:
        return ["acc" if rng.random() < 0.8 else "human" for _ in range(count)]
    if level == "closed_loop":
        return [str(rng.choice(["cruise", "acc"])) for _ in range(count)]
    return ["human"] * count
