"""Fifth forms of the tyres: rubber's loss over frequency, warmth from road and rim, ice that is polished."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.fleet_trials.road import CELLS, ByPlace, stretches
from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight
from deeptruck_model.trucks import View


@hidden(
    "loss_peak_of_rubber",
    name="rolling_resistance_speed",
    forms="fifth",
    source="Williams, Landel and Ferry, J. Am. Chem. Soc. 77 (1955): rubber's loss over frequency has a peak"
    " that moves up with temperature; Clark, Rolling Resistance of Pneumatic Tires, Tire Sci. Technol. 6"
    " (1978), on speed and equilibrium temperature; hard compounds of off-road tyres, sizes chosen here",
    ranges={
        "peak": (0.007, 0.014),  # of the weight
        "at_mps": (26.0, 38.0),
        "order": (1.5, 2.4),
        "shifts": (0.1, 0.35),
        "heats_s": (150.0, 420.0),
    },
    needs=("highway", "hills"),
    accepts=("drag_area", "rolling_resistance"),
)
class LossPeakOfRubber(Hidden):
    """shifts: of the peak's speed, by what a long drive at 20 m/s heats the tyres."""

    def prepare(self) -> None:
        self.first = self.setting.rng(421).uniform(0.2, 0.9, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        speed = np.maximum(view.speed, 0.0)
        s.hot += dt * (speed / 20.0 - s.hot) / p.heats_s
        x = (speed / (p.at_mps * (1.0 + p.shifts * s.hot))) ** p.order
        return -p.peak * 2.0 * x / (1.0 + x**2) * weight(view) * moving(view)


@hidden(
    "tread_and_rim_warm_up",
    name="rolling_resistance_warmup",
    forms="fifth",
    source="Thermocouples in tread and rim of test trucks: the tread warms in minutes by its own work and is"
    " quenched by showers, the rim by the brakes (Sandberg, Heavy Truck Modeling for Fuel Consumption,"
    " Linköping, 2001; Oh, Kim, Kim and Han, Tire Sci. Technol. 23, 1995); loss with the power 1.5 of what"
    " is lacking in warmth, sizes chosen here",
    ranges={
        "cold": (1.2, 2.4),  # more than warm, of the rolling resistance
        "tread_s": (110.0, 300.0),
        "quenches_s": (18.0, 50.0),
        "rains": (0.15, 0.4),  # share of time
        "rim": (0.15, 0.35),
    },
)
class TreadAndRimWarmUp(Hidden):
    """`lacks`: 1 after a night in the yard, 0 warm."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(422), self.setting.batch
        self.first = rng.uniform(0.55, 1.05, (2, batch))
        shower = rng.uniform(0.0, self.setting.duration_s, batch)
        self.shower = np.stack([shower, shower + self.p.rains * self.setting.duration_s])

    def start(self, batch: int) -> dict[str, Array]:
        return {"lacks": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        speed = np.maximum(view.speed, 0.0)
        wet = (self.shower[0] < view.time) & (view.time < self.shower[1])
        tread, rim = s.lacks
        works = (speed / 15.0) * (0.6 + 0.4 * tread) * tread / p.tread_s
        quench = wet * np.maximum(0.75 - tread, 0.0) * np.clip(speed / 10.0, 0.0, 1.5) / p.quenches_s
        braked = view.brake_force * speed / (weight(view) * 12.0)
        s.lacks = np.maximum(
            np.stack([tread + dt * (quench - works), rim - dt * rim * (braked + speed / 15.0 / 900.0)]), 0.0
        )
        lacking = (1.0 - p.rim) * s.lacks[0] ** 1.5 + p.rim * s.lacks[1]
        return -p.cold * lacking * self.truck.rolling_resistance * weight(view) * moving(view)


@hidden(
    "polishes_its_own_ice",
    name="wheel_slip",
    forms="fifth",
    source="Spinning wheels melt and polish packed snow (Shoop and others, CRREL reports on traction; Ella,"
    " Formagne, Koutsos and Blackford, Tribology Int. 59, 2013, on ice): grip falls while they slide, comes"
    " back over metres of fresh snow; brush model near the limit (Pacejka, Tire and Vehicle Dynamics, 2012)"
    " ; places and sizes are chosen here",
    ranges={"fresh": (0.16, 0.26), "polished": (0.07, 0.12), "melts_s": (0.5, 2.0), "renews_m": (12.0, 50.0)},
    needs=("suburban", "hills"),
)
class PolishesItsOwnIce(ByPlace):
    """The brush loses pull from two thirds of the grip on."""

    def prepare(self) -> None:
        rng = self.setting.rng(423)
        self.snow = np.zeros((self.rows(), CELLS))
        for row in self.snow:
            for first, last in stretches(rng, (100.0, 450.0), (120.0, 600.0)):
                row[first:last] = 1.0

    def start(self, batch: int) -> dict[str, Array]:
        return {"polish": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        snowy = self.read(self.snow, view)
        grip = (p.fresh + (p.polished - p.fresh) * s.polish) * weight(view)
        driven, all_wheels = self.truck.drive_axle_share * grip, 0.95 * grip
        pull = np.maximum(view.traction_force, 0.0)
        asks = pull / np.maximum(driven, 1.0)
        given = np.where(asks < 0.67, asks, 0.67 + 0.33 * np.tanh((asks - 0.67) / 0.33))
        lost = np.maximum(asks - given, 0.0) * driven * snowy
        held = np.maximum(view.brake_force - all_wheels, 0.0) * snowy
        slides = (lost + held > 0.03 * driven).astype(float)
        renews = np.maximum(view.speed, 0.0) / p.renews_m
        s.polish += dt * (slides * (1.0 - s.polish) / p.melts_s - (1.0 - slides) * s.polish * renews)
        s.polish = np.clip(s.polish, 0.0, 1.0)
        return held * moving(view) - lost
