"""Torque that waits for air because of valves, vanes and flaps."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="turbo_lag", accepts="command_rate_limit", shown=True)


@law("egr_valve_then_ramp", "fourth", "suburban hills")
@sizes(shuts_s=(0.4, 1.2), full_s=(7.0, 17.0), without=(0.12, 0.24), runs_on_s=(2.0, 5.0))
class EgrValveThenRamp(Hidden):
    """full_s: from nothing to peak torque at 1200 rpm.
    Source: Tip-in of diesels with exhaust-gas recirculation (Hagena, Filipi and Assanis, Transient Diesel
    Emissions: Analysis of Engine Operation During a Tip-In, SAE 2006-01-1151): nothing more until the valve
    has shut, then fuel along a straight ramp that a faster engine makes steeper; the turbine runs on for
    seconds after; times are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"most": np.full(batch, self.p.without), "asks": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        short = asked > s.most
        s.asks = np.where(short, s.asks + dt, np.maximum(s.asks - 3.0 * dt, 0.0))
        rate = np.clip(view.engine_speed / 125.7, 0.5, 1.7) ** 1.8 / p.full_s
        rises = dt * rate * (s.asks > p.shuts_s)
        falls = dt * (s.most - np.maximum(asked, p.without)) / p.runs_on_s
        s.most = np.maximum(np.where(short, s.most + rises, s.most - falls), p.without)
        over = np.maximum(asked - s.most, 0.0) * self.truck.peak_torque
        return -self.at_wheels(view, over)


@law("sticking_vanes", "sixth", "suburban hills")
@sizes(sticks=(0.10, 0.24), runs_s=(0.8, 2.2), spools_s=(0.9, 2.2), without=(0.15, 0.30))
class StickingVanes(Hidden, vane=0.2, runs=0.0, boost=0.2):
    """A small step may never be answered, a large one is answered at once but slowly. sticks: of the vanes'
    way; spools_s: at 125 rad/s.
    Source: Variable turbine vanes (Guzzella and Onder, Introduction to Modeling and Control of Internal
    Combustion Engine Systems, 2010, on turbochargers) that soot has made stick: they wait until the actuator
    is far enough away, then run; boost follows the vanes, fuel follows boost; sizes chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wanted = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1)
        away = wanted - s.vane
        s.runs = np.where(np.abs(away) > p.sticks, 1.0, np.where(np.abs(away) < 0.02, 0.0, s.runs))
        s.vane = s.vane + s.runs * np.clip(away, -dt / p.runs_s, dt / p.runs_s)
        spools = np.where(s.vane > s.boost, p.spools_s / np.clip(view.engine_speed / 125.0, 0.5, 1.7), 0.8)
        s.boost += dt * (s.vane - s.boost) / spools
        missing = np.maximum(asked - p.without - (1.0 - p.without) * s.boost, 0.0)
        return -self.at_wheels(view, missing * self.truck.peak_torque) * moving(view)


@law("n_boost_is_dumped", "ninth", "suburban hills")
@sizes(without=(0.18, 0.35), builds_s=(1.5, 4.0), leaks_s=(2.0, 8.0), lift=(0.04, 0.12))
class BoostIsDumped(Hidden, boost=0.3):
    """A lifted pedal blows it off; part load lets it sink slowly; the flow of gas builds it up again.
    Source: Recirculating valves of throttled gas engines, which dump boost against surge when the throttle
    shuts (Watson and Janota, Turbocharging the Internal Combustion Engine, 1982, on surge); rates are chosen
    here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wanted = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1)
        flow = np.clip(view.engine_speed / 130.0, 0.4, 1.6) * (0.2 + 0.8 * asked)
        builds = np.minimum(s.boost + dt * flow / p.builds_s, wanted)
        sinks = s.boost - dt * (s.boost - wanted) / p.leaks_s
        dumps = s.boost * (1.0 - dt / 0.25)
        s.boost = np.where(asked < p.lift, dumps, np.where(wanted > s.boost, builds, sinks))
        missing = np.maximum(asked - p.without - (1.0 - p.without) * s.boost, 0.0)
        return -self.at_wheels(view, missing * self.truck.peak_torque) * moving(view)


