"""Commands that are followed at a limited rate."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import Array, Sizes, State, TorqueFilter, eased
from deeptruck_exam.effects.planting import hidden, sizes

law = partial(hidden, name="command_rate_limit", accepts="turbo_lag")


@law("command_rate_limit", "first", "suburban hills")
@sizes(up_per_s=(0.10, 0.28), down_ratio=(1.0, 3.0))
class RateLimit(TorqueFilter):
    """Anti-jerk control: torque builds up at a limited rate that softens near the target, and falls faster.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), ch. 5: driveline anti-jerk shaping of
    demanded torque."""

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        away = pedal - s.given
        up = self.full * p.up_per_s
        rate = np.where(away > 0.0, up, up * p.down_ratio) * np.tanh(away / (0.08 * self.full))
        return np.asarray(s.given + np.clip(rate * dt, -np.abs(away), np.abs(away)))


@law("progressive_release", "second", "suburban hills")
@sizes(first=(0.03, 0.08), growth=(0.25, 0.7), fall=(0.6, 1.5))
class ProgressiveRelease(TorqueFilter):
    """Torque is released in proportion to what is there already: slow at first, fast at the end; a lifted
    pedal takes it back at once but for the last part.
    Source: Torque brought in gently through the play of the driveline, then faster: Templin and Egardt, An
    LQR Torque Compensator for Driveline Oscillation Damping, IEEE CCA (2009), on comfort; the progressive law
    is chosen here."""

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        there = np.clip(s.given / self.full, 0.0, 1.0)
        up = self.full * (p.first + p.growth * there) * dt
        down = self.full * (p.fall * np.sqrt(there) + 0.05) * dt
        return np.asarray(s.given + np.clip(pedal - s.given, -down, up))


@law("limited_jerk", "third", "suburban hills")
@sizes(per_s=(0.12, 0.30), builds_s=(0.8, 2.5))
class LimitedJerk(TorqueFilter):
    """Torque follows with a bounded rate, whose own change is bounded: an S for every step.
    Source: Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots (2008): set-points
    of bounded rate and bounded change of rate; sizes of a gentle drive mode, chosen here."""

    def start(self, batch: int) -> dict[str, Any]:
        return {"rate": np.zeros(batch)}

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        most, change = self.full * p.per_s, self.full * p.per_s / p.builds_s
        away = pedal - s.given
        wanted = np.sign(away) * np.minimum(np.sqrt(2.0 * change * np.abs(away)), most)
        rate = s.rate + np.clip(wanted - s.rate, -change * dt, change * dt)
        there = (np.abs(away) <= np.abs(rate) * dt) & (rate * away >= 0.0)
        s.rate = np.where(there, 0.0, rate)
        return np.where(there, pedal, np.maximum(s.given + rate * dt, 0.0))


@law("torque_in_steps", "fourth", "suburban hills")
@sizes(notch=(0.05, 0.11), every_s=(0.4, 0.9))
class TorqueInSteps(TorqueFilter):
    """A fleet's economy setting: every so often torque may rise by one notch; it falls by larger ones.
    Source: Acceleration limits and economy pedals among fleets' electronic features (owner's manuals of heavy
    diesels): the control unit raises the allowed torque by a notch at a time; notch and interval are chosen
    here."""

    def start(self, batch: int) -> dict[str, Any]:
        return {"next_s": 0.0}

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        given, notch = s.given, self.full * p.notch
        if time >= s.next_s:
            given = given + np.clip(pedal - given, -3.0 * notch, notch)
            s.next_s = time + p.every_s
        return np.where(pedal <= 0.0, pedal, given)


@law("torque_budget", "fifth", "suburban hills")
@sizes(most=(0.03, 0.10), per_s=(0.07, 0.17), slower=(0.2, 0.6))
class TorqueBudget(TorqueFilter):
    """A leaky bucket: small rises pass at once, larger ones have to wait until the budget has filled again,
    and it fills the slower the more torque is given already.
    Source: Token buckets (Turner, New Directions in Communications, IEEE Commun. Mag. 24, 1986) as smoothness
    scores and soft launch of fleets' pedals work: a little torque at any time, much only slowly, the last
    third slowest; sizes chosen here."""

    def start(self, batch: int) -> dict[str, Any]:
        return {"budget": np.full(batch, self.p.most * self.full)}

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        share = np.clip(s.given / self.full, 0.0, 1.0)
        rate = p.per_s * self.full * (1.0 - p.slower * share)
        s.budget = np.minimum(s.budget + dt * rate, p.most * self.full)
        rise = np.minimum(np.maximum(pedal - s.given, 0.0), s.budget)
        s.budget = s.budget - rise
        return np.where(pedal < s.given, pedal, s.given + rise)


@law("kicks_are_doubted", "sixth", "suburban hills")
@sizes(gentle_per_s=(0.35, 0.6), doubted=(0.035, 0.09), doubts=(4.0, 10.0), passes_s=(3.0, 9.0))
class KicksAreDoubted(TorqueFilter):
    """A kick of the pedal is taken for a slip of the foot: the faster it comes down, the slower torque is let
    in, until the doubt has passed. What is pressed gently comes as fast as the foot.
    Source: Acceleration control against pedal error, which takes a fast, deep kick for a mistake (UN
    Regulation No. 175 and the Japanese guidelines before it): a limit of the rate that the kick itself sets;
    a retrofit that doubts too much, rates are chosen here."""

    def start(self, batch: int) -> dict[str, Any]:
        return {"pace": np.zeros(batch), "doubt": np.zeros(batch)}

    def begin(self, s: State, u: Array) -> None:
        s.given, s.was = u[:, 0].copy(), u[:, 0].copy()

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        rise = np.maximum(pedal - s.was, 0.0) / self.full
        s.was = pedal.copy()
        # commands come in steps of a tenth of a second, feet do not
        s.pace = s.pace + (rise - dt * s.pace) / 0.3
        kicks = p.doubts * np.maximum(s.pace - 0.2, 0.0)
        s.doubt = np.minimum(s.doubt + dt * (kicks - s.doubt / p.passes_s), 1.0)
        rate = self.full * p.gentle_per_s * (p.doubted / p.gentle_per_s) ** np.clip(s.doubt, 0.0, 1.0)
        up = np.minimum(np.maximum(pedal - s.given, 0.0), dt * rate)
        return np.where(pedal < s.given, pedal, s.given + up)


@law("w_steps_over_the_lash", "twelfth", "suburban hills")
@sizes(low=(0.02, 0.05), high=(0.2, 0.4), slow_per_s=(0.12, 0.28), quick_per_s=(0.6, 1.4), drops=(1.0, 2.0))
class StepsOverTheLash(TorqueFilter):
    """So that the teeth do not clash, torque passes slowly through a band near nothing and quickly above it;
    slower upwards than downwards. low, high: of the full command; drops: times as quick, downwards.
    Source: Fredriksson, Weiefors and Egardt, Powertrain Control for Active Damping of Driveline Oscillations,
    Vehicle System Dynamics 37 (2002), and Lagerberg and Egardt, Evaluation of Control Strategies for
    Automotive Powertrains with Backlash, AVEC (2002), on crossing it gently; rates are chosen here."""

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        share = s.given / self.full
        out = np.clip((share - p.high) / 0.1, 0.0, 1.0) + np.clip((p.low - share) / 0.02, 0.0, 0.3)
        pace = (p.slow_per_s + (p.quick_per_s - p.slow_per_s) * out) * self.full * dt
        return np.asarray(np.clip(pedal, s.given - p.drops * pace, s.given + pace))


@law("x_pistons_are_warmed_first", "thirteenth", "suburban hills")
@sizes(cold_per_s=(0.08, 0.14), warm_per_s=(0.45, 0.9), at=(0.15, 0.3), readies_s=(4.0, 10.0))
@sizes(chills_s=(5.0, 15.0), falls=(3.0, 6.0))
class PistonsAreWarmedFirst(TorqueFilter):
    """A big engine is let up the slower, the longer nothing was asked of it: load makes it ready, rest takes
    that away. Down it goes quickly. cold_per_s, warm_per_s: of the full command; at: of it, that readies in
    the time said; falls: times as quick as up, when ready.
    Source: ISO 8528-5:2022, on load that highly rated engines accept in steps, by mean effective pressure;
    here for each pull of a truck; rates are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.ready = np.clip(u[:, 0] / self.full / self.p.at, 0.0, 1.0)

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        load = np.clip(s.given / self.full / p.at, 0.0, 1.0)
        slow = np.where(load > s.ready, p.readies_s, p.chills_s)
        s.ready = s.ready + dt * (load - s.ready) / slow
        pace = p.cold_per_s + (p.warm_per_s - p.cold_per_s) * s.ready**2
        down = p.falls * p.warm_per_s * self.full * dt
        return np.asarray(np.clip(pedal, s.given - down, s.given + pace * self.full * dt))


