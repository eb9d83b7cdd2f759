"""What a hidden effect is: a name, a source, ranges to draw from, and what it plants in the true truck.

Nothing in this folder may import the tool it examines; tests/deeptruck_exam holds that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.trucks import CommandFilter, Force, View

Array = NDArray[np.float64]
Kind = Literal["missing_physics", "measurement_fault", "parameter_error"]
Fault = Callable[[dict[str, Array], float, np.random.Generator], None]
"""Spoils the recorded channels of one recording in place; second argument is dt."""

GRAVITY = 9.81
SCENARIOS = ("highway", "suburban", "hills", "descent")
FORMS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh")  # families


@dataclass(frozen=True)
class Setting:
    """What a planted effect may know of its world.

    `truck` are the true parameters before planting; `start_m`, `direction` and `route` place every
    recording on its road; `leader_m` (batch, n) is the way of the leader from the truck's start, NaN
    without one; `dt` its period."""

    truck: SimpleNamespace
    batch: int
    duration_s: float
    dt: float
    seed: int
    start_m: Array
    direction: Array
    route: NDArray[np.int64]
    leader_m: Array
    converter: bool = False

    def rng(self, salt: int) -> np.random.Generator:
        """Random numbers of the effect alone, so that a rebuilt case is the same case."""
        return np.random.default_rng([self.seed, salt])


@dataclass(frozen=True)
class Planted:
    """What makes the true truck or its recording differ from what the simulator knows."""

    forces: tuple[Force, ...] = ()
    filters: tuple[CommandFilter, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    conceal: tuple[str, ...] = ()


@dataclass(frozen=True)
class Effect:
    """`name` is the right answer, `key` tells effects of one name apart, `forms` says which of FORMS its law
    is of, `ranges` are (low, high) by name, drawn uniformly. `accepts` are names that recordings alone
    cannot tell from it, counted right only inside a stated group. `needs` are scenarios in which it acts,
    `trucks` the trucks that can have it."""

    key: str
    name: str
    kind: Kind
    source: str
    ranges: Mapping[str, tuple[float, float]]
    build: Callable[[Setting, SimpleNamespace], Planted]
    needs: tuple[str, ...] = SCENARIOS
    trucks: tuple[str, ...] = ("freightliner", "trucksim", "volvo")
    accepts: tuple[str, ...] = ()
    leader: bool = False
    gateable: bool = False
    forms: str = "first"

    def draw(self, rng: np.random.Generator, scale: float = 1.0) -> dict[str, float]:
        """Random sizes. `scale` moves the draw towards the upper end of the ranges (1: uniform)."""
        return {
            n: float(lo + (hi - lo) * rng.random() ** (1.0 / scale)) for n, (lo, hi) in self.ranges.items()
        }


EFFECTS: dict[str, Effect] = {}


def register(effect: Effect) -> None:
    if effect.key in EFFECTS:
        raise ValueError(f"effect '{effect.key}' is registered twice")
    EFFECTS[effect.key] = effect


class Hidden:
    """A force at the road with a state `s` of arrays (batch,); subclasses say `start` and `newtons`.
    `conceal` are channels that would tell what the force hook cannot change, such as the engine speed of a
    truck in neutral."""

    conceal: tuple[str, ...] = ()

    def __init__(self, setting: Setting, values: SimpleNamespace) -> None:
        self.setting, self.p, self.truck = setting, values, setting.truck
        self.s = SimpleNamespace()
        self.prepare()

    def prepare(self) -> None:
        """Constants and random series, made once and shared by copies."""

    def start(self, batch: int) -> dict[str, Array]:
        """The state at rest."""
        return {}

    def newtons(self, view: View, dt: float) -> Array:
        raise NotImplementedError

    def reset(self, batch: int) -> None:
        self.s = SimpleNamespace(**self.start(batch))

    def force(self, view: View, dt: float) -> Array:
        return self.newtons(view, dt)

    def __deepcopy__(self, memo: Any) -> Hidden:
        twin = copy(self)
        twin.s = SimpleNamespace(**{name: value.copy() for name, value in vars(self.s).items()})
        return twin


def hidden(
    key: str,
    *,
    source: str,
    ranges: Mapping[str, tuple[float, float]],
    name: str | None = None,
    gateable: bool = True,
    **more: Any,
) -> Callable[[type[Hidden]], type[Hidden]]:
    """Register a Hidden class as the effect `key` (its name too, unless given)."""

    def add(cls: type[Hidden]) -> type[Hidden]:
        def build(setting: Setting, values: SimpleNamespace) -> Planted:
            return Planted(forces=(cls(setting, values),), conceal=cls.conceal)

        kind: Kind = "missing_physics"
        register(Effect(key, name or key, kind, source, ranges, build, gateable=gateable, **more))
        return cls

    return add


def moving(view: View) -> Array:
    """0 at rest to 1 from 0.5 m/s on: a resistance must not push a standing truck."""
    return np.clip(view.speed / 0.5, 0.0, 1.0)


def weight(view: View) -> Array:
    return view.mass * GRAVITY


def place(setting: Setting, view: View) -> Array:
    """Position on the road, m, whichever way it is driven."""
    return setting.start_m + setting.direction * view.distance


def wheel_force(setting: Setting, view: View, torque: Array) -> Array:
    """Force at the road of a torque at the flywheel, N; zero while the driveline is open for a shift."""
    return torque * view.ratio / setting.truck.wheel_radius * (1.0 - view.shifting)


def ou_series(rng: np.random.Generator, shape: tuple[int, int], dt: float, time_constant: float) -> Array:
    """Unit-variance coloured noise along the last axis."""
    from scipy.signal import lfilter

    keep = np.exp(-dt / time_constant)
    white = rng.standard_normal(shape)
    white[:, 0] /= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], white, axis=-1))


def some_drives(rng: np.random.Generator, batch: int, share: float) -> NDArray[np.bool_]:
    """A share of the recordings, one of the last two (held out) always among them, never all."""
    count = int(np.clip(round(share * batch), 2, batch - 1))
    order = [batch - 1 - int(rng.integers(2)), *rng.permutation(batch - 2).tolist()]
    chosen = np.zeros(batch, bool)
    chosen[order[:count]] = True
    return chosen