@law("w_wastegate_sticks_open", "twelfth", "suburban hills")
@sizes(without=(0.18, 0.32), spools_s=(0.9, 1.8), slower=(2.0, 4.0), opens=(0.75, 0.95), shuts=(0.15, 0.35))
class WastegateSticksOpen(Hidden, boost=0.0, open=0.0):
    """`boost` over the most; much of it opens the wastegate, which sticks and shuts only after the boost has
    gone. A pull that follows upon a hard one builds its boost with half of the gas. without: of peak torque,
    with none; slower: times, with an open gate; opens, shuts: boost.
    Source: Galindo, Climent, Guardiola and Domenech, Modeling the Vacuum Circuit of a Pneumatic Valve System,
    J. Dyn. Sys. Meas. Control 131 (2009), and Thomasson, Eriksson, Leufven and Andersson, Wastegate Actuator
    Modeling and Model-Based Boost Pressure Control, IFAC E-COSM (2009), on friction in actuators; sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        goal = np.clip((asked - p.without) / (1.0 - p.without), 0.0, 1.1)
        flow = np.clip(view.engine_speed / 140.0, 0.4, 1.3)
        pushed = np.where(s.boost > p.opens, 1.0, np.where(s.boost < p.shuts, 0.0, np.rint(s.open)))
        s.open = s.open + dt * (pushed - s.open) / 0.5
        up = flow * (0.3 + s.boost) / (p.spools_s * (1.0 + (p.slower - 1.0) * s.open))
        rises = up * np.clip((goal - s.boost) / 0.15, 0.0, 1.0)
        s.boost = s.boost + dt * (rises + np.minimum(goal - s.boost, 0.0) / 0.7)
        lacks = np.maximum(goal - s.boost, 0.0) * (1.0 - p.without) * self.truck.peak_torque
        return -self.at_wheels(view, lacks) * moving(view)


@law("x_pipe_holds_burnt_gas", "thirteenth", "suburban hills")
@sizes(burnt=(0.5, 0.75), clears_s=(0.5, 1.1), valve_s=(0.3, 0.8), boosts_s=(0.7, 1.6), least=(0.2, 0.35))
class PipeHoldsBurntGas(Hidden, valve=1.0, near=1.0, mid=1.0, far=1.0, boost=0.0):
    """Exhaust that is led back fills the long pipe to the engine at part load. When more is asked the valve
    shuts, but the engine has to breathe what is in the pipe: `near` the valve, `mid` and `far` along it. It
    breathes the slower, the lower the boost, and smoke limits torque until air has come. burnt: torque that
    burnt gas takes; clears_s: of a third of the pipe; least: of peak torque, without boost.
    Source: Wahlstrom and Eriksson, Modelling Diesel Engines with a Variable-Geometry Turbocharger and Exhaust
    Gas Recirculation, Proc. IMechE D 225 (2011), on oxygen in the intake, and Heywood, Internal Combustion
    Engine Fundamentals (2018), on transport in manifolds; a long route, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        s.boost = s.boost + dt * (asked - s.boost) / np.where(asked > s.boost, p.boosts_s, 0.5)
        shut = np.clip((asked - 0.3) / 0.25, 0.0, 1.0)
        s.valve = s.valve + dt * (1.0 - shut - s.valve) / p.valve_s
        flow = np.clip(view.engine_speed / 130.0, 0.4, 1.5) * (0.5 + s.boost) / p.clears_s
        s.far = s.far + dt * flow * (s.mid - s.far)
        s.mid = s.mid + dt * flow * (s.near - s.mid)
        s.near = s.near + dt * flow * (s.valve - s.near)
        most = (p.least + (1.1 - p.least) * np.clip(1.15 * s.boost, 0.0, 1.0)) * (1.0 - p.burnt * s.far)
        lacks = np.maximum(asked - most, 0.0) * self.truck.peak_torque
        return -self.at_wheels(view, lacks) * moving(view)


