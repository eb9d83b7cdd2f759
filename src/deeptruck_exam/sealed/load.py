"""Spray that freezes on, a roof that floats, a press that its wheels drive, a cushion of air, and foam."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import MAP_CELL_M, OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("h_spray_freezes_on", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(most=(0.26, 0.42), gains_m=(500.0, 1500.0), breaks=(0.035, 0.07), falls_s=(2.0, 6.0))
@sizes(mean_m=(300.0, 900.0), share=(0.35, 0.6))
class SprayFreezesOn(OnRoad):
    """`ice` on frame, axles and load of a light truck in hard frost. Where the road is wet with brine, its
    own wheels throw up spray, which freezes to it. A hard braking or pull breaks slabs of it off. most: of
    the mass, all iced; gains_m: of wet road at 15 m/s; breaks: g that ice bears.
    Source: Makkonen, Models for the Growth of Rime, Glaze, Icicles and Wet Snow on Structures, Phil. Trans.
    Royal Society A 358 (2000), on spray that freezes; the worst roads, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1951), self.rows(), self.p.mean_m, self.p.share)

    def start(self, batch: int) -> dict[str, Array]:
        return {"ice": self.rng(1952).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        throws = self.between(self.road, view) * speed * np.minimum(speed / 15.0, 1.5) / p.gains_m
        jerked = np.abs(np.clip(view.acceleration, -3.0, 3.0)) / GRAVITY
        breaks = np.clip(jerked / p.breaks - 1.0, 0.0, 2.0) / p.falls_s
        s.ice = np.clip(
            s.ice + dt * (throws * (1.0 - s.ice) - breaks * np.maximum(s.ice - 0.1, 0.0)), 0.0, 1.0
        )
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -p.most * s.ice * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("h_roof_floats_on_it", needs="suburban", name="load_slosh")
@sizes(share=(0.35, 0.5), swings_rads=(1.6, 3.0), rubs=(0.12, 0.28), slowly=(0.4, 0.7), dull=(0.02, 0.06))
class RoofFloatsOnIt(Hidden, x=0.0, v=0.0):
    """A liquid under a roof that floats on it. The seal of that roof rubs dry on the walls: it holds all of
    the liquid still under gentle driving, and lets it swing under harsh driving, until its swing is small.
    `x` m, `v`: the liquid's middle. share: of the mass; rubs: m/s2 that the seal holds; slowly: of that,
    while it glides.
    Source: Ibrahim, Liquid Sloshing Dynamics (2005), on lids that float and damp, and Den Hartog, Mechanical
    Vibrations (1956), on swings with dry friction; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        push = -felt - p.swings_rads**2 * s.x - 2.0 * p.dull * p.swings_rads * s.v
        holds = p.rubs * (p.slowly + (1.0 - p.slowly) * np.exp(-np.abs(s.v) / 0.05))
        free = s.v + dt * push
        after = np.sign(free) * np.maximum(np.abs(free) - dt * holds, 0.0)
        gains = (after - s.v) / dt
        s.v = np.clip(after, -2.5, 2.5)
        s.x = np.clip(s.x + dt * s.v, -2.0, 2.0)
        return np.asarray(np.clip(-p.share * gains, -2.0, 2.0) * view.mass * moving(view))


@law("h_wheels_drive_a_press", needs="suburban hills highway", name="unknown")
@sizes(most=(0.02, 0.034), cycle_m=(80.0, 180.0), hard=(1.5, 3.0), empty=(0.1, 0.25), patch_m=(200.0, 700.0))
class WheelsDriveAPress(OnRoad):
    """A machine is towed whose own wheels drive a press for what it gathers along the way. `turned`: of a
    cycle of the press, by the way. It resists more and more as the chamber is closed, and nothing as it opens
    again; where it gathers much it is harder. most: of the weight, at the end; hard: power of the way in.
    Source: Kepner, Bainer and Barger, Principles of Farm Machinery (1978), on balers driven from the ground
    and on pressing hay by its density; long cycles and sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1953)
        grows = 0.7 + 0.4 * ou_series(rng, (self.rows(), 6000), MAP_CELL_M, self.p.patch_m)
        self.road = np.clip(grows, 0.0, 1.5)

    def start(self, batch: int) -> dict[str, Array]:
        return {"turned": self.rng(1954).uniform(0.0, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.turned = (s.turned + dt * np.maximum(view.speed, 0.0) / p.cycle_m) % 1.0
        closes = np.clip(s.turned / 0.65, 0.0, 1.0) ** p.hard
        lets_go = 0.5 * (1.0 + np.cos(np.pi * np.clip((s.turned - 0.65) / 0.1, 0.0, 1.0)))
        presses = np.where(s.turned < 0.65, closes, lets_go) * self.between(self.road, view)
        return -p.most * (p.empty + (1.0 - p.empty) * presses) * weight(view) * moving(view)


@law("h_floats_on_a_cushion", needs="suburban hills highway", name="unknown")
@sizes(most=(0.018, 0.03), lifts_rads=(120.0, 160.0), power=(1.5, 2.5), fills_s=(0.8, 2.5), leaks=(0.2, 0.45))
@sizes(rough_m=(120.0, 500.0))
class FloatsOnACushion(OnRoad, air=0.5):
    """A platform is towed that floats on air, which a blower on the truck's engine presses under its skirts.
    `air`: of what lifts it whole. With a slow engine it sinks and its skirts drag, and over rough ground the
    air escapes below them. most: of the weight, sunk; lifts_rads: of the engine; leaks: of the air.
    Source: Amyot, Hovercraft Technology, Economics and Applications (1989), on drag of skirts by cushion
    flow, and makers' notes on hover platforms for heavy loads; sizes are chosen here."""

    def prepare(self) -> None:
        self.road = np.abs(ou_series(self.rng(1955), (self.rows(), 6000), MAP_CELL_M, self.p.rough_m))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        blows = np.minimum(view.engine_speed / p.lifts_rads, 1.2) ** p.power
        escapes = np.minimum(p.leaks * self.between(self.road, view), 0.8)
        s.air = eased(s.air, np.clip(blows - escapes, 0.0, 1.0), p.fills_s, dt)
        return -p.most * (1.0 - 0.9 * s.air) * weight(view) * moving(view)


@law("h_machine_stands_on_foam", needs="suburban", name="load_slosh")
@sizes(share=(0.28, 0.42), soft_rads=(2.2, 3.6), hard_m=(0.12, 0.25), keeps=(0.3, 0.5), creeps_s=(1.5, 5.0))
@sizes(dull=(0.04, 0.1))
class MachineStandsOnFoam(Hidden, x=0.0, v=0.0, set=0.0):
    """A heavy machine is wedged into its box by foam, soft at first and hard once pressed. `x` m that it
    is ahead, `v` of that. `set` m: foam that has been pressed for a while stays so, and leaves the machine
    free to move on the way back. share: of the mass; hard_m: of pressing, from which it is hard; keeps: of
    the pressing; creeps_s: until it does.
    Source: Gibson and Ashby, Cellular Solids (1997), on foams that collapse, get dense and come back slowly,
    and Mustin, Theory and Practice of Cushion Design (1968); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        s.set = eased(s.set, p.keeps * s.x, p.creeps_s, dt)
        pressed = s.x - s.set
        spring = p.soft_rads**2 * pressed * (1.0 + (pressed / p.hard_m) ** 2)
        gains = -felt - spring - 2.0 * p.dull * p.soft_rads * s.v
        s.v = np.clip(s.v + dt * gains, -2.0, 2.0)
        s.x = np.clip(s.x + dt * s.v, -0.8, 0.8)
        return np.asarray(np.clip(-p.share * gains, -2.0, 2.0) * view.mass * moving(view))
