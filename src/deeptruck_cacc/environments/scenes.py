"""Scenes: initial states of the trucks and histories of leader, road and radar, for a whole batch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array

Drawer = Callable[[np.random.Generator, int, int, float], "Scene"]

LATE_S = 0.2  # what a bus and the controllers behind it take at most


@dataclass(frozen=True)
class Scene:
    """Everything outside the ego truck: (batch,) initial values and (batch, T) histories over the path.

    `gap_jump` changes the true gap (cut-in, cut-out) at the start of a step, `leader_speed_jump` the leader's
    speed with it. `seen_gap_offset` and `seen_speed_offset` are errors of the radar, `seen` False is a
    dropout (NaN). `hidden_grade` is a slope that acts on the truck and that no sensor reports. Commands reach
    the truck `command_delay` (batch,) steps late, as over a bus. Absent histories are None.
    """

    leader_speed: Array
    speed: Array
    gap: Array
    time_gap: Array
    leader_acceleration: Array
    grade: Array
    gap_jump: Array | None = None
    leader_speed_jump: Array | None = None
    seen_gap_offset: Array | None = None
    seen_speed_offset: Array | None = None
    seen: NDArray[np.bool_] | None = None
    hidden_grade: Array | None = None
    command_gain: Array | None = None
    command_delay: NDArray[np.int64] | None = None

    @property
    def batch(self) -> int:
        """Number of rollouts."""
        return len(self.speed)

    @property
    def steps(self) -> int:
        """Path length."""
        return self.leader_acceleration.shape[1]


def paper(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """The paper's initial distributions, constant leader speed, flat road.

    Leader 8.3..22.2 m/s, ego +-1.39 m/s about it, gap error +-1.39 m, time gap 2..5 s.
    """
    leader = rng.uniform(8.3, 22.2, batch)
    speed = leader + rng.uniform(-1.39, 1.39, batch)
    time_gap = rng.uniform(2.0, 5.0, batch)
    gap = speed * time_gap + rng.uniform(-1.39, 1.39, batch)
    still = np.zeros((batch, steps))
    return Scene(leader, speed, gap, time_gap, still, still.copy())


def graded(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """The paper's scene on a constant random grade within +-3 % (the paper's theta distribution)."""
    scene = paper(rng, batch, steps, dt)
    return replace(scene, grade=np.tile(rng.uniform(-0.03, 0.03, (batch, 1)), (1, steps)))


def moving(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """Leader of varying speed on a graded road: 0.5 m/s2 sine with period 10..20 s, grade a slow random walk
    within +-3 %."""
    scene = paper(rng, batch, steps, dt)
    t = dt * np.arange(steps)
    period = rng.uniform(10.0, 20.0, (batch, 1))
    phase = rng.uniform(0.0, 2 * np.pi, (batch, 1))
    acceleration = 0.5 * np.sin(2 * np.pi * t / period + phase)
    return replace(
        scene, leader_acceleration=acceleration, grade=rolling_road(rng, batch, steps, dt, scene.speed)
    )


def rolling_road(
    rng: np.random.Generator, batch: int, steps: int, dt: float, speed: Array, limit: float = 0.03
) -> Array:
    """Grade (batch, steps) of two hills of 0.3..2 km wavelength, passed at the initial speed, within
    +-limit."""
    distance = np.atleast_1d(speed)[:, None] * dt * np.arange(steps)
    grade = np.zeros((batch, steps))
    for share in (0.65, 0.35):
        wavelength = rng.uniform(300.0, 2000.0, (batch, 1))
        grade += share * np.sin(2 * np.pi * distance / wavelength + rng.uniform(0, 2 * np.pi, (batch, 1)))
    return limit * grade


def wide(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """Training mix beyond the paper: larger errors, leaders of varying speed, hills, and trucks that differ
    from the simulator.

    A third of the rollouts is the paper's own scene, a tenth closes a wide gap; in the others the leader's
    speed is a sine, has steps or includes hard braking. Half have a radar with noise of up to 0.2 m and 0.1
    m/s (sd). The hidden slope (+-1 %) and the command gains (1/1.7..1.7) represent what the simulator does
    not know: payload, wind, a grade sensor's bias, a weaker engine.
    """
    scene = moving(rng, batch, steps, dt)
    calm, off = rng.random(batch) < 1 / 3, rng.random(batch) < 0.3
    time_gap = np.where(off, rng.uniform(1.2, 5.0, batch), scene.time_gap)
    speed = scene.leader_speed + rng.uniform(-1, 1, batch) * np.where(off, 3.0, 1.39)
    gap = speed * time_gap + rng.uniform(-1, 1, batch) * np.where(off, 0.8 * speed, 1.39)
    closing = rng.random(batch) < 0.1
    time_gap = np.where(closing, rng.uniform(1.3, 2.0, batch), time_gap)
    speed = np.where(closing, scene.leader_speed + rng.uniform(1.0, 3.0, batch), speed)
    gap = np.where(closing, speed * (time_gap + rng.uniform(0.5, 1.2, batch)), gap)
    calm |= closing
    noise = rng.uniform(0.0, 1.0, (batch, 1)) * (rng.random((batch, 1)) < 0.5)
    kind = rng.random((batch, 1))
    sines = scene.leader_acceleration * rng.uniform(0.0, 1.5, (batch, 1))
    pull = np.where(kind < 0.5, sines, _ramps(rng, batch, steps, dt))
    pull = np.where(kind > 0.85, _braking(rng, scene.leader_speed, steps, dt), pull)
    return replace(
        scene,
        time_gap=time_gap,
        speed=speed,
        gap=np.maximum(gap, 8.0),
        leader_acceleration=np.where(calm[:, None], 0.0, pull),
        grade=np.where(calm[:, None], 0.0, scene.grade),
        seen_gap_offset=0.2 * noise * rng.normal(size=(batch, steps)),
        seen_speed_offset=0.1 * noise * rng.normal(size=(batch, steps)),
        hidden_grade=np.tile(rng.uniform(-0.01, 0.01, (batch, 1)), (1, steps)),
        command_gain=np.exp(rng.uniform(-1, 1, (batch, 2)) * np.log(1.7)),
    )


def late(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """`wide` with commands delayed by between 0 and LATE_S, constant for each truck, as over a bus."""
    scene = wide(rng, batch, steps, dt)
    return replace(scene, command_delay=delays(rng, batch, dt))


def delays(rng: np.random.Generator, batch: int, dt: float) -> NDArray[np.int64]:
    """Random delays in steps of dt, uniform from 0 to LATE_S, (batch,)."""
    return rng.integers(0, round(LATE_S / dt), batch, endpoint=True)


def _ramps(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Array:
    """Piecewise constant leader acceleration with zero sum: +a, rest, -a, rest."""
    length = rng.integers(round(2 / dt), round(6 / dt), (batch, 1))
    size = rng.uniform(-1.0, 1.0, (batch, 1))
    phase = (np.arange(steps) // length + rng.integers(0, 4, (batch, 1))) % 4
    return size * np.array([1.0, 0.0, -1.0, 0.0])[phase]


def _braking(rng: np.random.Generator, speed: Array, steps: int, dt: float) -> Array:
    """The leader brakes once, at 1..4 m/s2, down to a third of its speed."""
    batch = len(speed)
    rate = rng.uniform(1.0, 4.0, (batch, 1))
    begin = rng.uniform(2.0, 0.6 * steps * dt, (batch, 1))
    after = dt * np.arange(steps) - begin
    return np.where((after >= 0) & (after < 0.67 * speed[:, None] / rate), -rate, 0.0)


def reach(scene: Scene) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each observed signal at the start of a scene (and of grade over it)."""
    values = {
        "leader_speed": scene.leader_speed,
        "speed": scene.speed,
        "gap": scene.gap,
        "target_time_gap": scene.time_gap,
        "grade": scene.grade,
    }
    return {name: (float(x.min()), float(x.max())) for name, x in values.items()}


DRAWERS: dict[str, Drawer] = {
    "paper": paper,
    "graded": graded,
    "moving": moving,
    "wide": wide,
    "late": late,
}