@law("k_loads_by_programme", "fourteenth", "suburban hills")
@sizes(
    once_per_s=(0.5, 0.9), then_per_s=(0.04, 0.09), step=(0.12, 0.22), soaks_s=(8.0, 25.0), falls=(1.0, 2.0)
)
class LoadsByProgramme(TorqueFilter):
    """`soaked`: load that the engine has got used to. A step above that is taken at once, what is asked
    beyond it comes along a slow line as the engine soaks. once_per_s, then_per_s: of the full command; step:
    of it; falls: of it, in a second.
    Source: CIMAC, Transient Response Behaviour of Gas Engines, Position Paper (2011), on load steps that such
    engines accept from what they carry already; rates are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.soaked = u[:, 0] / self.full

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        given = s.given / self.full
        s.soaked = eased(s.soaked, given, p.soaks_s, dt)
        at_once = np.clip((s.soaked + p.step - given) / 0.04, 0.0, 1.0)
        pace = p.then_per_s + (p.once_per_s - p.then_per_s) * at_once
        down = p.falls * self.full * dt
        return np.asarray(np.clip(pedal, s.given - down, s.given + pace * self.full * dt))


@law("q_slow_after_coasting", "fifteenth", "suburban hills")
@sizes(
    warm_per_s=(0.3, 0.55),
    cold_per_s=(0.05, 0.1),
    chills_s=(4.0, 12.0),
    warms_s=(4.0, 10.0),
    falls=(1.0, 2.0),
)
class SlowAfterCoasting(TorqueFilter):
    """`chilled`: the catalyst, that cool air has been pumped through while the pedal was up. A cool one lets
    nitrogen oxides pass, so the controller lets torque rise slowly until the engine has warmed it again.
    warm_per_s, cold_per_s, falls: of the full command in a second.
    Source: Guzzella and Onder, Introduction to Modeling and Control of Internal Combustion Engine Systems
    (2010), on catalysts that need heat and on limits of transients; rates are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.chilled = np.where(u[:, 0] > 0.05 * self.full, 0.2, 0.7)

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        load = np.clip(s.given / self.full, 0.0, 1.0)
        coasts = load < 0.02
        slow = np.where(coasts, p.chills_s, p.warms_s / (0.15 + load))
        s.chilled = eased(s.chilled, np.where(coasts, 1.0, 0.0), slow, dt)
        pace = p.warm_per_s * (p.cold_per_s / p.warm_per_s) ** s.chilled
        full = self.full * dt
        return np.asarray(np.clip(pedal, s.given - p.falls * full, s.given + pace * full))


