"""Platoons: each truck follows the one before it; amplification of a disturbance along the string."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from deeptruck_cacc.controllers.policy import Policy
from deeptruck_cacc.environments.hard_scenes import settled
from deeptruck_cacc.environments.rollouts import Trace, roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_core.arrays import Array
from deeptruck_model.simulators import Simulator

FREQUENCIES = np.geomspace(0.01, 0.5, 12)


def drive(
    simulator: Simulator,
    policy: Policy,
    first: Scene,
    trucks: int = 8,
    radar: np.random.Generator | None = None,
) -> list[Trace]:
    """The traces of `trucks` trucks in a row behind the leader of `first`.

    Followers do not affect the trucks before them, so simulating the trucks one after another is exact.
    Without V2V pass a `radar` generator: leader speed then has 0.1 m/s and gap 0.2 m of noise (sd).
    """
    traces: list[Trace] = []
    scene = first
    for _ in range(trucks):
        if radar is not None:
            shape = scene.leader_acceleration.shape
            scene = replace(
                scene,
                seen_speed_offset=radar.normal(0, 0.1, shape),
                seen_gap_offset=radar.normal(0, 0.2, shape),
            )
        traces.append(roll_out(simulator, policy, scene))
        scene = behind(scene, traces[-1])
    return traces


def behind(scene: Scene, trace: Trace) -> Scene:
    """The scene of a truck that follows the truck of `trace`, with its own radar noise."""
    speed = np.vstack([scene.speed, trace["speed"]]).T
    pull = np.diff(speed, axis=1) / trace.dt
    return replace(
        scene,
        leader_speed=scene.speed,
        leader_acceleration=pull,
        seen_speed_offset=None,
        seen_gap_offset=None,
    )


def string_stability(
    simulator: Simulator,
    policy: Policy,
    *,
    trucks: int = 8,
    time_gap: float = 1.5,
    speed: float = 18.0,
    amplitude: float = 0.5,
    v2v: bool = True,
    draws: int = 8,
    frequencies: Array = FREQUENCIES,
) -> dict[str, Any]:
    """Amplification of speed and gap error from truck to truck at `frequencies` (n,), Hz, the worst of the
    string, and of speed from the leader to the last truck.

    The leader's speed is a sine of `amplitude` m/s about `speed`; the response is its Fourier coefficient
    over whole periods in the second half of the run. Gap errors begin with truck 1, so their amplification
    compares trucks 2..n. Without V2V each frequency is driven with `draws` of radar noise and the
    coefficients are averaged, because a response to a truck's own radar noise is no amplification. Eight
    draws leave a contribution of up to 0.01 at an amplitude of 0.2 m/s, 64 draws a third of that.
    """
    dt, steps = simulator.dt, round(200.0 / simulator.dt)
    t = dt * np.arange(steps)
    omega = 2 * np.pi * np.tile(frequencies, 1 if v2v else draws)[:, None]
    scene = settled(len(omega), steps, speed, time_gap)
    pull = np.diff(amplitude * np.sin(omega * np.append(t, t[-1] + dt)), axis=1) / dt
    scene = replace(scene, leader_acceleration=pull)
    traces = drive(simulator, policy, scene, trucks, None if v2v else np.random.default_rng(0))
    lead = _coefficient(traces[0]["leader_speed"].T, dt, frequencies)
    speeds = np.array([lead] + [_coefficient(trace["speed"].T, dt, frequencies) for trace in traces])
    gaps = np.array([_coefficient(_gap_error(trace), dt, frequencies) for trace in traces])
    return {
        "trucks": trucks,
        "time_gap_s": time_gap,
        "v2v": v2v,
        "frequency_hz": frequencies.tolist(),
        "worst_speed_amplification": (speeds[1:] / np.maximum(speeds[:-1], 0.05 * amplitude))
        .max(axis=0)
        .tolist(),
        "head_to_tail_speed_amplification": (speeds[-1] / speeds[0]).tolist(),
        "worst_gap_error_amplification": (gaps[1:] / np.maximum(gaps[:-1], 0.05)).max(axis=0).tolist(),
        "crashes": int(sum(trace["crash"].any() for trace in traces)),
    }


def _gap_error(trace: Trace) -> Array:
    return (trace["gap"] - trace["speed"] * trace.scene.time_gap).T


def _coefficient(signals: Array, dt: float, frequencies: Array = FREQUENCIES) -> Array:
    """Amplitude at `frequencies` (n,) of the signals (k * n, T), k runs concatenated, over whole periods at
    the end."""
    runs = len(signals) // len(frequencies)
    coefficients = []
    for frequency, row in zip(np.tile(frequencies, runs), signals, strict=True):
        whole = max(np.floor(0.5 * len(row) * dt * frequency), 1.0) / frequency
        tail = row[-round(whole / dt) :]
        t = dt * np.arange(len(tail))
        coefficients.append(2 * np.mean((tail - tail.mean()) * np.exp(-2j * np.pi * frequency * t)))
    return np.abs(np.reshape(coefficients, (runs, -1)).mean(axis=0))
