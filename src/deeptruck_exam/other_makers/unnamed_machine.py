"""Third effects for which no library name exists: machinery the simulator's makers did not think of."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight, wheel_force
from deeptruck_exam.other_makers.engine import power_share
from deeptruck_model.trucks import View


@hidden(
    "steam_from_exhaust",
    name="unknown",
    forms="third",
    source="Rankine cycle on a truck's exhaust (Teng, Regner and Cowland, Waste Heat Recovery of Heavy-Duty"
    " Diesel Engines by Organic Rankine Cycle, SAE 2007-01-0537): an expander helps with the heat of the"
    " minutes before; a boiler that is emptied in bursts, and sizes, are chosen here",
    ranges={
        "power_w": (40000.0, 80000.0),
        "fills_s": (9.0, 20.0),  # at full engine power
        "empties_s": (7.0, 14.0),
        "until": (0.1, 0.4),
    },
    needs=("hills", "highway"),
)
class SteamFromExhaust(Hidden):
    """power_w: of a 20 t truck; by-passed while the brake is pressed."""

    def start(self, batch: int) -> dict[str, Array]:
        first = self.setting.rng(271).uniform(0.2, 1.0, batch)
        return {"steam": first, "open": np.zeros(batch), "force": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.steam += dt * (np.minimum(power_share(self, view), 1.0) / p.fills_s - s.open / p.empties_s)
        s.open = np.where(s.steam > 1.0, 1.0, np.where(s.steam < p.until, 0.0, s.open))
        watts = p.power_w * np.clip(view.mass / 2.0e4, 0.5, 1.6) * s.open
        wanted = watts / np.maximum(view.speed, 6.0) * (view.u[:, 1] <= 0.01)
        s.force += dt * (wanted - s.force) / 0.6
        return s.force * moving(view)


@hidden(
    "overboost",
    name="unknown",
    forms="third",
    source="Short-time overload of drives against a thermal budget (IEC 60034-1, duty type S2): more torque"
    " than the data sheet's while much is asked, for some seconds, then a pause; as overboost of engines,"
    " sizes chosen here",
    ranges={"gain": (0.14, 0.28), "from": (0.35, 0.55), "spends_s": (6.0, 16.0), "rests_s": (20.0, 45.0)},
    needs=("suburban", "hills"),
)
class Overboost(Hidden):
    """Twice the same pull is not answered twice."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"budget": np.ones(batch), "on": np.zeros(batch), "torque": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        asked = view.engine_torque / self.truck.peak_torque > vars(p)["from"]
        s.on = np.where(~asked | (s.budget <= 0.0), 0.0, np.where(s.budget > 0.4, 1.0, s.on))
        s.budget = np.clip(s.budget + dt * np.where(s.on > 0.5, -1.0 / p.spends_s, 1.0 / p.rests_s), 0.0, 1.0)
        s.torque += dt * (p.gain * self.truck.peak_torque * s.on - s.torque) / 0.4
        return wheel_force(self.setting, view, s.torque) * moving(view)


@hidden(
    "all_speed_governor",
    name="unknown",
    forms="third",
    source="Diesel-Engine Management (Bosch), on variable-speed governors: the pedal asks for an engine"
    " speed, and torque falls off along a droop as the engine nears it, where the simulator's pedal asks"
    " for torque; droop and range are chosen here",
    ranges={"droop": (3.0, 6.5), "slowest": (80.0, 100.0), "fastest": (175.0, 215.0), "most": (0.16, 0.30)},
    needs=("suburban", "hills", "highway"),
)
class AllSpeedGovernor(Hidden):
    """droop: N m for 1 rad/s."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"torque": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        pedal = np.clip(view.u[:, 0] / self.truck.full_command, 0.0, 1.0)
        asked = p.slowest + (p.fastest - p.slowest) * pedal
        most = p.most * self.truck.peak_torque
        wanted = np.clip(p.droop * (asked - view.engine_speed), -most, most) * np.clip(pedal / 0.05, 0.0, 1.0)
        s.torque += dt * (wanted - s.torque) / 0.3
        return wheel_force(self.setting, view, s.torque) * moving(view)


@hidden(
    "bearing_runs_hot",
    name="unknown",
    forms="third",
    source="Stein and Tu, A State-Space Model for Monitoring Thermally Induced Preload in Anti-Friction"
    " Spindle Bearings of High-Speed Machine Tools, J. Dyn. Sys. Meas. Control 116 (1994): heat tightens a"
    " bearing and tightness heats it, so that drag grows by itself above a speed and dies below; hubs of a"
    " truck, sizes chosen here",
    ranges={
        "most": (0.012, 0.028),
        "critical_mps": (13.0, 18.0),
        "grows_s": (12.0, 35.0),
        "first": (0.2, 0.5),
    },
    needs=("highway", "hills"),
)
class BearingRunsHot(Hidden):
    """The same speed may cost little or much: it depends on minutes of history."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"tight": self.p.first * self.setting.rng(270).uniform(0.4, 1.6, batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        gain = np.clip(np.maximum(view.speed, 0.0) / p.critical_mps, 0.0, 1.6) ** 2 - 1.0
        s.tight = np.clip(s.tight + dt * gain * s.tight * (1.05 - s.tight) / p.grows_s, 0.06, 1.0)
        return -p.most * s.tight * weight(view) * moving(view)
