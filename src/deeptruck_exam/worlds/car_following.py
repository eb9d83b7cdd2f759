"""Speeds behind leaders and at lights: the Intelligent Driver Model with a truck's strength."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array
from deeptruck_exam.worlds.traffic import FLOOR, KINDS, Kind, allowed, finish

ALONE_S, BEHIND_S = 30.0, 32.0  # mean times between leaders and with one


class Ahead:
    """What lies ahead of one driver: a leader who comes and goes, and lights. Metres from the start."""

    def __init__(self, rng: np.random.Generator, kind: Kind, floor: float, dt: float) -> None:
        self.rng, self.kind, self.floor, self.dt = rng, kind, floor, dt
        self.leader: list[float] = []  # gap, speed, wanted speed, time left
        self.red_until_s = -1.0
        self.line_m = self._spacing()

    def _spacing(self) -> float:
        return self.kind.lights_m * self.rng.uniform(0.5, 1.5) if self.kind.lights_m else np.inf

    def follow(self, speed: float, free: float) -> list[tuple[float, float]]:
        """Gap and speed of the leader, if there is one, a step later."""
        rng, dt = self.rng, self.dt
        if not self.leader:
            if rng.random() < dt / ALONE_S:
                own = max(speed, self.floor)
                self.leader = [10.0 + 2.0 * speed, own, self._pace(free), rng.exponential(BEHIND_S)]
            return []
        gap, own, wanted, left = self.leader
        wanted = self._pace(free) if rng.random() < dt / 9.0 else wanted
        own = max(own + float(np.clip(wanted - own, -1.1 * dt, 0.6 * dt)), self.floor)
        self.leader = [gap + (own - speed) * dt, own, wanted, left - dt] if left > 0.0 else []
        return [(max(gap, 0.5), own)] if self.leader else []

    def _pace(self, free: float) -> float:
        return float(max(free - self.rng.uniform(0.0, self.kind.slower), self.floor))

    def stop(self, at_m: float, speed: float, time: float) -> list[tuple[float, float]]:
        """The line of a red light ahead; who cannot stop any more drives on."""
        ahead = self.line_m - at_m
        if ahead < 0.0:
            self.line_m, self.red_until_s = at_m + self._spacing(), -1.0
            return []
        if self.red_until_s < 0.0 and ahead < 90.0:
            red = self.rng.random() < 0.6
            self.red_until_s = time + (self.rng.uniform(9.0, 24.0) if red else 0.0)
        too_late = speed**2 / 5.0 > ahead
        return [(max(ahead, 0.5), 0.0)] if time < self.red_until_s and not too_late else []


def following(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Treiber, Hennecke and Helbing, Congested Traffic States in Empirical Observations and Microscopic
    Simulations, Phys. Rev. E 62 (2000)."""
    kind, floor = KINDS[scenario], FLOOR.get(scenario, 0.0)
    signs = [allowed(rng, kind) for _ in range(1 + int(n * dt / kind.lasts_s))]
    free = np.repeat(signs, round(kind.lasts_s / dt) + 1)[:n]
    slowest = floor if kind.lights_m else max(floor, 0.5 * kind.speeds[0])
    ahead = Ahead(rng, kind, slowest, dt)
    strength, calm = 1.3 * rng.uniform(*kind.pull), rng.uniform(0.9, 1.5)
    headway, eases = rng.uniform(1.3, 2.1), rng.uniform(0.25, 0.9)
    out, speed, at_m = np.empty(n), 0.95 * float(free[0]), 0.0
    for k, wish in enumerate(free.tolist()):
        change = max(strength * (1.0 - (speed / wish) ** 4), -eases)
        for gap, other in ahead.follow(speed, wish) + ahead.stop(at_m, speed, k * dt):
            closing = speed * (speed - other) / (2.0 * np.sqrt(strength * calm))
            change -= strength * ((2.5 + max(speed * headway + closing, 0.0)) / gap) ** 2
        speed = max(speed + dt * float(np.clip(change, -2.1, strength)), 0.0)
        speed = 0.0 if speed < 0.12 and change < 0.0 else speed
        at_m += dt * speed
        out[k] = speed
    return finish(rng, out, dt, 0.25, 9.0, floor)
