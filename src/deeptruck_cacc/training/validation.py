"""Validation during training: fresh scenes on the simulator used for training, never on the test truck."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers.policy import Policy
from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.hard_scenes import gap_closing
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_core.arrays import Array
from deeptruck_model.simulators import Simulator

EXAM_S = 40.0
SETTLED_S, STEADY_S = 10.0, 25.0  # the paper's times for the time gap and for the speed


def exam(seed: int, dt: float, *, copies: int = 1, late: bool = False) -> Scene:
    """40 paths of 40 s, the same rows `copies` times.

    16 are the paper's, 16 have leaders of varying speed on hills, 8 close a gap; half of each have unobserved
    command gains. With `late`, commands have the delays of scene `late`.
    """
    rng = np.random.default_rng([seed, 2**31])
    drawn = ((scenes.paper, 16), (scenes.moving, 16), (gap_closing, 8))
    parts = [draw(rng, count, round(EXAM_S / dt), dt) for draw, count in drawn]
    gain = np.exp(rng.uniform(-1, 1, (40, 2)) * np.log(1.5))
    gain[::2] = 1.0

    def join(name: str) -> NDArray[Any]:
        return np.concatenate([np.concatenate([getattr(part, name) for part in parts])] * copies)

    names = ("leader_speed", "speed", "gap", "time_gap", "leader_acceleration", "grade")
    rows: dict[str, Any] = {name: join(name) for name in names}
    exam = replace(parts[0], **rows, command_gain=np.concatenate([gain] * copies))
    return replace(exam, command_delay=np.tile(scenes.delays(rng, 40, dt), copies)) if late else exam


def scores(scene: Scene, dt: float, time_gap_error: Array, speed_error: Array, crashed: Array) -> Array:
    """Score of each row, its worst value over time; smaller is better. Errors (T, rows), crashed (rows,).

    The time-gap error (s) after 10 s, and the speed error (m/s) after 25 s behind steady leaders: behind a
    leader of varying speed, keeping the time gap requires a speed error of Tg a. A crash adds 10.
    """
    steady = ~np.any(scene.leader_acceleration, axis=1)
    worst = np.abs(time_gap_error[round(SETTLED_S / dt) :]).max(axis=0)
    speed = np.abs(speed_error[round(STEADY_S / dt) :]).max(axis=0)
    return worst + steady * speed + 10.0 * crashed


def score(simulator: Simulator, policy: Policy, scene: Scene) -> float:
    """Mean score of a policy over a scene's rows."""
    trace = roll_out(simulator, policy, scene)
    crashed = trace["crash"].max(axis=0)
    rows = scores(scene, trace.dt, trace["time_gap_error"], trace["speed_error"], crashed)
    return float(np.nan_to_num(rows, nan=1e3).mean())
