"""A chamber that leaks, pads that are knocked back, a hand brake half released, a brake that holds at
stands, and a brake that learns."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, sections
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
MANY = 97  # throws of dice for each drive


@law("q_leaks_while_it_is_held", needs="suburban descent", name="brake_fade", accepts="brake_gain")
@sizes(share=(0.5, 0.8), leaks_s=(2.0, 5.5), found=(0.3, 0.55), fills_s=(0.3, 0.8), step=(0.02, 0.05))
class LeaksWhileItIsHeld(Hidden, left=1.0, top=0.0, fills=0.0):
    """`left`: of the pressure behind torn diaphragms. While the pedal is held still the valve is shut, and
    they leak; it opens again when the pedal goes deeper, or when what is missing has been found. share: of
    the brake force; found: `left` that is noticed; step: of full braking.
    Source: WABCO, EBS, Electronically Controlled Brake System, System Description, on modulators that hold
    pressure with both valves shut, and UN Regulation No. 13 on leaks; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        off = asked < 0.004
        deeper = asked > s.top + p.step
        s.top = np.where(off, 0.0, np.where(deeper, asked, np.minimum(s.top, asked + p.step)))
        s.fills = np.where(deeper | (s.left < p.found), 1.0, np.where(s.left > 0.97, 0.0, s.fills))
        s.left = eased(s.left, s.fills, np.where(s.fills > 0.5, p.fills_s, p.leaks_s), dt)
        s.left = np.where(off, 1.0, s.left)
        return p.share * (1.0 - s.left) * view.brake_force * moving(view)


@law(
    "q_pads_are_knocked_back",
    needs="suburban hills descent",
    name="brake_lag",
    accepts="command_delay clock_offset",
)
@sizes(
    share=(0.6, 0.9), knocks_m=(150.0, 500.0), shuts_s=(0.9, 1.8), bites_s=(0.08, 0.2), mean_m=(200.0, 700.0)
)
class PadsAreKnockedBack(OnRoad, room=0.3, given=0.0):
    """`room` that bumps have made between pads and discs since the last braking, the more, the rougher the
    road. The next one has to push the pads across before it holds, gently for long; soon after that the
    brake bites at once. share: of the brake force; shuts_s: for a tenth of full braking.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on knock-back of pads by play and bending
    of wheel bearings; worn ones, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1511)
        number = sections(rng, self.rows(), self.p.mean_m)
        rough = rng.uniform(0.2, 1.8, (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(rough, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        opens = np.maximum(view.speed, 0.0) * self.read(self.road, view) / p.knocks_m * (asked < 0.004)
        shuts = np.minimum(asked / 0.1, 4.0) / p.shuts_s
        s.room = np.clip(s.room + dt * (opens - shuts), 0.0, 1.0)
        holds = 1.0 - np.clip(s.room / 0.12, 0.0, 1.0)
        s.given = eased(s.given, asked * holds, p.bites_s, dt)
        return p.share * (asked - s.given) * self.truck.brake_capacity * moving(view)


@law("q_hand_brake_half_released", needs="suburban", name="dragging_brake", accepts="rolling_resistance")
@sizes(
    most=(0.016, 0.03), often=(0.6, 0.85), heats_jpkg=(40.0, 120.0), cools_s=(30.0, 90.0), softens=(1.0, 2.5)
)
@sizes(rests_s=(1.5, 3.0))
class HandBrakeHalfReleased(Hidden, still=0.0, hot=0.0):
    """`pulls`: of a hand brake behind the gearbox, that was set at a stand and not quite let off. Each stand
    leaves something else, often nothing. Its small drum grows hot in a moment and then holds less. most: of
    the weight, cold; often: of stands, after which something is left; softens: of the grip, when hot.
    Source: Limpert, Brake Design and Safety, on parking brakes at the driveshaft, and AAMVA, Model Commercial
    Driver License Manual, on releasing the parking brake; sizes are chosen here."""

    def prepare(self) -> None:
        dice = self.rng(1512).random((self.setting.batch, MANY))
        self.leaves = np.where(dice < self.p.often, 0.35 + 0.65 * dice / self.p.often, 0.0)

    def start(self, batch: int) -> dict[str, Array]:
        first = np.resize(self.leaves[:, 0], batch)
        return {**super().start(batch), "pulls": first, "stands": np.ones(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        before, s.still = s.still, np.where(view.speed < 0.2, s.still + dt, 0.0)
        sets = (before <= p.rests_s) & (s.still > p.rests_s)
        row = np.arange(len(view.speed)) % len(self.leaves)
        s.pulls = np.where(sets, self.leaves[row, s.stands.astype(int)], s.pulls)
        s.stands = np.where(sets, (s.stands + 1.0) % MANY, s.stands)
        holds = p.most * s.pulls / (1.0 + p.softens * s.hot)
        work = 9.81 * holds * np.maximum(view.speed, 0.0) / p.heats_jpkg
        s.hot = np.clip(s.hot + dt * (work - s.hot / p.cools_s), 0.0, 3.0)
        return -holds * weight(view) * moving(view)


@law("q_halt_brake_lets_go_late", needs="suburban", name="unknown")
@sizes(most=(0.04, 0.065), sets_s=(0.6, 1.5), lets=(0.07, 0.12), waits_s=(0.6, 1.6), frees_s=(0.6, 1.8))
@sizes(off_mps=(5.0, 8.5))
class HaltBrakeLetsGoLate(Hidden, still=0.0, on=0.0, holds=0.0, pulled=0.0):
    """`holds`: a brake that holds by itself at stands. It lets go when the truck has pulled firmly for a
    while, or rolls after all; a gentle start drags it along. most, lets: of the weight, the second one of the
    pull; off_mps: where it lets go in any case.
    Source: makers' manuals of distribution trucks and city buses, on halt brakes and hill holders that are
    released by the accelerator; a late one, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.still = np.where(view.speed < 0.2, s.still + dt, 0.0)
        firm = view.traction_force > p.lets * weight(view)
        s.pulled = np.where(firm, s.pulled + dt, 0.0)
        goes = (s.pulled > p.waits_s) | (view.speed > p.off_mps)
        s.on = np.where(s.still > p.sets_s, 1.0, np.where(goes, 0.0, s.on))
        s.holds = np.clip(s.holds + dt * np.where(s.on > 0.5, 4.0, -1.0 / p.frees_s), 0.0, 1.0)
        return -p.most * s.holds * weight(view) * moving(view)


