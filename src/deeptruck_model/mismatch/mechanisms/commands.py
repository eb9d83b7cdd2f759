"""Command path and measurement: delays, rate limits, clocks and offsets."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from deeptruck_model.mismatch.evidence import GRAVITY, Evidence
from deeptruck_model.mismatch.expression import Rerun, lift
from deeptruck_model.mismatch.mechanisms.base import Column, Mechanism, Settings


def _delay_settings(e: Evidence) -> Iterator[Settings]:
    """Both commands or the engine's alone; a late brake alone is the brake's own dead time."""
    for which in ("all", "engine") if e.has("brake_command") else ("all",):
        for tau_s in (0.1, 0.2, 0.35, 0.5, 0.8):
            yield {"which": which, "tau_s": tau_s}


def _delay(s: Settings) -> list[Column]:
    return [Column(Rerun(f"delay_{s['which']}", s["tau_s"]), 0.3, "delay", "s", s["tau_s"], mean=1.0)]


def _rate_settings(e: Evidence) -> Iterator[Settings]:
    for which in ("engine", "brake"):
        if not e.has(f"{which}_command"):
            continue
        x = e[f"{which}_command"]
        span = float(np.nanmax(x) - np.nanmin(x))
        for full_range_s in (0.5, 1.0, 2.0, 4.0):
            if span > 0:
                yield {"which": which, "rate": span / full_range_s, "full_range_s": full_range_s}


def _rate(s: Settings) -> list[Column]:
    return [Column(Rerun(f"rate_{s['which']}", s["rate"]), 0.3, "share", mean=1.0)]


def _clock_settings(e: Evidence) -> Iterator[Settings]:
    for tau_s in (-1.0, -0.6, -0.4, -0.25, -0.1, 0.25, 0.5, 1.0):
        yield {"which": "all", "tau_s": tau_s}


def _grade_settings(e: Evidence) -> Iterator[Settings]:
    yield {}


def _grade_bias(s: Settings) -> list[Column]:
    return [Column(lift(-GRAVITY), 0.01, "bias", "ratio", sign=0)]


MECHANISMS = (
    Mechanism(
        "command_delay",
        "u(t) -> u(t - d)",
        "commands act later than the simulator thinks",
        ("engine_command",),
        ("command rate",),
        "J1939 message period plus actuator dead time",
        "step one command at a time, on one clock with the response",
        _delay_settings,
        _delay,
    ),
    Mechanism(
        "command_rate_limit",
        "|du/dt| <= r",
        "commands are slewed on their way",
        ("engine_command",),
        ("command rate",),
        "SAE J1939-71 TSC1 override ramping",
        "step commands of different size: a limit makes large ones late, a lag does not",
        _rate_settings,
        _rate,
    ),
    Mechanism(
        "clock_offset",
        "commands and responses are stamped by clocks d apart",
        "commands and responses are not on one clock",
        ("engine_command",),
        ("command rate",),
        "comparison of channels, no truck physics",
        "record one event on both clocks",
        _clock_settings,
        _delay,
        kind="measurement_fault",
        prior=0.5,
    ),
    Mechanism(
        "grade_bias",
        "grade = true + b",
        "the recorded grade is offset",
        ("grade",),
        ("nothing",),
        "inclinometer mounting angle",
        "stand on the same spot in both directions",
        _grade_settings,
        _grade_bias,
        kind="measurement_fault",
        prior=0.7,
    ),
)
