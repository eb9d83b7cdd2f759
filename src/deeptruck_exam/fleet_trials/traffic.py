"""Speeds of the fifth world: the Intelligent Driver Model among leaders, lights, sites, hairpins."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from deeptruck_exam.hidden import Array, ou_series


@dataclass(frozen=True)
class Kind:
    """free m/s with weights and mean length s; mean time s between leaders and with one; how much slower
    they are at most, and at least how fast, m/s; metres between lights (0: none); acceleration m/s2."""

    free: tuple[float, ...]
    weights: tuple[float, ...]
    zone_s: float
    alone_s: float
    behind_s: float
    slower: float
    floor: float
    lights_m: float
    strength: tuple[float, float]


KINDS = {  # motorway with a site at 60 km/h; city; a rolling country road; a pass with hairpins
    "highway": Kind(
        (16.7, 22.3, 24.0, 25.2), (0.15, 0.3, 0.35, 0.2), 55.0, 30.0, 35.0, 6.0, 15.5, 0.0, (0.35, 0.6)
    ),
    "suburban": Kind(
        (8.3, 11.0, 13.6, 16.0), (0.3, 0.2, 0.35, 0.15), 35.0, 18.0, 30.0, 8.0, 0.0, 330.0, (0.7, 1.1)
    ),
    "hills": Kind(
        (13.0, 16.0, 18.5, 21.0), (0.2, 0.3, 0.3, 0.2), 32.0, 35.0, 30.0, 6.0, 7.0, 2600.0, (0.45, 0.8)
    ),
    "descent": Kind(
        (7.0, 11.5, 14.0, 16.5), (0.3, 0.25, 0.25, 0.2), 24.0, 40.0, 30.0, 4.0, 4.5, 0.0, (0.4, 0.7)
    ),
}


@dataclass
class Around:
    """What lies ahead of one driver: a leader who comes and goes, and lights. Metres from the start."""

    rng: np.random.Generator
    kind: Kind
    dt: float
    leader: list[float] = field(default_factory=list)  # gap, speed, wanted speed, time left
    line_m: float = 0.0
    red_until_s: float = -1.0

    def __post_init__(self) -> None:
        self.line_m = self._spacing()

    def _spacing(self) -> float:
        return self.kind.lights_m * self.rng.uniform(0.5, 1.5) if self.kind.lights_m else np.inf

    def follow(self, speed: float, free: float) -> list[tuple[float, float]]:
        """Gap and speed of the leader, if there is one, a step later."""
        rng, kind, dt = self.rng, self.kind, self.dt
        if not self.leader:
            if rng.random() < dt / kind.alone_s:
                wanted = max(free - rng.uniform(0.0, kind.slower), kind.floor)
                self.leader = [
                    10.0 + 2.0 * speed,
                    max(speed, kind.floor),
                    wanted,
                    rng.exponential(kind.behind_s),
                ]
            return []
        gap, own, wanted, left = self.leader
        if rng.random() < dt / 9.0:
            wanted = max(free - rng.uniform(0.0, kind.slower), kind.floor)
        own = max(own + float(np.clip(wanted - own, -1.1 * dt, 0.6 * dt)), kind.floor)
        self.leader = [gap + (own - speed) * dt, own, wanted, left - dt] if left > 0.0 else []
        return [(max(gap, 0.5), own)] if self.leader else []

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


def _zones(rng: np.random.Generator, kind: Kind, n: int, dt: float) -> Array:
    """Speed (n,) that the road and its signs allow."""
    out: list[Array] = []
    length = 0
    while length < n:
        speed = float(rng.choice(kind.free, p=kind.weights)) * rng.normal(1.0, 0.025)
        m = round((8.0 + rng.gamma(1.6, kind.zone_s / 1.6)) / dt)
        out.append(np.full(m, speed))
        length += m
    return np.concatenate(out)[:n]


def _drive(rng: np.random.Generator, kind: Kind, free: Array, dt: float) -> Array:
    """Treiber, Hennecke and Helbing, Congested Traffic States in Empirical Observations and Microscopic
    Simulations, Phys. Rev. E 62 (2000), with a truck's strength."""
    around = Around(rng, kind, dt)
    strength, calm = rng.uniform(*kind.strength), rng.uniform(0.9, 1.5)
    headway, eases = rng.uniform(1.3, 2.1), rng.uniform(0.25, 0.9)
    out, speed, at_m = np.empty(len(free)), 0.95 * float(free[0]), 0.0
    for k, wish in enumerate(free):
        ahead = around.follow(speed, float(wish)) + around.stop(at_m, speed, k * dt)
        change = max(strength * (1.0 - (speed / float(wish)) ** 4), -eases)
        for gap, other in ahead:
            closing = speed * (speed - other) / (2.0 * np.sqrt(strength * calm))
            change -= strength * ((2.5 + max(speed * headway + closing, 0.0)) / gap) ** 2
        speed = max(speed + dt * float(np.clip(change, -2.1, strength)), 0.0)
        speed = 0.0 if speed < 0.12 and change < 0.0 else speed
        at_m += dt * speed
        out[k] = speed
    return out


def speed_profile(rng: np.random.Generator, scenario: str, n: int, dt: float) -> Array:
    """Speed a driver has in mind, (n,) m/s."""
    kind = KINDS[scenario]
    speed = _drive(rng, kind, _zones(rng, kind, n, dt), dt)
    wander = 0.25 * np.convolve(ou_series(rng, (1, n), dt, 9.0)[0], np.hanning(41) / 20.0, mode="same")
    speed = speed + wander * np.clip(speed / 6.0 - 0.4, 0.0, 1.0)
    ease = np.hanning(15) / np.hanning(15).sum()
    padded = np.concatenate([np.full(7, speed[0]), speed, np.full(7, speed[-1])])
    floor = 14.2 if scenario == "highway" else 0.0
    return np.asarray(np.clip(np.convolve(padded, ease, mode="valid"), floor, None))
