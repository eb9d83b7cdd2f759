"""Difficult scenes: stops, cut-ins, radar faults, descents, recorded leaders."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from deeptruck_cacc.environments.scenes import Drawer, Scene, graded, moving, paper, rolling_road, wide
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError


def settled(batch: int, steps: int, speed: float | Array, time_gap: float) -> Scene:
    """Both trucks at equal speed and at the desired gap, on a flat road."""
    v = np.broadcast_to(np.asarray(speed, float), (batch,)).copy()
    still = np.zeros((batch, steps))
    return Scene(v, v.copy(), v * time_gap, np.full(batch, time_gap), still, still.copy())


def stop(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """The leader brakes at -6 m/s2 to a standstill between 5 and 15 s; time gaps 2..5 s."""
    scene = paper(rng, batch, steps, dt)
    begin = rng.integers(round(5 / dt), round(15 / dt), batch)
    braking = np.arange(steps) >= begin[:, None]
    return replace(scene, leader_acceleration=np.where(braking, -6.0, 0.0))


def ramps(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """Leader speed in ramps of 1 m/s2 up and down by 3 m/s every 20 s."""
    scene = paper(rng, batch, steps, dt)
    t = dt * np.arange(steps)[None] + rng.uniform(0, 40, (batch, 1))
    ramp = (t % 20.0 < 3.0) * np.where(t % 40.0 < 20.0, -1.0, 1.0)
    return replace(scene, leader_acceleration=ramp)


def cut_in(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """At 20 s a vehicle with the leader's speed +-1 m/s cuts in at 35 to 60 % of the gap."""
    scene = paper(rng, batch, steps, dt)
    at = min(round(20 / dt), steps - 1)
    gap_jump, speed_jump = np.zeros((batch, steps)), np.zeros((batch, steps))
    gap_jump[:, at] = -rng.uniform(0.40, 0.65, batch) * scene.leader_speed * scene.time_gap
    speed_jump[:, at] = rng.uniform(-1, 1, batch)
    return replace(scene, gap_jump=gap_jump, leader_speed_jump=speed_jump)


