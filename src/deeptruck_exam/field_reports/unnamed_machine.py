"""Fourth effects for which no library name exists: engine and driveline."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, Hidden, hidden, moving, weight, wheel_force
from deeptruck_model.trucks import View


@hidden(
    "hydraulic_launch_assist",
    name="unknown",
    forms="fourth",
    source="Hydraulic launch assist of refuse trucks (Eaton; US EPA series and parallel hydraulic hybrids,"
    " EPA-420-F-06-043): a pump-motor on the propeller shaft charges an accumulator with the brake pedal and"
    " empties it on the next start; gas pressure as a polytrope; sizes are chosen here",
    ranges={
        "most": (0.025, 0.055),
        "volume_j": (0.25e6, 0.8e6),
        "gas": (0.35, 0.6),
        "until_mps": (9.0, 13.0),
    },
    needs=("suburban",),
)
class HydraulicLaunchAssist(Hidden):
    """most: over weight, at full pressure; volume_j: what a full accumulator holds, for a 20 t truck."""

    def prepare(self) -> None:
        self.first = self.setting.rng(380).uniform(0.0, 0.6, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {"oil": self.first.copy(), "force": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s, truck = self.p, self.s, self.truck
        pressure = (p.gas / (1.0 - (1.0 - p.gas) * s.oil)) ** 1.4
        able = p.most * weight(view) * pressure
        slow = np.clip((p.until_mps - view.speed) / 1.5, 0.0, 1.0)
        asked = np.clip(view.u[:, 0] / (0.3 * truck.full_command), 0.0, 1.0)
        gives = able * asked * slow * np.clip(s.oil / 0.05, 0.0, 1.0)
        takes = able * (view.u[:, 1] > 0.02) * np.clip((1.0 - s.oil) / 0.05, 0.0, 1.0)
        s.force += dt * (np.where(view.u[:, 1] > 0.02, -takes, gives) - s.force) / 0.2
        holds = p.volume_j * view.mass / 2.0e4
        s.oil = np.clip(s.oil - dt * s.force * np.maximum(view.speed, 0.0) / holds, 0.0, 1.0)
        return s.force * moving(view)


@hidden(
    "cylinders_rest",
    name="unknown",
    forms="fourth",
    source="Cylinder deactivation of heavy diesels (Allen and others, SAE 2018-01-0384, on low load): half"
    " the cylinders rest below a load, which spares pumping, and every change of mode costs a dip of torque;"
    " thresholds and dips are chosen here",
    ranges={"spares_nm": (50.0, 110.0), "dip": (0.35, 0.7), "dip_s": (0.5, 1.2), "below": (0.22, 0.36)},
    needs=("suburban", "hills", "highway"),
)
class CylindersRest(Hidden):
    def start(self, batch: int) -> dict[str, Array]:
        return {"load": np.full(batch, 0.3), "rest": np.zeros(batch), "since": np.full(batch, 9.0)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.load += dt * (load - s.load) / 0.4
        rest = np.where(s.load < p.below, 1.0, np.where(s.load > p.below + 0.08, 0.0, s.rest))
        fast = view.engine_speed > 75.0
        rest = rest * fast
        s.since = np.where((rest != s.rest) & (s.since > p.dip_s), 0.0, s.since + dt)
        s.rest = rest
        shape = np.clip(1.0 - s.since / p.dip_s, 0.0, 1.0) ** 0.5
        dip = p.dip * shape * (np.maximum(view.engine_torque, 0.0) + 0.06 * self.truck.peak_torque)
        return wheel_force(self.setting, view, p.spares_nm * s.rest - dip) * moving(view)


@hidden(
    "connector_drops_out",
    name="unknown",
    forms="fourth",
    source="Intermittent pedal sensors (service bulletins on idle validation; fretting of connectors:"
    " Swingler, McBride and Maul, IEEE Trans. Compon. Packag. Technol. 23, 2000): the engine falls to idle"
    " for about a second, in bursts, the more the truck shakes; odds are chosen here",
    ranges={"every_s": (9.0, 22.0), "lasts_s": (0.5, 1.6), "burst": (0.3, 0.6)},
    needs=("suburban", "hills", "highway"),
)
class ConnectorDropsOut(Hidden):
    """burst: the chance that one failure is followed by another at once."""

    def prepare(self) -> None:
        self.dice = self.setting.rng(381).random(
            (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        )

    def start(self, batch: int) -> dict[str, Array]:
        zero = np.zeros(batch)
        return {"left": zero, "given": np.ones(batch), "bad": zero.copy(), "seen": np.full(1, -1)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        at = min(int(view.time / 0.1), self.dice.shape[1] - 1)
        if at != s.seen[0]:
            s.seen[0] = at
            shakes = np.clip(view.speed / 14.0, 0.2, 1.6)
            chance = 0.1 / p.every_s * shakes + 0.1 / 3.0 * p.burst * (s.bad > 0.0)
            s.left = np.where((self.dice[:, at] < chance) & (s.left <= 0.0), p.lasts_s, s.left)
        s.left = np.maximum(s.left - dt, 0.0)
        s.bad = np.where(s.left > 0.0, 3.0, np.maximum(s.bad - dt, 0.0))
        lost = s.left > 0.0
        s.given += dt * (np.where(lost, 0.0, 1.0) - s.given) / np.where(lost, 0.06, 0.35)
        return -wheel_force(self.setting, view, (1.0 - s.given) * np.maximum(view.engine_torque, 0.0))


@hidden(
    "hydrostatic_front_axle",
    name="unknown",
    forms="fourth",
    source="Hydraulic wheel motors in the front hubs (product papers of on-demand front drives for trucks):"
    " they pull with a pressure-limited force at walking pace and with what the pump delivers above, let go"
    " at a road speed and stay off until the truck has slowed well below; sizes are chosen here",
    ranges={"most": (0.022, 0.045), "full_mps": (3.0, 5.5), "off_mps": (7.5, 11.0), "again_mps": (2.0, 4.0)},
    needs=("suburban",),
)
class HydrostaticFrontAxle(Hidden):
    """most: over weight. Works with the throttle open alone."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"on": np.ones(batch), "force": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        again = view.speed < p.off_mps - p.again_mps
        s.on = np.where(view.speed > p.off_mps, 0.0, np.where(again, 1.0, s.on))
        open_throttle = np.clip(view.u[:, 0] / (0.15 * self.truck.full_command) - 0.3, 0.0, 1.0)
        pump = np.minimum(p.full_mps / np.maximum(view.speed, 0.1), 1.0)
        wanted = p.most * weight(view) * pump * s.on * open_throttle
        s.force += dt * (wanted - s.force) / 0.35
        return s.force * moving(view)
