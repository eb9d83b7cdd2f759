"""Brakes that come late by their parts: drums, fluids, rubber, magnets, pads, valves, clamps, retarders."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving
from deeptruck_exam.effects.places import OnRoad, sections
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="brake_lag", accepts="command_delay clock_offset")


@law("n_spindle_needs_time", "ninth", "suburban descent")
@sizes(gap=(0.12, 0.25), travel_s=(2.2, 4.5), back=(1.1, 1.8), share=(0.75, 1.0))
class SpindleNeedsTime(Hidden, at=0.0):
    """`at`: way of the spindle, 1 for full force; gap: of that way, until the pads touch.
    Source: Line, Manzie and Good, Electromechanical Brake Modeling and Control: From PI to MPC, IEEE Trans.
    Control Syst. Technol. 16 (2008): a motor crosses the clearance and then bends the caliper, whose force
    grows faster than its way; a slow motor, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = np.clip(view.brake_force / full, 0.0, 1.0)
        goal = np.where(asked > 0.002, p.gap + (1.0 - p.gap) * np.sqrt(asked), 0.0)
        s.at = s.at + np.clip(goal - s.at, -p.back * dt / p.travel_s, dt / p.travel_s)
        held = np.clip((s.at - p.gap) / (1.0 - p.gap), 0.0, 1.0) ** 2
        return p.share * full * (asked - held) * moving(view)


@law("t_hot_drums_are_far", "tenth", "suburban descent")
@sizes(stroke_s=(0.25, 0.55), hot=(0.6, 1.8), share=(0.75, 1.0), fills_s=(0.15, 0.45))
class HotDrumsAreFar(Hidden, way=0.0, held=0.0):
    """`way`: s of the stroke that are done. A drum that has grown with heat is reached later. hot: for each
    100 K.
    Source: Flick, The Effect of Brake Adjustment on Braking Performance, DOT HS 807 287 (1988): stroke grows
    with wear and with drum temperature; the time it takes is chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = view.brake_force / full
        hotter = np.clip(view.brake_temperature - self.truck.ambient_temperature, 0.0, 250.0)
        stroke = p.stroke_s * (1.0 + p.hot * hotter / 100.0)
        pace = np.clip(0.5 + asked / 0.15, 0.5, 2.0)
        way = np.where(asked > 0.002, s.way + dt * pace, s.way - 3.0 * dt)
        s.way = np.clip(way, 0.0, stroke)
        touches = np.clip((s.way / stroke - 0.8) / 0.2, 0.0, 1.0)
        s.held = s.held + dt * (asked * touches - s.held) / p.fills_s
        return p.share * full * (asked - s.held) * moving(view)


@law("e_air_in_the_fluid", "eleventh", "suburban descent")
@sizes(air=(0.12, 0.3), bar=(0.03, 0.08), stiff=(0.3, 0.6), flows_s=(0.25, 0.55), share=(0.75, 1.0))
class AirInTheFluid(Hidden, volume=0.0):
    """`volume`: what has been pushed into the lines. It presses the air together first, so that gentle
    braking comes latest. air: of the volume at full braking; bar: pressure of the air at rest over that of
    full braking; stiff: of the lines without air; flows_s: to fill them at full pressure.
    Source: Yu, Chen and Lu, The Variation of Oil Effective Bulk Modulus with Pressure in Hydraulic Systems,
    J. Dyn. Sys. Meas. Control 116 (1994), on fluid with air in it, and Limpert, Brake Design and Safety, on
    air over hydraulic brakes; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = np.clip(view.brake_force / full, 0.0, 1.2)
        held = self.pressure(p, s.volume)
        differs = asked - held
        springs = np.where(differs > 0.0, differs, 1.5 * (differs - 0.05))  # of the shoes, that help it out
        s.volume = np.clip(s.volume + dt * np.clip(springs, -0.5, 0.5) / p.flows_s, 0.0, 2.0)
        return p.share * full * differs * moving(view)

    def pressure(self, p: Sizes, volume: Array) -> Array:
        """Over that of full braking: air takes p.air * q / (q + p.bar), the lines p.stiff * q."""
        b = p.air + p.stiff * p.bar - volume
        root = np.sqrt(np.maximum(b**2 + 4.0 * p.stiff * p.bar * volume, 0.0))
        return np.asarray(np.maximum((root - b) / (2.0 * p.stiff), 0.0))


