"""Command path and measurement: delays, rate limits, clocks and offsets."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np

from deeptruck_core.constants import GRAVITY
from deeptruck_model.mismatch.mechanisms.record import Column, Constants, Form, Mechanism, grid
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import Rerun, lift

DELAYS_S = (0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.25)
APART_S = (0.15, 0.3, 0.5, 0.8, 1.25)  # of engine and brake, where each has a line of its own
FULL_RANGE_S = (0.4, 0.6, 0.9, 1.4, 2.0, 3.0, 4.5, 7.0)
WAYS = {"engine": ("rate", "climb", "drop", "soft", "shaped"), "brake": ("rate", "climb", "drop")}


def _delay(which: str, tau_s: float) -> Column:
    """Delay of all commands, or of one of them; negative: early."""
    name = "delay" if which == "all" else f"delay_{which}"
    return Column(Rerun(f"delay_{which}", tau_s), 0.3, name, "s", tau_s, mean=1.0)


def _slewed(how: str, which: str, rate: float) -> Column:
    """A command with the kind of rate limit `how` of `CommandPath`, its rate in command units per s."""
    return Column(Rerun(f"{how}_{which}", rate), 0.3, f"share_{which}", mean=1.0)


def _ranges(e: Evidence) -> dict[str, float]:
    """The full range of each known command."""
    known = (w for w in WAYS if e.has(f"{w}_command"))
    return {which: float(np.ptp(e[f"{which}_command"][e.valid])) for which in known}


def _rates_of_one(e: Evidence) -> Iterable[Constants]:
    """Rates for several times over the full range. Torque is often shaped: it approaches its target smoothly,
    and is reduced faster than it is increased."""
    for which, full in _ranges(e).items():
        if full > 0:
            yield from grid(how=WAYS[which], which=(which,), rate=[full / s for s in FULL_RANGE_S])


def _rates_of_both(e: Evidence) -> Iterable[Constants]:
    full = _ranges(e)
    if len(full) == 2 and min(full.values()) > 0:
        yield from ({which: span / s for which, span in full.items()} for s in FULL_RANGE_S)


COMMAND_DELAY = Mechanism(
    "command_delay",
    "timing",
    says="commands act later than the simulator thinks",
    equation="u(t) -> u(t - d), engine and brake perhaps each by its own",
    needs=("engine_command",),
    depends_on=("command rate",),
    source="J1939 message period plus actuator dead time",
    manoeuvre="step one command at a time, on one clock with the response",
    forms={
        # a late brake alone is the brake's dead time
        "delay": Form(
            _delay,
            lambda e: grid(which=("all", "engine") if e.has("brake_command") else ("all",), tau_s=DELAYS_S),
            words={"which": ("all", "engine")},
            fitted={"tau_s": (0.05, 1.5)},
        ),
        "each its own": Form(
            lambda engine_s, brake_s: [_delay("engine", engine_s), _delay("brake", brake_s)],
            tuple({"engine_s": a, "brake_s": b} for a, b in itertools.permutations(APART_S, 2)),
            needs=("brake_command",),
        ),
    },
    delay=True,
)

COMMAND_RATE_LIMIT = Mechanism(
    "command_rate_limit",
    "timing",
    says="commands are slewed on their way",
    equation="|du/dt| <= r",
    needs=("engine_command",),
    depends_on=("command rate",),
    source="SAE J1939-71 TSC1 override ramping",
    manoeuvre="step commands of different size: a limit makes large ones late, a lag does not",
    forms={
        "one": Form(_slewed, _rates_of_one, words={"how": WAYS["engine"], "which": tuple(WAYS)}),
        "both": Form(
            lambda engine, brake: [_slewed("rate", "engine", engine), _slewed("rate", "brake", brake)],
            _rates_of_both,
        ),
    },
)

CLOCK_OFFSET = Mechanism(
    "clock_offset",
    "timing",
    says="commands and responses are not on one clock",
    equation="commands and responses are stamped by clocks d apart",
    needs=("engine_command",),
    depends_on=("command rate",),
    source="comparison of channels, no truck physics",
    manoeuvre="record one event on both clocks",
    # early commands only a clock can make; late ones look like a delay
    forms={
        "offset": Form(lambda tau_s: _delay("all", tau_s), grid(tau_s=(*(-d for d in DELAYS_S), *DELAYS_S)))
    },
    kind="measurement_fault",
    prior=0.5,
    delay=True,
)

GRADE_BIAS = Mechanism(
    "grade_bias",
    "sensors",
    says="the recorded grade is offset",
    equation="grade = true + b",
    needs=("grade",),
    depends_on=("nothing",),
    source="inclinometer mounting angle",
    manoeuvre="stand on the same spot in both directions",
    forms={"offset": Form(lambda: Column(lift(-GRAVITY), 0.01, "bias", "ratio", sign=0))},
    kind="measurement_fault",
    prior=0.7,
)

MECHANISMS = (COMMAND_DELAY, COMMAND_RATE_LIMIT, CLOCK_OFFSET, GRADE_BIAS)
