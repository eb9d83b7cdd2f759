"""Losses between flywheel and wheel."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="driveline_loss", accepts="torque_gain")


@law("driveline_loss", "first")
@sizes(mesh=(0.05, 0.11), churning_n=(100.0, 500.0))
class MeshAndChurning(Hidden):
    """churning_n: churning at 20 m/s.
    Source: ISO/TR 14179-2 mesh losses in proportion to load, either way; Changenet and Velex, J. Mech. Des.
    129 (2007): churning with the power 1.5 of speed."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        churning = p.churning_n * np.maximum(view.speed / 20.0, 0.0) ** 1.5
        return -(p.mesh * np.abs(view.traction_force) + churning) * moving(view)


@law("countershaft_and_hypoid", "second")
@sizes(countershaft=(0.06, 0.12), axle=(0.02, 0.05), coast=(1.5, 3.0), cold_nm=(30.0, 90.0))
@sizes(heat_j=(0.6e6, 2.0e6))
class CountershaftAndHypoid(Hidden, heat=0.0):
    """cold_nm: at the flywheel.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on losses: the direct
    gear passes no mesh of the countershaft, the others two; hypoid axles lose more on the coast flank; drag
    of cold oil falls as the loss itself heats it; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        direct = np.abs(view.ratio / self.truck.final_drive - 1.0) < 0.05
        share = p.axle * np.where(view.traction_force < 0.0, p.coast, 1.0) + p.countershaft * ~direct
        cold = self.at_wheels(view, p.cold_nm * np.exp(-s.heat))
        lost = share * np.abs(view.traction_force) + cold
        s.heat += dt * lost * np.maximum(view.speed, 0.0) / p.heat_j
        return -lost * moving(view)


@law("standard_losses", "third", accepts="torque_gain engine_friction")
@sizes(constant_nm=(20.0, 60.0), per_1000rpm_nm=(25.0, 75.0), share=(0.03, 0.08))
class StandardLosses(Hidden):
    """drag before the gearbox is drag of the engine.
    Source: Commission Regulation (EU) 2017/2400, annex VI (VECTO): torque loss at the input shaft as a
    constant, a part linear in its speed and a share of the torque carried; several times the standard values,
    as of worn bearings and wrong oil."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        drag = p.constant_nm + p.per_1000rpm_nm * view.engine_speed / 104.7
        lost = self.at_wheels(view, drag) + p.share * np.maximum(view.traction_force, 0.0)
        return -lost * moving(view)


@law("palmgren_and_cold_sumps", "fourth")
@sizes(cold_n=(1000.0, 2200.0), thins=(1.8, 2.8), load=(0.04, 0.09), warms_j=(1.0e6, 3.5e6))
class PalmgrenAndColdSumps(Hidden):
    """Some drives start with the sumps warm from the last. cold_n: of a 20 t truck at 20 m/s.
    Source: Palmgren, Grundlagen der Wälzlagertechnik: friction of bearings as the power 2/3 of viscosity
    times speed and a part with the load; viscosity of 75W-90 falls tenfold as a sump warms by its own losses;
    too much oil of the wrong grade, sizes chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(330).uniform(0.0, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        size, speed = np.clip(view.mass / 2.0e4, 0.5, 1.6), np.maximum(view.speed, 0.0)
        viscous = p.cold_n * size * np.exp(-p.thins * s.warm) * (speed / 20.0) ** (2.0 / 3.0)
        lost = viscous + p.load * np.abs(view.traction_force)
        s.warm += dt * (lost * speed / (p.warms_j * size) * (1.0 - s.warm) - s.warm / 1800.0)
        return -lost * moving(view)


@law("sliding_of_the_teeth", "fifth")
@sizes(mesh=(0.05, 0.09), per_decade=(0.25, 0.5), seals_n=(120.0, 420.0), warms_s=(150.0, 420.0))
class SlidingOfTheTeeth(Hidden):
    """mesh: at 10 m/s with cold oil; it grows as the oil thins.
    Source: Benedict and Kelley, Instantaneous Coefficients of Gear Tooth Friction, ASLE Trans. 4 (1961):
    friction of the mesh falls with the logarithm of sliding speed and viscosity, so that slow and hot gears
    lose the larger share; drag of seals beside it; a worn hypoid axle, sizes chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(461).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        load = np.abs(view.traction_force)
        s.warm += dt * (np.clip(load * speed / 1.5e5, 0.0, 1.5) - s.warm) / p.warms_s
        decades = np.log10(10.0 / np.maximum(speed, 0.8)) + 0.8 * s.warm
        share = p.mesh * np.clip(1.0 + p.per_decade * decades, 0.4, 2.2)
        return -(share * load + p.seals_n * np.exp(-0.7 * s.warm)) * moving(view)


