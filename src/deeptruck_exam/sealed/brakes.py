"""Oil baths that overheat, a regulator that rings, pads that bends knock off, damp linings, and a brake that
learns from slopes."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.places import Bends
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("w_oil_bath_overheats", needs="descent", name="brake_fade")
@sizes(oil_jpkgk=(5.0, 10.0), passes_s=(15.0, 40.0), bears_k=(50.0, 100.0), loss=(0.4, 0.65))
@sizes(cools_s=(60.0, 160.0))
class OilBathOverheats(Hidden, disc=0.0, oil=0.0):
    """`disc`, `oil`: K above cold. Discs in a bath give their heat to oil that the engine's pump sends
    through a cooler: thin oil makes them rub less, and who brakes in a high gear cools them least. oil_jpkgk:
    for each kg of truck; bears_k: of the discs, where half of `loss` is lost; cools_s: at 150 rad/s.
    Source: Yang, Twaddell, Chen and Lam, Theoretical and Experimental Studies on the Thermal Degradation of
    Wet Friction Materials, SAE 970978, and makers' manuals of articulated haulers on forced cooling of wet
    discs; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        hot = np.maximum(s.disc / p.bears_k, 0.0) ** 2
        lost = p.loss * hot / (1.0 + hot)
        work = (1.0 - lost) * view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        passes = (s.disc - s.oil) / p.passes_s
        pumps = np.clip(view.engine_speed / 150.0, 0.3, 1.5)
        s.disc = s.disc + dt * (work / (0.4 * p.oil_jpkgk) - passes)
        s.oil = np.maximum(s.oil + dt * (0.4 * passes - pumps * s.oil / p.cools_s), 0.0)
        return lost * view.brake_force * moving(view)


@law("w_regulator_rings", needs="suburban descent", name="brake_lag", accepts="command_delay clock_offset")
@sizes(hz=(0.4, 0.75), damping=(0.3, 0.6), dead_s=(0.0, 0.2), share=(0.7, 1.0), vents=(0.7, 1.0))
class RegulatorRings(Hidden, bar=0.0, pace=0.0, heard=0.0):
    """The pressure of the far axles is regulated by a loop that is slow and rings: it comes late, goes too
    far and comes back; letting go, a little slower still. vents: of the loop's own speed, downwards.
    Source: Subramanian, Darbha and Rajagopal, Modeling the Pneumatic Subsystem of an S-cam Air Brake System,
    J. Dyn. Sys. Meas. Control 126 (2004), on pressure transients, and Astrom and Hagglund, PID Controllers
    (1995), on loops tuned too sharply; frequencies are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = view.brake_force / full
        s.heard = s.heard + dt * (asked - s.heard) / (0.06 + p.dead_s)
        omega = 2.0 * np.pi * p.hz * np.where(s.heard < s.bar, p.vents, 1.0)
        s.pace = s.pace + dt * (omega**2 * (s.heard - s.bar) - 2.0 * p.damping * omega * s.pace)
        bar = s.bar + dt * s.pace
        s.pace = np.where((bar < 0.0) & (s.pace < 0.0), 0.0, s.pace)
        s.bar = np.clip(bar, 0.0, 1.5)
        return p.share * full * (asked - s.bar) * moving(view)


@law("w_bends_knock_it_off", needs="suburban descent hills", name="dragging_brake")
@sizes(drags=(0.007, 0.015), sets=(0.02, 0.06), knocks=(0.15, 0.5), eases_m=(900.0, 3000.0))
class BendsKnockItOff(Bends, near=0.5):
    """`near`: 1 where the pads lie on the disc with all of `drags`. Each braking sets them there; hubs that
    bend under the side force of a curve push them away, and smooth straights hardly do. drags: of the weight;
    sets: brake over weight at which they are set in a second; knocks: 1/m, at 1 m/s2 aside.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on residual torque and knock-back of pads
    by elastic hubs; pins that rust, bends and sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(1113), 0.02)

    def start(self, batch: int) -> dict[str, Array]:
        return {"near": self.rng(1114).uniform(0.2, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        aside = np.minimum(speed**2 * np.abs(self.read(self.bend, view)), 2.5)
        set_per_s = np.minimum(view.brake_force / weight(view) / p.sets, 2.0)
        away = speed * (p.knocks * 0.02 * aside**2 + 1.0 / p.eases_m)
        s.near = np.clip(s.near + dt * (set_per_s * (1.0 - s.near) - away * s.near), 0.0, 1.0)
        return -p.drags * s.near * weight(view) * moving(view)


@law("w_sharp_in_the_morning", needs="suburban descent hills", name="unknown")
@sizes(more=(0.45, 0.9), dries_jpkg=(60.0, 220.0), air_s=(400.0, 1500.0), gentle=(0.3, 0.6))
class SharpInTheMorning(Hidden):
    """`damp` of linings that stood in moist air, other in each drive: they bite too hard, gentle braking
    most, until work has dried them. more: of the brake force; gentle: of the brake force that counts as
    gentle, over a tenth of full braking.
    Source: Parker and Newcomb, The Performance and Characteristics of the Disc Brake, Proc. IMechE Automobile
    Division (1964-65), and Limpert, Brake Design and Safety, on morning sharpness of linings; sizes are
    chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"damp": self.rng(1115).uniform(0.5, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass
        s.damp = s.damp * np.exp(-dt * (work / p.dries_jpkg + 1.0 / p.air_s))
        hard = view.brake_force / (0.1 * self.truck.brake_capacity)
        bites = p.more * s.damp * (0.35 + 0.65 / (1.0 + (hard / p.gentle) ** 2))
        return -bites * view.brake_force * np.clip(view.speed - 0.3, 0.0, 1.0)


@law("w_learns_from_slopes", needs="descent suburban hills", name="unknown")
@sizes(learns=(0.3, 0.6), needs_s=(0.8, 2.0), most=(0.3, 0.5), forgets_s=(120.0, 400.0), builds_s=(0.2, 0.5))
class LearnsFromSlopes(Hidden, factor=0.0, held=0.0, sum=0.0, uses=0.0):
    """`factor` by which the brake is turned up or down, learned after each braking from what was felt against
    what was meant, as if the road were flat: down long slopes it turns up, and the next stop in a dip is
    harsh. learns: of the difference, at each.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), and Lindemann, Petersen, Schult and Korn,
    EBS and Tractor Trailer Brake Compatibility, SAE 973283, on adapting brakes from application to
    application; one that does not know the slope, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        first = self.rng(1116).uniform(-0.5, 0.5, batch) * self.p.most
        return {**super().start(batch), "factor": first}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        brakes = (view.brake_force > 0.01 * weight(view)) & (view.speed > 1.5)
        ends = ~brakes & (s.held > p.needs_s)
        meant = view.brake_force + view.drag_force + view.rolling_force
        lacks = (meant / view.mass + view.acceleration) / np.maximum(view.brake_force / view.mass, 0.1)
        lesson = s.sum / np.maximum(s.held, 0.1)
        s.factor = np.where(ends, s.factor + p.learns * np.clip(lesson, -0.8, 0.8), s.factor)
        s.factor = np.clip(s.factor * (1.0 - dt / p.forgets_s), -p.most, p.most)
        s.sum = np.where(brakes, s.sum + dt * np.clip(lacks, -1.5, 1.5), 0.0)
        s.held = np.where(brakes, s.held + dt, 0.0)
        s.uses = s.uses + dt * (s.factor - s.uses) / p.builds_s
        return -s.uses * view.brake_force * np.clip(view.speed - 0.5, 0.0, 1.0)