@law("x_rubber_creeps", "thirteenth", "suburban descent")
@sizes(quick_s=(0.25, 0.5), slow_s=(1.8, 4.0), creeps=(0.4, 0.65), stiff=(0.5, 1.5), warms_s=(60.0, 200.0))
class RubberCreeps(Hidden, quick=0.0, slow=0.0, soft=0.0):
    """Rubber in old chambers takes its share of the stroke twice: soon, and creeping for seconds. Force that
    creeps in creeps out again, and frost makes both slower until use has warmed it. creeps: share that comes
    slowly; stiff: times as slow, more, when cold; warms_s: of braking.
    Source: Findley, Lai and Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials (1976), on
    chains of springs and dampers, and SAE J1469 on brake actuators in the cold; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        s.soft = s.soft + dt * (1.0 - s.soft) * np.clip(20.0 * asked, 0.0, 1.0) / p.warms_s
        cold = 1.0 + p.stiff * (1.0 - s.soft)
        s.quick = s.quick + dt * (asked - s.quick) / (p.quick_s * cold)
        s.slow = s.slow + dt * (asked - s.slow) / (p.slow_s * cold)
        comes = (1.0 - p.creeps) * s.quick + p.creeps * s.slow
        return (asked - comes) * self.truck.brake_capacity * moving(view)


@law("k_magnets_are_dragged_along", "fourteenth", "suburban descent")
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


@law("q_pads_are_knocked_back", "fifteenth", "suburban hills descent")
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


@law("v_axles_come_in_turn", "sixteenth", "suburban hills descent")
@sizes(share=(0.7, 0.95), opens=(0.5, 0.8), fills_s=(0.25, 0.5), drains_s=(0.3, 0.7), last=(1.2, 2.0))
class AxlesComeInTurn(Hidden, one=0.0, two=0.0, three=0.0):
    """`one`, `two`, `three`: of full braking, on axles whose valves stand in a row. Each gets air once the
    one before it has most of its own, and each has a longer pipe than the one before. When the pedal is let
    go they empty in the same order. share: of the brake force; opens: of what is asked, at which the next
    valve opens; last: times the first one's time, for each further axle.
    Source: Limpert, Brake Design and Safety, on air brake timing of combinations with several axles; valves
    in a row, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        first = np.where(asked > s.one, p.fills_s, p.drains_s)
        s.one = eased(s.one, asked, first, dt)
        for before, name in (("one", "two"), ("two", "three")):
            ahead, mine = getattr(s, before), getattr(s, name)
            fill = np.clip((ahead - p.opens * asked) / np.maximum((1.0 - p.opens) * asked, 0.003), 0.0, 1.0)
            wish = np.where(ahead > mine, mine + fill * (ahead - mine), ahead)
            slow = p.last if name == "two" else p.last**2
            setattr(s, name, eased(mine, wish, first * slow, dt))
        given = (s.one + s.two + s.three) / 3.0
        return p.share * (asked - given) * self.truck.brake_capacity * moving(view)


@law("z_helped_by_the_steering_pump", "seventeenth", "suburban hills descent")
@sizes(share=(0.75, 0.95), per_s=(0.12, 0.25), at_rads=(120.0, 160.0), kept=(0.05, 0.15), fills_s=(6.0, 20.0))
@sizes(drains_s=(0.2, 0.5))
class HelpedByTheSteeringPump(Hidden, held=0.0, store=1.0):
    """`held`: of full braking, by a booster that the pump of the steering feeds. Its flow grows with the
    engine's speed, so that brakes come slowly at idle and soon at high revs. `store`, a small one, fills the
    first press at once, and is filled again while nobody brakes. share: of the brake force, boosted; per_s:
    of full braking, at at_rads; kept: of full braking, in a full store.
    Source: Bosch, Hydro-Boost service manual, on boosters fed by the power steering pump with a store for
    some stops, and Limpert, Brake Design and Safety; a worn pump, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        flow = p.per_s * np.clip(view.engine_speed / p.at_rads, 0.3, 1.5) ** 1.5
        wants = np.maximum(asked - s.held, 0.0)
        quick = np.minimum(np.minimum(s.store * p.kept / 0.25, wants / 0.1), 0.6)
        fills = np.minimum(flow, wants / 0.1)
        falls = eased(s.held, asked, p.drains_s, dt)
        s.held = np.where(wants > 0.0, np.minimum(s.held + dt * (fills + quick), asked), falls)
        gains = np.where(asked < 0.004, (1.0 - s.store) / p.fills_s, 0.0)
        s.store = np.clip(s.store + dt * (gains - quick / p.kept), 0.0, 1.0)
        return p.share * (asked - s.held) * self.truck.brake_capacity * moving(view)


@law("y_clamps_on_a_weak_battery", "eighteenth", "suburban hills descent")
@sizes(share=(0.8, 1.0), watts=(0.004, 0.01), least=(0.03, 0.08), sags=(0.35, 0.6), charges_s=(8.0, 20.0))
@sizes(opens_s=(0.15, 0.4))
class ClampsOnAWeakBattery(Hidden, held=0.0, full=1.0):
    """`held`: of full braking, by electric clamps. Their motors have a power and no more, so they close fast
    while they press little, and ever more slowly as they press hard. The battery sags while they work. share:
    of the brake force, by such clamps; watts: of full braking squared, in a second; least: clearance, of full
    braking; sags: of the power, in an empty battery.
    Source: Line, Manzie and Good, Electromechanical Brake Modeling and Control: From PI to MPC, IEEE Trans.
    Control Systems Technology 16 (2008); a weak supply, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        pace = p.watts * (1.0 - p.sags * (1.0 - s.full)) / (p.least + s.held)
        rises = np.minimum(s.held + dt * np.minimum(pace, 2.0), asked)
        falls = eased(s.held, asked, p.opens_s, dt)
        works = np.where(asked > s.held + 1e-4, 1.0, 0.0)
        s.held = np.where(asked > s.held, rises, falls)
        s.full = np.clip(s.full + dt * ((1.0 - s.full) / p.charges_s - 0.5 * works), 0.0, 1.0)
        return p.share * (asked - s.held) * self.truck.brake_capacity * moving(view)


