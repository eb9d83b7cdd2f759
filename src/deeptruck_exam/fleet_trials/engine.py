"""Fifth forms in the engine; torques act at the flywheel."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "manifold_goes_cold",
    name="turbo_lag",
    forms="fifth",
    source="Rakopoulos and Giakoumis, Diesel Engine Transient Operation (2009): the exhaust manifold takes"
    " the heat the turbine needs, the more the longer the engine has coasted; fuel is held to the air by a"
    " smoke limit; boost rises with the square of engine speed; times are chosen here",
    ranges={
        "spools_s": (1.2, 2.8),  # at 125 rad/s with a hot manifold
        "colder": (1.0, 3.0),  # times longer with a cold one
        "cools_s": (6.0, 18.0),
        "without": (0.18, 0.32),
    },
    needs=("suburban", "hills"),
    accepts=("command_rate_limit",),
)
class ManifoldGoesCold(Hidden):
    """The same tip-in is slower after a hill than after a gear change."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"boost": np.full(batch, 0.2), "hot": np.full(batch, 0.5)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        allowed = p.without + (1.0 - p.without) * s.boost**0.8
        burnt = np.minimum(asked, allowed)
        s.hot += dt * (np.sqrt(burnt) - s.hot) / np.where(burnt > s.hot, 0.5 * p.cools_s, p.cools_s)
        s.hot = np.clip(s.hot, 0.0, 1.0)
        turns = np.clip(view.engine_speed / 125.0, 0.5, 1.7)
        slow = p.spools_s / turns**2 * (1.0 + p.colder * (1.0 - s.hot))
        wanted = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1) ** 1.25
        s.boost = np.clip(s.boost + dt * (wanted - s.boost) / np.where(wanted > s.boost, slow, 1.2), 0.0, 1.2)
        return -wheel_force(
            self.setting, view, np.maximum(asked - allowed, 0.0) * self.truck.peak_torque
        ) * moving(view)


@hidden(
    "wax_in_the_filter",
    name="torque_derate",
    forms="fifth",
    source="Waxing of diesel below its cloud point (EN 116, cold filter plugging): the filter passes less"
    " the more has flowed, warm return fuel clears it again, and rail pressure falls with what is lacking"
    " (workshop notes on loss of power in frost); rates and sizes are chosen here",
    ranges={"depth": (0.35, 0.6), "clogs_s": (12.0, 35.0), "clears_s": (40.0, 110.0), "starves": (0.25, 0.5)},
    needs=("hills", "highway"),
    accepts=("torque_gain",),
)
class WaxInTheFilter(Hidden):
    """starves: power, of the engine's most, that fresh wax still lets through."""

    def prepare(self) -> None:
        self.first = self.setting.rng(451).uniform(0.0, 0.6, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"wax": self.first.copy()}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        torque = np.maximum(view.engine_torque, 0.0)
        flow = np.clip(torque * view.engine_speed / self.truck.peak_power, 0.0, 1.2)
        grows = np.maximum(flow - p.starves * s.wax, 0.0) * (1.0 - s.wax) / p.clogs_s
        s.wax = np.clip(s.wax + dt * (grows - s.wax * (1.2 - flow) / p.clears_s), 0.0, 1.0)
        lost = p.depth * s.wax * np.clip(flow / p.starves, 0.0, 1.5) / 1.5
        return -wheel_force(self.setting, view, lost * torque)


