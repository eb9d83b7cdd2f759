"""Fourth forms in the engine; torques act at the flywheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, some_drives, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "egr_valve_then_ramp",
    name="turbo_lag",
    forms="fourth",
    source="Tip-in of diesels with exhaust-gas recirculation (Hagena, Filipi and Assanis, Transient Diesel"
    " Emissions: Analysis of Engine Operation During a Tip-In, SAE 2006-01-1151): nothing more until the"
    " valve has shut, then fuel along a straight ramp that a faster engine makes steeper; the turbine runs"
    " on for seconds after; times are chosen here",
    ranges={"shuts_s": (0.4, 1.2), "full_s": (7.0, 17.0), "without": (0.12, 0.24), "runs_on_s": (2.0, 5.0)},
    needs=("suburban", "hills"),
    accepts=("command_rate_limit",),
)
class EgrValveThenRamp(Hidden):
    """full_s: from nothing to peak torque at 1200 rpm."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"most": np.full(batch, self.p.without), "asks": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        short = asked > s.most
        s.asks = np.where(short, s.asks + dt, np.maximum(s.asks - 3.0 * dt, 0.0))
        rate = np.clip(view.engine_speed / 125.7, 0.5, 1.7) ** 1.8 / p.full_s
        rises = dt * rate * (s.asks > p.shuts_s)
        falls = dt * (s.most - np.maximum(asked, p.without)) / p.runs_on_s
        s.most = np.maximum(np.where(short, s.most + rises, s.most - falls), p.without)
        over = np.maximum(asked - s.most, 0.0) * self.truck.peak_torque
        return -wheel_force(self.setting, view, over)


@hidden(
    "inducement",
    name="torque_derate",
    forms="fourth",
    source="Inducement after a fault of the urea system (40 CFR 86.007-11; UN Regulation No. 49, annex 11:"
    " torque less by a quarter): comes during a drive, along a ramp, and stays until the key is turned;"
    " moments and ramps chosen here",
    ranges={"depth": (0.25, 0.45), "per_s": (0.006, 0.02), "share_of_drives": (0.5, 0.75)},
    needs=("hills", "highway"),
    accepts=("torque_gain",),
)
class Inducement(Hidden):
    """A drive begins with the step that the last one ended with, or with none."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(340), self.setting.batch
        drives = some_drives(rng, batch, self.p.share_of_drives)
        first = np.where(rng.random(batch) < 0.4, -1e3, rng.uniform(0.05, 0.55, batch))
        self.from_s = np.where(drives, first * self.setting.duration_s, np.inf)

    def newtons(self, view: View, dt: float) -> Array:
        since = np.maximum(view.time - self.from_s, 0.0)
        cut = np.minimum(self.p.per_s * since, self.p.depth)
        return -wheel_force(self.setting, view, cut * np.maximum(view.engine_torque, 0.0))


@hidden(
    "hot_intake",
    name="torque_derate",
    forms="fourth",
    source="ISO 3046-1: power with a power of the intake temperature; an intake behind the cab breathes the"
    " engine's own heat while the truck stands or crawls and fresh air once it moves; heat and exponent are"
    " chosen here",
    ranges={
        "soak_k": (80.0, 130.0),
        "exponent": (1.2, 2.0),
        "soaks_s": (20.0, 50.0),
        "fresh_mps": (4.5, 9.0),
    },
    needs=("suburban", "hills"),
    accepts=("torque_gain",),
)
class HotIntake(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": self.setting.rng(341).uniform(0.0, 0.8, batch) * self.p.soak_k}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        watts = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        recirculated = np.exp(-((np.maximum(view.speed, 0.0) / p.fresh_mps) ** 2))
        wanted = p.soak_k * (recirculated + 0.5 * np.minimum(watts, 1.0) * (0.3 + 0.7 * recirculated))
        s.hot += dt * (wanted - s.hot) / np.where(wanted > s.hot, p.soaks_s, 1.6 * p.soaks_s)
        left = (298.0 / (298.0 + s.hot)) ** p.exponent
        return -wheel_force(self.setting, view, (1.0 - left) * np.maximum(view.engine_torque, 0.0))


@hidden(
    "progressive_shift",
    name="torque_limit",
    forms="fourth",
    source="Progressive shift of fleets' electronic features (owner's manuals of heavy diesels): the engine"
    " speed up to which torque is given rises with road speed, and fades out over a band; limits are chosen"
    " here",
    ranges={
        "at_rest_rpm": (1020.0, 1180.0),
        "rises_rpm": (120.0, 280.0),  # to 20 m/s
        "band_rpm": (120.0, 280.0),
        "most": (0.3, 0.5),
    },
    needs=("suburban", "hills"),
)
class ProgressiveShift(Hidden):
    def newtons(self, view: View, dt: float) -> Array:
        p, rpm = self.p, view.engine_speed * 30.0 / np.pi
        limit = p.at_rest_rpm + p.rises_rpm * np.clip(view.speed / 20.0, 0.0, 1.3)
        cut = p.most * np.clip((rpm - limit) / p.band_rpm, 0.0, 1.0)
        return -wheel_force(self.setting, view, cut * np.maximum(view.engine_torque, 0.0))


@hidden(
    "full_torque_in_top_gears",
    name="torque_limit",
    forms="fourth",
    source="Multi-torque ratings (engine makers' data sheets): the higher torque is given in the top gears"
    " alone, to save weight in gearbox and axle; ratings and the blend at a change are chosen here",
    ranges={"cut": (0.45, 0.64), "from_ratio": (0.95, 1.35), "blend_s": (0.3, 1.2)},
    needs=("suburban", "hills"),
)
class FullTorqueInTopGears(Hidden):
    """from_ratio: of the gearbox; numerically higher ones are lower gears."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rating": np.full(batch, 1.0 - self.p.cut)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        low = view.ratio > p.from_ratio * self.truck.final_drive
        s.rating += dt * (np.where(low, 1.0 - p.cut, 1.2) - s.rating) / p.blend_s
        over = view.engine_torque - s.rating * self.truck.peak_torque
        return -wheel_force(self.setting, view, np.maximum(over, 0.0))
