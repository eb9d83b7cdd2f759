"""Sixth forms in the engine; torques act at the flywheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import GRAVITY, Array, Hidden, hidden, moving, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "sticking_vanes",
    name="turbo_lag",
    forms="sixth",
    source="Variable turbine vanes (Guzzella and Onder, Introduction to Modeling and Control of Internal"
    " Combustion Engine Systems, 2010, on turbochargers) that soot has made stick: they wait until the"
    " actuator is far enough away, then run; boost follows the vanes, fuel follows boost; sizes chosen here",
    ranges={
        "sticks": (0.10, 0.24),  # of the vanes' way
        "runs_s": (0.8, 2.2),
        "spools_s": (0.9, 2.2),  # at 125 rad/s
        "without": (0.15, 0.30),
    },
    needs=("suburban", "hills"),
    accepts=("command_rate_limit",),
)
class StickingVanes(Hidden):
    """A small step may never be answered, a large one is answered at once but slowly."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"vane": np.full(batch, 0.2), "runs": np.zeros(batch), "boost": np.full(batch, 0.2)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wanted = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1)
        away = wanted - s.vane
        s.runs = np.where(np.abs(away) > p.sticks, 1.0, np.where(np.abs(away) < 0.02, 0.0, s.runs))
        s.vane = s.vane + s.runs * np.clip(away, -dt / p.runs_s, dt / p.runs_s)
        spools = np.where(s.vane > s.boost, p.spools_s / np.clip(view.engine_speed / 125.0, 0.5, 1.7), 0.8)
        s.boost += dt * (s.vane - s.boost) / spools
        missing = np.maximum(asked - p.without - (1.0 - p.without) * s.boost, 0.0)
        return -wheel_force(self.setting, view, missing * self.truck.peak_torque) * moving(view)


@hidden(
    "bank_trips",
    name="torque_derate",
    forms="sixth",
    source="Control units cut a bank of injectors whose driver or harness runs hot, and try again after the"
    " pedal has been closed (Diesel-Engine Management, Bosch, on monitoring and substitute functions); the"
    " trip as of a thermal cut-out, by the square of the load over time; sizes are chosen here",
    ranges={
        "share": (0.22, 0.40),
        "early": (0.66, 0.82),  # 1 less the mean of power over the most that it bears
        "warms_s": (10.0, 28.0),
        "rests_s": (0.6, 2.5),
    },
    needs=("hills", "highway"),
    accepts=("torque_gain",),
)
class BankTrips(Hidden):
    """Whoever lifts his foot has all cylinders again."""

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"heat": zero + 0.02, "out": zero.copy(), "rests": zero.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        torque = np.maximum(view.engine_torque, 0.0)
        power = np.clip(torque * view.engine_speed / self.truck.peak_power, 0.0, 1.2)
        s.heat += dt * (power**2 - s.heat) / p.warms_s
        trips = (1.0 - p.early) ** 2
        closed = (view.u[:, 0] < 0.02 * self.truck.full_command) & (view.shifting < 0.5)
        s.rests = np.where(closed, s.rests + dt, 0.0)
        again = s.rests > p.rests_s
        s.out = np.where(again, 0.0, np.where(s.heat > trips, 1.0, s.out))
        s.heat = np.where(again, np.minimum(s.heat, 0.5 * trips), s.heat)
        return -wheel_force(self.setting, view, p.share * s.out * torque)


