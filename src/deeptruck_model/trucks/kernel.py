"""What Python calls: compiled loops over the batch and over time.

`states` (batch,) of STATE, `parameters` (1,) or (batch,) of RECORD, u (batch, n_u), grade (batch,). The loops
return -1, or the row whose inputs were not numbers.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

from deeptruck_model.trucks.compiled import entry, part
from deeptruck_model.trucks.road import find_forces, move
from deeptruck_model.trucks.start import replace_speed, settle


@part
def advance(s: Any, p: Any, engine: float, brake: float, grade: float, substeps: int, h: float) -> float:
    """One control step; leaves the mean fuel rate in the state and returns the mean acceleration."""
    before, fuel = s.speed, 0.0
    for _ in range(substeps):
        fuel += find_forces(s, p, engine, brake, grade, h)
        move(s, p, 0.0, h)
    s.fuel_rate = fuel / substeps
    return (s.speed - before) / (substeps * h)


@entry
def reset(states: Any, parameters: Any, y0: Any) -> None:
    for i in range(states.shape[0]):
        settle(states[i], parameters[i % parameters.shape[0]], y0[i, 0], y0[i, 1])


@entry
def force(states: Any, parameters: Any, y: Any) -> None:
    for i in range(states.shape[0]):
        replace_speed(states[i], parameters[i % parameters.shape[0]], y[i, 0], y[i, 1])


@entry
def step(states: Any, parameters: Any, u: Any, grade: Any, substeps: int, h: float, y: Any) -> int:
    for i in range(states.shape[0]):
        if not (isfinite(u[i, 0]) and isfinite(u[i, 1]) and isfinite(grade[i])):
            return i
        s = states[i]
        y[i, 0] = advance(s, parameters[i % parameters.shape[0]], u[i, 0], u[i, 1], grade[i], substeps, h)
        y[i, 1] = s.speed
        if y.shape[1] > 2:
            y[i, 2] = s.fuel_rate
    return -1


@entry
def rollout(
    states: Any,
    raw: Any,
    parameters: Any,
    u: Any,
    grade: Any,
    asked: Any,
    recorded: Any,
    substeps: int,
    h: float,
    y: Any,
    seen: Any,
) -> int:
    """u (batch, T, 2), grade (batch, T), gears asked (batch, T or 0), recorded (batch, T or 0, n_y).

    Fills y (batch, T, n_y) from 1 on and seen (batch, T or 0, n) with the first n fields of the states, whose
    memory raw (batch, fields) is.
    """
    forced = recorded.shape[1] > 0
    for i in range(states.shape[0]):
        p = parameters[i % parameters.shape[0]]
        s = states[i]
        for k in range(u.shape[1] - 1):
            engine, brake, slope = u[i, k, 0], u[i, k, 1], grade[i, k]
            if not (isfinite(engine) and isfinite(brake) and isfinite(slope)):
                return i
            if asked.shape[1] > 0:
                s.asked_gear = asked[i, k]
            y[i, k + 1, 0] = advance(s, p, engine, brake, slope, substeps, h)
            y[i, k + 1, 1] = s.speed
            if y.shape[2] > 2:
                y[i, k + 1, 2] = s.fuel_rate
            for j in range(seen.shape[2] if seen.shape[1] > 0 else 0):
                seen[i, k + 1, j] = raw[i, j]
            if forced:
                replace_speed(s, p, recorded[i, k + 1, 0], recorded[i, k + 1, 1])
    return -1


@entry
def first_half(states: Any, parameters: Any, u: Any, grade: Any, h: float, fuel: Any) -> int:
    """Find the forces of one substep; `second_half` moves the trucks, after others had their say."""
    for i in range(states.shape[0]):
        if not (isfinite(u[i, 0]) and isfinite(u[i, 1]) and isfinite(grade[i])):
            return i
        p = parameters[i % parameters.shape[0]]
        fuel[i] += find_forces(states[i], p, u[i, 0], u[i, 1], grade[i], h)
    return -1


@entry
def second_half(states: Any, parameters: Any, external: Any, h: float) -> int:
    for i in range(states.shape[0]):
        if not isfinite(external[i]):
            return i
        move(states[i], parameters[i % parameters.shape[0]], external[i], h)
    return -1
