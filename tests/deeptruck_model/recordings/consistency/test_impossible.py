"""What no truck can do in the samples of one channel: which samples are found, and where none is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from csv_tables import speed

from deeptruck_core.arrays import Array
from deeptruck_model.recordings.consistency.impossible import (
    DROPPED,
    FROZEN,
    SPIKES,
    UNAVAILABLE,
    Places,
    changed_unit,
    impossible,
    lost_decimals,
    moving_at_zero,
    senders,
    zero_changes,
)

T = np.round(0.1 * np.arange(1200), 1)
V = np.round(speed(T), 2)
S = np.arange(400.0)
HEIGHT = 300.0 + np.round(0.02 * np.cumsum(speed(T)), 1)
STOP = np.clip(20 - 0.2 * S, 0, None)  # at 10 Hz


def put(values: Array, rows: Any, value: Any) -> Array:
    out = values.copy()
    out[rows] = value
    return out


def level() -> Array:
    """A road that is level for a while, and goes on where it was."""
    h = put(HEIGHT, slice(200, 600), HEIGHT[200])
    h[600:] += h[200] - HEIGHT[599]
    return h


def far_off(step_s: float, rows: list[int], by_m_s: float) -> tuple[str, Array, Array, dict[str, list[int]]]:
    t = step_s * np.arange(1200)
    v = np.round(speed(t), 2)
    return "speed", t, put(v, rows, v[rows] + by_m_s), {SPIKES: rows}


SAMPLES: dict[str, tuple[str, Array, Array, dict[str, list[int]]]] = {
    "a sound drive": ("speed", T, V, {}),
    "far off": far_off(0.1, [150, 400, 401, 700, 950], 30.0),
    "a little off": far_off(0.1, [150, 400, 401, 700, 950], -4.0),
    "first and last": far_off(0.1, [0, 1199], 30.0),
    "at 1 Hz": far_off(1.0, [50, 200, 201, 400], 18.0),
    "at 50 Hz": far_off(0.02, [300, 301, 302, 900], 3.0),
    "frozen": ("speed", T, put(V, slice(300, 420), V[300]), {FROZEN: [*range(301, 420)]}),
    "cruising": ("speed", T,
        np.where((T > 20) & (T < 60), 20.0, 20.0 + 0.1 * np.maximum(T - 60, 0)).round(2), {}),
    "coarse": ("speed", T, V.round(), {}),
    "a height that is frozen": ("elevation", T, put(HEIGHT, slice(300, 420), HEIGHT[300]),
        {FROZEN: [*range(301, 420)]}),
    "a level road": ("elevation", T, level(), {}),
    "a pedal that is held": ("engine_command", T, put(HEIGHT, slice(300, 420), HEIGHT[300]), {}),
    "idling": ("fuel_rate", T, np.where((T > 30) & (T < 50), 2.5, np.round(0.4 * V, 2)), {}),
    "a stop": ("speed", 0.1 * S, STOP, {}),
    "a stop with a drop-out": ("speed", 0.1 * S, put(STOP, slice(50, 60), 0.0), {DROPPED: [*range(50, 60)]}),
    "standing behind a cut": ("speed", S, np.where(S < 300, 20.0 + np.sin(S / 9), 0.0), {}),
    "standing before a cut": ("speed", S, np.where(S < 300, 20.0 + np.sin(S / 9), 0.0)[::-1], {}),
    **{f"{channel} before a fix": (channel, T, np.where(T < 2.0, 0.0, value + 1e-5 * T),
        {DROPPED: [*range(20)]})
       for channel, value in (("latitude", 49.0), ("longitude", -8.0), ("elevation", 300.0))},
    "-1 % for no value": ("engine_command", T, put(np.where(T < 5.0, 40.0, 0.0), slice(30, 33), -1.0),
        {UNAVAILABLE: [30, 31, 32]}),
    "retarding": ("engine_command", T, np.where(T > 8.0, -(T - 8.0) - 1.0, np.where(T < 5.0, 40.0, 0.0)), {}),
}  # fmt: skip


@pytest.mark.parametrize("name", SAMPLES)
def test_samples_that_are_no_values(name: str) -> None:
    channel, t, v, rows = SAMPLES[name]
    unit = "percent" if channel == "engine_command" else ""
    found = {reason: np.flatnonzero(these).tolist() for reason, these in impossible(channel, unit, t, v)}
    assert found == rows


@pytest.mark.parametrize("seconds", [10, 60])
def test_zero_while_a_pose_moves_is_no_speed(seconds: int) -> None:
    t = 0.1 * np.arange(10 * seconds)
    x = np.cumsum(speed(t)) * 0.1
    assert moving_at_zero(t, 0 * t, [Places(t, x, 0 * t)]).all()
    assert not moving_at_zero(t, 0 * t, [Places(t, 0 * t + 5.0, 0 * t)]).any()


@pytest.mark.parametrize(
    ("second", "what"),
    [(lambda v: v / 1.6093, "km/h to mph"), (lambda v: v / 3.6, "km/h to m/s"), (lambda v: v, "")],
)
def test_a_unit_that_changes_within_is_seen(second: Callable[[Array], Array], what: str) -> None:
    kmh = np.round(3.6 * speed(T), 1)
    said = changed_unit(T, np.where(T < 60, kmh, np.round(second(kmh), 1)))
    assert what in said and bool(said) == bool(what)


def test_what_changes_no_zero_has_its_points_and_is_of_one_sender() -> None:
    """Hills with noise; a drive, and random numbers; a coarse speed that flickers."""
    t = np.arange(600.0)
    hills = 200 + 8 * np.sin(t / 20) + np.cumsum(np.random.default_rng(1).normal(0, 1.0, 600))
    assert zero_changes(t, hills, np.zeros(0)) == []
    assert lost_decimals(V) == lost_decimals(np.random.default_rng(0).uniform(0, 30, 1000)) == ""
    assert not senders(np.round(V + 0.5 * (np.arange(1200) % 2)))
