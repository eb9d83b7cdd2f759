"""Fifth forms between flywheel and wheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "sliding_of_the_teeth",
    name="driveline_loss",
    forms="fifth",
    source="Benedict and Kelley, Instantaneous Coefficients of Gear Tooth Friction, ASLE Trans. 4 (1961):"
    " friction of the mesh falls with the logarithm of sliding speed and viscosity, so that slow and hot"
    " gears lose the larger share; drag of seals beside it; a worn hypoid axle, sizes chosen here",
    ranges={
        "mesh": (0.05, 0.09),
        "per_decade": (0.25, 0.5),
        "seals_n": (120.0, 420.0),
        "warms_s": (150.0, 420.0),
    },
    accepts=("torque_gain",),
)
class SlidingOfTheTeeth(Hidden):
    """mesh: at 10 m/s with cold oil; it grows as the oil thins."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.setting.rng(461).uniform(0.0, 0.8, batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        speed = np.maximum(view.speed, 0.0)
        load = np.abs(view.traction_force)
        s.warm += dt * (np.clip(load * speed / 1.5e5, 0.0, 1.5) - s.warm) / p.warms_s
        decades = np.log10(10.0 / np.maximum(speed, 0.8)) + 0.8 * s.warm
        share = p.mesh * np.clip(1.0 + p.per_decade * decades, 0.4, 2.2)
        return -(share * load + p.seals_n * np.exp(-0.7 * s.warm)) * moving(view)


