"""Base classes of laws: a force or a command filter with sizes `p` and a state `s`, in a setting."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_model.trucks import View

Channels = dict[str, Array]
Sizes = SimpleNamespace
State = SimpleNamespace

GRAVITY = 9.81
STEP_S = 0.01  # a substep of the truck


@dataclass(frozen=True)
class Setting:
    """Properties of the drives that a law may use.

    `truck` are the true parameters without the law; `start_m`, `direction` and `route` place every recording
    on its road; `leader_m` (batch, n) is the leader's position relative to the truck's start, NaN without a
    leader; `dt` its period.
    """

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
        """Random numbers specific to the law, so that a rebuilt case is identical."""
        return np.random.default_rng([self.seed, salt])


class Law:
    """A force at the road; subclasses define `newtons`.

    The state `s` holds arrays (batch,): initial values are given next to the class's name, in the variable's
    unit, or come from `start`. `withheld` are channels that the force hook cannot change although the effect
    would, such as the engine speed of a truck in neutral. If the effect reduces the engine torque, `reported`
    says that the engine controller knows of it: `on_bus_nm` (batch,) is then the difference of the reported
    from the requested torque (SAE J1939-71, SPN 513).
    """

    withheld: ClassVar[tuple[str, ...]] = ()
    reported: ClassVar[bool] = False
    initial: ClassVar[Mapping[str, float]] = {}

    def __init_subclass__(cls, **initial: float) -> None:
        super().__init_subclass__()
        cls.initial = {**cls.initial, **initial}

    def __init__(self, setting: Setting, p: Sizes) -> None:
        self.setting, self.p, self.truck = setting, p, setting.truck
        self.s, self.on_bus_nm = State(), np.zeros(1)
        self.prepare()

    def prepare(self) -> None:
        """Compute constants and random series once; copies share them."""

    def start(self, batch: int) -> dict[str, Array]:
        """The initial state."""
        return {name: np.full(batch, value) for name, value in self.initial.items()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        """Force (batch,) at the road, N, positive forwards. Advances `s` by dt."""
        raise NotImplementedError

    def rng(self, salt: int) -> np.random.Generator:
        return self.setting.rng(salt)

    def place(self, view: View) -> Array:
        """Position on the road, m, independent of the driving direction."""
        return self.setting.start_m + self.setting.direction * view.distance

    def at_wheels(self, view: View, torque: Array) -> Array:
        """Force at the road of a torque at the flywheel, N; zero while the driveline is open for a shift."""
        return torque * view.ratio / self.truck.wheel_radius * (1.0 - view.shifting)

    def power_share(self, view: View) -> Array:
        """Engine power delivered over peak power, 0 to about 1."""
        watts = np.maximum(view.engine_torque, 0.0) * view.engine_speed
        return np.asarray(watts / self.truck.peak_power)

    def reset(self, batch: int) -> None:
        self.s = State(**self.start(batch))
        self.on_bus_nm = np.zeros(batch)

    def force(self, view: View, dt: float) -> Array:
        newtons = self.newtons(self.p, self.s, view, dt)
        if self.reported:
            self.on_bus_nm = newtons * self.truck.wheel_radius / np.maximum(view.ratio, 1.0)
        return newtons

    def __deepcopy__(self, memo: Any) -> Self:
        twin = copy(self)
        twin.s = State(**{name: value.copy() for name, value in vars(self.s).items()})
        return twin


class CommandLaw:
    """A change of the commands between recorder and truck.

    `prepare` makes what all copies share, `start` the state; the first call calls `begin` to fill the state,
    and `pass_on` returns the commands that the truck receives.
    """

    def __init__(self, setting: Setting, p: Sizes) -> None:
        self.setting, self.p, self.full = setting, p, setting.truck.full_command
        self.s, self.begun = State(), False
        self.prepare()

    def prepare(self) -> None:
        """Compute constants and random series once; copies share them."""

    def start(self, batch: int) -> dict[str, Any]:
        """The state before the first command: arrays, lists and numbers."""
        return {}

    def begin(self, s: State, u: Array) -> None:
        """The state after a constant command (batch, 2) of infinite duration."""

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        """The commands (batch, 2) that the truck receives."""
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
        twin.s = State(**{name: copy(value) for name, value in vars(self.s).items()})
        return twin


def moving(view: View) -> Array:
    """Factor from 0 at rest to 1 at 0.5 m/s, so that a resistance does not push a standing truck."""
    return np.clip(view.speed / 0.5, 0.0, 1.0)


def weight(view: View) -> Array:
    return view.mass * GRAVITY


def index(view: View, series: Array, seconds: float = 1.0) -> int:
    """The column of a series (batch, n) at the present time; its period is `seconds`."""
    return min(int(view.time / seconds), series.shape[1] - 1)