@hidden(
    "acceleration_management",
    name="torque_limit",
    forms="fifth",
    source="Vehicle acceleration management of heavy engines (owner's manuals on electronic features): the"
    " control unit winds torque back while the truck gains speed faster than a limit that falls with speed,"
    " and lets it out again slowly; an empty truck feels it, a full one does not; sizes chosen here",
    ranges={
        "at_rest": (0.30, 0.55),  # m/s2
        "per_mps": (0.010, 0.022),
        "winds": (0.6, 1.8),  # of peak torque, each second and m/s2
        "lets_out_s": (3.0, 9.0),
    },
    needs=("suburban", "hills"),
)
class AccelerationManagement(Hidden):
    """Downhill it takes torque that was needed for nothing, uphill none at all."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"cut": np.zeros(batch), "gains": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.gains += dt * (np.clip(view.acceleration, -3.0, 3.0) - s.gains) / 0.25
        limit = np.maximum(p.at_rest - p.per_mps * np.maximum(view.speed, 0.0), 0.08)
        over = s.gains - limit
        change = np.where(over > 0.0, p.winds * over, -s.cut / p.lets_out_s)
        share = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.cut = np.clip(s.cut + dt * change, 0.0, 0.6) * (share > 0.02)
        return -wheel_force(self.setting, view, np.minimum(s.cut, share) * self.truck.peak_torque)


@hidden(
    "liner_runs_warm",
    name="engine_friction",
    forms="fifth",
    source="Piston friction on floating liners falls with the liner's temperature within seconds of a load"
    " (Livanos and Kyrtatos, Friction Model of a Marine Diesel Engine Piston Assembly, Tribology Int. 40,"
    " 2007), around a block that needs minutes; viscosity to the power 1/2; worn rings, sizes chosen here",
    ranges={
        "cold_nm": (120.0, 230.0),
        "film": (0.25, 0.6),
        "film_s": (3.0, 9.0),
        "block_s": (180.0, 500.0),
        "with_speed": (0.3, 0.7),
    },
    accepts=("engine_brake", "accessory_load"),
)
class LinerRunsWarm(Hidden):
    """More friction in coasting than under load, and at the beginning of a drive."""

    def prepare(self) -> None:
        self.first = self.setting.rng(452).uniform(0.1, 0.8, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"block": self.first.copy(), "film": np.full(batch, 0.2)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        load = np.clip(view.engine_torque * view.engine_speed / self.truck.peak_power, 0.0, 1.1)
        s.film += dt * (np.sqrt(load) - s.film) / p.film_s
        s.block += dt * (1.0 - s.block) * (0.3 + load) / p.block_s
        thin = np.exp(-1.1 * s.block) * (1.0 - p.film * s.film)
        turns = np.clip(view.engine_speed / 140.0, 0.3, 1.7)
        return -wheel_force(self.setting, view, p.cold_nm * thin * turns**p.with_speed) * moving(view)


@hidden(
    "charges_in_overrun",
    name="accessory_load",
    forms="fifth",
    source="Large generators for electric refrigeration and buffers charge hard while the truck coasts, not"
    " at all under load, and steadily where the buffer is low (intelligent alternator control: Automotive"
    " Handbook, Bosch, on energy management); torque is power over speed; sizes are chosen here",
    ranges={
        "power_w": (16000.0, 32000.0),
        "steady": (0.35, 0.7),
        "energy_j": (0.3e6, 1.2e6),
        "uses": (0.2, 0.4),
    },
    needs=("hills", "highway", "suburban"),
    accepts=("engine_friction", "engine_brake"),
)
class ChargesInOverrun(Hidden):
    """uses: of the power, all the time; below a third of the buffer it charges under load too."""

    def prepare(self) -> None:
        self.first = self.setting.rng(453).uniform(0.2, 0.7, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"buffer": self.first.copy(), "must": np.zeros(batch), "torque": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.must = np.where(s.buffer < 0.33, 1.0, np.where(s.buffer > 0.6, 0.0, s.must))
        coasts = view.engine_torque < 0.0
        share = np.where(coasts, s.buffer < 0.97, p.steady * s.must)
        most = 1.3 * p.power_w / 105.0  # N m, the belt's
        wanted = np.minimum(share * p.power_w / np.maximum(view.engine_speed, 60.0), most)
        s.torque += dt * (wanted - s.torque) / 0.3
        gained = s.torque * view.engine_speed - p.uses * p.power_w
        s.buffer = np.clip(s.buffer + dt * gained / p.energy_j, 0.0, 1.0)
        return -wheel_force(self.setting, view, s.torque) * moving(view)


@hidden(
    "blows_off_cement",
    name="accessory_load",
    forms="fifth",
    source="Compressors and pumps on a clutch-independent power take-off that the driver leaves on between"
    " yards (bulk and vacuum tankers, body makers' manuals): a fixed displacement against a back pressure"
    " that creeps up and is blown off by a valve; sizes are chosen here",
    ranges={"torque_nm": (150.0, 300.0), "creeps_s": (8.0, 25.0), "left": (0.3, 0.6), "on_share": (0.4, 0.7)},
    needs=("hills", "highway", "suburban"),
    accepts=("engine_friction",),
)
class BlowsOffCement(Hidden):
    """A saw tooth of torque, in parts of the drives."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(454), self.setting.batch
        first = rng.uniform(0.0, 0.6, batch) * self.setting.duration_s
        self.from_s = np.where(rng.random(batch) < 0.5, 0.0, first)
        self.until_s = self.from_s + self.p.on_share * self.setting.duration_s

    def start(self, batch: int) -> dict[str, Array]:
        return {"pressure": np.full(batch, self.p.left)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        on = (self.from_s <= view.time) & (view.time < self.until_s)
        pumped = dt * np.clip(view.engine_speed / 130.0, 0.4, 1.6) / p.creeps_s
        s.pressure = np.where(s.pressure >= 1.0, p.left, np.minimum(s.pressure + pumped * on, 1.0))
        return -wheel_force(self.setting, view, p.torque_nm * s.pressure * on) * moving(view)
