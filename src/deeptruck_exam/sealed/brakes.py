"""Linings that polish themselves, rubber that creeps, iron that stays magnetic, and brakes against gusts."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, index, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import SAMPLE_S, arrivals
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("x_linings_polish_themselves", needs="descent", name="brake_fade")
@sizes(loss=(0.45, 0.7), warms_jpkg=(250.0, 600.0), cools_s=(90.0, 260.0), turns=(0.3, 0.6))
@sizes(polishes_m=(150.0, 450.0), rips=(0.14, 0.25))
class LiningsPolishThemselves(Hidden, hot=0.0):
    """`hot`: 1 where resin softens; `glaze`: share of the face that is polished. Long gentle braking when hot
    melts a smooth skin over the lining, which stays when it is cold again; one firm braking rips it off.
    loss: of the brake force, all polished; turns: `hot` at which it begins; rips: of full braking.
    Source: Jacko, Physical and Chemical Changes of Organic Disc Pads in Service, Wear 46 (1978), and Limpert,
    Brake Design and Safety, on glazing; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "glaze": self.rng(1311).uniform(0.2, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        lost = p.loss * s.glaze
        work = (1.0 - lost) * view.brake_force * speed / view.mass
        s.hot = np.clip(s.hot + dt * (work / p.warms_jpkg - s.hot / p.cools_s), 0.0, 2.0)
        hard = view.brake_force / self.truck.brake_capacity / p.rips
        rubs = np.clip(10.0 * hard, 0.0, 1.0) * speed / p.polishes_m
        skin = rubs * np.clip((s.hot - p.turns) / 0.3, 0.0, 1.0) * (1.0 - s.glaze)
        s.glaze = np.clip(s.glaze + dt * (skin - 0.4 * np.clip(hard - 1.0, 0.0, 3.0) * s.glaze), 0.0, 1.0)
        return lost * view.brake_force * moving(view)


@law("x_rubber_creeps", needs="suburban descent", name="brake_lag", accepts="command_delay clock_offset")
@sizes(quick_s=(0.25, 0.5), slow_s=(1.8, 4.0), creeps=(0.4, 0.65), stiff=(0.5, 1.5), warms_s=(60.0, 200.0))
class RubberCreeps(Hidden, quick=0.0, slow=0.0, soft=0.0):
    """Rubber in old chambers takes its share of the stroke twice: soon, and creeping for seconds. Force that
    creeps in creeps out again, and frost makes both slower until use has warmed it. creeps: share that comes
    slowly; stiff: times as slow, more, when cold; warms_s: of braking.
    Source: Findley, Lai and Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials (1976), on
    chains of springs and dampers, and SAE J1469 on brake actuators in the cold; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        s.soft = s.soft + dt * (1.0 - s.soft) * np.clip(20.0 * asked, 0.0, 1.0) / p.warms_s
        cold = 1.0 + p.stiff * (1.0 - s.soft)
        s.quick = s.quick + dt * (asked - s.quick) / (p.quick_s * cold)
        s.slow = s.slow + dt * (asked - s.slow) / (p.slow_s * cold)
        comes = (1.0 - p.creeps) * s.quick + p.creeps * s.slow
        return (asked - comes) * self.truck.brake_capacity * moving(view)


@law("x_iron_stays_magnetic", needs="suburban descent hills", name="dragging_brake")
@sizes(most=(0.016, 0.028), peak_mps=(5.0, 11.0), full=(0.04, 0.1), shakes_m=(300.0, 1200.0))
@sizes(turns=(0.3, 0.7))
class IronStaysMagnetic(Hidden):
    """`kept`: magnetism of a retarder's iron, of the most. Each braking drives a current that leaves its
    mark, a hard one a strong mark, a gentle one wipes part of it out; shaking over the way loosens it. The
    rotor then turns in a field that nobody asked for. most: of the weight; full: brake over weight that
    saturates; turns: of `kept` that a gentle current wipes out, in a second.
    Source: Bozorth, Ferromagnetism (1951), on remanence and minor loops, and Wouterse, IEE Proc. B 138
    (1991), on eddy torque over speed; a retarder on the brake pedal, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"kept": self.rng(1312).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        current = np.clip(view.brake_force / weight(view) / p.full, 0.0, 1.3)
        marks = np.tanh(1.5 * current)
        grows = 3.0 * np.maximum(marks - s.kept, 0.0) * (current > 0.02)
        wipes = p.turns * s.kept * np.where((current > 0.02) & (marks < 0.6 * s.kept), 1.0, 0.0)
        speed = np.maximum(view.speed, 0.0)
        s.kept = np.clip(s.kept + dt * (grows - wipes - speed * s.kept / p.shakes_m), 0.0, 1.0)
        slip = speed / p.peak_mps
        return -p.most * s.kept * weight(view) * 2.0 * slip / (1.0 + slip**2) * moving(view)


@law("x_brakes_against_gusts", needs="highway hills", name="unknown")
@sizes(most=(0.018, 0.035), from_mps=(11.0, 14.0), mean_s=(9.0, 25.0), dies_s=(1.2, 3.5), bears=(0.35, 0.8))
@sizes(holds_s=(0.8, 2.5))
class BrakesAgainstGusts(Hidden, acts=0.0, tired=0.0):
    """Gusts from the side turn a high truck, and its computer brakes the wheels of one side against it, above
    a speed; wheels that it has braked for long get a rest. most: of the weight; bears: gust that it leaves to
    the driver; holds_s: of the brake, behind the gust.
    Source: Baker, Ground Vehicles in High Cross Winds, J. Fluids and Structures 5 (1991), on gusts and yaw,
    and makers' descriptions of crosswind assistants that brake one side; gusts by chance, sizes are chosen
    here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / SAMPLE_S) + 20)
        raw = arrivals(self.rng(1313), shape, self.p.mean_s, self.p.dies_s)
        self.gusts = raw * self.p.dies_s / self.p.mean_s

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gust = self.gusts[:, index(view, self.gusts, SAMPLE_S)]
        gust = gust * np.clip(view.speed / 20.0, 0.0, 1.3)
        fast = np.clip((view.speed - p.from_mps) / 1.5, 0.0, 1.0)
        wants = fast * np.clip((gust - 0.4 * p.bears) / 0.5, 0.0, 1.0) * (1.0 - 0.6 * s.tired)
        s.acts = s.acts + dt * (wants - s.acts) / np.where(wants > s.acts, 0.25, p.holds_s)
        s.tired = np.clip(s.tired + dt * (s.acts / 15.0 - s.tired / 40.0), 0.0, 1.0)
        return -p.most * s.acts * weight(view) * moving(view)
