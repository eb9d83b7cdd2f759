"""Lock-up clutches that are opened, or are not let shut."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, sections
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="torque_converter_slip", trucks="freightliner", gateable=False)


@law("lockup_hunts", "third", "suburban hills highway", accepts="driveline_loss")
@sizes(lost=(0.12, 0.25), coast=(0.4, 0.8), warms_s=(8.0, 20.0), cools_s=(8.0, 20.0))
class LockupHunts(Hidden):
    """While open it takes a share of the pull, and most of the engine's drag when coasting. as the older
    forms of this name.
    Source: Lock-up clutches that open against judder (Naunheimer, Bertsche, Ryborz and Novak, Automotive
    Transmissions, 2011, on converter lock-up); efficiency of an open converter near coupling, one to two
    tenths lost; opening and closing by the clutch's heat is chosen here."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        first = self.rng(221).uniform(0.0, 0.9, batch)
        return {"heat": first, "open": np.zeros(batch), "slips": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = 0.5 + np.abs(view.engine_torque) / self.truck.peak_torque
        s.heat += dt * np.where(s.open > 0.5, -1.0 / p.cools_s, load / p.warms_s)
        s.open = np.where(s.heat > 1.0, 1.0, np.where(s.heat < 0.0, 0.0, s.open))
        s.slips += dt * (s.open * (view.speed > 4.0) - s.slips) / 0.3
        pull, push = np.maximum(view.traction_force, 0.0), np.maximum(-view.traction_force, 0.0)
        return s.slips * (p.coast * push - p.lost * pull) * moving(view)


@law("no_lockup_in_cold_oil", "fourth", "suburban hills highway", accepts="driveline_loss")
@sizes(slip=(0.20, 0.38), coast=(0.4, 0.8), warms_j=(1.0e6, 3.0e6), warms_s=(250.0, 500.0))
class NoLockupInColdOil(Hidden):
    """slip: at peak torque and 1200 rpm. It ends when the oil is warm, and the slip itself warms it.
    Source: Automatic gearboxes keep the converter open until the sump is warm (operator's manuals of heavy
    automatics on cold operation); slip of a fluid coupling in proportion to torque over speed squared
    (Föttinger's similarity; Naunheimer and others, Automotive Transmissions, 2011); sizes chosen here."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(332).uniform(-0.6, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.abs(view.engine_torque) / self.truck.peak_torque
        slip = np.clip(p.slip * load * (126.0 / np.maximum(view.engine_speed, 60.0)) ** 2, 0.03, 0.5)
        is_open = np.clip((1.0 - s.warm) / 0.05, 0.0, 1.0) * (view.speed > 3.0)
        pull, push = np.maximum(view.traction_force, 0.0), np.maximum(-view.traction_force, 0.0)
        lost = is_open * slip * pull
        s.warm = np.minimum(s.warm + dt * (lost * view.speed / p.warms_j + 1.0 / p.warms_s), 1.5)
        return (is_open * p.coast * push - lost) * moving(view)


@law("s_lockup_opens_on_kicks", "eighth", "suburban hills highway", accepts="driveline_loss")
@sizes(lost=(0.16, 0.32), coast=(0.3, 0.7), kick_per_s=(0.1, 0.25), stays_s=(4.0, 12.0))
class LockupOpensOnKicks(Hidden, was=0.0, pace=0.0, left=0.0, slips=0.0):
    """Each quick change of torque opens it for a while.
    Source: Lock-up clutches are opened during torque transients against jerks (Kiencke and Nielsen,
    Automotive Control Systems, 2005, on converters); a nervous control, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = view.engine_torque / self.truck.peak_torque
        s.pace = s.pace + (np.abs(load - s.was) - dt * s.pace) / 0.5
        s.was = load.copy()
        s.left = np.where(s.pace > p.kick_per_s, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.slips = s.slips + dt * ((s.left > 0.0) - s.slips) / 0.4
        pull, push = np.maximum(view.traction_force, 0.0), np.maximum(-view.traction_force, 0.0)
        return s.slips * (p.coast * push - p.lost * pull) * moving(view)


@law("n_lockup_opens_on_lift", "ninth", "suburban hills", accepts="driveline_loss")
@sizes(lost=(0.35, 0.7), couples_mps=(6.0, 18.0), shuts_s=(3.0, 9.0), coast=(0.4, 0.8))
class LockupOpensOnLift(Hidden, pulls=99.0, slips=0.0):
    """Closed again some seconds after the pedal was. It couples the better, the faster one drives.
    Source: Lock-up clutches that open in overrun and shut after a delay under load (Naunheimer, Bertsche,
    Ryborz and Novak, Automotive Transmissions, 2011, on control of converters); slip with the root of the
    load, delays and sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.pulls = np.where(self.pedal(view) < 0.03, 0.0, s.pulls + dt)
        s.slips = s.slips + dt * ((s.pulls < p.shuts_s) - s.slips) / 0.3
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        lost = p.lost * np.sqrt(load) / (1.0 + np.maximum(view.speed, 0.0) / p.couples_mps)
        pull, push = np.maximum(view.traction_force, 0.0), np.maximum(-view.traction_force, 0.0)
        return s.slips * (p.coast * push - lost * pull) * moving(view)


@law("e_locks_when_it_is_let", "eleventh", "suburban hills", accepts="driveline_loss torque_limit")
@sizes(gentle=(0.25, 0.45), waits_s=(1.0, 2.5), last_s=(12.0, 25.0), slips=(0.14, 0.26), left=(0.3, 0.7))
class LocksWhenItIsLet(Hidden, gear=0.0, since=0.0, open=0.0):
    """Every change of gear opens the lock-up clutch. It shuts again only once torque is gentle, or after a
    long time. gentle: of peak torque; slips: of the torque, lost at peak torque; left: of the engine's drag,
    while it is open.
    Source: Hahn and Lee, Nonlinear Robust Control of Torque Converter Clutch Slip System for Passenger
    Vehicles Using Advanced Torque Estimation Algorithms, Vehicle System Dynamics 37 (2002), on engagement
    under torque; one that avoids it, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (view.gear != s.gear) & (s.gear > 0.0)
        s.gear = view.gear.copy()
        s.since = np.where(changed, 0.0, np.minimum(s.since + dt, 100.0))
        load = view.engine_torque / self.truck.peak_torque
        shuts = ((s.since > p.waits_s) & (np.abs(load) < p.gentle)) | (s.since > p.last_s)
        wants = np.where(changed, 1.0, np.where(shuts, 0.0, np.rint(s.open)))
        pace = np.where(wants > s.open, 0.15, 0.8)
        s.open = np.where(changed, np.maximum(s.open, 0.6), s.open + dt * (wants - s.open) / pace)
        lost = p.slips * np.sqrt(np.clip(load, 0.0, 1.1)) * np.maximum(view.engine_torque, 0.0)
        drag = (1.0 - p.left) * np.minimum(view.engine_torque, 0.0)
        rolls = np.clip(view.speed - 1.0, 0.0, 1.0)
        return -self.at_wheels(view, s.open * (lost + drag)) * rolls


@law(
    "q_opens_with_the_brake_lights",
    "fifteenth",
    "suburban hills descent",
    accepts="driveline_loss engine_brake",
)
@sizes(waits_s=(3.0, 9.0), slips=(0.2, 0.38), frees=(0.4, 0.7), locks_s=(0.5, 1.5), free_mps=(12.0, 20.0))
class OpensWithTheBrakeLights(Hidden, left=0.0, open=0.0):
    """`open`: the clutch of the converter, which the switch of the brake lights opens. While the truck brakes
    the engine holds it back little, and for some seconds after that it slips when it is to pull. waits_s:
    from the last braking to locking; slips, frees: of the torque, pulling and holding back; free_mps: where
    little slip is left.
    Source: General Motors and Allison service manuals on converter clutches that are released through the
    brake switch; a long wait, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lit = view.brake_force > 0.003 * weight(view)
        s.left = np.where(lit, p.waits_s, np.maximum(s.left - dt, 0.0))
        s.open = eased(s.open, np.where(s.left > 0.0, 1.0, 0.0), np.where(lit, 0.2, p.locks_s), dt)
        slow = 1.0 / (1.0 + (np.maximum(view.speed, 0.0) / p.free_mps) ** 2)
        pulls, holds = np.maximum(view.engine_torque, 0.0), np.maximum(-view.engine_torque, 0.0)
        torque = s.open * (p.frees * holds - p.slips * (0.4 + 0.6 * slow) * pulls)
        return self.at_wheels(view, torque) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("v_rough_roads_open_it", "sixteenth", "suburban hills highway", accepts="driveline_loss")
@sizes(slips=(0.2, 0.36), frees=(0.4, 0.7), trips=(0.5, 0.8), stays_s=(2.0, 6.0), couples_mps=(9.0, 18.0))
@sizes(mean_m=(120.0, 400.0))
class RoughRoadsOpenIt(OnRoad, shakes=0.0, left=0.0, open=0.0):
    """`open`: the lock-up clutch. Speeds of the wheels that shake on a rough road look like a driveline
    that shuffles, so it is opened. It is shut again once they have been smooth for a while. Open, it slips
    less the faster one drives, and the engine holds back little. slips, frees: of the torque, pulling and
    holding back; trips: of the shaking of a rough road at 15 m/s.
    Source: General Motors service manuals on rough road detection by wheel speeds, which disables lock-up
    and misfire tests; sizes are chosen here."""

    conceal = ("engine_speed",)

    def prepare(self) -> None:
        rng = self.rng(1634)
        number = sections(rng, self.rows(), self.p.mean_m)
        rough = rng.uniform(0.0, 1.3, (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(rough, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        beats = self.read(self.road, view) * np.sqrt(np.clip(view.speed / 15.0, 0.0, 2.0))
        s.shakes = eased(s.shakes, beats, 0.7, dt)
        s.left = np.where(s.shakes > p.trips, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.open = eased(s.open, np.where(s.left > 0.0, 1.0, 0.0), 0.35, dt)
        share = p.slips * (0.3 + 0.7 * np.exp(-np.maximum(view.speed, 0.0) / p.couples_mps))
        pulls, holds = np.maximum(view.engine_torque, 0.0), np.maximum(-view.engine_torque, 0.0)
        torque = s.open * (p.frees * holds - share * pulls)
        return self.at_wheels(view, torque) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("z_oil_flies_out_of_balance", "seventeenth", "suburban hills highway", accepts="driveline_loss")
@sizes(holds=(0.9, 1.15), off_rads=(195.0, 225.0), soft=(0.08, 0.18), frees=(0.4, 0.7), heats_s=(3.0, 9.0))
class OilFliesOutOfBalance(Hidden, glazed=0.0):
    """The oil behind a lock-up clutch's piston flies outwards with the turning engine and presses against it.
    So the clutch holds less torque, the faster the engine turns, by the square. What is more slips away, and
    the slip leaves its plates hot and weaker for a while. holds: of peak torque, at rest; off_rads: where
    nothing is held; frees: of the torque that holds back, lost above half of that.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on clutch pistons, their
    rotating oil and how it is balanced; a leaking balance, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        peak = self.truck.peak_torque
        turns = np.clip(view.engine_speed / p.off_rads, 0.0, 1.0) ** 2
        holds = np.maximum(p.holds * (1.0 - turns) * (1.0 - 0.3 * s.glazed), 0.12) * peak
        pulls, back = np.maximum(view.engine_torque, 0.0), np.maximum(-view.engine_torque, 0.0)
        over = pulls - holds
        slips = 0.5 * (over + np.sqrt(over**2 + (p.soft * peak) ** 2)) * np.minimum(pulls / (0.2 * peak), 1.0)
        slips = np.clip(slips, 0.0, 0.45 * pulls)
        s.glazed = eased(s.glazed, np.clip(slips / (0.15 * peak), 0.0, 1.0), p.heats_s, dt)
        lets = p.frees * np.clip(2.0 * turns - 0.4, 0.0, 1.0) * back
        return self.at_wheels(view, lets - slips) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("y_keeps_a_steady_slip", "eighteenth", "suburban hills highway", accepts="driveline_loss")
@sizes(slips_rads=(22.0, 36.0), below_rads=(112.0, 140.0), soft_rads=(5.0, 10.0), shakes=(0.25, 0.5))
@sizes(moves_s=(0.3, 0.8))
class KeepsASteadySlip(Hidden, slip=0.0):
    """So that a slow engine does not shake the truck, the lock-up clutch is made to slip by some rad/s,
    however much torque goes through. Above an engine speed it locks. What is lost is slip over engine speed.
    `slip` rad/s. More is let slip under hard pulls. shakes: of slip, more at full torque.
    Source: Hiramatsu, Akagi and Yoneda, Control Technology of Minimal Slip-Type Torque Converter Clutch, SAE
    850460 (1985); a large slip, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pulls = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        slow = 1.0 / (1.0 + np.exp(np.clip((view.engine_speed - p.below_rads) / p.soft_rads, -30.0, 30.0)))
        s.slip = eased(s.slip, p.slips_rads * slow * (1.0 + p.shakes * pulls), p.moves_s, dt)
        lost = np.clip(s.slip / np.maximum(view.engine_speed, 60.0), 0.0, 0.35)
        return -self.at_wheels(view, lost * np.maximum(view.engine_torque, 0.0)) * moving(view)


@law("h_coil_gets_hot", "nineteenth", "suburban hills highway", accepts="driveline_loss")
@sizes(holds=(0.42, 0.58), falls=(0.6, 0.85), heats_s=(8.0, 25.0), cools_s=(30.0, 80.0), slides=(0.5, 0.8))
class CoilGetsHot(Hidden, lost=0.0):
    """A valve sets the pressure of the lock-up clutch by the current through its coil. `hot`: the coil, by
    the engine's heat and its own. Hot wire lets less current through, the clutch is pressed less, and torque
    beyond what it holds makes it slip. holds: of peak torque, cold; falls: of that, lost when hot; slides: of
    the torque beyond, that is lost.
    Source: Bosch Automotive Handbook (2014), on solenoids, whose current falls with their heat, and
    Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on lock-up clutches;
    sizes are chosen here."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(1933).uniform(0.1, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        heats = (0.15 + 1.3 * np.clip(self.power_share(view), 0.0, 1.0)) * (1.0 - s.hot) / p.heats_s
        air = 0.4 + 0.6 * np.clip(view.speed / 15.0, 0.0, 1.5)
        s.hot = np.clip(s.hot + dt * (heats - s.hot * air / p.cools_s), 0.0, 1.0)
        holds = p.holds * (1.0 - p.falls * s.hot) * self.truck.peak_torque
        over = np.maximum(view.engine_torque - holds, 0.0)
        s.lost = eased(s.lost, p.slides * over, 0.2, dt)
        return -self.at_wheels(view, np.minimum(s.lost, np.maximum(view.engine_torque, 0.0))) * moving(view)


@law("b_opened_to_gain_on_slopes", "twentieth", "hills suburban highway", accepts="driveline_loss")
@sizes(steep=(0.008, 0.018), asks=(0.3, 0.5), slips=(0.3, 0.5), at_rads=(120.0, 150.0), stays_s=(3.0, 9.0))
@sizes(opens_s=(0.3, 0.8))
class OpenedToGainOnSlopes(Hidden, left=0.0, open=0.0):
    """A programme opens the lock-up clutch on climbs under load, to gain torque, and leaves it so for a while
    behind them. The fluid then slips by the torque over the square of the engine's speed. steep: slope from
    which it opens; asks: of peak torque; slips: at peak torque and at_rads.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on lock-up programmes and
    on the performance number of converters; a converter that gains nothing, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        climbs = (view.grade > p.steep) & (load > p.asks)
        s.left = np.where(climbs, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.open = eased(s.open, np.where(s.left > 0.0, 1.0, 0.0), p.opens_s, dt)
        turns = (p.at_rads / np.maximum(view.engine_speed, 60.0)) ** 2
        slip = np.minimum(p.slips * load * turns, 0.8)
        return -self.at_wheels(view, s.open * slip * np.maximum(view.engine_torque, 0.0)) * moving(view)
