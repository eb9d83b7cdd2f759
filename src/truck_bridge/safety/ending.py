"""The braking that goes on when control is lost; decided here alone, for vehicle and simulation.

With each command the controller says which braking the hazard that it knows needs, and for how long that is
assumed. While it is, this braking goes on, whoever takes control away, and it holds a truck that came to a
standstill (a minimal-risk manoeuvre). From other driving, and once the hazard is no longer assumed, the
truck rolls out; one that is slow by then is braked to a standstill.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

STANDS_M_S = 0.1  # below, a truck stands; ours
SLOW_M_S = 5.0  # below, a truck that brakes for a hazard stops: its idling engine would drive it on; ours


class BrakeHold:
    """Brake demands that are held and never fall. `beyond` has for each braking axis the demand, with its
    sign, beyond which only a hazard is braked for; an infinite one only takes part."""

    def __init__(self, beyond: Mapping[str, float]) -> None:
        self._beyond = beyond
        self._needs: dict[str, float] = {}  # of the known hazard
        self._until = -math.inf  # to when it is assumed, s
        self.demands: dict[str, float] = {}  # held; empty before the first time

    def know(self, needs: Mapping[str, float], until: float) -> None:
        """What the hazard ahead needs, by axis, assumed until a time, s; nothing needed is no hazard."""
        self._needs, self._until = dict(needs), until

    def knows(self, now: float) -> bool:
        """Whether a hazard is known and assumed."""
        return now <= self._until and any(self._needs.values())

    def shift(self, seconds: float) -> None:
        """The clock was set, or nobody watched: so long later the hazard is assumed as now."""
        self._until += seconds

    def is_hard(self, *demands: Mapping[str, float]) -> bool:
        """Whether one of the demands is beyond what other driving asks for."""
        beyond = self._beyond.items()
        return any(given.get(axis, 0.0) / least > 1.0 for given in demands for axis, least in beyond)

    def begin(self, *demands: Mapping[str, float]) -> None:
        """Each axis holds the strongest of these and of what the hazard needs."""
        every = (*demands, self._needs)
        self.demands = {
            axis: max((given.get(axis, 0.0) for given in every), key=abs) for axis in self._beyond
        }

    def hold(self, demands: Mapping[str, float]) -> None:
        """Hold a standing truck, by these demands or stronger ones."""
        self.begin(demands, {axis: least for axis, least in self._beyond.items() if abs(least) < math.inf})

    def rise(self, axis: str, demand: float) -> float:
        """The held demand of an axis, after a stronger one took its place."""
        if abs(demand) > abs(self.demands[axis]):
            self.demands[axis] = demand
        return self.demands[axis]