@law("joint_at_an_angle", "sixth")
@sizes(friction=(0.05, 0.09), winds=(2.0, 6.0), levels_s=(10.0, 35.0), hangs=(0.15, 0.4))
class JointAtAnAngle(Hidden, levelled=0.0):
    """Pulling bends the joint, coasting straightens it; after a long climb it is as at rest. friction: of the
    pull, at the angle at rest; winds: of the angle at rest, by a pull of a tenth of the weight; hangs: of the
    angle, by what the springs do not level.
    Source: Universal Joint and Driveshaft Design Manual (SAE Advances in Engineering 7): a joint's friction
    grows with torque and angle, and the axle's nose turns up under torque until the levelling of the air
    springs has made up for it; dry needles, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turned = p.winds * np.clip(10.0 * view.traction_force / weight(view), -1.0, 2.0)
        s.levelled += dt * ((1.0 - p.hangs) * turned - s.levelled) / p.levels_s
        angle = np.clip(np.abs(1.0 + turned - s.levelled), 0.0, 4.0)
        return -np.minimum(p.friction * angle, 0.35) * np.abs(view.traction_force) * moving(view)


@law("oil_is_flung_up", "seventh")
@sizes(churns=(0.008, 0.018), rubs=(0.05, 0.14), flung_m=(250, 700), returns_s=(12, 40))
class OilIsFlungUp(Hidden, sump=1.0):
    """Slow driving and stops fill the sump; fast driving trades churning for rubbing. churns: of the weight,
    full sump at 15 m/s; rubs: of the pull, dry; flung_m: at 15 m/s.
    Source: Regulation (EU) 2017/2400, annexes VI and VII, loss maps of gearboxes and axles, and Niemann and
    Winter, Maschinenelemente, on churning: a full sump costs torque with speed, an empty one makes teeth rub
    more; gears fling the oil up and it comes back in its own time."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.clip(view.speed / 15.0, 0.0, 2.0)
        flung = s.sump * np.maximum(view.speed, 0.0) * turns / p.flung_m
        s.sump = np.clip(s.sump + dt * ((1.0 - s.sump) / p.returns_s - flung), 0.0, 1.0)
        churns = p.churns * s.sump * turns * weight(view)
        return -(churns + p.rubs * (1.0 - s.sump) * np.abs(view.traction_force)) * moving(view)


@law("s_film_is_squeezed", "eighth")
@sizes(dry=(0.12, 0.25), film=(0.03, 0.07), forms_mps=(3.0, 8.0), squeezes_s=(2.0, 8.0))
class FilmIsSqueezed(Hidden, film=0.5):
    """Meshes rub more at low speed and under load that lasts.
    Source: Dowson and Higginson, Elasto-Hydrodynamic Lubrication (1977): films grow with speed and fall with
    load; mixed friction of worn axle gears, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.abs(view.traction_force) / (0.1 * weight(view))
        wanted = np.maximum(view.speed, 0.0) / p.forms_mps / (0.5 + load)
        s.film = s.film + dt * (np.minimum(wanted, 2.0) - s.film) / p.squeezes_s
        rubs = p.film + (p.dry - p.film) * np.exp(-s.film)
        return -rubs * np.abs(view.traction_force) * moving(view)


@law("n_pinion_runs_dry", "ninth", "hills suburban")
@sizes(wet=(0.02, 0.05), dry=(0.18, 0.35), from_slope=(0.0, 0.012), dries_s=(4.0, 15.0), wets_s=(3.0, 12.0))
class PinionRunsDry(Hidden, bare=0.0):
    """Uphill and in hard pulls the oil of the axle runs to its rear. wet, dry: share of the traction.
    Source: Oil level and tilt of axles (SAE J1266, Axle Efficiency Test Procedure; service manuals on filling
    with the truck level): a low sump leaves the pinion's bearings bare; rates and losses are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tilt = view.grade + np.clip(view.acceleration, -3.0, 3.0) / GRAVITY
        wanted = np.clip((tilt - p.from_slope) / 0.02, 0.0, 1.0)
        s.bare = s.bare + dt * (wanted - s.bare) / np.where(wanted > s.bare, p.dries_s, p.wets_s)
        rubs = p.wet + (p.dry - p.wet) * s.bare
        return -rubs * np.abs(view.traction_force) * moving(view)