@hidden(
    "gearbox_brake_in_cold_oil",
    name="shift_interruption",
    forms="fifth",
    source="Unsynchronised automated gearboxes (Naunheimer, Bertsche, Ryborz and Novak, Automotive"
    " Transmissions, 2011, on central synchronisation): the countershaft has to change speed by the step,"
    " quickly upwards in thick oil and slowly downwards; torque returns as half a cosine; a worn gearbox"
    " brake, times are chosen here",
    ranges={
        "per_step_s": (0.3, 0.7),
        "down": (1.3, 2.2),
        "returns_s": (0.5, 1.2),
        "worn": (0.5, 1.6),  # longer when the oil is warm
        "warms_s": (90.0, 240.0),
    },
    needs=("suburban", "hills"),
)
class GearboxBrakeInColdOil(Hidden):
    """per_step_s: beyond the known time of a change, for each gear that is passed."""

    def start(self, batch: int) -> dict[str, Array]:
        gone = np.full(batch, 1e3)
        return {"gear": np.zeros(batch), "since": gone, "dwell": np.zeros(batch), "warm": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        steps = view.gear - s.gear
        changed = (steps != 0.0) & (s.gear > 0.0) & (view.speed > 1.0)
        up = 1.0 + p.worn * s.warm
        pace = np.where(steps > 0.0, up, p.down)
        wait = np.minimum(p.per_step_s * np.sqrt(np.abs(steps)) * pace, 1.8)
        s.dwell = np.where(changed, wait, s.dwell)
        s.since = np.where(changed, 0.0, s.since + dt * (1.0 - view.shifting))
        s.gear = view.gear.copy()
        s.warm = s.warm + dt * (1.0 - s.warm) / p.warms_s
        back = np.clip((s.since - s.dwell) / p.returns_s, 0.0, 1.0)
        missing = 0.5 * (1.0 + np.cos(np.pi * back))
        return -missing * np.maximum(view.traction_force, 0.0) * moving(view)


@hidden(
    "glazed_lockup_clutch",
    name="torque_converter_slip",
    forms="fifth",
    gateable=False,
    source="Lock-up linings glaze and slip above a torque, which heat lowers: the slip heats the lining, and"
    " more of it slips (Holgerson, Influence of Operating Conditions on Friction and Temperature"
    " Characteristics of a Wet Clutch Engagement, TriboTest 7, 2000); capacities are chosen here",
    ranges={"holds": (0.33, 0.52), "left": (0.5, 0.75), "heats_j": (0.12e6, 0.5e6), "cools_s": (15.0, 45.0)},
    needs=("suburban", "hills", "highway"),
    trucks=("freightliner",),
    accepts=("driveline_loss", "torque_limit"),
)
class GlazedLockupClutch(Hidden):
    """holds: of peak torque, cold; left: of what slips, as drag of the oil in the gap."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        capacity = p.holds * self.truck.peak_torque * (1.0 - 0.45 * s.hot)
        over = np.maximum(view.engine_torque - capacity, 0.0)
        lost = (1.0 - p.left * np.exp(-over / (0.8 * capacity))) * over
        s.hot += dt * (lost * view.engine_speed * 0.3 / p.heats_j - s.hot / p.cools_s)
        s.hot = np.clip(s.hot, 0.0, 1.0)
        return -wheel_force(self.setting, view, lost) * (view.speed > 2.0) * moving(view)


@hidden(
    "drum_on_a_belt",
    name="rotating_inertia",
    forms="fifth",
    source="Rotors driven by V-belts follow up to the friction of the belt (Euler and Eytelwein; Shigley,"
    " Mechanical Engineering Design, on belt drives) and slip beyond it, with less friction than before; a"
    " threshing or chipping drum the driver couples for a part of the drive; sizes are chosen here",
    ranges={
        "kgm2": (6.0, 12.0),
        "holds_nm": (220.0, 520.0),
        "slipping": (0.55, 0.8),
        "stays_s": (40.0, 110.0),
    },
    needs=("suburban", "hills"),
    accepts=("mass", "payload_change"),
)
class DrumOnABelt(Hidden):
    """slipping: friction of a belt that slips over that of one that holds."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(462), self.setting.batch
        self.turns = np.cumsum(rng.uniform(0.5, 1.5, (batch, 24)) * self.p.stays_s, axis=1)
        self.first = rng.integers(0, 2, batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"drum": np.full(batch, 60.0), "slips": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        on = (self.first + (self.turns < view.time).sum(axis=1)) % 3 < 2
        away = view.engine_speed - s.drum
        most = p.holds_nm * np.where(s.slips > 0.0, p.slipping, 1.0) * on
        torque = np.clip(p.kgm2 * away / 0.1, -most, most)
        s.slips = (np.abs(away) > np.where(s.slips > 0.0, 0.4, most * 0.1 / p.kgm2)).astype(float)
        s.drum = np.maximum(s.drum + dt * (torque / p.kgm2 - s.drum / 40.0), 0.0)
        return -wheel_force(self.setting, view, torque) * (view.speed > 1.5)


@hidden(
    "lash_by_the_gear",
    name="driveline_backlash",
    forms="fifth",
    source="Play at the axle seen from the engine grows with the gear's ratio, and a free engine crosses it"
    " in the root of play, inertia and torque (Lagerberg, A Literature Survey on Control of Automotive"
    " Powertrains with Backlash, Chalmers R013/2001); the knock that ends it grows with what was gained on"
    " the way; a worn axle, sizes are chosen here",
    ranges={
        "play_rad": (0.12, 0.30),  # at the wheels
        "winds_s": (0.08, 0.25),
        "knock": (0.3, 0.8),
        "coast": (1.5, 3.0),
    },
    needs=("suburban", "hills"),
)
class LashByTheGear(Hidden):
    """coast: the way back is as many times slower, pushed by friction alone."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"side": np.ones(batch), "way": zero + 1.0, "pace": zero.copy(), "knock": zero.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, pull = self.p, self.s, view.traction_force
        side = np.where(np.abs(pull) > 120.0, np.sign(pull), s.side)
        turned = side != s.side
        s.side = side
        s.way, s.pace = np.where(turned, 0.0, s.way), np.where(turned, 0.0, s.pace)
        gap = p.play_rad * np.maximum(view.ratio, 2.0)  # rad, at the engine
        slower = np.where(side < 0.0, p.coast, 1.0)
        torque = np.clip(np.abs(view.engine_torque), 25.0, 250.0) / slower**2
        crossing = s.way < 1.0
        s.pace = np.where(crossing, s.pace + dt * torque / (self.truck.engine_inertia * gap), s.pace)
        way = np.where(crossing, np.minimum(s.way + dt * s.pace, 1.0), s.way + dt / p.winds_s)
        s.knock = np.where(
            crossing & (way >= 1.0), np.minimum(s.pace, 3.0) / 3.0, s.knock * (1.0 - dt / 0.12)
        )
        s.way = way
        held = np.clip(s.way - 1.0, 0.0, 1.0)
        return (p.knock * s.knock - (1.0 - held)) * pull * moving(view)
