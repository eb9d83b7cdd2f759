"""Tests the promise: batched rollouts, and an adversarial search for a violation.

The truck is the worst one that is assumed: for `response_s` after the full brake command it goes on
braking as little as before, or accelerates by a(v) where it did not brake, then brakes with exactly
`braking(heat)`; below the full command it brakes by the least that is promised of it. The adversary controls
policy, leader, radar error and dropouts; a leader that the radar has lost may brake as hard as
is assumed. Two results are counted: how close the gap comes to d_safety, and how early the shield brakes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from deeptruck_cacc.safety.assumptions import GOES_ON_S, Assumptions
from deeptruck_cacc.safety.shield import Ahead, Shield, Truck
from deeptruck_core.arrays import Array, Mask

FULL = 1.0 - 1e-9  # share of the brake command: all of it, but for rounding
KNOTS = 12  # pieces of a rollout in which leader, policy and radar keep one behaviour
WIDTH = 5 + 4 * KNOTS  # numbers that describe one rollout, each in 0..1


@dataclass(frozen=True)
class Outcome:
    """What a search found. `least_margin_m` is the smallest gap - d_safety of all; negative is a crash.

    `earliest_m` is the largest excess of the gap over that needed behind the worst leader, at times when the
    shield braked.
    """

    rollouts: int
    violations: int
    least_margin_m: float
    acted_share: float
    earliest_m: float


class Margins(NamedTuple):
    """Of each rollout, (batch,)."""

    least: Array  # m, of gap - d_safety
    acted: Array  # share of steps overridden
    earliest: Array  # m, the most left to the needed gap when the shield braked beyond `mild_braking`


class _Leader(NamedTuple):
    """The true state of the leader, each (batch,), and the worst possible state since it was last
    detected."""

    speed: Array
    slow: Array  # speed when seen, through the filter of the assumptions
    braking: Array  # the hardest it may brake while it is not seen
    unseen_s: Array
    worst_lag_m: Array  # by how much less than the true one the gap behind the worst leader is
    worst_speed: Array

    def moved(self, p: Assumptions, pull: Array, lost: Mask) -> _Leader:
        """The leader one step later, at the acceleration `pull` (batch,); `lost` marks rollouts in which the
        truck does not detect the leader in that step."""
        on = (self.unseen_s < GOES_ON_S - p.dt / 2) | (self.braking > p.emergency)
        may = np.where(lost & on, self.braking, 0.0)
        rate = np.where(lost, np.maximum(pull, -may), pull)
        speed = np.maximum(self.speed + p.dt * rate, 0.0)
        worst = np.where(lost, np.maximum(self.worst_speed - p.dt * may, 0.0), speed)
        behind = np.where(lost, self.worst_lag_m + p.dt * (speed - worst), 0.0)
        seen_to_brake = (self.slow - speed) / (p.track_s + self.unseen_s)
        braking = np.where(lost, may, np.clip(seen_to_brake, 0.0, p.leader_braking))
        share = np.minimum((p.dt + self.unseen_s) / p.track_s, 1.0)
        slow = np.where(lost, self.slow, self.slow + share * (speed - self.slow))
        return _Leader(speed, slow, braking, np.where(lost, self.unseen_s + p.dt, 0.0), behind, worst)


def rollouts(assumed: Assumptions, genes: Array, steps: int = 300, *, shielded: bool = True) -> Margins:
    """Simulate rollouts with genes (batch, WIDTH).

    Every rollout starts at a covered state: at or above the gap from which immediate braking suffices.
    """
    p, batch = assumed, len(genes)
    speed, first, heat = 32.0 * genes[:, 0], 32.0 * genes[:, 1], 1500.0 * genes[:, 2] ** 2
    start = p.needed_gap(speed + p.speed_error, np.maximum(first - p.speed_error, 0.0), heat, 0.0)
    gap = start + p.gap_error + 20.0 * genes[:, 3] ** 3
    since, nothing = np.zeros(batch), np.zeros(batch)  # s of full brake command so far
    partly = np.zeros(batch)  # share of the brake command before it was full
    leader = _Leader(first, first, nothing, nothing, nothing, first)
    shield = Shield(p, 0.0, 1.0)
    # the assumptions include knowing how hot the brakes are
    shield._truck = Truck.unknown(batch)._replace(speed=speed, heat=heat.copy())
    shield._ahead = Ahead.never(1, batch)._replace(
        gap=gap[None], speed=first[None], slow=first[None], unseen_s=nothing[None], near=nothing[None]
    )
    pull, wish, blind, noise = np.split(genes[:, 5:], 4, axis=1)
    least, acted, earliest = np.full(batch, np.inf), np.zeros(batch), np.full(batch, -np.inf)
    for k in range(steps):
        piece = _piece(k, steps)
        lost = blind[:, piece] > 0.9
        seen = _measured(p, gap, leader.speed, speed, noise[:, piece], lost)
        engine, brake = wished = _policy(wish[:, piece])
        if shielded:
            may_be_hot = shield._truck.heat
            engine, brake = shield.filter(*seen, *wished)
            acted += shield.acted
            left = gap - leader.worst_lag_m - p.needed_gap(speed, leader.worst_speed, may_be_hot, p.dt)
            beyond = brake > np.maximum(wished[1], p.mild_brake) + 1e-9
            earliest = np.where(beyond, np.maximum(earliest, left), earliest)
        before = speed
        partly = np.where(brake >= FULL, partly, brake)
        speed, since, heat = _worst_truck(p, speed, since, heat, engine, brake, partly)
        gap = gap + (leader.speed - before) * p.dt
        wanted = (8.0 * pull[:, piece] - 6.0).clip(-p.leader_braking, 2.0)
        leader = leader.moved(p, wanted, blind[:, _piece(k + 1, steps)] > 0.9)
        least = np.minimum(least, gap - p.d_safety)
    return Margins(least, acted / steps, earliest)


def _piece(k: int, steps: int) -> int:
    return min(k * KNOTS // steps, KNOTS - 1)


def _measured(
    p: Assumptions, gap: Array, leader: Array, speed: Array, noise: Array, lost: Mask
) -> tuple[Array, Array, Array]:
    """Readings of radar and speedometer at the limits of their stated errors."""
    sign = 2.0 * (noise > 0.3) - 1.0  # mostly flattering: further and faster than true
    seen_gap = np.where(lost, np.nan, gap + sign * p.gap_error)
    seen_leader = np.where(lost, np.nan, np.maximum(leader + sign * p.speed_error, 0.0))
    return seen_gap, seen_leader, np.maximum(speed - sign * p.speed_error, 0.0)


def _policy(wish: Array) -> tuple[Array, Array]:
    """Commands of any policy: full engine, some brake, or NaN."""
    engine = np.where(wish > 0.95, np.nan, np.clip(2.0 * wish - 0.5, 0.0, 1.0))
    return engine, np.clip(0.4 - 2.0 * wish, 0.0, 1.0)


def _worst_truck(
    p: Assumptions,
    speed: Array,
    since: Array,
    heat: Array,
    engine: Array,
    brake: Array,
    partly: Array | float = 0.0,
) -> tuple[Array, Array, Array]:
    """Next speed, time under full brake, and heat; `partly` was the brake command before it was full."""
    full = brake >= FULL
    braking, push = p.braking_when(heat), p.acceleration_at(speed)
    free = np.where(brake > 0.0, -p.least_braking(brake, heat), np.nan_to_num(engine) * push)
    late = since >= p.response_s - 1e-9
    waits = np.where(np.asarray(partly) > 0.0, -p.least_braking(np.asarray(partly), heat), push)
    rate = np.where(full, np.where(late, -braking, waits), free)
    after = np.maximum(speed + rate * p.dt, 0.0)
    stopped = p.heat_after(heat, np.zeros(len(heat)), speed)
    stopped = stopped + np.where(late, p.dt * p.stop_heat * braking * speed, 0.0)
    heat = np.where(full, stopped, p.heat_after(heat, brake, speed))
    return after, np.where(full, since + p.dt, 0.0), heat


def random_search(assumed: Assumptions, count: int, *, shielded: bool = True) -> Outcome:
    """`count` rollouts with uniformly random genes."""
    rng = np.random.default_rng(0)
    return _outcome(
        rollouts(assumed, rng.random((min(10_000, count - done), WIDTH)), shielded=shielded)
        for done in range(0, count, 10_000)
    )


def adversarial_search(assumed: Assumptions, *, population: int = 2500, generations: int = 20) -> Outcome:
    """Cross-entropy search for the smallest margin: each generation is drawn around the worst 4 % so far."""
    rng = np.random.default_rng(0)
    genes = rng.random((population, WIDTH))
    elite, elite_margin = np.zeros((0, WIDTH)), np.zeros(0)
    found = []
    for _ in range(generations):
        found.append(rollouts(assumed, genes))
        margin = found[-1].least
        pool, pool_margin = np.vstack([elite, genes]), np.concatenate([elite_margin, margin])
        best = np.argsort(pool_margin)[: population // 25]
        elite, elite_margin = pool[best], pool_margin[best]
        parents = elite[rng.integers(len(elite), size=population)]
        others = elite[rng.integers(len(elite), size=population)]
        crossed = np.where(rng.random(parents.shape) < 0.3, others, parents)
        moved = np.where(rng.random(parents.shape) < 0.2, rng.normal(crossed, 0.15), crossed)
        fresh = rng.random(parents.shape)
        genes = np.clip(np.where(rng.random(parents.shape) < 0.03, fresh, moved), 0.0, 1.0)
    return _outcome(found)


def _outcome(parts: Iterable[Margins]) -> Outcome:
    margin, share, early = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    crashes = int((margin < -1e-9).sum())
    return Outcome(len(margin), crashes, float(margin.min()), float(share.mean()), float(early.max()))


def hardest_braking_when_lost(assumed: Assumptions, speed: Array, time_gap: float, seconds: float) -> Array:
    """Hardest braking (m/s^2, (batch,)) while a leader with the truck's speed (batch,) is lost for `seconds`.

    The policy keeps the speed; the truck decelerates in proportion to the brake command, by `mild_braking` at
    `mild_brake`.
    """
    p, shield = assumed, Shield(assumed, 0.0, 1.0)
    per_brake = p.mild_braking / p.mild_brake
    own, gap, hardest = speed.copy(), time_gap * speed, np.zeros(len(speed))
    for k in range(-20, round(seconds / p.dt) + 1):
        seen = np.full(len(speed), 1.0 if k <= 0 else np.nan)
        _, brake = shield.filter(seen * gap, seen * speed, own, np.full(len(own), 0.5), np.zeros(len(own)))
        hardest = np.maximum(hardest, brake * per_brake)
        before, own = own, np.maximum(own - p.dt * brake * per_brake, 0.0)
        gap = gap + p.dt * (speed - before)
    return hardest
