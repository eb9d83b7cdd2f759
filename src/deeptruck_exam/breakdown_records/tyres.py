"""Sixth forms of tyres and hubs: wheels out of balance, grease that makes way, ground that is dug up."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.fleet_trials.road import CELLS, ByPlace, stretches
from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight
from deeptruck_model.trucks import View


@hidden(
    "wheels_out_of_balance",
    name="rolling_resistance_speed",
    forms="sixth",
    source="Rotating unbalance below and at resonance (Den Hartog, Mechanical Vibrations; Gillespie,"
    " Fundamentals of Vehicle Dynamics, 1992, on tyre and wheel assemblies): wheels that lost tread or are"
    " packed with snow hop, and dampers and load take the power; mud flies off with speed; sizes chosen here",
    ranges={
        "peak": (0.014, 0.024),  # of the weight, in resonance
        "hop_mps": (21.0, 28.0),
        "damping": (0.28, 0.45),
        "flies_s": (250.0, 800.0),  # at 20 m/s
        "rings_s": (0.8, 3.0),
    },
    needs=("highway",),
    accepts=("drag_area", "rolling_resistance"),
)
class WheelsOutOfBalance(Hidden):
    """packed: what is left of the mass that turns out of balance."""

    def prepare(self) -> None:
        self.first = self.setting.rng(508).uniform(0.75, 1.1, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"packed": self.first.copy(), "hops": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        speed = np.maximum(view.speed, 0.0)
        s.packed -= dt * s.packed * (speed / 20.0) ** 2 / p.flies_s
        x = speed / p.hop_mps
        broad = (2.0 * p.damping) ** 2
        power = x**5 * broad / ((1.0 - x**2) ** 2 + broad * x**2)
        s.hops += dt * (power - s.hops) / p.rings_s
        return -p.peak * s.packed**2 * s.hops * weight(view) * moving(view)


@hidden(
    "grease_makes_way",
    name="rolling_resistance_warmup",
    forms="sixth",
    source="Lugt, Grease Lubrication in Rolling Bearings (2013), on churning and channelling: fresh or cold"
    " grease is churned until revolutions have pushed it aside, and slumps back while the wheels stand;"
    " a power of the way; hubs packed with too much of it, sizes are chosen here",
    ranges={
        "churns": (1.3, 2.6),  # of the rolling resistance, at 10 degrees
        "way_m": (300.0, 1100.0),
        "order": (0.6, 1.1),
        "slumps_s": (25.0, 90.0),
    },
)
class GreaseMakesWay(Hidden):
    """Colder air, more drag; a stop gives a part of it back."""

    def prepare(self) -> None:
        self.first = self.setting.rng(509).uniform(0.0, 0.5, self.setting.batch) * self.p.way_m

    def start(self, batch: int) -> dict[str, Array]:
        return {"way": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        speed = np.maximum(view.speed, 0.0)
        s.way += dt * np.where(speed < 0.3, -s.way / p.slumps_s, speed)
        stiff = np.exp(-0.018 * np.clip(self.truck.ambient_temperature - 10.0, -25.0, 25.0))
        left = p.churns * stiff * (1.0 + s.way / p.way_m) ** -p.order
        return -left * self.truck.rolling_resistance * weight(view) * moving(view)


@hidden(
    "digs_itself_in",
    name="wheel_slip",
    forms="sixth",
    source="Slip and sinkage (Bekker, Introduction to Terrain-Vehicle Systems, 1969; Wong, Theory of Ground"
    " Vehicles, on shear and slip-sinkage): driven wheels shear loose ground, dig in by what they slip, and"
    " have to climb out of it over some metres; sites on the way, strengths chosen here",
    ranges={
        "shears": (0.24, 0.40),  # of the driven axles' load
        "bogs": (0.015, 0.035),  # of the weight, dug in to the rims
        "digs_m": (5.0, 16.0),
        "climbs_m": (8.0, 30.0),
    },
    needs=("suburban", "hills"),
)
class DigsItselfIn(ByPlace):
    """A start with much torque costs for metres after."""

    def prepare(self) -> None:
        rng = self.setting.rng(510)
        self.loose = np.zeros((self.rows(), CELLS))
        for row in self.loose:
            for first, last in stretches(rng, (80.0, 350.0), (120.0, 600.0)):
                row[first:last] = rng.uniform(0.7, 1.0)

    def start(self, batch: int) -> dict[str, Array]:
        return {"sunk": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        loose = self.read(self.loose, view)
        most = p.shears * self.truck.drive_axle_share * weight(view)
        pull = np.maximum(view.traction_force, 0.0)
        lost = (pull - most * np.tanh(pull / most)) * loose
        slips = np.minimum((pull / most) ** 2, 2.0) * loose
        way = dt * (np.maximum(view.speed, 0.0) + 0.3 * slips)
        s.sunk = np.clip(s.sunk + way * (slips * (1.0 - s.sunk) / p.digs_m - s.sunk / p.climbs_m), 0.0, 1.0)
        return -lost - p.bogs * s.sunk * weight(view) * moving(view)
