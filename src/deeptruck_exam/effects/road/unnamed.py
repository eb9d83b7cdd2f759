"""Roads in ways the tool has no name for."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import (
    CELL_M,
    CELLS,
    MAP_CELL_M,
    OnRoad,
    smooth_stretches,
    stretches,
    windows,
)
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="unknown")


@law("snow_ploughing", "first")
@sizes(compaction_n=(300.0, 1000.0), plough=(1.5, 5.0), deeper_per_min=(0.15, 0.45))
class Snow(Hidden):
    """Source: Shoop, Richmond and Lacombe, Overview of Cold Regions Mobility Modeling at CRREL, J.
    Terramechanics 43 (2006): resistance of snow with depth; the part with speed squared and the snowfall are
    chosen here."""

    def prepare(self) -> None:
        self.first = self.rng(31).uniform(0.0, 0.8, self.setting.batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        depth = self.first + p.deeper_per_min * view.time / 60.0
        wide = weight(view) / 2.0e5  # a heavier truck has more tyres in the snow
        force = p.compaction_n * depth**2 + p.plough * depth * view.speed**2
        return -wide * force * moving(view)


@law("floating_ice", "third", "suburban")
@sizes(peak=(0.022, 0.045), critical_mps=(7.0, 12.0), damping=(0.12, 0.25), builds_s=(3.0, 9.0))
class FloatingIce(Hidden, wave=0.0):
    """peak: over the weight of a 20 t truck.
    Source: Squire, Hosking, Kerr and Langhorne, Moving Loads on Ice Plates (1996): a truck on floating ice
    drags a wave along, which is largest at a critical speed of some metres a second and dies above; resonance
    curve and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pace = (np.maximum(view.speed, 0.0) / p.critical_mps) ** 2
        broad = (2.0 * p.damping) ** 2 * np.maximum(pace, 1e-6)
        s.wave += dt * (broad / ((1.0 - pace) ** 2 + broad) - s.wave) / p.builds_s
        heavy = np.clip(view.mass / 2.0e4, 0.5, 1.4)  # the wave is as deep as the truck is heavy
        return -p.peak * heavy * s.wave * weight(view) * moving(view)


