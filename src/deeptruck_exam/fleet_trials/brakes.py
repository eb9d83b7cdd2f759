"""Fifth forms in the brakes: hot bands, tanks that run low, shoes frozen on, a staged compression brake."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "hot_bands",
    name="brake_fade",
    forms="fifth",
    source="Barber, Thermoelastic Instabilities in the Sliding of Conforming Solids, Proc. R. Soc. A 312"
    " (1969), and Anderson and Knapp, Hot Spotting in Automotive Friction Systems, Wear 135 (1990): above a"
    " critical speed the contact draws together in bands, which glaze; they stay until the disc has cooled"
    " and worn; rates and sizes are chosen here",
    ranges={
        "depth": (0.32, 0.58),
        "critical_mps": (6.0, 10.0),
        "warm_k": (28.0, 58.0),
        "grows_s": (5.0, 14.0),
        "heals_s": (60.0, 160.0),
    },
    needs=("descent",),
)
class HotBands(Hidden):
    """Braking long and gently at speed costs more than a hard stop."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"above": np.full(batch, 15.0), "bands": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, truck = self.p, self.s, self.truck
        speed = np.maximum(view.speed, 0.0)
        lost = p.depth * s.bands**2 * (3.0 - 2.0 * s.bands)
        power = (1.0 - lost) * view.brake_force * speed
        # the discs of a made-up truck are lighter than its drums
        film = truck.brake_cooling + truck.brake_cooling_speed * speed
        s.above += dt * (power - film * s.above) / (0.35 * truck.brake_heat_capacity)
        unstable = np.clip(speed / p.critical_mps - 1.0, 0.0, 1.0) * (view.brake_force > 0.01 * weight(view))
        hot = np.clip(s.above / p.warm_k - 0.6, 0.0, 2.0)
        rate = unstable * hot * (1.02 - s.bands) / p.grows_s
        heals = s.bands / p.heals_s / (0.5 + hot)
        s.bands = np.clip(s.bands + dt * (rate - heals), 0.0, 1.0)
        return lost * view.brake_force * moving(view)


