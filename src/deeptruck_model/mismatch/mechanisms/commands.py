"""Command path and measurement: delays, rate limits, clocks and offsets."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch.expression import Rerun, lift
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
    Settings,
)
from deeptruck_model.mismatch.residual.evidence import Evidence

DELAYS_S = (0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.25)
APART_S = (0.15, 0.3, 0.5, 0.8, 1.25)  # of engine and brake, where each has a line of its own
FULL_RANGE_S = (0.4, 0.6, 0.9, 1.4, 2.0, 3.0, 4.5, 7.0)


def _delay_settings(e: Evidence) -> Iterator[Settings]:
    """Both commands, the engine's alone, or each by its own; a late brake alone is the brake's dead time."""
    for which in ("all", "engine") if e.has("brake_command") else ("all",):
        for tau_s in DELAYS_S:
            yield {"lines": {which: tau_s}}
    if e.has("brake_command"):
        for engine_s, brake_s in itertools.permutations(APART_S, 2):
            yield {"lines": {"engine": engine_s, "brake": brake_s}}


def _delay(s: Settings) -> list[Column]:
    return [
        Column(Rerun(f"delay_{which}", tau_s), 0.3, _delay_of(which), "s", tau_s, mean=1.0)
        for which, tau_s in s["lines"].items()
    ]


def _delay_of(which: str) -> str:
    return "delay" if which == "all" else f"delay_{which}"


def _rate_settings(e: Evidence) -> Iterator[Settings]:
    """One command or both, by how long the full range takes; one may be slewed only up or only down. Torque
    is often shaped: eased into its target, and taken away faster than it is added."""
    spans = {}
    for which in ("engine", "brake"):
        if e.has(f"{which}_command"):
            spans[which] = float(np.ptp(e[f"{which}_command"][e.valid]))
    for some in ([w] for w in spans):
        shaped = ("soft", "shaped") if some == ["engine"] else ()
        for how in ("rate", "climb", "drop", *shaped):
            for s in FULL_RANGE_S if spans[some[0]] > 0 else ():
                yield {"how": how, "rates": {w: spans[w] / s for w in some}}
    if len(spans) == 2 and min(spans.values()) > 0:
        yield from (
            {"how": "rate", "rates": {w: span / s for w, span in spans.items()}} for s in FULL_RANGE_S
        )


def _rate(s: Settings) -> list[Column]:
    return [
        Column(Rerun(f"{s['how']}_{which}", rate), 0.3, f"share_{which}", mean=1.0)
        for which, rate in s["rates"].items()
    ]


def _clock_settings(e: Evidence) -> Iterator[Settings]:
    """Early commands only a clock can make; late ones look like a delay."""
    for tau_s in (*(-d for d in DELAYS_S), *DELAYS_S):
        yield {"lines": {"all": tau_s}}


def _grade_settings(e: Evidence) -> Iterator[Settings]:
    yield {}


def _grade_bias(s: Settings) -> list[Column]:
    return [Column(lift(-GRAVITY), 0.01, "bias", "ratio", sign=0)]


MECHANISMS = (
    Mechanism(
        "command_delay",
        "u(t) -> u(t - d), engine and brake perhaps each by its own",
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
