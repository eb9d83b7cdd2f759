"""Fourth forms in the brakes: linings on the dynamometer, push rods, slack adjusters."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving
from deeptruck_model.trucks import View

LINING_C = np.array([0.0, 100.0, 140.0, 190.0, 230.0, 280.0, 330.0, 400.0])
LINING = np.array([1.0, 1.04, 1.05, 0.95, 0.80, 0.63, 0.50, 0.42])


@hidden(
    "lining_on_the_dynamometer",
    name="brake_fade",
    forms="fourth",
    source="Friction over drum temperature of SAE J661 (first and second fade) and the recovery that comes"
    " late in FMVSS 121 S5.4 dynamometer tests: a table that first rises; two axle groups of unlike shares"
    " of the work; table and shares are chosen here",
    ranges={
        "severity": (0.9, 1.4),
        "overworked": (0.50, 0.68),  # share of the work on 0.4 of the drums' heat capacity
        "recovers_s": (40.0, 120.0),
    },
    needs=("descent",),
)
class LiningOnTheDynamometer(Hidden):
    """A drum that has been hot rubs as if hot for a while after it has cooled."""

    def prepare(self) -> None:
        self.share = np.array([[self.p.overworked], [1.0 - self.p.overworked]])
        self.capacity = 0.42 * self.truck.brake_heat_capacity * np.array([[0.4], [0.6]])

    def start(self, batch: int) -> dict[str, Array]:
        first = self.setting.rng(313).uniform(40.0, 130.0, batch)
        drums = np.tile(self.truck.ambient_temperature + first, (2, 1))
        return {"drums": drums, "memory": drums.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        s, truck = self.s, self.truck
        left = 1.0 - self.p.severity * (1.0 - np.interp(s.memory, LINING_C, LINING))
        lost = np.minimum((self.share * (1.0 - left)).sum(axis=0), 0.55)
        speed = np.maximum(view.speed, 0.0)
        power = self.share * left * view.brake_force * speed
        film = truck.brake_cooling + truck.brake_cooling_speed * speed
        cooling = film * np.array([[0.4], [0.6]]) * (s.drums - truck.ambient_temperature)
        s.drums += dt * (power - cooling) / self.capacity
        s.memory = np.maximum(s.drums, s.memory + dt * (s.drums - s.memory) / self.p.recovers_s)
        return lost * view.brake_force * moving(view)


@hidden(
    "green_linings",
    name="brake_fade",
    forms="fourth",
    source="Herring, Mechanism of Brake Fade in Organic Brake Linings, SAE 670146: gas of the decomposing"
    " resin lifts the lining; it comes by Arrhenius and is gone once the lining has been hot, why new"
    " linings are burnished (SAE J880); rates and sizes are chosen here",
    ranges={
        "depth": (0.50, 0.80),
        "onset_c": (90.0, 120.0),
        "e_fold_k": (14.0, 28.0),
        "resin_s": (90.0, 200.0),  # of gas at the onset
    },
    needs=("descent",),
)
class GreenLinings(Hidden):
    """The first heat fades, the second does not."""

    def prepare(self) -> None:
        self.fresh = self.setting.rng(310).uniform(0.5, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"drum": np.full(batch, self.truck.ambient_temperature + 30.0), "resin": self.fresh.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, truck = self.p, self.s, self.truck
        hot = np.exp(np.clip((s.drum - p.onset_c) / p.e_fold_k, -8.0, 2.5))
        gas = s.resin * hot / p.resin_s
        s.resin = np.maximum(s.resin - dt * gas, 0.0)
        lost = p.depth * (1.0 - np.exp(-60.0 * gas))
        speed = np.maximum(view.speed, 0.0)
        cooling = (truck.brake_cooling + truck.brake_cooling_speed * speed) * (
            s.drum - truck.ambient_temperature
        )
        power = (1.0 - lost) * view.brake_force * speed
        s.drum += dt * (power - cooling) / (0.6 * truck.brake_heat_capacity)
        return lost * view.brake_force * moving(view)


@hidden(
    "chamber_stroke",
    name="brake_lag",
    forms="fourth",
    source="ISO 6358 flow through a fixed conductance (choked, then an ellipse) into a brake chamber that"
    " must first be filled over the stroke of its push rod (SAE J1469 on chamber volumes; Limpert, Brake"
    " Design and Safety): gentle applications fill it slowly; conductances of long hoses, chosen here",
    ranges={"share": (0.6, 0.95), "stroke": (0.35, 0.8), "rise": (0.07, 0.15), "return_s": (0.5, 1.5)},
    needs=("suburban", "descent"),
    accepts=("command_delay", "clock_offset"),
)
class ChamberStroke(Hidden):
    """stroke, rise: 1/s for each bar of absolute supply pressure; pressures over full pressure of 8.5 bar."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rod": np.zeros(batch), "chamber": np.zeros(batch)}

    @staticmethod
    def flow(up: Array, down: Array) -> Array:
        beyond = np.clip((np.clip(down / up, 0.0, 1.0) - 0.3) / 0.7, 0.0, 1.0)
        return np.asarray(up * np.sqrt(1.0 - beyond**2))

    def newtons(self, view: View, dt: float) -> Array:
        p, s, full = self.p, self.s, self.truck.brake_capacity
        supply = view.brake_force / full
        asked, inside = 1.0 + 8.5 * supply, 1.0 + 8.5 * s.chamber
        filling = (supply > s.chamber + 1e-4) & (supply > 0.002)
        touches = s.rod >= 1.0
        s.rod = np.where(
            filling,
            np.minimum(s.rod + dt * p.stroke * self.flow(asked, np.ones_like(asked)), 1.0),
            np.where(supply < 0.002, np.maximum(s.rod - dt / p.return_s, 0.0), s.rod),
        )
        rise = dt * p.rise * self.flow(asked, inside) * touches
        fall = dt * 1.6 * p.rise * self.flow(inside, np.ones_like(inside))
        s.chamber = np.where(
            filling, np.minimum(s.chamber + rise, supply), np.maximum(s.chamber - fall, supply)
        )
        return p.share * full * (supply - s.chamber) * moving(view)


