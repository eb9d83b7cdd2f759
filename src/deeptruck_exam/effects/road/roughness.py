"""Roads that are rough: stretches, washboards, holes, stones."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.places import CELL_M, CELLS, MAP_CELL_M, MAP_CELLS, OnRoad, sections, stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="road_surface", accepts="road_grade")

AXLES_M = np.array([0.0, 3.7, 5.1, 11.2, 12.5])[:, None]  # behind the front axle


@law("road_surface", "first")
@sizes(texture=(0.003, 0.010), roughness=(0.0001, 0.0004), share_of_road=(0.25, 0.5))
class RoughStretches(Hidden):
    """Stretches of 250 to 900 m, the same whenever and whichever way the road is driven.
    Source: Hammarström, Eriksson, Karlsson and Yahya, VTI rapport 748A (2012): rolling resistance with
    texture and, growing with speed, with roughness; the sizes are those of gravel and snow, chosen here."""

    def prepare(self) -> None:
        rng = self.rng(4)
        self.step_m, length = 5.0, 60000.0
        routes = int(self.setting.route.max()) + 1
        self.rough = np.zeros((routes, int(length / self.step_m)))
        for row in self.rough:
            at = 0.0
            while at < length:
                at += rng.uniform(250.0, 900.0) * (1.0 - self.p.share_of_road) / self.p.share_of_road
                end = at + rng.uniform(250.0, 900.0)
                row[int(at / self.step_m) : int(end / self.step_m)] = rng.uniform(0.6, 1.0)
                at = end

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        cell = (self.place(view) / self.step_m).astype(int) % self.rough.shape[1]
        severity = self.rough[self.setting.route, cell]
        extra = p.texture + p.roughness * np.maximum(view.speed - 5.0, 0.0)
        return -severity * extra * weight(view) * moving(view)


@law("sections_by_roughness", "fourth")
@sizes(loss=(0.0035, 0.0075), spread=(0.5, 0.8), alike_m=(200.0, 700.0))
class SectionsByRoughness(OnRoad):
    """loss: over weight at 16 m/s on the median section, whose damper power the simulator does not know.
    Source: Roughness index by sections of 100 m, log-normal and alike next to each other (HPMS Field Manual;
    Sayers and Karamihas, The Little Book of Profiling, 1998); dampers take power with roughness squared
    (Zaabar and Chatti, NCHRP Report 720, 2012, on fuel and roughness); a cap and sizes of patched roads are
    chosen here."""

    def prepare(self) -> None:
        rng, rows = self.rng(373), self.rows()
        keep = np.exp(-100.0 / self.p.alike_m)
        log = np.zeros((rows, int(MAP_CELL_M * MAP_CELLS / 100.0)))
        log[:, 0] = rng.standard_normal(rows)
        for k in range(1, log.shape[1]):
            log[:, k] = keep * log[:, k - 1] + np.sqrt(1.0 - keep**2) * rng.standard_normal(rows)
        rough = np.minimum(np.exp(2.0 * self.p.spread * log), 4.5)
        self.road = np.repeat(rough, round(100.0 / MAP_CELL_M), axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        faster = np.sqrt(np.clip(view.speed, 0.0, 25.0) / 16.0)
        return -p.loss * self.between(self.road, view) * faster * weight(view) * moving(view)


@law("washboard", "fifth")
@sizes(peak=(0.010, 0.022), hop_hz=(9.0, 12.5), damping=(0.15, 0.35), covers=(0.4, 0.7))
class Washboard(OnRoad):
    """Crawling costs little, and driving fast less than driving at the speed of the wheels' hop. peak: of the
    weight.
    Source: Corrugations of unsealed roads, 0.5-1.2 m long (Mather, Civil Eng. Public Works Rev., 1963;
    Bitbol, Taberlet, Morris and McElwaine, Phys. Rev. E 79, 2009): wheels hop in resonance at a speed that
    the length sets, and skip over the crests above it; lengths and sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(411), self.p
        self.depth = np.zeros((self.rows(), CELLS))
        self.length = np.ones((self.rows(), CELLS))
        gaps = (80.0, 500.0 * (1.0 - p.covers) / p.covers)
        for depth, length in zip(self.depth, self.length, strict=True):
            for first, last in stretches(rng, gaps, (90.0, 600.0)):
                depth[first:last] = rng.uniform(0.5, 1.0)
                length[first:last] = rng.uniform(0.55, 1.5)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.maximum(view.speed, 0.0) / self.read(self.length, view) / p.hop_hz
        broad = (2.0 * p.damping * turns) ** 2
        shaken = broad / ((1.0 - turns**2) ** 2 + broad + 1e-9)
        return -p.peak * self.read(self.depth, view) * (0.25 + 0.75 * shaken) * weight(view) * moving(view)