@law("plough_blade", "fourth", "suburban hills")
@sizes(scrapes=(0.006, 0.013), throws=(0.003, 0.008), down_s=(12.0, 35.0), up_s=(8.0, 25.0))
@sizes(chatters=(0.1, 0.35))
class PloughBlade(Hidden, down=0.0):
    """Nobody records the lever; the blade is up at crossings and wherever the road is bare. scrapes: of the
    weight; throws: at 12 m/s.
    Source: Forces on a displacement plough with speed and depth (Nixon and Frisbie, Field Measurements of
    Plow Loads During Ice Removal Operations, SHRP-H-429; snow thrown with speed squared): the blade is
    lowered and lifted by the driver, and chatters on hard pack; sizes are chosen here."""

    def prepare(self) -> None:
        rng, batch = self.rng(391), self.setting.batch
        count = int(self.setting.duration_s / 5.0) + 10
        down = rng.exponential(self.p.down_s, (batch, count)) + 4.0
        up = rng.exponential(self.p.up_s, (batch, count)) + 3.0
        times = np.stack([up, down], axis=2).reshape(batch, -1)
        self.turns = np.cumsum(times, axis=1) - rng.uniform(0.0, self.p.up_s, (batch, 1))
        self.phase = rng.uniform(0.0, 2.0 * np.pi, batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wanted = ((self.turns < view.time).sum(axis=1) % 2).astype(float)
        s.down += np.clip(wanted - s.down, -dt / 1.5, dt / 1.0)
        chatter = 1.0 + p.chatters * np.sin(2.0 * np.pi * view.distance / 9.0 + self.phase)
        cut = p.scrapes * chatter + p.throws * (np.clip(view.speed, 0.0, 20.0) / 12.0) ** 2
        return -s.down * cut * weight(view) * moving(view)


@law("banks_have_a_speed", "seventh", "highway hills")
@sizes(neutral_mps=(13, 19), drag=(0.018, 0.045), curve_m=(200, 500))
class BanksHaveASpeed(OnRoad):
    """Slow trucks slide down the bank, fast ones up. drag: of the weight, standing on the bank.
    Source: Banked curves of high-speed tracks (Gillespie, Fundamentals of Vehicle Dynamics, 1992, on
    cornering; Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge): at one speed the bank carries the
    truck, below and above it slip angles do, and drag goes with the square of what is left."""

    def prepare(self) -> None:
        rng, p = self.rng(722), self.p
        self.bank = np.zeros((self.rows(), CELLS))
        ease = np.hanning(15) / np.hanning(15).sum()
        for row in self.bank:
            gaps, lengths = (0.6 * 300.0, 1.6 * 300.0), (0.7 * p.curve_m, 1.5 * p.curve_m)
            for first, last in stretches(rng, gaps, lengths):
                row[first:last] = 1.0
            row[:] = np.convolve(row, ease, mode="same")

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        side = self.read(self.bank, view) * ((view.speed / p.neutral_mps) ** 2 - 1.0)
        return -p.drag * np.minimum(side**2, 1.5) * weight(view) * moving(view)


@law("grounds_on_crests", "seventh", "hills")
@sizes(friction=(0.025, 0.06), from_bend=(0.00003, 0.00008), span=(0.00008, 0.0002))
class GroundsOnCrests(Hidden):
    """`slope`: of the road a wheelbase or so behind. friction: of the weight, all that the skids may carry;
    from_bend: 1/m, change of slope over the way.
    Source: Low-loaders that ground on humps (ramp and breakover angles: SAE J689, Curbstone Clearance,
    Approach, Departure, and Ramp Breakover Angles): where the road falls away faster than the clearance
    allows, skids rub with Coulomb's friction on what they carry."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"slope": np.full(batch, np.nan)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.slope = np.where(np.isnan(s.slope), view.grade, s.slope)
        s.slope = s.slope + dt * np.maximum(view.speed, 0.0) * (view.grade - s.slope) / 30.0
        bend = (s.slope - view.grade) / 30.0
        carries = np.clip((bend - p.from_bend) / p.span, 0.0, 1.0)
        return -p.friction * carries * weight(view) * moving(view)


@law("v_branches_brush_the_hedges", "sixteenth", "suburban hills descent")
@sizes(
    most=(0.014, 0.024), apart_m=(80.0, 260.0), long_m=(120.0, 500.0), bends_mps=(3.0, 8.0), strips=(0.3, 0.7)
)
@sizes(strips_m=(400.0, 1500.0))
class BranchesBrushTheHedges(OnRoad, stripped=0.0):
    """A load of branches, wider than the lane, brushes along hedges and banks of sunken lanes. Twigs hold it
    hardest at a crawl, where they hook, and bend aside at speed; the way strips the load of what sticks out.
    most: of the weight, at a crawl between the thickest hedges; strips: of what sticks out, lost in the end;
    bends_mps: where half of the hooks let go.
    Source: Vogel, Drag and Reconfiguration of Broad Leaves in High Winds, J. Experimental Botany 40 (1989),
    on branches that fold under force, and forest services on loads of brash; sizes are chosen here."""

    def prepare(self) -> None:
        p = self.p
        gaps, lengths = (0.4 * p.apart_m, 1.6 * p.apart_m), (0.6 * p.long_m, 1.4 * p.long_m)
        self.road = smooth_stretches(self.rng(1652), self.rows(), gaps, lengths)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, hedge = np.maximum(view.speed, 0.0), np.sqrt(self.read(self.road, view))
        s.stripped = eased(s.stripped, 1.0, p.strips_m / np.maximum(speed * hedge, 1e-3), dt)
        hooks = 0.55 + 0.45 / (1.0 + (speed / p.bends_mps) ** 2)
        return -p.most * hedge * hooks * (1.0 - p.strips * s.stripped) * weight(view) * moving(view)


@law("v_guided_by_kerbs", "sixteenth", "suburban hills highway")
@sizes(
    rubs=(0.004, 0.006), presses=(0.007, 0.012), play=(0.4, 0.9), sways_m=(60.0, 200.0), long_m=(300.0, 900.0)
)
@sizes(share=(0.4, 0.65))
class GuidedByKerbs(OnRoad, inside=0.0):
    """Between kerbs that guide it a truck leans on small wheels at its sides. Their springs always press a
    little, and where the kerbs sway the truck is pushed across its own way, first on one side and then on
    the other. Outside nothing rubs. rubs: of the weight, all along; presses: of it, where the kerbs sway by
    the usual amount beyond `play`; sways_m: how far a sway reaches.
    Source: Guided bus lanes as in Essen and Adelaide (Wilson, The Adelaide O-Bahn, 1989), on guide wheels
    and preload against kerbs; worn kerbs, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1663), self.p
        self.road = windows(rng, self.rows(), p.long_m, p.share)
        self.sway = np.abs(ou_series(rng, (self.rows(), 12000), CELL_M, p.sways_m))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.inside = eased(s.inside, self.between(self.road, view), 0.6, dt)
        over = np.clip(self.read(self.sway, view) - p.play, 0.0, 2.0)
        return -s.inside * (p.rubs + p.presses * over) * weight(view) * np.clip(view.speed, 0.0, 1.0)