@law("h_fluid_is_thick", "nineteenth", "suburban hills descent")
@sizes(share=(0.8, 1.0), cold_s=(0.9, 1.6), thins=(1.0, 1.8), warms_s=(5.0, 14.0), cools_s=(30.0, 90.0))
@sizes(back=(1.2, 2.0))
class FluidIsThick(Hidden, held=0.0):
    """`held`: of full braking, behind long thin pipes of fluid. Cold fluid is thick, and it flows through
    them by the difference of pressures alone, so that small and large brakings come as late. `warm`: the
    fluid, which braking warms and the wind cools. share: of the brake force; cold_s: behind cold pipes;
    thins: power of the warmth; back: of the time, to let go.
    Source: Limpert, Brake Design and Safety (1999), on brake fluid at low temperature, and Streeter and
    Wylie, Fluid Mechanics (1985), on laminar flow in pipes; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "warm": self.rng(1912).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        heats = np.clip(asked * np.maximum(view.speed, 0.0) / 2.0, 0.0, 2.0) * (1.0 - s.warm) / p.warms_s
        s.warm = np.clip(s.warm + dt * (heats - s.warm / p.cools_s), 0.0, 1.0)
        late = p.cold_s * np.exp(-p.thins * s.warm) * np.where(asked > s.held, 1.0, p.back)
        s.held = eased(s.held, asked, late, dt)
        return p.share * (asked - s.held) * self.truck.brake_capacity * moving(view)


@law("b_shoes_are_carried_round", "twentieth", "suburban hills descent")
@sizes(share=(0.75, 0.95), way_m=(5.0, 10.0), dry=(0.3, 0.7), back_s=(0.5, 1.4), least_s=(0.12, 0.3))
class ShoesAreCarriedRound(Hidden, held=0.0):
    """Shoes float in their drum, and do nothing before it has carried them round to their anchor. That takes
    a way and not a time: fast wheels are braked soon and slow ones late. Firmly pressed shoes are carried
    along better. `held`: of full braking. share: of the brake force; way_m: of the road, softly pressed; dry:
    less of it, firmly pressed; back_s: until springs have drawn them back.
    Source: Limpert, Brake Design and Safety (1999), on duo-servo drums whose shoes shift to an anchor; loose
    shoes, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        way = p.way_m * (1.0 - p.dry * np.tanh(8.0 * asked))
        carried = p.least_s + way / np.maximum(view.speed, 1.0)
        s.held = eased(s.held, asked, np.where(asked > s.held, carried, p.back_s), dt)
        return p.share * (asked - s.held) * self.truck.brake_capacity * moving(view)


@law("u_retarder_goes_first", "twenty-first", "suburban hills descent")
@sizes(takes=(0.08, 0.14), fills_s=(0.9, 1.8), empties_s=(0.5, 1.2), slow_mps=(5.0, 8.0), hurries=(0.3, 0.6))
class RetarderGoesFirst(Hidden, oil=0.0):
    """A gentle braking is done by a retarder alone, whose oil has to come first; what is asked beyond it is
    done by the linings at once. So light brakings come late and hard ones nearly in time. `oil`: braking that
    is there, of full. takes: of full braking, at most by the retarder; slow_mps: below that speed its share
    goes to the linings; hurries: of the time, saved by a store of air when it was filled shortly before.
    Source: makers' manuals on electronic brakes that blend retarder and linings, and Breuer and Bill, Brake
    Technology Handbook (SAE, 2008); a slow retarder, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "warm": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        can = p.takes * np.clip(view.speed / p.slow_mps, 0.0, 1.0)
        gentle = np.minimum(asked, can)
        s.warm = eased(s.warm, np.clip(gentle / p.takes, 0.0, 1.0), 8.0, dt)
        fills = p.fills_s * (1.0 - p.hurries * s.warm)
        s.oil = eased(s.oil, gentle, np.where(gentle > s.oil, fills, p.empties_s), dt)
        return (gentle - s.oil) * self.truck.brake_capacity * moving(view)
