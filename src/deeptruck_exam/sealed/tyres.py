"""An aid to start that drops its axle again, a truck that sinks at speed, cores of foam, and twins that
touch."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
SHELLS = 4  # of a tyre's core, from its skin inwards


@law("j_aid_drops_its_axle_again", needs="hills suburban", name="wheel_slip", accepts="driveline_loss")
@sizes(grip=(0.05, 0.08), more=(0.45, 0.8), drops_mps=(6.0, 9.0), back_mps=(1.5, 3.5), moves_s=(0.8, 2.0))
@sizes(glides=(0.15, 0.35))
class AidDropsItsAxleAgain(Hidden, lifted=1.0, spins=0.0):
    """To start on a slippery road the trailing axle is lifted, and the driven one has its load. At a speed it
    is let down again, wherever that is: on a hill the driven axle then slips under the pull that it bore
    before. It is lifted again only near standstill. A wheel that slips holds less. grip: pull over weight
    that is borne with the axle down; more: of that, with the axle lifted; glides: of grip, lost by slipping.
    Source: Directive 97/27/EC, annex IV, on aids for starting and the speed at which they end, and Wong,
    Theory of Ground Vehicles (2008), on traction by load; a slippery road, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        keeps = np.where(view.speed < p.back_mps, 1.0, np.rint(s.lifted))
        s.lifted = eased(s.lifted, np.where(view.speed > p.drops_mps, 0.0, keeps), p.moves_s, dt)
        holds = p.grip * (1.0 + p.more * s.lifted) * (1.0 - p.glides * s.spins) * weight(view)
        pull = np.maximum(view.traction_force, 0.0)
        over = np.maximum(pull - holds, 0.0)
        s.spins = eased(s.spins, np.clip(5.0 * over / np.maximum(pull, 1.0), 0.0, 1.0), 0.5, dt)
        return -over * moving(view)


@law(
    "j_sinks_at_speed_and_toes",
    needs="highway hills suburban",
    name="rolling_resistance_speed",
    accepts="drag_area rolling_resistance",
)
@sizes(most=(0.008, 0.014), sinks_mps=(13.0, 17.0), rises=(0.2, 0.4), waits_s=(2.0, 6.0), moves_s=(2.0, 5.0))
@sizes(little=(0.1, 0.25))
class SinksAtSpeedAndToes(Hidden, low=0.0, fast=0.0):
    """Air springs let the truck sink when it has been fast for a while, and lift it when it has been slow.
    Its steering arms are set for the high stand: low, the wheels toe out, and scrub at any speed. `fast`: 1
    when it was fast long enough; `low`: how far it has sunk. most: of the weight, low; sinks_mps: speed;
    rises: of it, lower, where it is lifted; little: of most, high.
    Source: makers' notes on air suspension that lowers a truck at speed, and Gillespie, Fundamentals of
    Vehicle Dynamics (1992), on toe by ride height; linkage set wrongly, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        above, below = view.speed > p.sinks_mps, view.speed < p.sinks_mps * (1.0 - p.rises)
        counts = np.where(above, 1.0, np.where(below, -1.0, 0.0)) / p.waits_s
        s.fast = np.clip(s.fast + dt * counts, 0.0, 1.0)
        goes = np.where(s.fast >= 1.0, 1.0, np.where(s.fast <= 0.0, -1.0, 0.0)) / p.moves_s
        s.low = np.clip(s.low + dt * goes, 0.0, 1.0)
        toes = p.little + (1.0 - p.little) * s.low**2
        return -p.most * toes * weight(view) * moving(view)


@law("j_core_of_foam_warms_inwards", name="rolling_resistance_warmup")
@sizes(most=(0.016, 0.024), shell_s=(12.0, 30.0), works_s=(25.0, 60.0), eases=(1.2, 2.0), inside=(0.5, 0.7))
class CoreOfFoamWarmsInwards(Hidden):
    """Tyres are filled with foam, against thorns. Kneading warms the outer shells of the foam, and heat goes
    from shell to shell inwards, so that resistance falls soon a little and late by much. At a stand the skin
    cools, and the core warms it again. `heat` of the shells, from outside. most: of the weight, cold;
    shell_s: from one to the next; inside: of the losses, in the inner half; eases: of the logarithm, by a
    heat of 1.
    Source: Carslaw and Jaeger, Conduction of Heat in Solids (1959), and Ferry, Viscoelastic Properties of
    Polymers (1980), on losses by temperature; heavy foam, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"heat": self.rng(2271).uniform(0.0, 0.3, (batch, 1)) * np.ones(SHELLS)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        share = np.array([0.6, 0.4, 0.55, 0.45]) * np.array([1.0 - p.inside] * 2 + [p.inside] * 2)
        fast = np.clip(view.speed / 20.0, 0.0, 1.4)[:, None]
        losses = share * np.exp(-np.minimum(p.eases * s.heat, 5.0))
        skin = (0.15 + 0.5 * fast[:, 0]) * s.heat[:, 0] / p.works_s
        flows = np.diff(s.heat, axis=1) / p.shell_s
        gains = fast * losses * 8.0 / p.works_s
        gains[:, :-1] += flows
        gains[:, 1:] -= flows
        gains[:, 0] -= skin
        s.heat = np.clip(s.heat + dt * gains, 0.0, 4.0)
        return -p.most * losses.sum(axis=1) * weight(view) * moving(view)


@law("j_twins_touch_each_other", needs="suburban hills highway", name="unknown")
@sizes(most=(0.026, 0.04), room=(0.0, 0.02), wide=(0.07, 0.11), rounds=(0.25, 0.45), warms_s=(20.0, 60.0))
@sizes(dips=(0.8, 1.4), along_m=(25.0, 45.0))
class TwinsTouchEachOther(Hidden, slope=9.0):
    """Two tyres on one hub are too close: where the load presses them down their flanks touch and rub. The
    driven ones carry more when the truck climbs or gathers speed, and in sags by the square of speed. Rubbing
    makes them `hot`, and hot air in them makes them stand up again. most: of the weight; room: load beyond
    the usual one, that flanks bear apart; wide: from there until all of it; rounds: of load, taken by a heat
    of 1; dips: of a sag's load that reaches them.
    Source: makers' manuals on the spacing of dual tyres, and The Pneumatic Tire, ed. Gent and Walter, NHTSA
    DOT HS 810 561 (2006), on deflection by load and pressure; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(2272).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.5)
        s.slope = np.where(s.slope > 1.0, view.grade, eased(s.slope, view.grade, p.along_m / speed, dt))
        sag = np.clip((view.grade - s.slope) / p.along_m * speed**2 / GRAVITY, -0.3, 0.3)
        felt = np.clip(view.acceleration / GRAVITY + view.grade, -0.2, 0.2)
        bulges = 1.2 * felt + p.dips * sag + 0.06 - p.room - p.rounds * 0.2 * s.hot
        touches = np.clip(bulges / p.wide, 0.0, 1.2)
        s.hot = eased(s.hot, 1.5 * touches * np.clip(speed / 15.0, 0.0, 1.3), p.warms_s, dt)
        return -p.most * touches**1.5 * weight(view) * moving(view)