@hidden(
    "worn_feed_pump",
    name="torque_limit",
    forms="sixth",
    source="A geared feed pump delivers its displacement less a leak that does not depend on speed (Manring,"
    " Hydraulic Control Systems, 2005, on pump leakage; Diesel-Engine Management, Bosch, on low-pressure"
    " supply): fuel for full torque is there only at high speed, and for a moment from the rail and filter;"
    " sizes are chosen here",
    ranges={
        "lacks": (0.22, 0.48),  # of peak torque, at endless speed
        "leaks": (45.0, 66.0),  # rad/s at which nothing is delivered
        "stores_s": (0.4, 1.6),  # of full torque
    },
    needs=("hills", "suburban", "highway"),
)
class WornFeedPump(Hidden):
    """`store`: what rail and filter hold, of `stores_s`."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"store": np.ones(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        asked = view.engine_torque / self.truck.peak_torque
        flows = (1.0 - p.lacks) * (1.0 - p.leaks / np.maximum(view.engine_speed, p.leaks + 10.0))
        s.store = np.clip(s.store + dt * (flows - np.maximum(asked, 0.0)) / p.stores_s, 0.0, 1.0)
        missing = np.maximum(asked - flows, 0.0) * (1.0 - np.clip(s.store / 0.2, 0.0, 1.0))
        return -wheel_force(self.setting, view, missing * self.truck.peak_torque)


@hidden(
    "overfilled_sump",
    name="engine_friction",
    forms="sixth",
    source="Cranks that dip into an overfilled sump (workshop manuals on oil level; windage in Heywood,"
    " Internal Combustion Engine Fundamentals, ch. 13): torque with speed squared and with the depth, which"
    " slope and acceleration tilt towards the flywheel, while foam takes oil away; sizes are chosen here",
    ranges={
        "torque_nm": (130.0, 260.0),  # a full dip at 150 rad/s
        "level": (0.45, 0.85),
        "tilts": (4.0, 12.0),
        "foams_s": (25.0, 80.0),
    },
    accepts=("engine_brake", "accessory_load"),
)
class OverfilledSump(Hidden):
    """More drag uphill than downhill, and less after minutes at high speed."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"foam": np.zeros(batch), "tilt": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.tilt += dt * (view.grade + np.clip(view.acceleration, -3.0, 3.0) / GRAVITY - s.tilt) / 0.4
        dips = np.clip(p.level + p.tilts * s.tilt - 0.5 * s.foam, 0.0, 1.6)
        turns = np.clip(view.engine_speed / 150.0, 0.3, 1.6)
        s.foam += dt * (np.clip(dips * turns**3, 0.0, 1.0) - s.foam) / p.foams_s
        return -wheel_force(self.setting, view, p.torque_nm * dips * turns**2) * moving(view)


@hidden(
    "pumps_after_braking",
    name="accessory_load",
    forms="sixth",
    source="Compressors run from cut-in to cut-out, as long as brakes, air springs and leaks have used (FMVSS"
    " 121 S5.1 on build-up; Automotive Handbook, Bosch, on air supply): after every hard use, and longer at"
    " low engine speed; large compressors of a train with a burst bellows, sizes are chosen here",
    ranges={
        "torque_nm": (90.0, 190.0),
        "uses": (1.2, 3.5),  # of the difference between cut-in and cut-out, by one full application
        "leaks_s": (40.0, 110.0),
        "fills_s": (12.0, 32.0),  # at 130 rad/s
    },
    needs=("hills", "highway", "suburban"),
    accepts=("engine_friction",),
)
class PumpsAfterBraking(Hidden):
    """air: 0 at cut-in, 1 at cut-out."""

    def prepare(self) -> None:
        self.first = self.setting.rng(514).uniform(0.0, 1.0, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"air": self.first.copy(), "on": (self.first < 0.5).astype(float), "was": zero}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        asked = view.brake_force / self.truck.brake_capacity
        used = p.uses * np.maximum(asked - s.was, 0.0) + dt / p.leaks_s
        s.was = asked
        s.on = np.where(s.air <= 0.0, 1.0, np.where(s.air >= 1.0, 0.0, s.on))
        pumped = dt * s.on * np.clip(view.engine_speed / 130.0, 0.4, 1.6) / p.fills_s
        s.air = np.clip(s.air + pumped - used, -1.0, 1.0)
        torque = p.torque_nm * (0.8 + 0.2 * s.air) * s.on
        return -wheel_force(self.setting, view, torque) * moving(view)
