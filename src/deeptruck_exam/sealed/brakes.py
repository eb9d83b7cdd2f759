"""Pins that bind when hot, axles that come in turn, mud that dries in drums, and a switch that is shaken."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, sections, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("v_pins_bind_when_hot", needs="suburban descent", name="brake_fade", accepts="brake_gain")
@sizes(
    binds=(0.05, 0.1), share=(0.3, 0.5), heats_jpkg=(60.0, 160.0), cools_s=(40.0, 120.0), frees=(0.35, 0.6)
)
class PinsBindWhenHot(Hidden, bound=0.0):
    """`hot`: the pins on which callipers slide. At 1 they bind, and stay so until they are much cooler: then
    the outer pads get only what is left of the force after friction, gentle braking gets nothing. binds: of
    full braking, held by friction; share: of the brake force, on bound callipers; frees: of `hot`.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on floating callipers and their guides,
    and Knorr-Bremse, SB and SN disc brakes service manual, on seized guide pins; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(1611).uniform(0.1, 1.1, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        work = view.brake_force * np.maximum(view.speed, 0.0) / view.mass / p.heats_jpkg
        s.hot = np.clip(s.hot + dt * (work - s.hot / p.cools_s), 0.0, 2.0)
        wish = np.where(s.hot > 1.0, 1.0, np.where(s.hot < p.frees, 0.0, np.round(s.bound)))
        s.bound = np.where(wish > 0.5, 1.0, eased(s.bound, 0.0, 3.0, dt))
        held = p.binds * (0.5 + 0.5 * s.hot) * self.truck.brake_capacity
        return p.share * s.bound * np.minimum(view.brake_force, held) * moving(view)


@law(
    "v_axles_come_in_turn",
    needs="suburban hills descent",
    name="brake_lag",
    accepts="command_delay clock_offset",
)
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


@law("v_mud_dries_in_the_drums", needs="suburban hills", name="dragging_brake", accepts="rolling_resistance")
@sizes(
    most=(0.008, 0.014),
    sticks=(0.35, 0.6),
    picks_m=(40.0, 150.0),
    dries_s=(20.0, 60.0),
    crumbles_m=(250.0, 900.0),
)
@sizes(mean_m=(200.0, 600.0), muddy=(0.2, 0.4))
class MudDriesInTheDrums(OnRoad):
    """`mud` between shoes and drums, from wet fields and fords; `dry` of it. Wet mud drags the more, the
    faster it is sheared; dry mud drags the same at any speed, then crumbles out over the way, or at once
    when the brakes press it. most: of the weight, drums full; sticks: of that, at no speed; muddy: of the
    road.
    Source: Coussot, Mudflow Rheology and Dynamics (1997), on yield stress and flow of muds, and makers'
    manuals of construction trucks on cleaning drums; sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1612), self.rows(), self.p.mean_m, self.p.muddy)

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1613)
        return {"mud": rng.uniform(0.0, 1.0, batch), "dry": rng.uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed, wet = np.maximum(view.speed, 0.0), self.between(self.road, view)
        picks = wet * speed / p.picks_m * (1.0 - s.mud)
        presses = np.clip(view.brake_force / self.truck.brake_capacity / 0.1, 0.0, 1.0) / 1.5
        s.mud = np.clip(s.mud + dt * (picks - s.mud * (s.dry * speed / p.crumbles_m + presses)), 0.0, 1.0)
        s.dry = np.clip(
            s.dry + dt * ((1.0 - s.dry) * (1.0 - wet) / p.dries_s - picks * s.dry * 3.0), 0.0, 1.0
        )
        flows = (1.0 - s.dry) * (1.0 - p.sticks) * np.sqrt(np.minimum(speed / 12.0, 1.6))
        return -p.most * s.mud * (p.sticks + flows) * weight(view) * moving(view)


@law("v_switch_shakes_open", needs="suburban hills", name="unknown")
@sizes(most=(0.02, 0.035), trips=(0.75, 1.15), lasts_s=(1.2, 3.0), ramps_s=(0.3, 0.7), mean_m=(60.0, 200.0))
@sizes(deaf_s=(6.0, 15.0))
class SwitchShakesOpen(OnRoad, shakes=0.0, left=0.0, deaf=0.0, on=0.0):
    """A ramp that is not shut must hold the truck, so its switch puts the brakes on gently. A worn switch
    shakes open where the road is rough and the speed shakes it; it shuts again in a moment, and its bus
    reports at most once in a while. most: of the weight; trips: of the shaking of a rough road at 12 m/s;
    deaf_s: between two reports.
    Source: makers' manuals of car carriers, buses and low loaders on brakes that are interlocked with ramps
    and doors; a worn switch, sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1614)
        number = sections(rng, self.rows(), self.p.mean_m)
        rough = rng.lognormal(-0.45, 0.6, (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(rough, number, axis=1)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        beats = self.read(self.road, view) * np.maximum(view.speed, 0.0) / 12.0
        s.shakes = eased(s.shakes, beats, 0.4, dt)
        opens = (s.shakes > p.trips) & (s.deaf <= 0.0)
        s.left = np.where(opens, p.lasts_s, np.maximum(s.left - dt, 0.0))
        s.deaf = np.where(opens, p.lasts_s + p.deaf_s, np.maximum(s.deaf - dt, 0.0))
        s.on = np.clip(s.on + dt * np.where(s.left > 0.0, 1.0, -1.0) / p.ramps_s, 0.0, 1.0)
        return -p.most * s.on * weight(view) * moving(view)
