"""What is dragged, floats, flies, or works as its wheels turn. The tool has no name for it."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import MAP_CELL_M, OnRoad, smooth_stretches, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("y_chain_drags_behind", "eighteenth", "suburban hills highway")
@sizes(heavy=(0.009, 0.015), flies_mps=(9.0, 14.0), power=(2.0, 4.0), gravel=(0.8, 1.6), hops=(0.25, 0.5))
@sizes(mean_m=(150.0, 500.0), share=(0.3, 0.6))
class ChainDragsBehind(OnRoad, lies=1.0):
    """A long anchor chain drags on the ground behind the truck. `lies`: of it on the ground. The faster the
    truck, the more of it is lifted, by the pull along it and by the wind, and the less it holds. On gravel it
    digs in. heavy: of the weight, at rest on asphalt; flies_mps: where half is lifted; gravel: more by that;
    hops: less as it jumps.
    Source: Irvine, Cable Structures (1981), on lines that lie partly on the ground, and Hoerner,
    Fluid-Dynamic Drag (1965), on towed lines; a heavy chain, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1853), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, gravel = np.maximum(view.speed, 0.0), self.between(self.road, view)
        wish = 1.0 / (1.0 + (speed / p.flies_mps) ** p.power)
        s.lies = eased(s.lies, wish, 1.2, dt)
        jumps = 1.0 - p.hops * np.clip(speed / 8.0, 0.0, 1.0) * (1.0 - gravel)
        return -p.heavy * s.lies * (1.0 + p.gravel * gravel) * jumps * weight(view) * moving(view)


@law("h_wheels_drive_a_press", "nineteenth", "suburban hills highway")
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


@law("h_floats_on_a_cushion", "nineteenth", "suburban hills highway")
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


@law("b_tows_a_glider_up", "twentieth", "suburban hills highway")
@sizes(
    most=(0.02, 0.034), lifts_mps=(8.0, 12.0), climbs_s=(12.0, 30.0), sinks_s=(6.0, 18.0), rope=(0.25, 0.5)
)
class TowsAGliderUp(Hidden, pull=0.0):
    """A glider hangs on a rope behind the truck. `high`: 1 at the top of its rope. It climbs while the truck
    is fast, pulling by the square of speed and the more, the steeper it climbs; near the top it pulls down
    more than back. Slower than it can fly it sinks and pulls little, until it is towed up again. most: of 20
    t; lifts_mps: where it begins to fly; rope: of the pull, left at the top.
    Source: Welch, Welch and Irving, New Soaring Pilot (1977), on launches by car, and Gibson, The Mechanics
    of the Winch Launch (2005); large gliders, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "high": self.rng(2054).uniform(0.0, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fast = np.clip(view.speed / p.lifts_mps, 0.0, 2.2)
        flies = np.clip((fast - 0.95) / 0.2, 0.0, 1.0)
        climbs = flies * np.minimum(fast, 1.6) * (1.0 - s.high) / p.climbs_s
        s.high = np.clip(s.high + dt * (climbs - (1.0 - flies) * s.high / p.sinks_s), 0.0, 1.0)
        steep = np.cos(0.5 * np.pi * s.high * (1.0 - p.rope))
        wish = (0.2 + 0.8 * flies * steep) * np.minimum(fast, 1.7) ** 2 / 1.7
        s.pull = eased(s.pull, wish, 0.8, dt)
        return -p.most * s.pull * 20000.0 * GRAVITY * moving(view)


@law("u_roller_shakes_behind", "twenty-first", "suburban hills highway")
@sizes(
    most=(0.016, 0.027), tone_rads=(120.0, 150.0), wide=(0.12, 0.22), eases=(0.5, 0.8), mean_m=(200.0, 600.0)
)
@sizes(sinks_m=(4.0, 12.0))
class RollerShakesBehind(OnRoad, sunk=0.4):
    """A roller is towed that the truck's engine shakes. Over soft stretches it sinks in and has to be drawn
    out of its own hollow; near the tone of the ground the shaking makes the ground flow, and the roller goes
    more easily. `sunk`: of the most. most: of the weight; tone_rads: of the engine; eases: of the drag.
    Source: Wong, Theory of Ground Vehicles (2008), on rigid wheels that sink, and Adam and Kopf, Operational
    Devices for Compaction Optimization and Quality Control, Bearing Capacity of Roads (2004), on rollers and
    the tone of the ground; towing it on the way, sizes are chosen here."""

    def prepare(self) -> None:
        p = self.p
        gaps, lengths = (0.2 * p.mean_m, 0.8 * p.mean_m), (0.6 * p.mean_m, 1.6 * p.mean_m)
        self.soft = smooth_stretches(self.rng(2153), self.rows(), gaps, lengths)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        soft = 0.3 + 0.7 * self.read(self.soft, view)
        flows = 1.0 / (1.0 + ((view.engine_speed / p.tone_rads - 1.0) / p.wide) ** 2)
        wish = soft * (1.0 - p.eases * flows)
        s.sunk = eased(s.sunk, wish, p.sinks_m / np.maximum(view.speed, 0.5), dt)
        return -p.most * np.maximum(s.sunk, 0.0) ** 0.75 * weight(view) * moving(view)