def cut_out(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """At 20 s the leader leaves; the next vehicle is 15 to 40 m farther away and up to 2 m/s slower."""
    scene = paper(rng, batch, steps, dt)
    at = min(round(20 / dt), steps - 1)
    gap_jump, speed_jump = np.zeros((batch, steps)), np.zeros((batch, steps))
    gap_jump[:, at] = rng.uniform(15, 40, batch)
    speed_jump[:, at] = rng.uniform(-2, 0, batch)
    return replace(scene, gap_jump=gap_jump, leader_speed_jump=speed_jump)


def dropout(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """A leader of varying speed on hills, lost by the radar for 0.3 to 1.5 s about every 10 s."""
    scene = moving(rng, batch, steps, dt)
    seen = np.ones((batch, steps), bool)
    for row in seen:
        for begin in np.flatnonzero(rng.random(steps) < dt / 10):
            row[begin : begin + round(rng.uniform(0.3, 1.5) / dt)] = False
    seen[:, 0] = True
    return replace(scene, seen=seen)


def radar_jump(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """For 1 to 3 s from 20 s on, the radar reports a vehicle 20 to 40 m farther away and up to 3 m/s
    faster."""
    scene = paper(rng, batch, steps, dt)
    begin = round(20 / dt)
    during = np.arange(steps)[None] - begin
    active = (during >= 0) & (during < rng.integers(round(1 / dt), round(3 / dt), (batch, 1)))
    return replace(
        scene,
        seen_gap_offset=active * rng.uniform(20, 40, (batch, 1)),
        seen_speed_offset=active * rng.uniform(0, 3, (batch, 1)),
    )


def descent(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """A long descent of 3 to 5 %, leader steady at 12 to 20 m/s: brakes grow hot."""
    scene = settled(batch, steps, rng.uniform(12, 20, batch), 2.5)
    grade = -rng.uniform(0.03, 0.05, (batch, 1)) * np.ones((1, steps))
    return replace(scene, grade=grade)


def gap_closing(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """The paper's field run: 2 m/s faster than a steady leader, at a gap 1 s too long, desired time gap 1.5
    s."""
    scene = settled(batch, steps, rng.uniform(17, 21, batch), 1.5)
    speed = scene.leader_speed + 2.0
    return replace(scene, speed=speed, gap=speed * 2.5)


class LaneChange(NamedTuple):
    """A lane change of the paper's field run, during which the radar detects another vehicle."""

    at_s: float = 63.0
    duration_s: float = 2.0
    gap_m: float = 30.0  # how much further that one is
    speed: float = 1.5  # how much faster, m/s


LANE_CHANGE = LaneChange()


def long_following(rng: np.random.Generator, batch: int, steps: int, dt: float) -> Scene:
    """The paper's field run: a leader of arbitrary speed at time gap 1.5 s, and LANE_CHANGE."""
    scene = settled(batch, steps, rng.uniform(17, 21, batch), 1.5)
    t = dt * np.arange(steps)[None]
    pull = np.zeros((batch, steps))
    for period in (13.0, 23.0, 41.0):
        pull += 0.12 * np.sin(2 * np.pi * t / period + rng.uniform(0, 2 * np.pi, (batch, 1)))
    change = LANE_CHANGE
    looking_past = (t >= change.at_s) & (t < change.at_s + change.duration_s)
    return replace(
        scene,
        leader_acceleration=pull,
        grade=rolling_road(rng, batch, steps, dt, scene.speed, 0.015),
        seen_gap_offset=looking_past * np.full((batch, 1), change.gap_m),
        seen_speed_offset=looking_past * np.full((batch, 1), change.speed),
    )


def recorded(speeds: Array, time_gap: float) -> Scene:
    """Scenes with recorded leaders, speeds (batch, T + 1) in m/s at the simulator's dt of 0.1 s."""
    pull = np.diff(speeds, axis=1) / 0.1
    start = settled(len(speeds), pull.shape[1], speeds[:, 0], time_gap)
    return replace(start, leader_acceleration=pull)


def data_folder() -> Path:
    """The folder of real recordings: $DEEPTRUCK_REAL_DATA, or ../shared/data next to the checkout."""
    default = Path(__file__).parents[4] / "shared" / "data"
    return Path(os.environ.get("DEEPTRUCK_REAL_DATA", default))


def recorded_leaders(name: str, seconds: float = 80.0) -> Array:
    """Speeds (batch, T + 1) at 10 Hz of recorded leaders: 'human' (fhwa_pav) or 'acc' (openacc).

    Contiguous pieces above 5 m/s of the first vehicle (human) or of the last car under ACC. Raises InputError
    if the recording is absent or holds no such piece.
    """
    files = {
        "human": ("fhwa_pav/data_example.csv", 0, "Speed1"),
        "acc": ("openacc/short_setting_dynamic_part1.csv", 5, "Speed6"),
    }
    if name not in files:
        raise InputError(f"there is no recorded leader '{name}'; known: {', '.join(files)}")
    path, skip, column = data_folder() / files[name][0], *files[name][1:]
    try:
        with path.open(encoding="latin-1") as file:
            lines = file.read().splitlines()[skip:]
    except OSError:
        raise InputError(f"{path} is absent; set DEEPTRUCK_REAL_DATA to the folder of recordings") from None
    index = lines[0].split(",").index(column)
    cells = [line.split(",")[index] for line in lines[1:]]
    speed = np.array([float(cell) if cell.strip() else np.nan for cell in cells])
    length = round(seconds / 0.1) + 1
    pieces = [speed[k : k + length] for k in range(0, len(speed) - length, length)]
    kept = [piece for piece in pieces if np.all(np.isfinite(piece)) and piece.min() > 5.0]
    if not kept:
        raise InputError(f"{path} has no {seconds:g} s above 5 m/s")
    return np.array(kept)


HARD: dict[str, tuple[Drawer, float]] = {  # name: (drawer, seconds)
    "paper": (paper, 80.0),
    "graded": (graded, 80.0),
    "moving": (moving, 80.0),
    "wide": (wide, 80.0),
    "steps": (ramps, 80.0),
    "stop": (stop, 40.0),
    "cut_in": (cut_in, 60.0),
    "cut_out": (cut_out, 60.0),
    "dropout": (dropout, 80.0),
    "radar_jump": (radar_jump, 60.0),
    "descent": (descent, 300.0),
    "gap_closing": (gap_closing, 40.0),
    "long_following": (long_following, 120.0),
}
