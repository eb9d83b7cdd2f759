"""Wheels that hop off their grip, beads that balance, tread that pull warms, and nuts that are loose."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("v_hops_off_its_grip", needs="suburban hills", name="wheel_slip")
@sizes(grip=(0.26, 0.36), leaves=(0.6, 0.8), at_mps=(3.5, 8.0), wide_mps=(2.5, 4.5), mean_m=(120.0, 450.0))
@sizes(share=(0.4, 0.65), hops_s=(0.4, 1.0))
class HopsOffItsGrip(OnRoad, hops=0.0, lost=0.0):
    """`hops`: of driven wheels on a corrugated road. Where ripples come as fast as the axle likes to bounce
    the wheels are half the time in the air and cannot pull; slower or faster they can. A wheel that pulls
    hard bounces more. grip: of their load, on gravel; leaves: of that, lost at at_mps; wide_mps: half the
    width of that.
    Source: Both, Hong and Kurtze, Corrugation of Roads, Physica A 301 (2001), on wheels that bounce on
    ripples, and Wong, Theory of Ground Vehicles (2008), on thrust; sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1671), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gravel, pull = self.between(self.road, view), np.maximum(view.traction_force, 0.0)
        tune = np.exp(-(((view.speed - p.at_mps) / p.wide_mps) ** 2))
        works = np.clip(0.5 + pull / (0.08 * weight(view)), 0.5, 1.0)
        s.hops = eased(s.hops, gravel * tune * works, p.hops_s, dt)
        most = 0.35 * p.grip * (1.0 - p.leaves * s.hops) * weight(view)
        spins = np.maximum(pull - most * np.tanh(pull / most), 0.0)
        s.lost = eased(s.lost, gravel * spins, 0.25, dt)
        return -np.minimum(s.lost, pull) * moving(view)


@law(
    "v_beads_in_the_tyres",
    needs="highway hills suburban",
    name="rolling_resistance_speed",
    accepts="drag_area",
)
@sizes(
    most=(0.008, 0.013), sticks_mps=(15.5, 20.0), falls=(0.75, 0.9), spreads_s=(3.0, 9.0), power=(0.8, 1.6)
)
class BeadsInTheTyres(Hidden, held=0.0):
    """`held`: of the beads that were put into the tyres to balance them, against the tread. Slow wheels carry
    them up and let them fall, which costs more with speed; fast ones press them outwards and they run along
    for nothing. They stay there well below the speed at which they were caught. most: of the weight, right
    below that speed; falls: of it, where they drop; power: of the cost with speed.
    Source: Counteract and International Marketing, balancing beads in heavy truck tyres, on speeds where
    they take hold, and Mellmann, Transverse Motion of Solids in Rotating Cylinders, Powder Technology 118
    (2001); many beads, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "caught": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        drops = speed < p.falls * p.sticks_mps
        s.caught = np.where(speed > p.sticks_mps, 1.0, np.where(drops, 0.0, s.caught))
        s.held = eased(s.held, s.caught, p.spreads_s, dt)
        lifts = np.minimum(speed / p.sticks_mps, 1.3) ** p.power
        return -p.most * (1.0 - 0.9 * s.held) * lifts * weight(view) * moving(view)


@law("v_pull_warms_the_tread", name="rolling_resistance_warmup")
@sizes(most=(0.014, 0.021), hard=(0.03, 0.05), warms_s=(12.0, 35.0), cools_s=(60.0, 180.0), rolls=(0.1, 0.25))
class PullWarmsTheTread(Hidden):
    """`warm`: the tread of winter tyres. Rolling warms it little, but each pull and each braking makes it
    creep on the road, and that heat comes with the square of the force. So a truck that has worked hard
    rolls easily, and one that has rolled along is stiff. most: of the weight, cold; hard: of the weight, the
    force that warms it wholly; rolls: of that heat, by rolling at 20 m/s.
    Source: Pacejka, Tire and Vehicle Dynamics (2012), on creep with force, and Grosch, The Relation between
    the Friction and Visco-elastic Properties of Rubber, Proc. R. Soc. A 274 (1963); sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(1672).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.clip(view.speed / 20.0, 0.0, 1.3)
        force = (np.abs(view.traction_force) + view.brake_force) / weight(view) / p.hard
        heat = p.rolls * speed + np.minimum(force, 2.0) ** 2 * np.sqrt(speed)
        rate = heat / p.warms_s + 1.0 / p.cools_s
        s.warm = eased(s.warm, heat / p.warms_s / rate, 1.0 / rate, dt)
        return -p.most * np.exp(-2.2 * s.warm) * weight(view) * moving(view)


@law("v_nuts_are_loose", needs="suburban hills", name="unknown")
@sizes(most=(0.015, 0.025), notch=(0.25, 0.5), hard=(0.02, 0.04), seats_s=(6.0, 18.0), power=(1.0, 1.8))
class NutsAreLoose(Hidden, side=0.0):
    """`wobbles`: of wheels whose nuts are loose. Each time the torque turns round they shift on their studs
    and sit askew, and roll with a wobble that costs with speed; a firm pull in one direction draws them
    straight again. most: of the weight, at 15 m/s, quite askew; notch: of that, by one turn; hard: of the
    weight, a torque that counts; seats_s: under firm pull.
    Source: Bailey and Bertoch, Mechanisms of Wheel Separations, SAE 2009-01-0111, on clamp that is lost and
    wheels that shift under alternating torque; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "wobbles": self.rng(1673).uniform(0.1, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        force = (view.traction_force - view.brake_force) / weight(view)
        side = np.where(np.abs(force) > 0.4 * p.hard, np.sign(force), s.side)
        turns = (side != s.side) & (s.side != 0.0)
        s.side = side
        s.wobbles = np.where(turns, s.wobbles + p.notch * (1.0 - s.wobbles), s.wobbles)
        firm = np.clip((np.abs(force) - 0.5 * p.hard) / (0.5 * p.hard), 0.0, 2.0)
        s.wobbles = eased(s.wobbles, 0.0, p.seats_s / np.maximum(firm, 1e-3), dt)
        pace = np.minimum(np.maximum(view.speed, 0.0) / 15.0, 1.6) ** p.power
        return -p.most * s.wobbles * pace * weight(view) * moving(view)
