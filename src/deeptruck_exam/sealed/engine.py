"""A capsule that sticks, a relief valve that stays open, a drawbar that is spared, taps that add stages, and
cams that run dry; a chipper and a pump of strokes; two maps that do not meet, and whole cylinders."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("b_capsule_sticks", needs="suburban hills", name="turbo_lag", accepts="command_rate_limit", shown=True)
@sizes(least=(0.2, 0.32), builds_s=(0.8, 1.6), falls_s=(0.5, 1.2), sticks=(0.2, 0.36), moves_s=(0.15, 0.4))
class CapsuleSticks(Hidden, boost=0.1, capsule=0.1):
    """A capsule lets in fuel by the boost that it feels. Its rod sticks: it stays where it is until boost has
    moved away by some amount, and then lags behind by that. So a pull is short of fuel until boost is well
    up. least: of peak torque, without boost; builds_s: of boost, at 140 rad/s; sticks: of full boost.
    Source: Bosch, Diesel-Engine Management (2014), on boost-pressure compensators of injection pumps, and
    Canudas de Wit, Olsson, Åström and Lischinsky, A New Model for Control of Systems with Friction, IEEE
    Trans. Automatic Control 40 (1995); a dirty rod, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wish = np.clip((asked - p.least) / (1.0 - p.least) * 1.1, 0.0, 1.1 + p.sticks)
        turns = np.clip(view.engine_speed / 140.0, 0.5, 1.5)
        rising = wish > s.boost
        s.boost = eased(
            s.boost, wish + p.sticks * (wish > 0.0), np.where(rising, p.builds_s / turns, p.falls_s), dt
        )
        loose = np.clip(s.capsule, s.boost - p.sticks, s.boost + p.sticks)
        s.capsule = eased(s.capsule, loose, p.moves_s, dt)
        most = p.least + (1.0 - p.least) * np.maximum(s.capsule, 0.0)
        return -self.at_wheels(view, np.maximum(asked - most, 0.0) * self.truck.peak_torque) * moving(view)


@law(
    "b_relief_valve_stays_open",
    needs="suburban hills",
    name="torque_derate",
    accepts="torque_gain torque_limit",
    shown=True,
)
@sizes(most=(0.35, 0.55), quick_per_s=(0.45, 0.8), rests_s=(3.0, 8.0), opens_s=(0.3, 0.9), warm=(0.2, 0.5))
class ReliefValveStaysOpen(Hidden, was=-1.0, rested=0.0, opened=0.0, lost=0.0):
    """A valve on the fuel rail opens when pressure overshoots, after a quick kick of torque, and stays open:
    the controller takes torque back, whatever is asked. It shuts only when little has been asked for some
    seconds. most: of the torque, taken; quick_per_s: rise of torque that opens it, of the peak; rests_s:
    until it shuts; warm: of what is taken, less at low engine speed.
    Source: Bosch, Diesel-Engine Management (2014), on pressure-relief valves of common rails, and makers'
    notes on running with an open one; a weak valve, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        opened = np.rint(self.rng(2041).uniform(0.0, 1.0, batch))
        return {**super().start(batch), "opened": opened}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.was = np.where(s.was < 0.0, load, s.was)
        lagging = eased(s.was, load, 0.25, dt)
        quick = (load - s.was) / 0.25
        s.was = lagging
        s.rested = np.where(load < 0.12, s.rested + dt, 0.0)
        s.opened = np.where(quick > p.quick_per_s, 1.0, np.where(s.rested > p.rests_s, 0.0, s.opened))
        slow = np.clip(1.0 - view.engine_speed / 160.0, 0.0, 0.6)
        s.lost = eased(s.lost, p.most * s.opened * (1.0 - p.warm * slow), p.opens_s, dt)
        return -self.at_wheels(view, s.lost * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("b_spares_its_drawbar", needs="hills suburban", name="torque_limit", accepts="torque_derate", shown=True)
@sizes(bears=(0.028, 0.045), trailer=(0.55, 0.75), shuts_s=(0.8, 2.0), opens_s=(5.0, 15.0), least=(0.25, 0.4))
class SparesItsDrawbar(Hidden, most=1.0):
    """A pin in the drawbar measures the pull on the trailer, its share of mass times acceleration and slope.
    While that is more than the bar bears the controller lowers the `most` that the engine may give, and
    afterwards lets it rise slowly. bears: of the truck's weight; shuts_s: for a pull that is twice as hard.
    Source: ISO 18868 and UN Regulation No. 55 on couplings and the forces that they bear, and Åström and
    Hägglund, PID Controllers (1995), on integral limits; a weak bar, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration / GRAVITY + view.grade + self.truck.rolling_resistance, -0.2, 0.2)
        over = p.trailer * felt / p.bears - 1.0
        moves = np.where(over > 0.0, -np.minimum(over, 2.0) / p.shuts_s, np.minimum(-over, 1.0) / p.opens_s)
        s.most = np.clip(s.most + dt * moves, p.least, 1.1)
        over_nm = np.maximum(view.engine_torque - s.most * self.truck.peak_torque, 0.0)
        return -self.at_wheels(view, over_nm) * moving(view)


