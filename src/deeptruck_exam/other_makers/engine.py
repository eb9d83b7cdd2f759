"""Third forms of engine and auxiliaries; torques act at the flywheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight, wheel_force
from deeptruck_model.trucks import View


def power_share(hidden_force: Hidden, view: View) -> Array:
    """Delivered over peak power, 0 to about 1."""
    watts = np.maximum(view.engine_torque, 0.0) * view.engine_speed
    return np.asarray(watts / hidden_force.truck.peak_power)


@hidden(
    "two_lags_by_cycles",
    name="turbo_lag",
    forms="third",
    source="Guzzella and Onder, Introduction to Modeling and Control of Internal Combustion Engine Systems"
    " (2010): rotor and intake receiver as two lags in a row that count engine cycles, and a smoke limit;"
    " the collapse in gear changes is chosen here",
    ranges={"rotor_s": (1.0, 2.4), "without": (0.15, 0.32), "falls": (1.5, 4.0)},  # rotor_s at 1200 rpm
    needs=("suburban", "hills"),
    accepts=("command_rate_limit",),
)
class TwoLagsByCycles(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"rotor": np.full(batch, 0.15), "receiver": np.full(batch, 0.15)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, full = self.p, self.s, self.truck.peak_torque
        asked = np.clip(view.engine_torque / full, 0.05, 1.05) * (1.0 - view.shifting)
        rate = np.clip(view.engine_speed / 125.7, 0.4, 2.0) / p.rotor_s
        s.rotor += dt * rate * np.where(asked < s.rotor, p.falls, 1.0) * (asked - s.rotor)
        s.receiver += dt * 3.0 * rate * (s.rotor - s.receiver)
        most = full * (p.without + (1.0 - p.without) * s.receiver)
        return wheel_force(self.setting, view, np.minimum(most - view.engine_torque, 0.0))


@hidden(
    "clogged_filter",
    name="torque_derate",
    forms="third",
    source="Back pressure of a loaded particulate filter, Konstandopoulos and others, Fundamental Studies of"
    " Diesel Particulate Filters, SAE 2000-01-1016: resistance of the soot times the flow; loss of torque"
    " with back pressure, loading and burning off are chosen here",
    ranges={"depth": (0.35, 0.60), "flow_power": (0.6, 1.2), "loads_s": (150.0, 400.0), "burns": (0.5, 2.0)},
    needs=("hills", "highway"),
    accepts=("torque_gain",),
)
class CloggedFilter(Hidden):
    """Every drive begins with the soot of the last; it burns while much is asked."""

    def prepare(self) -> None:
        self.first = self.setting.rng(210).uniform(0.35, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"soot": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        flow = np.clip(power_share(self, view), 0.0, 1.2)
        burning = p.burns * np.clip((flow - 0.7) / 0.2, 0.0, 1.0) * s.soot
        s.soot = np.clip(s.soot + dt * (0.3 + flow - 2.0 * burning) / p.loads_s, 0.1, 1.0)
        cut = p.depth * s.soot * flow**p.flow_power
        return -wheel_force(self.setting, view, cut * np.maximum(view.engine_torque, 0.0))


@hidden(
    "axle_torque_limit",
    name="torque_limit",
    forms="third",
    source="Gear-dependent torque that spares gearbox and axle (Naunheimer, Bertsche, Ryborz and Novak,"
    " Automotive Transmissions, 2011, on interaction of engine and transmission): torque at the axle, not"
    " at the engine, is held; limit and lag are chosen here",
    ranges={"most": (0.035, 0.065), "lag_s": (0.15, 0.6)},
    needs=("suburban", "hills"),
    accepts=("wheel_slip",),  # as would a steady friction under the driven wheels
)
class AxleTorqueLimit(Hidden):
    """most: pull over weight."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"cut": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        pull = np.maximum(view.traction_force, 0.0)
        over = np.maximum(pull - self.p.most * weight(view), 0.0)
        self.s.cut += dt * (over - self.s.cut) / self.p.lag_s
        return -np.minimum(self.s.cut, pull)


@hidden(
    "thin_oil",
    name="engine_friction",
    forms="third",
    source="Stribeck (1902) and Stachowiak and Batchelor, Engineering Tribology (2013): mixed friction grows"
    " as oil thins with heat and falls with sliding speed; worn bearings of a heavy diesel, sizes chosen"
    " here",
    ranges={
        "rubbing_nm": (220.0, 450.0),  # at idle with hot oil
        "cold": (0.2, 0.5),
        "fades_rads": (60.0, 120.0),
        "heats_s": (50.0, 140.0),
    },
    accepts=("engine_brake", "accessory_load"),
)
class ThinOil(Hidden):
    """Worst at low engine speed after a hard pull."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": self.setting.rng(211).uniform(0.0, 0.5, batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.heat += dt * (np.minimum(1.6 * power_share(self, view), 1.0) - s.heat) / p.heats_s
        share = p.cold + (1.0 - p.cold) * s.heat
        mixed = np.exp(-np.maximum(view.engine_speed - 62.8, 0.0) / p.fades_rads)
        return -wheel_force(self.setting, view, p.rubbing_nm * share * mixed) * moving(view)


@hidden(
    "mixer_drum",
    name="accessory_load",
    forms="third",
    source="Hydrostatic drive of a constant power, torque in inverse proportion to engine speed (Automotive"
    " Handbook, Bosch, on hydrostatic transmissions); a mixer drum whose concrete stiffens, with minutes of"
    " fast turning; powers and times chosen here",
    ranges={
        "power_w": (14000.0, 30000.0),
        "stiffens": (0.1, 0.5),
        "fast": (1.3, 1.8),
        "each_s": (50.0, 90.0),
    },
    needs=("hills", "highway", "suburban"),
    accepts=("engine_friction",),
)
class MixerDrum(Hidden):
    """A light truck has a small drum."""

    def prepare(self) -> None:
        self.first = self.setting.rng(212).uniform(0.0, 1.0, self.setting.batch)
        self.power = self.p.power_w * np.clip(self.truck.mass / 2.0e4, 0.5, 1.6)

    def newtons(self, view: View, dt: float) -> Array:
        p = self.p
        fast = (view.time / p.each_s + self.first) % 1.0 < 0.35
        stiff = 1.0 + p.stiffens * view.time / self.setting.duration_s
        watts = self.power * stiff * np.where(fast, p.fast, 1.0)
        torque = np.minimum(watts / np.maximum(view.engine_speed, 60.0), 0.10 * self.truck.peak_torque)
        return -wheel_force(self.setting, view, torque) * moving(view)
