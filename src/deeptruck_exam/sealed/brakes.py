"""Iron that warms in its field, magnets that a drum drags along, a foot that rests, and axles by turns."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, index, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("k_iron_warms_in_its_field", needs="descent", name="brake_fade")
@sizes(share=(0.65, 0.9), peak_mps=(9.0, 14.0), resists=(0.9, 1.6), heats_jpkg=(120.0, 320.0))
@sizes(cools_s=(80.0, 220.0), field=(0.2, 0.35))
class IronWarmsInItsField(Hidden, hot=0.0):
    """An electric retarder does most of what the pedal asks. Its iron conducts the worse, the hotter: then
    it brakes best at a higher speed and less below it, and hot coils make a weaker field. Air that it blows
    itself cools it. share: of the brake force; peak_mps: where it brakes best, cold; resists: of the
    resistance, more when hot; field: of the force, lost by hot coils.
    Source: Schieber, Braking Torque on Rotating Sheet in Stationary Magnetic Field, Proc. IEE 121 (1974), and
    Limpert, Brake Design and Safety, on electric retarders when hot; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        cold = speed / p.peak_mps
        warm = cold / (1.0 + p.resists * s.hot)
        ratio = (1.0 + cold**2) / (1.0 + warm**2) / (1.0 + p.resists * s.hot)
        kept = np.minimum(ratio, 1.0) * (1.0 - p.field * np.minimum(s.hot, 1.0))
        work = p.share * kept * view.brake_force * speed / view.mass
        s.hot = np.clip(
            s.hot + dt * (work / p.heats_jpkg - s.hot * (0.4 + speed / 20.0) / p.cools_s), 0.0, 1.5
        )
        return p.share * (1.0 - kept) * view.brake_force * moving(view)


@law(
    "k_magnets_are_dragged_along",
    needs="suburban descent",
    name="brake_lag",
    accepts="command_delay clock_offset",
)
@sizes(share=(0.6, 0.9), rises_m=(5.0, 12.0), coil_s=(0.1, 0.3), lets_s=(0.25, 0.6))
class MagnetsAreDraggedAlong(Hidden, coil=0.0, lever=0.0):
    """Electric brakes of a trailer: a magnet sticks to the turning drum, which drags it along and so turns
    the lever that spreads the shoes. Force comes over a way, not over a time, and slowest when slow; a spring
    takes it back. share: of the brake force; rises_m: of the way.
    Source: Limpert, Brake Design and Safety, on electric brakes whose magnets are carried along by the drum;
    a worn armature, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        s.coil = eased(s.coil, asked, p.coil_s, dt)
        drags = p.rises_m / np.maximum(view.speed, 0.3)
        s.lever = eased(s.lever, s.coil, np.where(s.coil > s.lever, drags, p.lets_s), dt)
        return p.share * (asked - s.lever) * self.truck.brake_capacity * moving(view)


@law("k_foot_rests_on_the_pedal", needs="suburban descent hills", name="dragging_brake")
@sizes(most=(0.012, 0.022), stays_s=(25.0, 90.0), tense_s=(6.0, 20.0), kicks=(0.55, 0.8), lifts_s=(3.0, 8.0))
class FootRestsOnThePedal(Hidden):
    """`rests`: a left foot that stays on the brake pedal after it has braked, lighter and lighter, below what
    the switch of the pedal tells; a driver who treads on the accelerator firmly takes it away. How tense he
    is comes and goes. most: of the weight; kicks: of the full pedal, that takes the foot away.
    Source: AAMVA, Model Commercial Driver License Manual, against riding the brakes; times and sizes are
    chosen here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / 0.5) + 20)
        self.tense = 0.65 + 0.35 * np.tanh(ou_series(self.rng(1411), shape, 0.5, self.p.tense_s))

    def start(self, batch: int) -> dict[str, Array]:
        return {"rests": self.rng(1412).uniform(0.2, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        brakes = np.clip(view.brake_force / weight(view) / 0.02, 0.0, 1.0)
        kicked = self.pedal(view) > p.kicks
        wish = np.where(brakes > 0.3, 1.0, 0.0)
        s.rests = eased(
            s.rests, wish, np.where(brakes > 0.3, 0.8, np.where(kicked, p.lifts_s, p.stays_s)), dt
        )
        tense = self.tense[:, index(view, self.tense, 0.5)]
        return -p.most * s.rests * tense * (1.0 - brakes) * weight(view) * moving(view)


@law("k_wears_its_axles_by_turns", needs="suburban descent hills", name="unknown")
@sizes(weak=(0.3, 0.5), strong=(0.15, 0.3), gentle=(0.14, 0.28), hands_s=(0.15, 0.4))
class WearsItsAxlesByTurns(Hidden, pressed=0.0, share=0.0):
    """So that linings wear alike, gentle braking is done by one group of axles and then by the other, one
    application after the other; one has poor linings and the other has sharp ones. Hard braking uses all.
    weak, strong: of the brake force, less and more; gentle: of full braking.
    Source: WABCO, EBS, Electronically Controlled Brake System, System Description, on lining wear control
    between axles; linings of two makes, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "turn": self.rng(1413).integers(0, 2, batch).astype(float)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        begins = (asked > 0.012) & (s.pressed < 0.5)
        s.turn = np.where(begins, 1.0 - s.turn, s.turn)
        s.pressed = np.where(begins, 1.0, np.where(asked < 0.005, 0.0, s.pressed))
        alone = np.clip(2.0 - asked / p.gentle, 0.0, 1.0)
        s.share = eased(s.share, alone * np.where(s.turn > 0.5, p.weak, -p.strong), p.hands_s, dt)
        return s.share * view.brake_force * moving(view)