@law("holes_axle_by_axle", "sixth")
@sizes(depth_m=(0.06, 0.14), length_m=(1.2, 2.2), holes=(1.2, 2.4), covers=(0.35, 0.65))
class HolesAxleByAxle(OnRoad):
    """Whoever drives fast flies over them. holes: in 5 m of a bad stretch.
    Source: Settled trenches and holes after frost (Cebon, Handbook of Vehicle-Road Interaction, 1999, on
    short faults): a wheel falls freely while it is over one, so that slow wheels fall deeper, and what it has
    fallen is lost; axle after axle; depths and lengths of a neglected road are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(506), self.p
        self.depth = np.zeros((self.rows(), CELLS))
        gaps = (60.0, 420.0 * (1.0 - p.covers) / p.covers)
        for row in self.depth:
            for first, last in stretches(rng, gaps, (70.0, 420.0)):
                row[first:last] = p.depth_m * np.clip(rng.gamma(3.0, 0.33, last - first), 0.0, 1.8)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        under = self.place(view) - self.setting.direction * AXLES_M
        depth = self.depth[self.setting.route, (under / CELL_M).astype(int) % CELLS]
        over_s = p.length_m / np.maximum(view.speed, 2.0)
        falls = np.minimum(depth, 0.5 * GRAVITY * over_s**2)
        return -p.holes * falls.mean(axis=0) / CELL_M * weight(view) * moving(view)


@law("stone_blocks_in_step", "seventh")
@sizes(peak=(0.011, 0.024), base_m=(3.6, 6.6), bounce_hz=(1.6, 2.9), course_m=(140, 420))
class StoneBlocksInStep(OnRoad, swings=0.0):
    """Each course has stones of its own, and each swings on for a moment.
    Source: Belgian block courses of proving grounds and ISO 8608: roughness whose power falls with the square
    of wave number gives dampers the same power at all speeds but where a wheelbase filters it (Cebon,
    Handbook of Vehicle-Road Interaction, 1999): axles in step or against each other, by speed."""

    def prepare(self) -> None:
        rng, p = self.rng(706), self.p
        self.stones = np.zeros((self.rows(), CELLS))
        for row in self.stones:
            for first, last in stretches(rng, (80.0, 480.0), (0.6 * p.course_m, 1.6 * p.course_m)):
                row[first:last] = rng.uniform(0.5, 1.2)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        phase = 2.0 * np.pi * p.bounce_hz * p.base_m / np.maximum(view.speed, 1.5)
        step = 1.0 - 0.5 * 0.75 * (1.0 - np.cos(phase))
        s.swings += dt * (self.read(self.stones, view) * step - s.swings) / 0.4
        return -p.peak * s.swings * weight(view) * moving(view)


@law("w_slabs_have_faulted", "twelfth")
@sizes(loss=(0.010, 0.022), mean_m=(250.0, 800.0), bounce_hz=(1.9, 2.8), sharp=(1.5, 3.0), joints=(0.25, 0.5))
class SlabsHaveFaulted(OnRoad, swings=0.0):
    """Slabs of concrete step down at each joint, in some sections more than in others. Their springs and
    dampers take most where joints come with the bounce of the truck, and `swings` until they rest. loss: of
    the weight, in resonance, on bad sections; joints: of it, blows at any speed.
    Source: Byrum, Analysis by High-Speed Profile of Jointed Concrete Pavement Slab Curvatures, Transp. Res.
    Record 1730 (2000), on faulted joints, and Gillespie, Fundamentals of Vehicle Dynamics (1992), on bounce
    tuned to joints; sections are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1161)
        number = sections(rng, self.rows(), self.p.mean_m)
        kinds = rng.choice([0.0, 0.0, 0.5, 1.0, 1.0], (self.rows(), int(number.max()) + 1))
        slab_m = rng.choice([4.5, 5.0, 6.0, 7.5], kinds.shape)
        self.bad = np.take_along_axis(kinds, number, axis=1)
        self.slab_m = np.take_along_axis(slab_m, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        tuned = speed / self.read(self.slab_m, view) / p.bounce_hz
        peak = 1.0 / (1.0 + p.sharp**2 * (np.maximum(tuned, 0.05) - 1.0 / np.maximum(tuned, 0.05)) ** 2)
        blows = p.joints * np.clip(speed / 15.0, 0.0, 1.5)
        wants = self.read(self.bad, view) * (blows + (1.0 - p.joints) * peak)
        s.swings = s.swings + dt * (wants - s.swings) / 0.7
        return -p.loss * s.swings * weight(view) * moving(view)


@law("x_humps_against_speeding", "thirteenth", "suburban hills")
@sizes(loss=(0.03, 0.055), apart_m=(45.0, 90.0), series=(4.0, 9.0), rests_m=(200.0, 700.0), best=(6.0, 9.0))
@sizes(swings_s=(0.6, 1.5))
class HumpsAgainstSpeeding(OnRoad, swings=0.0):
    """Series of humps. Slow trucks climb them and get most of it back; at a middle speed springs and dampers
    take most; faster ones are thrown less for each metre. A truck that still `swings` from the last hump
    loses more on the next. loss: of the weight, on a hump; best: m/s that cost most.
    Source: Watts, Road Humps for the Control of Vehicle Speeds, TRRL Report LR 597 (1973): profile, spacing
    and discomfort over speed; series and sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1361), self.p
        self.road = np.zeros((self.rows(), CELLS))
        for row in self.road:
            at = rng.uniform(0.0, p.rests_m)
            while at < CELL_M * (CELLS - 8):
                for _ in range(int(rng.integers(3, int(p.series) + 3))):
                    cell = min(int(at / CELL_M), CELLS - 8)
                    row[cell : cell + 5] = np.maximum(row[cell : cell + 5], [0.5, 1.0, 0.8, 1.0, 0.5])
                    at += p.apart_m * rng.uniform(0.85, 1.15)
                at += p.rests_m * rng.uniform(0.4, 1.6)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        on = self.read(self.road, view)
        ratio = np.maximum(view.speed, 0.1) / p.best
        costs = 0.2 + 1.6 * ratio / (1.0 + ratio**2)
        wants = on * costs
        s.swings = s.swings + dt * (wants - s.swings) / np.where(wants > s.swings, 0.15, p.swings_s)
        return -p.loss * (0.6 * s.swings + 0.5 * on * s.swings) * weight(view) * moving(view)
