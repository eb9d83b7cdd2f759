"""What becomes of the truck when control cannot go on; decided here alone, for vehicle and simulation.

Braking beyond 1.5 m/s^2 comes from the shield's bound alone: something is near. Whatever is lost then, or
while the controller says that what is ahead needs braking, it goes on to a standstill and there (a
minimal-risk manoeuvre). From other driving the truck rolls out.
"""

from __future__ import annotations

from collections.abc import Mapping

STANDS_M_S = 0.1  # below, a truck stands; ours


class BrakeHold:
    """Brake demands that are held and never fall. `beyond` has for each braking axis the demand, with its
    sign, from which a loss of control goes on braking; an infinite one only takes part."""

    def __init__(self, beyond: Mapping[str, float]) -> None:
        self._beyond = beyond
        self.demands: dict[str, float] = {}  # held; empty before the first time

    def begin(self, *demands: Mapping[str, float], asked: Mapping[str, float] | None = None) -> bool:
        """Whether any demand is beyond its axis's, or `asked` for: then each axis holds the strongest of its
        own."""
        every = (*demands, asked or {})
        strongest = {axis: max((given.get(axis, 0.0) for given in every), key=abs) for axis in self._beyond}
        begins = any(strongest[axis] / beyond > 1.0 for axis, beyond in self._beyond.items())
        begins = begins or any((asked or {}).values())
        if begins:
            self.demands = strongest
        return begins

    def hold(self, demands: Mapping[str, float]) -> None:
        """Hold a standing truck, by these demands or stronger ones."""
        self.demands = {axis: demands.get(axis, 0.0) for axis in self._beyond}
        for axis, beyond in self._beyond.items():
            if abs(beyond) < float("inf"):
                self.rise(axis, beyond)

    def rise(self, axis: str, demand: float) -> float:
        """The held demand of an axis, after a stronger one took its place."""
        if abs(demand) > abs(self.demands[axis]):
            self.demands[axis] = demand
        return self.demands[axis]
