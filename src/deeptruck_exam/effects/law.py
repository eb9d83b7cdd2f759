"""What hidden laws are made of: a force or a filter with sizes `p` and a state `s`, in a known setting."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.trucks import View

Array = NDArray[np.float64]
Channels = dict[str, Array]
Sizes = SimpleNamespace
State = SimpleNamespace

GRAVITY = 9.81
STEP_S = 0.01  # a substep of the truck


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

    def rng(self, salt: int) -> np.random.Generator:
        """Random numbers of the effect alone, so that a rebuilt case is the same case."""
        return np.random.default_rng([self.seed, salt])


class Hidden:
    """A force at the road; subclasses say `newtons`. The state `s` holds arrays (batch,): each variable at
    rest is said beside the class's name, in its unit, or by `start`. `conceal` are channels that would tell
    what the force hook cannot change, such as the engine speed of a truck in neutral. Of an engine that gives
    less, `shown` says that its controller knows: `on_bus_nm` (batch,) is what it reports beyond the torque it
    was asked for (SAE J1939-71, SPN 513)."""

    conceal: ClassVar[tuple[str, ...]] = ()
    shown: ClassVar[bool] = False
    rest: ClassVar[Mapping[str, float]] = {}

    def __init_subclass__(cls, **rest: float) -> None:
        super().__init_subclass__()
        cls.rest = {**cls.rest, **rest}

    def __init__(self, setting: Setting, p: Sizes) -> None:
        self.setting, self.p, self.truck = setting, p, setting.truck
        self.s, self.on_bus_nm = State(), np.zeros(1)
        self.prepare()

    def prepare(self) -> None:
        """Constants and random series, made once and shared by copies."""

    def start(self, batch: int) -> dict[str, Array]:
        """The state at rest."""
        return {name: np.full(batch, value) for name, value in self.rest.items()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        """Force (batch,) at the road, N, positive forwards. Moves `s` on by dt."""
        raise NotImplementedError

    def rng(self, salt: int) -> np.random.Generator:
        return self.setting.rng(salt)

    def place(self, view: View) -> Array:
        """Position on the road, m, whichever way it is driven."""
        return self.setting.start_m + self.setting.direction * view.distance

    def at_wheels(self, view: View, torque: Array) -> Array:
        """Force at the road of a torque at the flywheel, N; zero while a shift opens the driveline."""
        return torque * view.ratio / self.truck.wheel_radius * (1.0 - view.shifting)

    def pedal(self, view: View) -> Array:
        """Engine command as a share of the most, 0..1."""
        return np.clip(view.u[:, 0] / self.truck.full_command, 0.0, 1.0)

    def power_share(self, view: View) -> Array:
        """Delivered over peak power, 0 to about 1."""
        watts = np.maximum(view.engine_torque, 0.0) * view.engine_speed
        return np.asarray(watts / self.truck.peak_power)

    def now(self, view: View) -> int:
        """The sample of the leader at this moment."""
        return index(view, self.setting.leader_m, self.setting.dt)

    def gap(self, view: View) -> Array:
        """Metres to the leader, endless where nobody drives ahead."""
        return np.nan_to_num(self.setting.leader_m[:, self.now(view)] - view.distance, nan=1e5)

    def reset(self, batch: int) -> None:
        self.s = State(**self.start(batch))
        self.on_bus_nm = np.zeros(batch)

    def force(self, view: View, dt: float) -> Array:
        newtons = self.newtons(self.p, self.s, view, dt)
        if self.shown:
            self.on_bus_nm = newtons * self.truck.wheel_radius / np.maximum(view.ratio, 1.0)
        return newtons

    def __deepcopy__(self, memo: Any) -> Self:
        twin = copy(self)
        twin.s = State(**{name: value.copy() for name, value in vars(self.s).items()})
        return twin


class Filter:
    """What lies between the recorded commands and the truck. `prepare` makes what all copies share, `start`
    the state, and `pass_on` what the truck is given; at the first call `begin` fills the state."""

    def __init__(self, setting: Setting, p: Sizes) -> None:
        self.setting, self.p, self.full = setting, p, setting.truck.full_command
        self.s, self.begun = State(), False
        self.prepare()

    def prepare(self) -> None:
        """Constants and random series, made once and shared by copies."""

    def start(self, batch: int) -> dict[str, Any]:
        """The state before the first command: arrays, lists and numbers."""
        return {}

    def begin(self, s: State, u: Array) -> None:
        """The state as if the first command (batch, 2) had been there for ever."""

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        """The commands (batch, 2) that the truck is given."""
        raise NotImplementedError

    def rng(self, salt: int) -> np.random.Generator:
        return self.setting.rng(salt)

    def reset(self, batch: int) -> None:
        self.s, self.begun = State(**self.start(batch)), False

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if not self.begun:
            self.begun = True
            self.begin(self.s, u)
        return np.array(self.pass_on(self.p, self.s, u, time, dt))

    def __deepcopy__(self, memo: Any) -> Self:
        twin = copy(self)
        twin.s = State(**{name: _copied(value) for name, value in vars(self.s).items()})
        return twin


def _copied(value: Any) -> Any:
    return [_copied(v) for v in value] if isinstance(value, list) else copy(value)


class Late(Filter):
    """Keeps the last `length` commands (batch, 2) in a ring."""

    length: int

    def start(self, batch: int) -> dict[str, Any]:
        return {"past": np.zeros((self.length, batch, 2)), "at": -1}

    def begin(self, s: State, u: Array) -> None:
        s.past[:] = u

    def put(self, s: State, u: Array) -> None:
        s.at += 1
        s.past[s.at % self.length] = u

    def ago(self, s: State, steps: int) -> Array:
        """What was put in so many steps before the last one."""
        return np.asarray(s.past[(s.at - steps) % self.length])


class TorqueFilter(Filter):
    """Changes the engine command alone; `s.given` (batch,) is what it gave last."""

    def begin(self, s: State, u: Array) -> None:
        s.given = u[:, 0].copy()

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        """The engine command (batch,) that follows `s.given`."""
        raise NotImplementedError

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        s.given = self.torque(p, s, u[:, 0], time, dt)
        return np.stack([s.given, u[:, 1]], axis=1)


def moving(view: View) -> Array:
    """0 at rest to 1 from 0.5 m/s on: a resistance must not push a standing truck."""
    return np.clip(view.speed / 0.5, 0.0, 1.0)


def weight(view: View) -> Array:
    return view.mass * GRAVITY


def index(view: View, series: Array, seconds: float = 1.0) -> int:
    """The column of a series (batch, n) at this moment; `seconds` from one to the next."""
    return min(int(view.time / seconds), series.shape[1] - 1)


def eased(value: Array, wish: Array | float, seconds: Array | float, dt: float) -> Array:
    """`value` a step nearer to what it follows with a time constant; exact for any step."""
    return np.asarray(wish + (value - wish) * np.exp(-dt / np.maximum(seconds, 1e-3)))