@law(
    "b_each_tap_adds_a_stage", needs="descent hills suburban", name="engine_brake", accepts="engine_friction"
)
@sizes(stage_nm=(200.0, 330.0), at_rads=(150.0, 190.0), bites_s=(0.2, 0.6), taps=(0.012, 0.03))
class EachTapAddsAStage(Hidden, stages=0.0, was=0.0, torque=0.0):
    """Each tap of the brake pedal switches on one more of three stages of an engine brake that nobody
    records, and they stay on when the foot is off again. The accelerator switches all of them off. stage_nm:
    of torque, at at_rads; taps: of full braking, that counts as a tap.
    Source: SAE J1939-71 on engine brakes that latch, and makers' manuals on stages by taps of the brake
    pedal; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        pressed = np.where(asked > p.taps, 1.0, np.where(asked < 0.5 * p.taps, 0.0, s.was))
        s.stages = np.minimum(s.stages + np.maximum(pressed - s.was, 0.0), 3.0)
        s.stages = np.where(self.pedal(view) > 0.05, 0.0, s.stages)
        s.was = pressed
        turns = np.clip(view.engine_speed / p.at_rads, 0.0, 1.3)
        s.torque = eased(s.torque, p.stage_nm * s.stages * turns**1.5, p.bites_s, dt)
        return -self.at_wheels(view, s.torque) * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("b_cams_run_dry", name="engine_friction", accepts="accessory_load engine_brake torque_gain")
@sizes(nm=(190.0, 310.0), at_rads=(95.0, 125.0), power=(0.5, 1.0), wets_s=(4.0, 12.0), dries_s=(25.0, 70.0))
@sizes(wet=(0.5, 0.75))
class CamsRunDry(Hidden):
    """Cams and followers get their oil by what the crank throws up. `film` on them: made while the engine
    turns fast, and wiped off while it turns slowly. Dry cams rub the harder, the slower they turn. nm: dry,
    at at_rads; power: of the speed, by which it falls; wet: of it, less with a whole film.
    Source: Taylor (ed.), Engine Tribology (1993), on friction of cams and followers, and Heywood, Internal
    Combustion Engine Fundamentals (2018); worn cams, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"film": self.rng(2042).uniform(0.0, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turns = np.maximum(view.engine_speed, 50.0) / p.at_rads
        throws = np.clip(turns - 0.95, 0.0, 0.6) / 0.3 * (1.0 - s.film) / p.wets_s
        s.film = np.clip(s.film + dt * (throws - s.film / p.dries_s), 0.0, 1.0)
        rubs = np.minimum(turns**-p.power, 1.6) * (1.0 - p.wet * s.film)
        return -self.at_wheels(view, p.nm * rubs) * moving(view)


@law("b_chipper_waits_for_the_engine", needs="suburban hills highway", name="accessory_load")
@sizes(nm=(210.0, 330.0), on_rads=(118.0, 132.0), below=(0.06, 0.14), bites_s=(0.4, 1.0), knots_s=(2.0, 6.0))
@sizes(idles=(0.05, 0.15))
class ChipperWaitsForTheEngine(Hidden, feeds=0.0, bites=0.0):
    """The engine drives a chipper whose feed stops itself when the engine gets slow, and starts again when it
    turns fast enough: it works or idles by the engine's speed, and each has to be left by some margin. Thick
    wood and thin come by chance. nm: of torque, for usual wood; below: of on_rads, where it stops.
    Source: Spinelli, Cavallo, Eliasson and Facello, Comparing the Efficiency of Drum and Disc Chippers, Silva
    Fennica 47 (2013), and makers' notes on no-stress feeds; sizes are chosen here."""

    def prepare(self) -> None:
        on, off = (0.5 * self.p.knots_s, 2.5 * self.p.knots_s), (0.5 * self.p.knots_s, 2.5 * self.p.knots_s)
        self.thick = spells(self.rng(2043), self.setting.batch, on, off)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stops = view.engine_speed < p.on_rads * (1.0 - p.below)
        s.feeds = np.where(view.engine_speed > p.on_rads, 1.0, np.where(stops, 0.0, s.feeds))
        wish = s.feeds * (0.75 + 0.5 * within(self.thick, view.time))
        s.bites = eased(s.bites, wish, p.bites_s, dt)
        return -self.at_wheels(view, p.nm * (p.idles + (1.0 - p.idles) * s.bites)) * moving(view)


@law(
    "b_pump_of_two_strokes", needs="suburban hills highway", name="accessory_load", accepts="engine_friction"
)
@sizes(nm=(200.0, 320.0), turns=(55.0, 130.0), dips=(0.6, 0.95), dips_s=(0.4, 0.9), presses=(0.2, 0.5))
class PumpOfTwoStrokes(Hidden, pumps=0.5):
    """Two pistons press mortar through a hose by turns, while the truck drives on. Within each stroke the
    pressure rises as the mortar is packed, and between strokes a valve swings over and nothing is pressed. A
    stroke takes so many `turns` of the engine. nm: of torque, on the way; presses: of it, that comes along
    the stroke; dips: of it, that is gone between strokes.
    Source: Putzmeister and Schwing, makers' notes on two-piston pumps for concrete, and ACI 304.2R, Placing
    Concrete by Pumping Methods; pumping on the way and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "stroke": self.rng(2044).uniform(0.0, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        per_s = np.maximum(view.engine_speed, 40.0) / (2.0 * np.pi * p.turns)
        s.stroke = (s.stroke + dt * per_s) % 1.0
        swings = np.where(s.stroke < np.minimum(p.dips_s * per_s, 0.4), 1.0, 0.0)
        wish = (1.0 - p.dips * swings) * (1.0 - p.presses * (0.5 - s.stroke))
        s.pumps = eased(s.pumps, wish, 0.12, dt)
        return -self.at_wheels(view, p.nm * s.pumps) * moving(view)


@law("b_two_maps_do_not_meet", needs="suburban hills highway", name="unknown")
@sizes(more=(0.07, 0.12), less=(0.09, 0.15), at=(0.35, 0.55), tilts=(0.2, 0.5), apart=(0.08, 0.16))
@sizes(blends_s=(0.4, 1.2))
class TwoMapsDoNotMeet(Hidden, second=0.0):
    """An engine burns in two ways, each with a map of its own, and the maps do not meet: in the `second` one
    it gives less than it is asked for, in the first one more. The second begins beyond a line over torque and
    engine speed, and is left at a lower line. more, less: of the torque; at: of peak torque, at 140 rad/s;
    tilts: of it, lower at twice the speed; apart: of peak torque, between both lines.
    Source: Kimura, Aoki, Ogawa, Muranaka and Enomoto, New Combustion Concept for Ultra-Clean and High-
    Efficiency Small DI Diesel Engines, SAE 1999-01-3681, on engines of two ways to burn; sizes are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        line = p.at - p.tilts * p.at * (view.engine_speed / 140.0 - 1.0)
        wish = np.where(load > line, 1.0, np.where(load < line - p.apart, 0.0, np.rint(s.second)))
        s.second = eased(s.second, wish, p.blends_s, dt)
        gains = p.more * (1.0 - s.second) - p.less * s.second
        return self.at_wheels(view, gains * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("b_fires_whole_cylinders", needs="suburban hills highway", name="unknown")
@sizes(steps=(3.2, 4.8), holds=(0.06, 0.16), moves_s=(0.15, 0.5), keeps=(0.75, 1.0))
class FiresWholeCylinders(Hidden, fires=0.0):
    """An engine fires whole cylinders or none: what it gives goes by steps, and lies above or below what is
    asked. A step is kept until the wish is well beyond its half. steps: from nothing to peak torque; holds:
    of a step, beyond its half; keeps: of the difference, which boost does not even out.
    Source: Serrano, Routledge, Lo, Shost, Srinivasan and Ghosh, Methods of Evaluating and Mitigating NVH When
    Operating an Engine in Dynamic Skip Fire, SAE 2014-01-1675; one of few levels, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1) * p.steps
        near = np.rint(s.fires)
        moved = np.abs(asked - near) > 0.5 + p.holds
        s.fires = eased(s.fires, np.where(moved, np.rint(asked), near), p.moves_s, dt)
        differs = p.keeps * (s.fires - asked) / p.steps * np.clip(asked / 0.25, 0.0, 1.0)
        return self.at_wheels(view, differs * self.truck.peak_torque) * moving(view)
