"""Fourth forms between the recorded command and the actuator."""

from __future__ import annotations

from copy import copy
from types import SimpleNamespace
from typing import Any

import numpy as np

from deeptruck_exam.hidden import Array, Effect, Planted, Setting, register

H = 0.01  # s, a substep of the truck


class TwoGateways:
    """Torque and brake requests go through unlike gateways, each polled by a task of its own period; the
    phase of the poll drifts through the sender's."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        self.line = (max(1, round(p.engine_s / H)), max(1, round(p.brake_s / H)))
        self.period = (p.poll_s, 0.618 * p.poll_s)
        self.phase = setting.rng(320).uniform(0.0, p.poll_s, 2)
        self.start(0)

    def start(self, batch: int) -> None:
        self.past = [np.zeros((n, batch)) for n in self.line]
        self.held, self.steps = np.zeros((batch, 2)), -1
        self.next_s = self.phase.copy()

    def reset(self, batch: int) -> None:
        self.start(batch)

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.steps < 0:
            self.held = u.copy()
            for j in (0, 1):
                self.past[j][:] = u[:, j]
        self.steps += 1
        out = self.held.copy()
        for j in (0, 1):
            slot = self.steps % self.line[j]
            if time >= self.next_s[j]:
                out[:, j] = self.past[j][slot]
                self.next_s[j] = time + self.period[j]
            self.past[j][slot] = u[:, j]
        self.held = out
        return out

    def __deepcopy__(self, memo: Any) -> TwoGateways:
        twin = copy(self)
        twin.past = [row.copy() for row in self.past]
        twin.next_s = self.next_s.copy()
        return twin


class TorqueInSteps:
    """A fleet's economy setting: every so often torque may rise by one notch; it falls by larger ones."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        self.up = setting.truck.full_command * p.notch
        self.down, self.every_s = 3.0 * self.up, p.every_s
        self.given: Array | None = None
        self.next_s = 0.0

    def reset(self, batch: int) -> None:
        self.given, self.next_s = None, 0.0

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.given is None:
            self.given = u[:, 0].copy()
        if time >= self.next_s:
            self.given = self.given + np.clip(u[:, 0] - self.given, -self.down, self.up)
            self.next_s = time + self.every_s
        self.given = np.where(u[:, 0] <= 0.0, u[:, 0], self.given)
        return np.stack([self.given, u[:, 1]], axis=1)


class LinkagePlay:
    """The lever follows the pedal when its play is used up, and stays where it is in between."""

    def __init__(self, setting: Setting, p: SimpleNamespace) -> None:
        self.half = 0.5 * p.play * setting.truck.full_command
        self.rod: Array | None = None

    def reset(self, batch: int) -> None:
        self.rod = None

    def filter(self, u: Array, time: float, dt: float) -> Array:
        if self.rod is None:
            self.rod = u[:, 0].copy()
        self.rod = np.clip(self.rod, u[:, 0] - self.half, u[:, 0] + self.half)
        # a closed pedal reaches the stop, which pulls the lever home over half a second
        closed = u[:, 0] <= 0.002 * self.half
        self.rod = np.where(closed, self.rod * (1.0 - dt / 0.5), self.rod)
        return np.stack([np.maximum(self.rod, 0.0), u[:, 1]], axis=1)


def _planted(kind: type[TwoGateways] | type[TorqueInSteps] | type[LinkagePlay]) -> Any:
    def build(setting: Setting, p: SimpleNamespace) -> Planted:
        return Planted(filters=(kind(setting, p),))

    return build


register(
    Effect(
        "two_gateways",
        "command_delay",
        "missing_physics",
        "Chains of unsynchronised cyclic tasks (Feiertag, Richter, Nordlander and Jonsson, A Compositional"
        " Framework for End-to-End Path Delay Calculation, CRTS 2008): a queue and a poll for each of SAE"
        " J1939-71's TSC1 and XBR, of other length each; retrofit gateways, sizes chosen here",
        {"engine_s": (0.25, 0.6), "brake_s": (0.45, 1.0), "poll_s": (0.08, 0.3)},
        _planted(TwoGateways),
        needs=("suburban", "hills", "descent"),
        accepts=("clock_offset",),
        forms="fourth",
    )
)
register(
    Effect(
        "torque_in_steps",
        "command_rate_limit",
        "missing_physics",
        "Acceleration limits and economy pedals among fleets' electronic features (owner's manuals of heavy"
        " diesels): the control unit raises the allowed torque by a notch at a time; notch and interval are"
        " chosen here",
        {"notch": (0.05, 0.11), "every_s": (0.4, 0.9)},
        _planted(TorqueInSteps),
        needs=("suburban", "hills"),
        accepts=("turbo_lag",),
        forms="fourth",
    )
)
register(
    Effect(
        "worn_linkage",
        "unknown",
        "missing_physics",
        "Lost motion in the throttle linkage of mechanically governed diesels, in every workshop manual; the"
        " play operator of Krasnosel'skii and Pokrovskii, Systems with Hysteresis (1989); play chosen here",
        {"play": (0.14, 0.30)},
        _planted(LinkagePlay),
        needs=("suburban", "hills", "highway"),
        forms="fourth",
    )
)