@law("q_flap_opens_late", "fifteenth", "suburban hills")
@sizes(sticks_s=(1.2, 2.6), opens_s=(1.4, 3.2), spools_s=(0.6, 1.3), least=(0.06, 0.15), cakes_s=(6.0, 20.0))
class FlapOpensLate(Hidden, flap=1.0, boost=0.3, sticks=0.0, cakes=0.0):
    """`flap` in the exhaust, 1 open, which shuts while the pedal is up. Soot cakes it the longer it is shut;
    then it sticks for a while when it is to open, and the turbine gets no gas until it does. sticks_s: caked;
    least: of peak torque, without boost.
    Source: Heywood, Internal Combustion Engine Fundamentals (2018), on boost from the exhaust, and makers'
    service manuals on exhaust flaps that stick with soot; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        up = self.pedal(view) < 0.03
        s.cakes = eased(s.cakes, np.where(up, 1.0, 0.0), np.where(up, p.cakes_s, p.sticks_s + p.opens_s), dt)
        s.sticks = np.where(up, p.sticks_s * (0.3 + 0.7 * s.cakes), np.maximum(s.sticks - dt, 0.0))
        wish = np.where(up | (s.sticks > 0.0), 0.0, 1.0)
        s.flap = np.clip(s.flap + dt * np.where(wish > 0.5, 1.0 / p.opens_s, -1.0 / 0.4), 0.0, 1.0)
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        spools = np.where(asked > s.boost, p.spools_s / (0.1 + 0.9 * s.flap), 0.8)
        s.boost = eased(s.boost, asked, spools, dt)
        most = p.least + (1.12 - p.least) * np.minimum(1.2 * s.boost, 1.0) * (0.15 + 0.85 * s.flap)
        lacks = np.maximum(asked - most, 0.0) * self.truck.peak_torque
        return -self.at_wheels(view, lacks) * moving(view)


@law("v_vanes_choke_first", "sixteenth", "suburban hills")
@sizes(chokes=(0.1, 0.2), slow_s=(1.2, 2.4), flow_rads=(110.0, 150.0), shuts_s=(0.1, 0.3), opens_s=(0.8, 2.0))
@sizes(least=(0.12, 0.25))
class VanesChokeFirst(Hidden, boost=0.4, vanes=0.0):
    """`vanes` of the turbine, 1 shut. When more is asked than there is air for they shut to spin it up, and
    at first the engine has to press its gas against them: torque falls before it rises. They open again
    slowly, so a second pedal soon after the first finds them half shut. chokes: of peak torque, at
    flow_rads; slow_s: of `boost`, at flow_rads with open vanes; least: of peak torque, without boost.
    Source: Wahlström and Eriksson, Modelling Diesel Engines with a Variable-Geometry Turbocharger and Exhaust
    Gas Recirculation, J. Automobile Engineering 225 (2011), on responses that begin the wrong way; sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wish = np.clip((asked - s.boost) / 0.15, 0.0, 1.0)
        s.vanes = eased(s.vanes, wish, np.where(wish > s.vanes, p.shuts_s, p.opens_s), dt)
        flow = np.clip(view.engine_speed / p.flow_rads, 0.4, 1.6)
        spools = p.slow_s / (flow * (0.35 + 0.65 * s.vanes))
        s.boost = eased(s.boost, asked, np.where(asked > s.boost, spools, 1.2), dt)
        most = p.least + (1.1 - p.least) * np.minimum(1.1 * s.boost, 1.0)
        lacks = np.maximum(asked - most, 0.0) + p.chokes * flow * s.vanes * np.minimum(asked, 0.5) * 2.0
        return -self.at_wheels(view, np.minimum(lacks, asked) * self.truck.peak_torque) * moving(view)


@law("b_capsule_sticks", "twentieth", "suburban hills")
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


@law("u_boost_swings", "twenty-first", "suburban hills")
@sizes(least=(0.22, 0.36), own_rads=(1.1, 2.0), dull=(0.12, 0.28), falls_s=(0.5, 1.2))
class BoostSwings(Hidden, boost=0.2, pace=0.0):
    """The controller of a charger is set too sharply: after a kick `boost` shoots up, falls back and swings
    about its wish, and each time that it is short so is the torque. `pace` of it in a second. least: of peak
    torque, without boost; own_rads: of the swing, at 140 rad/s of the engine; dull: its damping.
    Source: Åström and Hägglund, PID Controllers (1995), on loops of little damping, and Eriksson and Nielsen,
    Modeling and Control of Engines and Drivelines (2014), on control of boost; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        wish = np.clip((asked - p.least) / (1.0 - p.least), 0.0, 1.1)
        own = p.own_rads * np.clip(view.engine_speed / 140.0, 0.6, 1.4)
        lifted = asked < 0.05
        pulls = own**2 * (wish - s.boost) - 2.0 * p.dull * own * s.pace
        s.pace = np.where(lifted, -s.boost / p.falls_s, np.clip(s.pace + dt * pulls, -2.0, 2.0))
        s.boost = np.clip(s.boost + dt * s.pace, 0.0, 1.5)
        lacks = np.maximum(asked - p.least - (1.0 - p.least) * s.boost, 0.0)
        return -self.at_wheels(view, lacks * self.truck.peak_torque) * moving(view)