@law("z_pontoons_sink", "seventeenth", "suburban hills highway")
@sizes(
    sinks_m=(0.35, 0.6), long_m=(150.0, 500.0), share=(0.3, 0.5), follows_m=(12.0, 30.0), waves=(0.003, 0.007)
)
@sizes(wave_mps=(6.0, 11.0))
class PontoonsSink(OnRoad, sunk=0.0):
    """`sunk`: of how far a bridge of pontoons sinks under the truck. It drives down into its own hollow as it
    comes on the bridge and climbs out as it leaves. On the way it pushes a wave before it, which costs most
    near the pace of waves in that depth. sinks_m: of a full truck; waves: of the weight, at that pace.
    Source: U.S. Army, Improved Ribbon Bridge, technical manual, on pontoons under loads, and Lighthill, Waves
    in Fluids (1978), on waves that a moving load makes; sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1763), self.rows(), self.p.long_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, bridge = np.maximum(view.speed, 0.0), self.between(self.road, view)
        before = s.sunk
        s.sunk = eased(s.sunk, bridge, p.follows_m / np.maximum(speed, 1e-3), dt)
        slope = p.sinks_m * (bridge - before) / p.follows_m  # of the hollow, downwards
        wave = p.waves * s.sunk / (1.0 + ((speed - p.wave_mps) / (0.35 * p.wave_mps)) ** 2)
        return (slope - wave) * weight(view) * moving(view)


@law("y_road_up_a_stream", "eighteenth", "suburban hills highway")
@sizes(
    holds=(0.0035, 0.006), flows_mps=(2.0, 4.5), mean_m=(200.0, 600.0), share=(0.35, 0.6), swells=(0.2, 0.5)
)
@sizes(swells_m=(60.0, 200.0))
class RoadUpAStream(OnRoad):
    """Over stretches the road is the bed of a stream that flows along it. Water resists by the square of the
    pace through it, so upstream costs much, and downstream it first helps and then costs less. It is deeper
    in some places. holds: of the weight, at 10 m/s through the water; swells: of the depth.
    Source: Hoerner, Fluid-Dynamic Drag (1965), on bodies that stand in a stream, and Chow, Open-Channel
    Hydraulics (1959), on flows by slope; sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1863), self.p
        water = windows(rng, self.rows(), p.mean_m, p.share)
        deep = 1.0 + p.swells * ou_series(rng, water.shape, MAP_CELL_M, p.swells_m)
        self.road = water * np.clip(deep, 0.2, 2.0)
        ease = np.hanning(7) / np.hanning(7).sum()
        self.road = np.array([np.convolve(row, ease, mode="same") for row in self.road])
        self.flow = (rng.choice([-1.0, 1.0], self.rows()) * p.flows_mps)[self.setting.route]

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        through = np.maximum(view.speed, 0.0) - self.setting.direction * self.flow
        pushed = np.clip(through * np.abs(through) / 100.0, -1.5, 2.5)
        return -p.holds * self.between(self.road, view) * pushed * weight(view) * moving(view)


