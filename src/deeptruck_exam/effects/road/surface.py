"""Road surfaces that resist: what lies on the road, and ground that gives way."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, eased, index, moving, weight
from deeptruck_exam.effects.places import (
    CELL_M,
    CELLS,
    MAP_CELL_M,
    MAP_CELLS,
    OnRoad,
    sections,
    smooth_stretches,
    stretches,
    windows,
)
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series, spells, within
from deeptruck_model.trucks import View

law = partial(hidden, name="road_surface", accepts="road_grade")
GRADERS = 16


@law("standing_water", "second")
@sizes(film=(0.35, 1.0), gap_m=(250.0, 600.0), pool_m=(150.0, 500.0), driest=(0.4, 0.9))
class StandingWater(OnRoad):
    """film: N for each 1 kN of weight at 15 m/s would be 7.6 times it.
    Source: Gengenbach (1968), in Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge: splash resistance of
    a tyre with its width, water depth and the power 1.6 of speed; where the water stands, and how much of it
    each day, are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(151), self.p
        self.road = smooth_stretches(
            rng, self.rows(), (0.6 * p.gap_m, 1.6 * p.gap_m), (0.7 * p.pool_m, 1.8 * p.pool_m)
        )
        self.wet = rng.uniform(p.driest, 1.0, self.setting.batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        splash = 0.01 * (np.clip(view.speed, 0.0, 22.0) / 15.0) ** 1.6  # beyond it the tyres float
        return -p.film * self.wet * self.read(self.road, view) * splash * weight(view) * moving(view)


@law("soft_ground", "third")
@sizes(loss=(0.012, 0.028), half_mps=(6.0, 14.0), mean_m=(350.0, 900.0))
class SoftGround(OnRoad):
    """loss: over weight at walking pace on the softest.
    Source: Louhghalam, Akbarian and Ulm, Scaling Relationships of Dissipation-Induced Pavement-Vehicle
    Interactions, Transportation Research Record 2457 (2014): a viscous road costs the more the slower one
    drives; classes from concrete to unbound ground, sizes chosen here."""

    def prepare(self) -> None:
        rng = self.rng(251)
        number = sections(rng, self.rows(), self.p.mean_m)
        classes = rng.choice([0.0, 0.0, 0.45, 1.0], (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(classes, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slow = p.half_mps / (p.half_mps + np.maximum(view.speed, 0.0))
        return -p.loss * self.read(self.road, view) * slow * weight(view) * moving(view)


@law("snow_drifts", "fourth")
@sizes(compacts=(0.016, 0.034), throws=(0.006, 0.016), each_m=(350.0, 900.0), lee_m=(60.0, 200.0))
class SnowDrifts(OnRoad):
    """compacts: of the weight, in the deepest; throws: at 15 m/s.
    Source: Drifts behind fences and cuttings (Tabler, Controlling Blowing and Drifting Snow with Snow Fences
    and Road Design, NCHRP 20-7(147), 2003), steep to windward and long to leeward; compaction and thrown snow
    with speed squared (van Es, J. Aircraft 36, 1999); traffic wears them down from drive to drive; sizes are
    chosen here."""

    def prepare(self) -> None:
        rng, rows = self.rng(374), self.rows()
        self.road = np.zeros((rows, MAP_CELLS))
        cells = np.arange(MAP_CELLS) * MAP_CELL_M
        for row in self.road:
            crests = np.cumsum(rng.exponential(self.p.each_m, 400) + 120.0)
            for crest in crests[crests < MAP_CELL_M * MAP_CELLS]:
                away = cells - crest
                length = np.where(away < 0.0, 20.0, self.p.lee_m)
                row[:] = np.maximum(row, rng.uniform(0.5, 1.0) * np.exp(-np.abs(away) / length))
        self.left = rng.uniform(0.6, 1.0, self.setting.batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        depth = self.between(self.road, view) * self.left
        pace = (np.clip(view.speed, 0.0, 25.0) / 15.0) ** 2
        return -depth * (p.compacts * depth + p.throws * pace) * weight(view) * moving(view)


@law("chippings", "fifth")
@sizes(drags=(0.010, 0.024), passes=(1.5, 5.0), pushes_mps=(7.0, 16.0), site_m=(250.0, 700.0))
class Chippings(OnRoad):
    """Later drives find less of it.
    Source: Surface dressing: loose chippings are rolled into the binder by traffic, pass by pass, and drag
    until then (TRL Road Note 39, Design Guide for Road Surface Dressing); a wheel pushes a wave of them from
    a speed on (Wong, Theory of Ground Vehicles, on bulldozing); sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(412), self.setting.batch
        self.loose = np.zeros((self.rows(), CELLS))
        for row in self.loose:
            for first, last in stretches(rng, (150.0, 600.0), (0.6 * self.p.site_m, 2.0 * self.p.site_m)):
                fresh = rng.uniform(0.6, 1.0)
                row[first:last] = fresh * rng.uniform(0.6, 1.3, last - first)
        order = rng.permutation(batch)
        self.left = np.exp(-order * 0.5 / self.p.passes)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lies = self.read(self.loose, view) * self.left
        speed = np.maximum(view.speed, 0.0)
        wave = 0.55 + 0.45 * np.tanh(speed / p.pushes_mps) ** 2
        return -p.drags * lies * wave * weight(view) * moving(view)


@law("s_pavement_bends", "eighth")
@sizes(loss=(0.010, 0.022), slow_mps=(5.0, 14.0), share=(0.3, 0.6), mean_m=(300.0, 900.0))
class PavementBends(OnRoad):
    """loss: of the weight, at walking pace. Slow trucks sink deeper.
    Source: Louhghalam, Akbarian and Ulm, Flügge's Conjecture: Dissipation- versus Deflection-Induced
    Pavement-Vehicle Interactions, J. Eng. Mech. 140 (2014): loss falls with speed; soft asphalt, sizes are
    chosen here."""

    def prepare(self) -> None:
        self.soft = windows(self.rng(832), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        slow = 1.0 / (1.0 + np.maximum(view.speed, 0.0) / p.slow_mps)
        return -2.0 * p.loss * slow * self.between(self.soft, view) * weight(view) * moving(view)


@law("n_clay_sticks", "ninth")
@sizes(
    soft=(0.006, 0.014), sticks=(0.008, 0.016), picks_m=(60.0, 200.0), sheds_m=(120.0, 450.0),
    share=(0.25, 0.45), mean_m=(150.0, 500.0),
)  # fmt: skip
class ClaySticks(OnRoad, clod=0.0):
    """Stretches of clay hold the wheels and load them with it; beyond, it is thrown off over the way, sooner
    at speed. soft, sticks: of the weight.
    Source: Bekker, Introduction to Terrain-Vehicle Systems (1969), on adhesive soils, and rules on mud that
    trucks carry from sites onto roads; lengths and sizes are chosen here."""

    def prepare(self) -> None:
        self.clay = windows(self.rng(942), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        here, speed = self.between(self.clay, view), np.maximum(view.speed, 0.0)
        picks = here * (1.0 - s.clod) / p.picks_m
        sheds = (1.0 - here) * s.clod * np.clip(speed / 10.0, 0.2, 2.0) / p.sheds_m
        s.clod = np.clip(s.clod + dt * speed * (picks - sheds), 0.0, 1.0)
        return -(p.soft * here + p.sticks * s.clod) * weight(view) * moving(view)


@law("t_dunes_creep_over", "tenth")
@sizes(resists=(0.014, 0.032), dune_m=(40.0, 130.0), apart_m=(60.0, 260.0), ploughs=(0.3, 0.9))
class DunesCreepOver(OnRoad):
    """`deep` (routes, cells): sand that thickens slowly to a crest and ends steeply. Rear axles follow in the
    ruts. resists: of the weight, at the crest; ploughs: more of it, at 15 m/s.
    Source: Bagnold, The Physics of Blown Sand and Desert Dunes (1941), on barchans, and Wong, Theory of
    Ground Vehicles (2008), on compaction and bulldozing resistance in sand; sizes are chosen here."""

    wheelbase_m = 6.0

    def prepare(self) -> None:
        rng, p = self.rng(988), self.p
        self.deep = np.zeros((self.rows(), CELLS))
        gaps, lengths = (0.5 * p.apart_m, 1.5 * p.apart_m), (0.6 * p.dune_m, 1.6 * p.dune_m)
        for row in self.deep:
            for first, last in stretches(rng, gaps, lengths):
                along = (np.arange(last - first) + 0.5) / (last - first)
                dune = np.minimum((along / 0.75) ** 1.3, (1.0 - along) / 0.25)
                row[first:last] = rng.uniform(0.5, 1.0) * dune

    def sand(self, view: View, behind_m: float) -> Array:
        """Depth, between the middles of cells."""
        at = (self.place(view) - self.setting.direction * behind_m) / CELL_M
        low, route = at.astype(int), self.setting.route
        share = at - np.floor(at)
        ends = (self.deep[route, low % CELLS], self.deep[route, (low + 1) % CELLS])
        return np.asarray((1.0 - share) * ends[0] + share * ends[1])

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        deep = 0.6 * self.sand(view, 0.0) + 0.4 * self.sand(view, self.wheelbase_m)
        faster = 1.0 + p.ploughs * np.clip(view.speed / 15.0, 0.0, 2.0) ** 2
        return -p.resists * deep * faster / (1.0 + p.ploughs) * weight(view) * moving(view)


@law("e_mat_over_the_bog", "eleventh")
@sizes(
    whole=(0.004, 0.009), torn=(0.016, 0.032), bears=(0.02, 0.045), sinks_m=(4.0, 15.0), out_m=(25.0, 90.0)
)
class MatOverTheBog(OnRoad, sunk=0.0):
    """A mat of roots bears the truck until its wheels shear it, by pull or brake; then they are in the peat,
    and come out over the way. whole, torn: of the weight; bears: shear over weight, more in some places than
    in others.
    Source: Wong, Radforth and Preston-Thomas, Some Further Studies on the Mechanical Properties of Muskeg in
    Relation to Vehicle Mobility, J. Terramechanics 19 (1982); stretches and sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1061)
        self.soft = np.zeros((self.rows(), CELLS))
        self.bears = np.full((self.rows(), CELLS), 1e3)
        for soft, bears in zip(self.soft, self.bears, strict=True):
            for first, last in stretches(rng, (60.0, 450.0), (90.0, 500.0)):
                soft[first:last] = 1.0
                bears[first:last] = self.p.bears * rng.lognormal(0.0, 0.35)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "on": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        way = dt * np.maximum(view.speed, 0.0)
        s.on = s.on + way * (self.read(self.soft, view) - s.on) / 6.0
        shear = np.maximum(np.abs(view.traction_force), view.brake_force) / weight(view)
        tears = np.clip((shear / self.read(self.bears, view) - 1.0) / 0.2, 0.0, 1.0)
        s.sunk = np.clip(s.sunk + way * (tears * (1.0 - s.sunk) / p.sinks_m - s.sunk / p.out_m), 0.0, 1.0)
        resists = p.whole + (p.torn - p.whole) * s.sunk
        return -resists * s.on * weight(view) * moving(view)


@law("k_ruts_are_climbed", "fourteenth", "suburban hills highway descent")
@sizes(most=(0.016, 0.03), apart_m=(150.0, 600.0), wanders_s=(2.0, 6.0), free=(0.2, 0.5))
class RutsAreClimbed(OnRoad):
    """Wheels that wander climb the sides of deep ruts and are pressed back by them: tyres then roll across
    their heading. In the middle of a rut nothing is lost. most: of the weight, in the deepest ruts; free: of
    the usual wander, that has room.
    Source: Pacejka, Tire and Vehicle Dynamics (2012), on side force by slip and camber, a rut's side taken as
    a slope, and Cebon, Handbook of Vehicle-Road Interaction (1999), on ruts; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1461), self.p
        self.road = smooth_stretches(rng, self.rows(), (0.4 * p.apart_m, 1.6 * p.apart_m), (300.0, 1500.0))
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        self.aside = np.abs(ou_series(rng, shape, 0.1, p.wanders_s))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        aside = self.aside[:, index(view, self.aside, 0.1)]
        climbs = np.clip(aside - p.free, 0.0, 2.0) ** 1.2
        return -p.most * self.read(self.road, view) * climbs * weight(view) * moving(view)


@law("q_gives_way_onto_the_shoulder", "fifteenth", "suburban hills", accepts="rolling_resistance")
@sizes(
    most=(0.028, 0.048), aside_s=(3.0, 8.0), between_s=(12.0, 40.0), soft=(0.5, 0.75), mean_m=(200.0, 800.0)
)
@sizes(sinks_mps=(6.0, 15.0))
class GivesWayOntoTheShoulder(OnRoad, aside=0.0):
    """On a narrow road the right wheels run on the shoulder while somebody comes the other way. Some
    shoulders are paved or dry; soft ones hold the wheels back, and the more, the slower they roll, for then
    they sink. most: of the weight; soft: of the road; sinks_mps: where sinking is a third of the most.
    Source: Wong, Theory of Ground Vehicles (2008), on motion resistance by sinkage and on its rate, and
    AASHTO, Guidelines for Geometric Design of Low-Volume Roads, on meeting there; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1561), self.p
        self.road = windows(rng, self.rows(), p.mean_m, p.soft)
        on, off = (0.6 * p.aside_s, 1.4 * p.aside_s), (0.5 * p.between_s, 1.5 * p.between_s)
        self.meets = spells(rng, self.setting.batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.aside = eased(s.aside, within(self.meets, view.time), 0.8, dt)
        sinks = 0.4 + 0.6 * np.exp(-np.maximum(view.speed, 0.0) / p.sinks_mps)
        soft = 0.05 + 0.95 * self.between(self.road, view)
        return -p.most * s.aside * soft * sinks * weight(view) * moving(view)


@law("v_bitumen_bleeds", "sixteenth", "suburban hills highway", accepts="rolling_resistance")
@sizes(
    most=(0.006, 0.01), power=(0.3, 0.5), mean_m=(150.0, 700.0), sunny=(0.3, 0.55), cleans_m=(150.0, 600.0)
)
@sizes(clouds_s=(40.0, 120.0))
class BitumenBleeds(OnRoad, coat=0.0):
    """`coat` of binder that tyres have picked up where the sun makes it bleed out of the road. They have to
    be peeled off it, which costs with a small power of speed; behind the patch the coat still clings to clean
    road, until it has worn off. Clouds cool it. most: of the weight, at 15 m/s; sunny: of the road.
    Source: Gent and Petrich, Adhesion of Viscoelastic Materials to Rigid Substrates, Proc. R. Soc. A 310
    (1969), on peeling with a power of speed, and Lesueur, The Colloidal Structure of Bitumen (2009); sizes
    are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1662)
        self.road = windows(rng, self.rows(), self.p.mean_m, self.p.sunny)
        shape = (self.setting.batch, int(self.setting.duration_s) + 5)
        self.sun = 0.75 + 0.25 * np.tanh(2.0 * ou_series(rng, shape, 1.0, self.p.clouds_s))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, bleeds = np.maximum(view.speed, 0.0), self.between(self.road, view)
        s.coat = eased(
            s.coat, bleeds, np.where(bleeds > s.coat, 30.0, p.cleans_m) / np.maximum(speed, 1e-3), dt
        )
        tack = self.sun[:, index(view, self.sun)] * (0.65 * bleeds + 0.35 * s.coat)
        return -p.most * tack * np.minimum(speed / 15.0, 1.8) ** p.power * weight(view) * moving(view)


@law("z_grader_is_ahead", "seventeenth", "suburban hills highway", accepts="rolling_resistance")
@sizes(
    most=(0.009, 0.015), firm_s=(90.0, 300.0), pace_mps=(2.0, 5.0), long_m=(300.0, 1200.0), rises=(0.3, 0.8)
)
class GraderIsAhead(OnRoad, loose=0.0):
    """Graders work along a gravel road, each over a length of its own. Where the blade has just been the
    gravel lies loose, and traffic makes it firm again in minutes. So a place resists by the time since the
    blade was there, and the road ahead of the blade is firm. most: of the weight, fresh; rises: power of the
    firmness with speed.
    Source: Keller and Sherar, Low-Volume Roads Engineering (2003), on blading and on traffic that compacts,
    and Wong, Theory of Ground Vehicles (2008), on passes over loose ground; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p, shape = self.rng(1762), self.p, (self.rows(), GRADERS)
        spaced = 20000.0 * (np.arange(GRADERS) + rng.uniform(0.1, 0.9, shape)) / GRADERS + 2000.0
        pace = rng.choice([-1.0, 1.0], shape) * p.pace_mps * rng.uniform(0.7, 1.3, shape)
        long = p.long_m * rng.uniform(0.7, 1.3, shape)
        self.first, self.pace, self.long = (rows[self.setting.route] for rows in (spaced, pace, long))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        way = (self.place(view)[:, None] - self.first) * np.sign(self.pace)  # beyond where a grader began
        ago = view.time + 150.0 - way / np.abs(self.pace)  # since its blade was here
        bladed = (way > 0.0) & (way < self.long) & (ago > 0.0)
        fresh = np.where(bladed, np.exp(-np.maximum(ago, 0.0) / p.firm_s), 0.0).max(axis=1)
        speed = np.maximum(view.speed, 0.0)
        s.loose = eased(s.loose, fresh, 12.0 / np.maximum(speed, 0.5), dt)
        return (
            -p.most * s.loose * np.minimum(speed / 12.0, 2.0) ** (0.5 * p.rises) * weight(view) * moving(view)
        )