@hidden(
    "tanks_run_low",
    name="brake_lag",
    forms="fifth",
    source="Repeated applications empty the reservoirs and slow the next one (FMVSS 121 S5.1.2 on reservoir"
    " volumes; UN Regulation No. 13, annex 7, on energy after eight strokes): flow with the root of the"
    " pressure left, from a compressor that is geared to the engine; leaking trains, sizes chosen here",
    ranges={
        "share": (0.55, 0.85),  # of the brakes on the far tank
        "fills_s": (0.35, 0.8),  # with full tanks
        "draws": (0.10, 0.28),  # of the tank, by one full application
        "pumps_s": (60.0, 160.0),
        "vents_s": (0.2, 0.7),
    },
    needs=("suburban", "descent"),
    accepts=("command_delay", "clock_offset"),
)
class TanksRunLow(Hidden):
    """tank: from 1 full to 0.3, where spring brakes would come on."""

    def prepare(self) -> None:
        self.first = self.setting.rng(431).uniform(0.6, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"tank": self.first.copy(), "inside": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, full = self.p, self.s, self.truck.brake_capacity
        asked = view.brake_force / full
        drop = np.maximum(s.tank - s.inside, 0.05)
        up = np.sqrt(drop) * s.tank / p.fills_s * np.maximum(asked - s.inside, 0.0)
        up = np.minimum(up, 0.5 * s.tank / p.fills_s)
        down = np.maximum(s.inside - asked, 0.0) / p.vents_s
        s.inside = np.clip(s.inside + dt * (up - down), 0.0, 1.2)
        pumped = np.clip(view.engine_speed / 150.0, 0.3, 1.5) * (1.0 - s.tank) / p.pumps_s
        s.tank = np.clip(s.tank + dt * (pumped - 2.5 * p.draws * up), 0.3, 1.0)
        return p.share * full * (asked - s.inside) * moving(view)


@hidden(
    "shoes_frozen_on",
    name="dragging_brake",
    forms="fifth",
    source="Shoes that freeze to wet drums overnight and in long stops (winter bulletins of trailer makers;"
    " latent heat of ice in any handbook of physics): the wheel turns, drags, and thaws itself by the work"
    " of its own drag; adhesion with the root of what is frozen, sizes chosen here",
    ranges={
        "force_n": (1800.0, 4200.0),
        "thaws_j": (0.8e6, 3.0e6),
        "again_s": (5.0, 18.0),
        "water_s": (60.0, 200.0),
    },
    needs=("suburban", "descent"),
)
class ShoesFrozenOn(Hidden):
    """Braking throws meltwater back on the linings, and standing freezes it."""

    def prepare(self) -> None:
        self.first = self.setting.rng(432).uniform(0.5, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"ice": self.first.copy(), "water": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        drag = p.force_n * weight(view) / 2.0e5 * np.sqrt(s.ice)
        work = (drag + 0.15 * view.brake_force) * np.maximum(view.speed, 0.0)
        thaw = np.minimum(work / p.thaws_j, s.ice / dt)
        slow = view.speed < 0.8
        freeze = slow * s.water * (1.0 - s.ice) / p.again_s
        s.water = np.clip(s.water + dt * (thaw - freeze - s.water / p.water_s), 0.0, 1.0)
        s.ice = np.clip(s.ice + dt * (freeze - thaw), 0.0, 1.0)
        return -drag * moving(view)


@hidden(
    "stages_by_acceleration",
    name="engine_brake",
    forms="fifth",
    source="Drivers' use of a six-stage lever, as fleets' event recorders show it: one stage more whenever"
    " the truck gains speed on a closed pedal, one less when it loses; compression brakes grow with the"
    " boost they make themselves (Cummins, SAE 650196 and later papers on retarders); sizes chosen here",
    ranges={
        "torque_nm": (500.0, 1100.0),  # with all stages, boosted, at 190 rad/s
        "moves_s": (0.8, 2.5),
        "unboosted": (0.4, 0.65),
        "boost_s": (0.8, 2.5),
    },
    needs=("descent", "hills"),
    accepts=("engine_friction",),
)
class StagesByAcceleration(Hidden):
    """The lever is not recorded. The first stage comes with the first gain in speed."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"stage": zero, "waits": zero.copy(), "boost": zero.copy(), "torque": zero.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        closed = (view.u[:, 0] <= 0.01 * self.truck.full_command) & (view.speed > 4.0)
        s.waits = np.where(closed, s.waits + dt, 0.0)
        step = np.where(view.acceleration > 0.04, 1.0, np.where(view.acceleration < -0.45, -1.0, 0.0))
        moves = closed & (s.waits > p.moves_s) & (step != 0.0)
        s.stage = np.where(closed, np.clip(s.stage + moves * step, 0.0, 6.0), 0.0)
        s.waits = np.where(moves, 0.0, s.waits)
        turns = np.clip(view.engine_speed / 190.0, 0.0, 1.3)
        share = s.stage / 6.0
        s.boost += dt * (share * turns - s.boost) / p.boost_s
        wanted = p.torque_nm * share * turns * (p.unboosted + (1.0 - p.unboosted) * s.boost)
        s.torque += dt * (wanted - s.torque) / np.where(wanted > s.torque, 0.18, 0.1)
        return -wheel_force(self.setting, view, s.torque) * moving(view)


@hidden(
    "retarder_sheds_heat",
    name="engine_brake",
    forms="fifth",
    source="Hydrodynamic retarders on the engine's side of the gearbox (Automotive Handbook, Bosch, on"
    " primary retarders): torque with speed squared up to the valve's limit, half a second of filling, and"
    " taken back by the coolant's temperature; set by the driver for a hill; sizes chosen here",
    ranges={
        "most_nm": (450.0, 1000.0),
        "square_at": (95.0, 150.0),  # rad/s at which the limit is reached
        "fill_s": (0.4, 1.2),
        "hot_j": (2.5e6, 7.0e6),
        "leaves": (0.35, 0.6),
    },
    needs=("descent", "hills"),
    accepts=("engine_friction",),
)
class RetarderShedsHeat(Hidden):
    """Braking by the pedal fills it, the accelerator empties it; a hot one keeps `leaves` of its torque."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"set": np.zeros(batch), "filled": np.zeros(batch), "heat": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        pressed = view.u[:, 1] > 0.03 * (1.0 if self.truck.by_deceleration else 100.0)
        opened = view.u[:, 0] > 0.02 * self.truck.full_command
        s.set = np.where(opened | (view.speed < 3.0), 0.0, np.where(pressed, 1.0, s.set))
        s.filled += dt * (s.set - s.filled) / np.where(s.set > s.filled, p.fill_s, 0.3)
        cut = 1.0 - (1.0 - p.leaves) * np.clip((s.heat - 0.5) / 0.4, 0.0, 1.0)
        torque = p.most_nm * cut * s.filled * np.minimum((view.engine_speed / p.square_at) ** 2, 1.0)
        s.heat += dt * (torque * view.engine_speed / p.hot_j - s.heat / 90.0)
        return -wheel_force(self.setting, view, torque) * moving(view)
