"""Sand that is swept up, a heap that comes down in slides, castors that shimmy and a mat that smooths a
track."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, smooth_stretches, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("j_sweeps_up_the_sand", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(
    most=(0.36, 0.52), fills_m=(180.0, 450.0), brush_mps=(5.0, 9.0), mean_m=(150.0, 500.0), tips_s=(3.0, 9.0)
)
class SweepsUpTheSand(OnRoad):
    """A sweeper takes up the sand that wind has blown on the road: all that lies there while it is slow, ever
    less as it outruns its brush. As the hopper fills the sand lies in the way of its own air, and less comes
    in. Where the truck stands long enough it tips. `full`: of the hopper. most: of the mass; fills_m: of deep
    sand, at low speed, until two thirds are full; brush_mps: where half is left behind.
    Source: USEPA AP-42, section 13.2.1 on paved roads and their silt, and makers' manuals of sweepers; a
    large hopper, sizes are chosen here."""

    def prepare(self) -> None:
        gaps, lengths = (0.2 * self.p.mean_m, self.p.mean_m), (0.5 * self.p.mean_m, 2.0 * self.p.mean_m)
        self.road = smooth_stretches(self.rng(2251), self.rows(), gaps, lengths)

    def start(self, batch: int) -> dict[str, Array]:
        return {"full": self.rng(2252).uniform(0.0, 0.8, batch), "stood": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        takes = self.read(self.road, view) / (1.0 + (speed / p.brush_mps) ** 2)
        s.full = np.clip(s.full + dt * speed * takes * (1.0 - s.full) / p.fills_m, 0.0, 1.0)
        s.stood = np.where(speed < 0.3, s.stood + dt, 0.0)
        s.full = np.where(s.stood > p.tips_s, eased(s.full, 0.0, 1.0, dt), s.full)
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -p.most * s.full * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("j_heap_comes_down_in_slides", needs="suburban hills", name="load_slosh")
@sizes(share=(0.36, 0.52), starts=(0.03, 0.055), stops=(0.1, 0.3), runs_s=(0.25, 0.6), steep=(0.5, 1.1))
@sizes(room_m=(1.0, 2.0))
class HeapComesDownInSlides(Hidden, slope=0.0, pace=0.0, slides=0.0):
    """A heap of dry sand lies at its steepest. What the truck feels leans it beyond; from a lean on it comes
    down all at once, and stops only where it is much flatter than where it began. `slope`: of the heap
    backwards, as moved sand has made it; `pace` m/s of the sand, backwards. share: of the mass; starts: lean
    where it begins; stops: of that, where it ends; steep: of slope, by a metre.
    Source: Jaeger, Liu and Nagel, Relaxation at the Angle of Repose, Physical Review Letters 62 (1989), on
    the two angles of a heap; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration / GRAVITY + view.grade, -0.25, 0.25)
        over = felt - s.slope
        s.slides = np.where(np.abs(over) > p.starts, 1.0, s.slides)
        s.slides = np.where(np.abs(over) < p.stops * p.starts, 0.0, s.slides)
        wish = s.slides * np.clip(over / p.starts, -2.0, 2.0) * 0.1 * p.room_m / p.runs_s
        before = s.pace
        s.pace = eased(s.pace, wish, p.runs_s, dt)
        s.slope = np.clip(s.slope + dt * p.steep * s.pace, -0.25, 0.25)
        gains = np.clip((s.pace - before) / dt, -2.0, 2.0)
        return p.share * gains * view.mass * np.clip(view.speed, 0.0, 1.0)


@law("j_castors_shimmy", needs="suburban hills", name="unknown")
@sizes(most=(0.015, 0.026), from_mps=(7.0, 10.0), to_mps=(16.0, 21.0), grows_s=(0.8, 2.0))
@sizes(starts=(0.09, 0.15))
class CastorsShimmy(Hidden, swing=0.02, felt=0.0):
    """What is towed runs on castors. Between two speeds a small swing of theirs dies out and a large one
    keeps itself up, and costs its work at the road: a jerk of pulling or braking sets it on, and it lasts
    until the truck is clearly slower or faster. `swing`: of the most. most: of the weight; starts: swing
    beyond which it grows, in the middle of the speeds.
    Source: Besselink, Shimmy of Aircraft Main Landing Gears (2000), and Pacejka, Tire and Vehicle Dynamics
    (2012), on trailing wheels and limit cycles; loose castors, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        middle, half = 0.5 * (p.from_mps + p.to_mps), 0.5 * (p.to_mps - p.from_mps)
        off = ((view.speed - middle) / half) ** 2
        small = p.starts**2 * (1.0 + np.minimum(30.0 * off**2, 90.0))
        square = s.swing**2
        grows = s.swing * (square - small) * (1.0 - square) / p.grows_s
        force = (view.traction_force - view.brake_force) / weight(view)
        jerk = 12.0 * np.maximum(np.abs(force - s.felt) - 0.02, 0.0)
        s.felt = eased(s.felt, force, 0.5, dt)
        kicks = np.clip(jerk, 0.0, 1.0) * np.clip(view.speed / 5.0, 0.0, 1.0)
        s.swing = np.clip(s.swing + dt * (4.0 * grows + 1.2 * kicks * (1.0 - s.swing)), 0.01, 1.1)
        return -p.most * (s.swing**2 + 0.02) * weight(view) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("j_mat_smooths_the_track", needs="suburban hills", name="unknown")
@sizes(
    rubs=(0.006, 0.01), prism=(0.014, 0.024), gathers_m=(15.0, 50.0), skips_mps=(7.0, 12.0), spills=(0.5, 0.9)
)
@sizes(mean_m=(200.0, 600.0), share=(0.5, 0.7))
class MatSmoothsTheTrack(OnRoad, heap=0.3):
    """A mat of old tyres is drawn over a sandy track to smooth it. Its front gathers a heap of sand over some
    way, which has to be pushed along; hard ground lets the heap run out. Faster than a speed the mat skips,
    rubs less and spills its heap. `heap`: of the most. rubs, prism: of the weight, for the mat and the heap;
    spills: of the heap, over its usual way, when skipping.
    Source: Wong, Theory of Ground Vehicles (2008), on bulldozing of loose ground, and Caterpillar Performance
    Handbook (2018) on maintenance of tracks; a heavy mat, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(2253), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        sand, speed = self.between(self.road, view), np.maximum(view.speed, 0.0)
        skips = 1.0 / (1.0 + np.exp(np.clip(-2.0 * (speed - p.skips_mps), -30.0, 30.0)))
        gains = sand * (1.0 - s.heap) * (1.0 - skips) - (1.5 * (1.0 - sand) + 2.0 * p.spills * skips) * s.heap
        s.heap = np.clip(s.heap + dt * speed * gains / p.gathers_m, 0.0, 1.0)
        rubs = p.rubs * (1.0 - 0.6 * skips) * (0.6 + 0.4 * sand)
        return -(rubs + p.prism * s.heap) * weight(view) * moving(view)