@law("q_learns_brake_by_brake", needs="suburban descent hills", name="unknown")
@sizes(wide=(0.25, 0.42), learns=(0.5, 0.85), least_s=(0.8, 2.0), eases_s=(0.15, 0.4))
class LearnsBrakeByBrake(Hidden, lasts=0.0, acts=0.0):
    """`miss`: of the trailer's share, which its controller learns anew after each braking from the pull in
    the coupling that it has felt, rightly or wrongly. Within a braking nothing changes. wide: of the brake
    force, too much or too little; learns: of what it believes, at a time; least_s: of a braking that counts.
    Source: WABCO, EBS, Electronically Controlled Brake System, System Description, on coupling force control,
    which adapts over several applications; felt with much chance, sizes are chosen here."""

    def prepare(self) -> None:
        self.felt = self.rng(1513).uniform(-1.0, 1.0, (self.setting.batch, MANY))

    def start(self, batch: int) -> dict[str, Array]:
        first = np.resize(self.felt[:, 0], batch)
        return {**super().start(batch), "miss": self.p.wide * first, "count": np.ones(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        brakes = view.brake_force > 0.004 * weight(view)
        learns = ~brakes & (s.lasts > p.least_s)
        row = np.arange(len(view.speed)) % len(self.felt)
        believes = p.wide * self.felt[row, s.count.astype(int)]
        s.miss = np.where(learns, s.miss + p.learns * (believes - s.miss), s.miss)
        s.count = np.where(learns, (s.count + 1.0) % MANY, s.count)
        s.lasts = np.where(brakes, s.lasts + dt, 0.0)
        s.acts = eased(s.acts, s.miss, p.eases_s, dt)
        return -s.acts * view.brake_force * moving(view)