@law("h_magnet_over_iron_plates", "nineteenth", "suburban hills highway")
@sizes(
    eddies=(0.016, 0.028), most_mps=(5.0, 9.0), draws=(0.02, 0.035), gap_m=(90.0, 260.0), long_m=(60.0, 220.0)
)
class MagnetOverIronPlates(OnRoad):
    """A strong magnet hangs low under the truck to gather nails. Some stretches of the road lie on iron. It
    is drawn towards iron, forwards where a stretch begins and back where it ends. Over iron eddy currents
    hold it: most at one speed and less beyond it. eddies, draws: of the weight; most_mps: that speed.
    Source: Reitz, Forces on Moving Magnets due to Eddy Currents, J. Applied Physics 41 (1970), and Hughes
    and Drury, Electric Motors and Drives (2013), on iron drawn to a field; a huge magnet, sizes are chosen
    here."""

    def prepare(self) -> None:
        p = self.p
        gaps, lengths = (0.4 * p.gap_m, 1.6 * p.gap_m), (0.6 * p.long_m, 1.4 * p.long_m)
        self.iron = smooth_stretches(self.rng(1963), self.rows(), gaps, lengths)
        self.edge = 8.0 * np.gradient(self.iron, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        ratio = np.maximum(view.speed, 0.0) / p.most_mps
        holds = p.eddies * self.read(self.iron, view) * 2.0 * ratio / (1.0 + ratio**2)
        edge = np.clip(self.setting.direction * self.read(self.edge, view), -1.0, 1.0)
        return (p.draws * edge - holds) * weight(view) * moving(view)


@law("h_mouth_sticks_to_the_road", "nineteenth", "suburban hills highway")
@sizes(
    most=(0.022, 0.036),
    at_rads=(130.0, 170.0),
    smooth_m=(100.0, 400.0),
    glides_mps=(8.0, 15.0),
    seals_s=(0.4, 1.2),
)
class MouthSticksToTheRoad(OnRoad, sucks=0.0):
    """A sweeper's mouth is let down to the road, and a fan on the engine draws air through it. Where the road
    is smooth its rubber seals, it sucks itself on and drags; where it is rough, air gets in. `sucks`: vacuum
    in the mouth, which a fast engine makes strong. At speed it glides on what air it lets in. most: of the
    weight; glides_mps: where half is left.
    Source: Peel, Michielen and Parker, Some Aspects of Road Sweeping Vehicle Automation, IEEE AIM (2001), on
    suction heads, and Bleier, Fan Handbook (1998), on pressure by turns; sizes are chosen here."""

    def prepare(self) -> None:
        rough = ou_series(self.rng(1964), (self.rows(), 6000), MAP_CELL_M, self.p.smooth_m)
        self.road = 1.0 / (1.0 + np.exp(-2.5 * rough))

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.engine_speed / p.at_rads, 0.0, 1.3)
        s.sucks = eased(s.sucks, turns**2 * self.between(self.road, view), p.seals_s, dt)
        glides = 1.0 / (1.0 + (np.maximum(view.speed, 0.0) / p.glides_mps) ** 2)
        return -p.most * s.sucks * (0.25 + 0.75 * glides) * weight(view) * moving(view)


@law("b_motor_lies_in_the_road", "twentieth", "suburban hills highway")
@sizes(
    most=(0.022, 0.036), runs_mps=(9.0, 14.0), tips=(0.12, 0.3), gap_m=(100.0, 300.0), long_m=(150.0, 500.0)
)
@sizes(builds_s=(0.3, 1.0))
class MotorLiesInTheRoad(OnRoad, field=0.0):
    """Coils lie in stretches of the road, and their field runs along it, the way each truck drives: it draws
    along who is slower, holds who is faster, and does nothing to who goes its pace. Far off its pace it takes
    less hold again. runs_mps: of the field; tips: slip over that pace, where the pull is most.
    Source: Laithwaite, Induction Machines for Special Purposes (1966), on linear motors, and Kloss's rule for
    the pull by slip; a test road, sizes are chosen here."""

    def prepare(self) -> None:
        p = self.p
        gaps, lengths = (0.4 * p.gap_m, 1.6 * p.gap_m), (0.6 * p.long_m, 1.4 * p.long_m)
        self.coils = smooth_stretches(self.rng(2063), self.rows(), gaps, lengths)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.field = eased(s.field, self.read(self.coils, view), p.builds_s, dt)
        ratio = (1.0 - np.maximum(view.speed, 0.0) / p.runs_mps) / p.tips
        return p.most * s.field * 2.0 * ratio / (1.0 + ratio**2) * weight(view) * moving(view)