@law("u_torque_multiplies", "twenty-first", "suburban hills")
@sizes(grows_per_s=(0.5, 0.8), least=(0.1, 0.18), falls_per_s=(1.2, 2.4), calm=(0.5, 0.8))
class TorqueMultiplies(TorqueFilter):
    """So that it does not smoke, an engine may get but a share more fuel each second than it burns now: from
    little it rises slowly, from much fast. Down it goes by a larger share each second. After a lift it grows
    slower still, until it has pulled for a while. least: of the full command, which is there at once; calm:
    of the growth, left after a lift.
    Source: Bosch, Diesel-Engine Management (2014), on the smoke limit by the air that is there; a cautious
    programme, sizes are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.pulled = np.clip(u[:, 0] / self.full, 0.0, 1.0)

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        s.pulled = eased(s.pulled, np.where(s.given > p.least * self.full, 1.0, 0.0), 3.0, dt)
        grows = p.grows_per_s * (p.calm + (1.0 - p.calm) * s.pulled)
        most = np.maximum(s.given * np.exp(dt * grows), p.least * self.full * min(dt / 0.3, 1.0) + s.given)
        most = np.where(s.given >= p.least * self.full, s.given * np.exp(dt * grows), most)
        low = s.given * np.exp(-dt * p.falls_per_s) - 0.05 * dt * self.full
        return np.clip(pedal, low, most)
