"""Messages sent again, a dashpot, an electronic drawbar, and who sits beside the driver."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import STEP_S, Array, Hidden, Late, Sizes, State, TorqueFilter, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
STEPS = 60000  # of ten minutes


@law(
    "t_waits_for_what_was_lost", needs="suburban hills descent", name="command_delay", accepts="clock_offset"
)
@sizes(base_s=(0.22, 0.45), waits_s=(0.35, 0.8), every_s=(2.5, 7.0), again=(0.1, 0.35))
class WaitsForWhatWasLost(Late):
    """Nothing arrives until a lost message has been sent again, then all that waited comes at once; a wait
    that was in vain is followed by one twice as long. All trucks of a batch share the line.
    Source: RFC 6298, Computing TCP's Retransmission Timer (2011), on timeouts that double, and the order that
    TCP keeps (RFC 9293); a remote driver's line, losses are chosen here."""

    length = 600

    def prepare(self) -> None:
        rng, p = self.rng(961), self.p
        self.late, at = np.full(STEPS, round(p.base_s / STEP_S)), 0
        while at < STEPS:
            at += max(1, round(rng.exponential(p.every_s) / STEP_S))
            wait = round(p.waits_s * 2.0 ** min(rng.geometric(1.0 - p.again) - 1, 2) / STEP_S)
            part = self.late[at : at + wait]
            part += np.arange(1, len(part) + 1)
            at += wait + 1

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        return self.ago(s, int(self.late[s.at % STEPS]))


@law("t_oil_in_the_dashpot", needs="suburban hills", name="command_rate_limit", accepts="turbo_lag")
@sizes(per_s=(0.6, 1.3), preload=(0.12, 0.3), cold=(0.2, 0.45), warms_s=(50.0, 160.0))
class OilInTheDashpot(TorqueFilter):
    """The lever follows as fast as its spring can press oil through a bore: fast when far behind, slowly when
    near, slowest while the oil is cold. per_s: of the full command, for an error of all of it; cold: of the
    warm pace.
    Source: Karnopp, Margolis and Rosenberg, System Dynamics (2012), on springs and dashpots in a row; oil's
    viscosity over temperature (Vogel, Physikalische Zeitschrift 22, 1921); a throttle's damper, sizes are
    chosen here."""

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        error = (pedal - s.given) / self.full
        thin = 1.0 - (1.0 - p.cold) * np.exp(-time / p.warms_s)
        rate = p.per_s * thin * (p.preload + np.abs(error)) * np.where(error < 0.0, 2.5, 1.0)
        return np.asarray(s.given + self.full * np.sign(error) * np.minimum(np.abs(error), rate * dt))


@law("t_electronic_drawbar", needs="highway suburban", name="unknown", leader=True)
@sizes(per_s=(0.10, 0.22), sees_s=(0.5, 1.2), most_mps2=(0.15, 0.35), near_m=(45.0, 90.0))
class ElectronicDrawbar(Hidden):
    """A second computer helps to keep the distance to the leader: it pushes as he draws away and brakes as he
    comes nearer. per_s: for each m/s between them.
    Source: Gehring and Fritz, Practical Results of a Longitudinal Control Concept for Truck Platooning with
    Vehicle to Vehicle Communication, IEEE Conf. Intelligent Transportation Systems (1997); a weak one beside
    the driver, gains are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"gap": np.full(batch, np.nan), "acts": np.zeros(batch)}

    def between(self, view: View) -> Array:
        """Metres to the leader, whose way is a line between its samples; NaN without one."""
        way, at = self.setting.leader_m, view.time / self.setting.dt
        low = min(int(at), way.shape[1] - 2)
        share = min(at - low, 1.0)
        return np.asarray((1.0 - share) * way[:, low] + share * way[:, low + 1] - view.distance)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap = self.between(view)
        s.gap = np.where(np.isnan(s.gap), gap, s.gap)
        opens = (gap - s.gap) / p.sees_s
        s.gap = s.gap + dt * opens
        wanted = np.clip(p.per_s * np.nan_to_num(opens), -p.most_mps2, p.most_mps2)
        near = np.clip(2.0 - np.nan_to_num(gap, nan=1e5) / p.near_m, 0.0, 1.0)
        s.acts = s.acts + dt * (wanted * near - s.acts) / 0.3
        return s.acts * view.mass * np.clip(view.speed / 3.0, 0.0, 1.0)


@law("t_second_pair_of_pedals", needs="suburban hills", name="unknown")
@sizes(mps2=(0.35, 0.8), lasts_s=(1.2, 3.0), every_s=(12.0, 30.0), foot_s=(0.2, 0.5))
class SecondPairOfPedals(Hidden, foot=0.0):
    """A teacher brakes in passing when the pupil does not, harder the faster they go; only the pupil's pedals
    are recorded. mps2: at 12 m/s.
    Source: Dual controls of vehicles for driving instruction (Directive 2006/126/EC on driving licences, and
    national rules for instructors' pedals); how often and how hard is chosen here."""

    def prepare(self) -> None:
        p, rng, batch = self.p, self.rng(962), self.setting.batch
        lasts, every = (0.6 * p.lasts_s, 1.4 * p.lasts_s), (0.5 * p.every_s, 1.5 * p.every_s)
        self.steps_in = spells(rng, batch, lasts, every)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        wants = within(self.steps_in, view.time) * (view.brake_force <= 0.0) * (view.speed > 3.0)
        s.foot = s.foot + dt * (wants - s.foot) / p.foot_s
        hard = p.mps2 * np.sqrt(np.clip(view.speed / 12.0, 0.0, 2.0))
        return -s.foot * hard * view.mass * moving(view)
