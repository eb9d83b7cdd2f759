"""Command path and measurement: delays, rate limits, clocks and offsets."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from deeptruck_model.constants import GRAVITY
from deeptruck_model.mismatch.expression import Rerun, lift
from deeptruck_model.mismatch.mechanisms.base import (
    Column,
    Mechanism,
)
from deeptruck_model.mismatch.mechanisms.variants import Constants, Simple, Static
from deeptruck_model.mismatch.residual.evidence import Evidence

DELAYS_S = (0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.25)
APART_S = (0.15, 0.3, 0.5, 0.8, 1.25)  # of engine and brake, where each has a line of its own
FULL_RANGE_S = (0.4, 0.6, 0.9, 1.4, 2.0, 3.0, 4.5, 7.0)


@dataclass(frozen=True)
class Delays(Constants):
    """Each command ("all", "engine" or "brake") and by how many s it is late."""

    lines: tuple[tuple[str, float], ...]


def _delays(e: Evidence) -> Iterator[Static]:
    """Both commands, the engine's alone, or each by its own; a late brake alone is the brake's dead time."""
    for which in ("all", "engine") if e.has("brake_command") else ("all",):
        for tau_s in DELAYS_S:
            yield Static(Delays(((which, tau_s),)))
    if e.has("brake_command"):
        for engine_s, brake_s in itertools.permutations(APART_S, 2):
            yield Static(Delays((("engine", engine_s), ("brake", brake_s))))


def _delay(v: Simple) -> list[Column]:
    if not isinstance(v.constants, Delays):
        raise TypeError(f"{v!r} is no delay")
    return [
        Column(Rerun(f"delay_{which}", tau_s), 0.3, _delay_of(which), "s", tau_s, mean=1.0)
        for which, tau_s in v.constants.lines
    ]


def _delay_of(which: str) -> str:
    return "delay" if which == "all" else f"delay_{which}"


@dataclass(frozen=True)
class RateLimits(Constants):
    """How commands are slewed (a name of `CommandPath`), and each with its rate in units of the command per
    s."""

    how: str
    rates: tuple[tuple[str, float], ...]


def _rates(e: Evidence) -> Iterator[Static]:
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
                yield Static(RateLimits(how, tuple((w, spans[w] / s) for w in some)))
    if len(spans) == 2 and min(spans.values()) > 0:
        for s in FULL_RANGE_S:
            yield Static(RateLimits("rate", tuple((w, span / s) for w, span in spans.items())))


def _rate(v: Simple) -> list[Column]:
    if not isinstance(v.constants, RateLimits):
        raise TypeError(f"{v!r} is no rate limit")
    return [
        Column(Rerun(f"{v.constants.how}_{which}", rate), 0.3, f"share_{which}", mean=1.0)
        for which, rate in v.constants.rates
    ]


def _clocks(e: Evidence) -> Iterator[Static]:
    """Early commands only a clock can make; late ones look like a delay."""
    for tau_s in (*(-d for d in DELAYS_S), *DELAYS_S):
        yield Static(Delays((("all", tau_s),)))


def _grade_offsets(e: Evidence) -> Iterator[Static]:
    yield Static()


def _grade_bias(v: Simple) -> list[Column]:
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
        _delays,
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
        _rates,
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
        _clocks,
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
        _grade_offsets,
        _grade_bias,
        kind="measurement_fault",
        prior=0.7,
    ),
)