@hidden(
    "slack_adjusted_hot",
    name="dragging_brake",
    forms="fourth",
    source="Automatic slack adjusters that take up the clearance of a hot, expanded drum leave none when it"
    " cools (service manuals of slack adjusters and NTSB/HAR reports on misadjusted brakes): the drag comes"
    " minutes after the braking; growth of drums and forces are chosen here",
    ranges={
        "per_k_n": (18.0, 38.0),  # of a 20 t truck
        "clearance_k": (10.0, 35.0),
        "cools_s": (70.0, 160.0),
        "wears_m": (2500.0, 8000.0),
    },
    needs=("suburban", "descent"),
)
class SlackAdjustedHot(Hidden):
    """Temperatures in K above the air; clearances as the temperature that closes them."""

    def prepare(self) -> None:
        self.first = self.setting.rng(311).uniform(40.0, 190.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"drum": self.first.copy(), "taken": self.first - self.p.clearance_k}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        speed = np.maximum(view.speed, 0.0)
        tight = np.maximum(s.taken - s.drum, 0.0)
        drag = p.per_k_n * view.mass / 2.0e4 * np.minimum(tight, 130.0)
        applied = view.brake_force > 0.03 * self.truck.brake_capacity
        s.taken = np.where(applied, np.maximum(s.taken, s.drum - p.clearance_k), s.taken)
        s.taken = s.taken - dt * speed * tight / p.wears_m
        heats = (view.brake_force + drag) * speed / (0.6 * self.truck.brake_heat_capacity)
        s.drum += dt * (heats - s.drum * (0.5 + speed / 15.0) / p.cools_s)
        return -drag * moving(view)