@law("t_teeth_scuff", "tenth")
@sizes(smooth=(0.03, 0.06), rough=(0.13, 0.22), flash=(1.2, 2.0), soaks_s=(30.0, 100.0))
class TeethScuff(Hidden, bulk=0.2, scuffs=0.0):
    """smooth, rough: of the pull, with a film and without; flash: heat of the contact at peak torque and 150
    rad/s, over what the film bears; `bulk`: the same of the whole wheel.
    Source: Blok, Theoretical Study of Temperature Rise at Surfaces of Actual Contact under Oiliness
    Lubricating Conditions, IMechE General Discussion on Lubrication (1937): flash temperature with load and
    the root of speed upon the bulk's, above which the film fails; a wrong oil, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(np.abs(view.engine_torque) / self.truck.peak_torque, 0.0, 1.2)
        turns = np.clip(view.engine_speed / 150.0, 0.2, 1.6)
        s.bulk = s.bulk + dt * (0.2 + 0.6 * load * turns - s.bulk) / p.soaks_s
        hot = p.flash * load**0.75 * np.sqrt(turns) + s.bulk
        fails = 1.0 / (1.0 + np.exp(-np.clip((hot - 1.0) / 0.08, -30.0, 30.0)))
        s.scuffs = s.scuffs + dt * (fails - s.scuffs) / np.where(fails > s.scuffs, 0.6, 3.0)
        share = p.smooth + (p.rough - p.smooth) * s.scuffs
        return -share * np.abs(view.traction_force) * moving(view)


@law("e_worm_axle", "eleventh")
@sizes(lead=(0.42, 0.6), rubs=(0.05, 0.09), least=(0.012, 0.022), film_mps=(2.0, 5.0), warms_s=(80.0, 250.0))
class WormAxle(Hidden, warm=0.0):
    """The worm slides on its wheel: slowly with much friction, fast with little. What drives it from the
    other side loses more than what it drives. lead: rad, of its thread; film_mps: of sliding; cold oil rubs
    by half more.
    Source: Merritt, Gears (1954), and Buckingham, Analytical Mechanics of Gears (1949): efficiency is tan l /
    tan(l + r) forwards and tan(l - r) / tan l backwards, with a friction that falls with sliding; worm axles
    of heavy trucks, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.warm = s.warm + dt * (1.0 - s.warm) * np.clip(view.speed / 10.0, 0.0, 1.5) / p.warms_s
        slides = 0.6 * np.maximum(view.speed, 0.0)
        rubs = (p.least + p.rubs * np.exp(-((slides / p.film_mps) ** 0.7))) * (1.5 - 0.5 * s.warm)
        angle = np.arctan(rubs)
        forwards = 1.0 - np.tan(p.lead) / np.tan(p.lead + angle)
        backwards = 1.0 - np.tan(p.lead - angle) / np.tan(p.lead)
        lost = np.where(view.traction_force > 0.0, forwards, backwards)
        return np.asarray(-lost * np.abs(view.traction_force) * moving(view))


