"""Fifth effects for which no library name exists: bends, ropes and rough roads."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.fleet_trials.road import CELLS, ByPlace, stretches
from deeptruck_exam.hidden import (
    Array,
    Hidden,
    hidden,
    moving,
    ou_series,
    weight,
    wheel_force,
)
from deeptruck_model.trucks import View


class Bends(ByPlace):
    """`bend` (routes, cells): curvature, 1/m, left positive; spirals at both ends of each arc."""

    def draw_bends(self, rng: np.random.Generator, tightest: float) -> Array:
        bend = np.zeros((self.rows(), CELLS))
        for row in bend:
            for first, last in stretches(rng, (60.0, 500.0), (60.0, 260.0)):
                arc = rng.choice([-1.0, 1.0]) * tightest * rng.uniform(0.35, 1.0)
                row[first:last] = arc * np.sin(np.pi * np.linspace(0.0, 1.0, last - first)) ** 0.5
        return bend


@hidden(
    "stability_control_steps_in",
    name="unknown",
    forms="fifth",
    source="Roll stability of UN Regulation No. 13 (annex 21) and FMVSS 136: beyond a lateral acceleration"
    " torque is taken and the trailer is braked until the truck is well below; a unit that was set for a"
    " higher load; thresholds and bends are chosen here",
    ranges={
        "limit": (1.1, 1.9),  # m/s2
        "cut": (0.4, 0.8),
        "brakes": (0.015, 0.045),  # of the weight
        "calm": (0.55, 0.8),
        "tightest": (0.0030, 0.0055),
    },
    needs=("hills", "highway"),
)
class StabilityControlStepsIn(Bends):
    def prepare(self) -> None:
        self.bend = self.draw_bends(self.setting.rng(471), self.p.tightest)

    def start(self, batch: int) -> dict[str, Array]:
        return {"on": np.zeros(batch), "depth": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        across = np.abs(self.read(self.bend, view)) * view.speed**2
        s.on = np.where(across > p.limit, 1.0, np.where(across < p.calm * p.limit, 0.0, s.on))
        s.depth += dt * (s.on - s.depth) / np.where(s.on > s.depth, 0.25, 0.7)
        torque = p.cut * np.maximum(view.engine_torque, 0.0)
        held = p.brakes * weight(view) * np.clip(view.speed / 4.0, 0.0, 1.0)
        return -s.depth * (held + wheel_force(self.setting, view, torque))


@hidden(
    "axles_wind_up",
    name="unknown",
    forms="fifth",
    source="An inter-axle lock left in on a dry road: in every bend the axles turn unlike ways, the shafts"
    " wind up until a tyre slips, and unwind over the straight (truck makers' warnings on differential"
    " locks; Lanzer on 4WD wind-up, SAE 860241); stiffness and bends are chosen here",
    ranges={
        "most": (0.016, 0.032),  # of the weight
        "per_rad": (4.0, 10.0),
        "unwinds_m": (80.0, 260.0),
        "tightest": (0.004, 0.009),
    },
    needs=("suburban", "hills"),
)
class AxlesWindUp(Bends):
    """`wound`: 1 where a tyre slips. Lifting the throttle does not unwind it, the way does."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.setting.rng(472), self.p.tightest)

    def start(self, batch: int) -> dict[str, Array]:
        return {"wound": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        way = np.maximum(view.speed, 0.0) * dt
        turned = p.per_rad * np.abs(self.read(self.bend, view))
        s.wound = np.clip(s.wound + way * (turned - s.wound / p.unwinds_m), 0.0, 1.0)
        return -p.most * s.wound**1.3 * weight(view) * moving(view)


@hidden(
    "tow_rope",
    name="unknown",
    forms="fifth",
    source="Recovery on a rope: it pulls when it is tight and never pushes; whoever steers behind brakes when"
    " it goes slack (police and breakdown guides on towing); elasticity of polyester straps from makers'"
    " elongation tables; masses and habits are chosen here",
    ranges={
        "towed": (0.12, 0.26),  # of the truck's mass
        "metres": (0.3, 0.9),  # stretch under a tenth of the towed weight
        "rolls": (0.010, 0.020),
        "brakes": (0.3, 0.9),  # m/s2
        "late_s": (0.5, 1.3),
    },
    needs=("suburban", "hills"),
)
class TowRope(Hidden):
    """`slack` m, negative when the rope is stretched; `behind` m/s, the towed vehicle's speed."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"slack": np.full(batch, 0.1), "behind": np.full(batch, -1.0), "foot": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        s.behind = np.where(s.behind < 0.0, view.speed, s.behind)
        slower = s.behind - view.speed
        pull = np.maximum(-s.slack, 0.0) * 0.981 / p.metres
        pull = np.clip(pull * (1.0 - np.clip(3.0 * slower, -0.8, 0.8)), 0.0, 2.2)  # m/s2 of the towed mass
        loose = np.clip(s.slack / 0.4, 0.0, 1.0) * p.brakes
        s.foot += dt * (loose - s.foot) / p.late_s
        resists = 9.81 * (p.rolls * (s.behind > 0.05) + view.grade) + s.foot
        s.behind = np.maximum(s.behind + dt * (pull - resists), 0.0)
        s.slack = np.clip(s.slack + dt * slower, -2.5, 3.0)
        return -p.towed * view.mass * pull * moving(view)


@hidden(
    "antilock_is_fooled",
    name="unknown",
    forms="fifth",
    source="On rough roads wheels hop, antilock systems see them lock and let go of the brakes for moments"
    " (rough-road detection in UN Regulation No. 13 systems; van der Jagt, Pacejka and Savkoor, Vehicle"
    " System Dynamics 18, 1989, on uneven roads): braking is short there; sizes are chosen here",
    ranges={"lost": (0.35, 0.6), "from_mps": (3.0, 6.0), "cycle_s": (0.7, 1.6), "light": (0.008, 0.02)},
    needs=("suburban", "descent"),
)
class AntilockIsFooled(ByPlace):
    """light: braking over weight below which no wheel comes near locking."""

    def prepare(self) -> None:
        rng = self.setting.rng(473)
        self.rough = np.zeros((self.rows(), CELLS))
        for row in self.rough:
            for first, last in stretches(rng, (60.0, 260.0), (90.0, 420.0)):
                row[first:last] = rng.uniform(0.6, 1.0)

    def start(self, batch: int) -> dict[str, Array]:
        return {"cycle": np.zeros(batch), "left": np.zeros(batch)}

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        hops = self.read(self.rough, view) * np.clip(view.speed / p.from_mps - 0.5, 0.0, 1.0)
        works = (view.brake_force > p.light * weight(view)) & (hops > 0.0)
        s.cycle = np.where(works, (s.cycle + dt / p.cycle_s) % 1.0, 0.0)
        wanted = works * hops * np.where(s.cycle < 0.55, 1.0, 0.35)
        s.left += dt * (wanted - s.left) / 0.12
        return p.lost * s.left * view.brake_force * moving(view)


@hidden(
    "wanders_in_its_lane",
    name="unknown",
    forms="fifth",
    source="Steering with play and tired drivers: corrections come in bouts and drag with slip angle squared"
    " times cornering stiffness (Wierwille and others, Research on Vehicle-Based Driver Status Monitoring,"
    " DOT HS 808 247, 1994, on steering reversals; Wong, Theory of Ground Vehicles); sizes chosen here",
    ranges={
        "slip_rad": (0.014, 0.026),
        "stiffness": (6.0, 10.0),
        "bouts_s": (12.0, 40.0),
        "from_mps": (5.0, 9.0),
    },
    needs=("highway", "hills"),
)
class WandersInItsLane(Hidden):
    """stiffness: of all axles over weight, 1/rad."""

    def prepare(self) -> None:
        rng, batch = self.setting.rng(474), self.setting.batch
        slots = int(self.setting.duration_s / 0.1) + 20
        fast = ou_series(rng, (batch, slots), 0.1, 0.9)
        bouts = ou_series(rng, (batch, slots), 0.1, self.p.bouts_s)
        self.slip = self.p.slip_rad * fast * np.exp(0.9 * np.clip(bouts, -2.0, 1.4))

    def newtons(self, view: View, dt: float) -> Array:
        p = self.p
        slip = np.clip(self.slip[:, min(int(view.time / 0.1), self.slip.shape[1] - 1)], -0.06, 0.06)
        fades = np.clip(view.speed / p.from_mps - 0.5, 0.0, 1.0)
        return -p.stiffness * slip**2 * fades * weight(view)
