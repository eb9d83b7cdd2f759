"""Sixth forms of what the truck carries: water that is sprayed and drawn, pallets loose on their rollers."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.breakdown_records.air import spells, within
from deeptruck_exam.hidden import GRAVITY, Array, Hidden, hidden, moving
from deeptruck_model.trucks import View


@hidden(
    "pump_and_roll",
    name="payload_change",
    forms="sixth",
    source="Airport fire trucks spray while they drive (pump and roll: NFPA 414, Standard for Aircraft Rescue"
    " and Fire-Fighting Vehicles): a pump geared to the engine empties the tank in minutes, hydrants fill it"
    " where the truck stands; the simulator reckons with one level; sizes are chosen here",
    ranges={
        "load": (0.32, 0.5),  # of the mass, the full tank
        "known": (0.3, 0.7),
        "empties_s": (70.0, 160.0),  # at 150 rad/s
        "fills_s": (12.0, 35.0),
    },
    needs=("suburban", "hills"),
    accepts=("mass",),
)
class PumpAndRoll(Hidden):
    """The monitor is opened and closed by the crew; a gear lower, and the tank is empty sooner."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(505), self.setting.batch
        self.sprays = spells(rng, batch, (15.0, 60.0), (15.0, 60.0))
        self.first = np.where(rng.random(batch) < 0.6, 1.0, rng.uniform(0.0, 0.6, batch))

    def start(self, batch: int) -> dict[str, Array]:
        return {"water": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        out = within(self.sprays, view.time) * (view.engine_speed / 150.0) / p.empties_s
        stands = view.speed < 0.1
        s.water = np.clip(s.water + dt * np.where(stands, 1.0 / p.fills_s, -out), 0.0, 1.0)
        more = p.load * (s.water - p.known) * view.mass
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -more * felt * moving(view)


@hidden(
    "loose_on_rollers",
    name="load_slosh",
    forms="sixth",
    source="Roller beds of air cargo trucks whose locks were left open: units roll with the friction of the"
    " rollers alone (EN 12195-1 has friction of all other floors) and strike the stops at both ends; contact"
    " as a spring and damper (Goldsmith, Impact, 1960); masses and room are chosen here",
    ranges={
        "share": (0.25, 0.5),
        "friction": (0.008, 0.022),
        "room_m": (0.15, 0.9),
        "bounces": (0.2, 0.6),  # damping of the stops over critical
    },
    needs=("suburban",),
)
class LooseOnRollers(Hidden):
    """`at` m and `pace` m/s of the load on its bed, forward positive."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"at": np.full(batch, -0.5 * self.p.room_m), "pace": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        over = s.at - np.clip(s.at, -0.5 * p.room_m, 0.5 * p.room_m)
        omega = 12.0  # rad/s, on rubber stops
        stops = -(omega**2) * over - 2.0 * p.bounces * omega * s.pace * (over != 0.0)
        rolls = -p.friction * GRAVITY * np.tanh(s.pace / 0.02)
        turning = stops + rolls - np.clip(view.acceleration, -5.0, 5.0) - GRAVITY * view.grade
        s.pace = np.clip(s.pace + dt * turning, -3.0, 3.0)
        s.at = s.at + dt * s.pace
        # what the load gains over the truck it does not push on the truck
        return -p.share * view.mass * np.clip(turning, -8.0, 8.0) * moving(view)