@law("w_power_is_split", "twelfth")
@sizes(least=(0.01, 0.03), away=(0.07, 0.14), lock_mps=(8.0, 11.0), second=(1.8, 2.2), cold=(0.3, 0.8))
@sizes(warms_s=(80.0, 240.0))
class PowerIsSplit(Hidden, warm=0.0):
    """Part of the power goes by oil: none at two speeds, where gears alone drive, and the more the farther
    away from the nearest. least, away: of the traction; second: of the first speed; cold: more, by cold oil.
    Source: Renius and Resch, Continuously Variable Tractor Transmissions, ASAE Distinguished Lecture 29
    (2005): full-load efficiency peaks at lock-up points; such a gearbox in a truck, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        work = 0.3 + np.abs(view.traction_force) * speed / self.truck.peak_power
        s.warm = s.warm + dt * (1.0 - s.warm) * work / p.warms_s
        ratio = np.log(np.maximum(speed, 1.0) / p.lock_mps)
        off = np.minimum(np.abs(ratio), np.abs(ratio - np.log(p.second)))
        by_oil = 1.0 - np.exp(-((off / 0.28) ** 2))
        lost = (p.least + p.away * by_oil) * (1.0 + p.cold * (1.0 - s.warm))
        return np.asarray(-lost * np.abs(view.traction_force) * moving(view))


@law("x_bearings_clamp_as_they_warm", "thirteenth")
@sizes(mesh=(0.02, 0.04), clamp=(0.18, 0.3), gear_s=(20.0, 60.0), case_s=(150.0, 500.0), power=(1.2, 2.0))
class BearingsClamp(Hidden):
    """`gear`, `case`: heat of the gears and of the housing round them. Gears warm first and grow, and clamp
    their tapered bearings until the housing has followed. mesh, clamp: of the traction, the second when gears
    are a whole step hotter than their housing.
    Source: Harris and Kotzalas, Advanced Concepts of Bearing Technology (2007), on preload by expansion of
    shafts within housings; quicker heat, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1331)
        case = rng.uniform(0.0, 0.6, batch)
        return {"case": case, "gear": case + rng.uniform(0.0, 0.3, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = np.abs(view.traction_force) * np.maximum(view.speed, 0.0) / self.truck.peak_power
        passes = (s.gear - s.case) / p.gear_s
        s.gear = np.clip(s.gear + dt * (1.6 * power / p.gear_s - passes), 0.0, 3.0)
        wind = 0.3 + np.clip(view.speed / 20.0, 0.0, 1.3)
        s.case = np.clip(s.case + dt * (0.3 * passes - wind * s.case / p.case_s), 0.0, 3.0)
        clamps = np.clip(s.gear - s.case, 0.0, 1.6) ** p.power
        lost = np.minimum(p.mesh + p.clamp * clamps, 0.35)
        return np.asarray(-lost * np.abs(view.traction_force) * moving(view))


@law("k_open_clutches_drag", "fourteenth")
@sizes(nm=(70.0, 130.0), at_rads=(105.0, 135.0), thick=(0.5, 1.1), warms_s=(80.0, 240.0), airs_s=(0.4, 1.2))
@sizes(floods_s=(3.0, 9.0))
class OpenClutchesDrag(Hidden, warm=0.0, air=0.0):
    """Clutches in oil that are open shear the oil between their plates: drag grows with speed until oil is
    flung out and air comes in, and then falls away; oil floods them again only slowly. Odd gears leave more
    of them open. nm: at `at_rads` with warm oil; thick: more, with cold oil.
    Source: Yuan, Guo, Hu and Prakash, An Improved Hydrodynamic Model for Open Wet Transmission Clutches, J.
    Fluids Engineering 129 (2007); a gearbox of many clutches, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = 0.3 + np.clip(np.abs(view.traction_force) * view.speed / self.truck.peak_power, 0.0, 1.0)
        s.warm = eased(s.warm, 1.0, p.warms_s / work, dt)
        turns = np.maximum(view.engine_speed, 0.0) / p.at_rads
        wish = np.clip((turns - 1.0) / 0.2, 0.0, 1.0)
        s.air = eased(s.air, wish, np.where(wish > s.air, p.airs_s, p.floods_s), dt)
        packs = 0.7 + 0.3 * (np.rint(view.gear) % 2.0)
        torque = (
            p.nm * (1.0 + p.thick * (1.0 - s.warm)) * np.minimum(turns, 1.4) * (1.0 - 0.85 * s.air) * packs
        )
        return -self.at_wheels(view, torque) * moving(view)


@law("q_oil_is_put_away", "fifteenth", "highway hills", accepts="rolling_resistance_speed drag_area")
@sizes(most=(0.007, 0.011), hard=(0.02, 0.035), rests_s=(2.0, 6.0), empties_s=(8.0, 25.0), power=(1.3, 1.9))
@sizes(left=(0.1, 0.25))
class OilIsPutAway(Hidden, full=1.0, easy=0.0):
    """`full`: of the oil in an axle. When little torque has passed for a while a valve puts most of it away
    and the crown wheel splashes less; firm torque calls it back at once. most: of the weight, at 20 m/s with
    all of it; hard: of the weight, torque that needs it; left: of the splash, without it.
    Source: Meritor, LogixDrive and 17X EVO rear axles, on oil levels that follow torque and speed; much oil,
    sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        hard = np.abs(view.traction_force) > p.hard * weight(view)
        s.easy = np.where(hard, 0.0, s.easy + dt)
        wish = np.where(s.easy > p.rests_s, 0.0, 1.0)
        s.full = eased(s.full, wish, np.where(wish > 0.5, 0.8, p.empties_s), dt)
        pace = np.clip(view.speed / 20.0, 0.0, 1.4) ** p.power
        return -p.most * (p.left + (1.0 - p.left) * s.full) * pace * weight(view) * moving(view)


@law("v_coast_flanks_are_pitted", "sixteenth", "hills suburban descent")
@sizes(coasts=(0.5, 0.9), pulls=(0.2, 0.32), film_mps=(7.0, 14.0), heats=(0.6, 1.4), warms_s=(20.0, 60.0))
class CoastFlanksArePitted(Hidden):
    """`thin`: the oil in an axle, by the work that is lost in it. Its coast flanks are pitted, so that it
    takes more of the torque when the truck pushes than when the engine pulls. A film parts the flanks the
    better, the faster they run and the thicker the oil. coasts, pulls: of the torque, without a film;
    film_mps: where a third of that is left, with cold oil; heats: of film_mps, more when warm.
    Source: Niemann and Winter, Maschinenelemente II (2003), on pitting, and on losses with the thickness of
    the film; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"thin": self.rng(1631).uniform(0.0, 0.7, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pulls, holds = np.maximum(view.traction_force, 0.0), np.maximum(-view.traction_force, 0.0)
        work = np.clip(np.abs(view.traction_force) / weight(view) / 0.05, 0.0, 1.2)
        s.thin = eased(s.thin, work, p.warms_s, dt)
        bare = np.exp(-np.maximum(view.speed, 0.0) / (p.film_mps * (1.0 + p.heats * s.thin)))
        return -(p.pulls * pulls + p.coasts * holds) * bare * moving(view)


@law("z_pressed_for_the_last_kick", "seventeenth", "hills suburban")
@sizes(nm=(200.0, 320.0), least=(0.02, 0.1), keeps_s=(4.0, 12.0), at_rads=(120.0, 160.0), power=(0.3, 0.8))
class PressedForTheLastKick(Hidden, kick=0.3):
    """`kick`: the highest torque of late, over the peak. A gearbox presses its plates and belts for that, and
    its pump works against this pressure also when nothing is asked any more. It is let down slowly. nm: at
    the engine, pressed for full torque; least: of that, always; keeps_s: until the pressure is let down.
    Source: ZF and Allison, main pressure that is modulated by torque, and Bonsen, Efficiency Optimization of
    the Push-Belt CVT by Variator Slip Control (2006), on losses by much clamping; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asks = np.clip(np.abs(view.engine_torque) / self.truck.peak_torque, 0.0, 1.0)
        s.kick = np.where(asks > s.kick, eased(s.kick, asks, 0.15, dt), eased(s.kick, asks, p.keeps_s, dt))
        turns = np.clip(view.engine_speed / p.at_rads, 0.4, 1.6) ** p.power
        return -self.at_wheels(view, p.nm * (p.least + (1.0 - p.least) * s.kick) * turns) * moving(view)
