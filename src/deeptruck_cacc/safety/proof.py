"""The promise put to the test: batched rollouts, and a search for a violation that breeds near misses.

The truck is the worst that the promise allows: it accelerates by a(v) for `response_s` after
the full brake command, then brakes with exactly `braking(heat)`; short of the full command it does what the
policy wishes, within its limits. Policy, leader, radar error and dropouts are the adversary's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.safety.shield import Promise, Shield

Array = NDArray[np.float64]
KNOTS = 12  # pieces of a rollout in which leader, policy and radar keep one behaviour
WIDTH = 5 + 4 * KNOTS  # numbers that describe one rollout, each in 0..1


@dataclass(frozen=True)
class Outcome:
    """What a search found. `least_margin_m` is the smallest gap - d_safety of all; negative is a crash."""

    rollouts: int
    violations: int
    least_margin_m: float
    acted_share: float

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return vars(self) | {}


def rollouts(
    promise: Promise, genes: Array, steps: int = 300, *, shielded: bool = True
) -> tuple[Array, Array]:
    """Least margin gap - d_safety (m) and share of steps overridden, each (batch,), for genes (batch, WIDTH).

    Every rollout starts where the promise begins to hold: at or above the gap from which braking at once
    suffices.
    """
    p, batch = promise, len(genes)
    speed, leader, heat = 32.0 * genes[:, 0], 32.0 * genes[:, 1], 1500.0 * genes[:, 2] ** 2
    start = p.needed_gap(speed + p.speed_error, np.maximum(leader - p.speed_error, 0.0), heat, 0.0)
    gap = start + p.gap_error + 20.0 * genes[:, 3] ** 3
    since = np.zeros(batch)  # s of full brake command so far
    shield = Shield(p, 0.0, 1.0)
    shield._seen = gap, leader, speed, heat.copy()  # the promise includes knowing how hot the brakes are
    pull, wish, blind, noise = np.split(genes[:, 5:], 4, axis=1)
    least, acted = np.full(batch, np.inf), np.zeros(batch)
    for k in range(steps):
        piece = min(k * KNOTS // steps, KNOTS - 1)
        seen_gap, seen_leader, seen_speed = _measured(p, gap, leader, speed, noise[:, piece], blind[:, piece])
        engine, brake = _policy(wish[:, piece])
        if shielded:
            engine, brake = shield.filter(seen_gap, seen_leader, seen_speed, engine, brake)
            acted += shield.acted
        before = speed
        speed, since, heat = _worst_truck(p, speed, since, heat, engine, brake)
        gap = gap + (leader - before) * p.dt
        leader = np.maximum(leader + p.dt * (8.0 * pull[:, piece] - 6.0).clip(-p.leader_braking, 2.0), 0.0)
        least = np.minimum(least, gap - p.d_safety)
    return least, acted / steps


def _measured(
    p: Promise, gap: Array, leader: Array, speed: Array, noise: Array, blind: Array
) -> tuple[Array, Array, Array]:
    """Radar and speedometer at the edge of their stated errors; lost where `blind` is above 0.9."""
    sign = 2.0 * (noise > 0.3) - 1.0  # mostly flattering: further and faster than true
    lost = blind > 0.9
    seen_gap = np.where(lost, np.nan, gap + sign * p.gap_error)
    seen_leader = np.where(lost, np.nan, np.maximum(leader + sign * p.speed_error, 0.0))
    return seen_gap, seen_leader, np.maximum(speed - sign * p.speed_error, 0.0)


def _policy(wish: Array) -> tuple[Array, Array]:
    """Anything: full engine, some brake, or not a number."""
    engine = np.where(wish > 0.95, np.nan, np.clip(2.0 * wish - 0.5, 0.0, 1.0))
    return engine, np.clip(0.4 - 2.0 * wish, 0.0, 1.0)


def _worst_truck(
    p: Promise, speed: Array, since: Array, heat: Array, engine: Array, brake: Array
) -> tuple[Array, Array, Array]:
    """Next speed, time under full brake, and heat."""
    full = brake >= 1.0 - 1e-9
    braking, push = p.braking_when(heat), p.acceleration_at(speed)
    free = np.where(brake > 0.0, -brake * 0.5 * braking, np.nan_to_num(engine) * push)
    late = since >= p.response_s - 1e-9
    rate = np.where(full, np.where(late, -braking, push), free)
    after = np.maximum(speed + rate * p.dt, 0.0)
    stopping = np.where(late, p.stop_heat * braking, 0.0)
    heating = np.where(full, stopping, brake * p.strongest_braking) * speed - heat / p.cooling_s
    return after, np.where(full, since + p.dt, 0.0), heat + p.dt * heating


def random_search(promise: Promise, count: int, seed: int = 0, *, shielded: bool = True) -> Outcome:
    """`count` rollouts with everything drawn uniformly."""
    rng = np.random.default_rng(seed)
    parts = [
        rollouts(promise, rng.random((min(10_000, count - done), WIDTH)), shielded=shielded)
        for done in range(0, count, 10_000)
    ]
    return _outcome(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def adversarial_search(
    promise: Promise,
    *,
    population: int = 2500,
    generations: int = 20,
    seed: int = 0,
    shielded: bool = True,
) -> Outcome:
    """Cross-entropy search for the smallest margin: each generation is bred about the worst 4 % so far."""
    rng = np.random.default_rng(seed)
    genes = rng.random((population, WIDTH))
    elite, elite_margin = np.zeros((0, WIDTH)), np.zeros(0)
    margins, shares = [], []
    for _ in range(generations):
        margin, share = rollouts(promise, genes, shielded=shielded)
        margins.append(margin)
        shares.append(share)
        pool, pool_margin = np.vstack([elite, genes]), np.concatenate([elite_margin, margin])
        best = np.argsort(pool_margin)[: population // 25]
        elite, elite_margin = pool[best], pool_margin[best]
        parents = elite[rng.integers(len(elite), size=population)]
        others = elite[rng.integers(len(elite), size=population)]
        crossed = np.where(rng.random(parents.shape) < 0.3, others, parents)
        moved = np.where(rng.random(parents.shape) < 0.2, rng.normal(crossed, 0.15), crossed)
        fresh = rng.random(parents.shape)
        genes = np.clip(np.where(rng.random(parents.shape) < 0.03, fresh, moved), 0.0, 1.0)
    return _outcome(np.concatenate(margins), np.concatenate(shares))


def _outcome(margin: Array, share: Array) -> Outcome:
    return Outcome(len(margin), int((margin < -1e-9).sum()), float(margin.min()), float(share.mean()))
