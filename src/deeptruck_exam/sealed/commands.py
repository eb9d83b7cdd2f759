"""A command that has to stand still, a motor that gets tired, and a cab that tugs at its cable."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Filter, Hidden, Sizes, State, TorqueFilter, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law(
    "y_waits_until_it_stands_still",
    needs="suburban hills descent",
    name="command_delay",
    accepts="clock_offset",
)
@sizes(stands_s=(0.35, 0.6), most_s=(1.3, 2.2), band=(0.03, 0.07))
class WaitsUntilItStandsStill(Filter):
    """A receiver believes a command when it has stood still for a moment, within a band. As long as it moves
    on, the old one holds, though not for ever. Each pedal is judged by itself. stands_s: of standing still;
    most_s: of waiting; band: of the full command.
    Source: Ganssle, A Guide to Debouncing (2008), and IEC 61131-2 on filters of inputs that wait for a steady
    value; a slow one, times are chosen here."""

    def start(self, batch: int) -> dict[str, Any]:
        zeros = np.zeros((batch, 2))
        return {"held": zeros.copy(), "near": zeros.copy(), "stood": zeros.copy(), "waited": zeros.copy()}

    def begin(self, s: State, u: Array) -> None:
        s.held, s.near = u.copy(), u.copy()

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        wide = p.band * np.array([self.full, 40.0])
        moves = np.abs(u - s.near) > wide
        s.near = np.where(moves, u, s.near)
        s.stood = np.where(moves, 0.0, s.stood + dt)
        believed = (s.stood > p.stands_s) | (s.waited > p.most_s)
        s.held = np.where(believed, u, s.held)
        s.waited = np.where(np.abs(u - s.held) > wide, s.waited + dt, 0.0)
        return np.asarray(s.held)


@law("y_motor_gets_tired", needs="suburban hills highway", name="command_rate_limit", accepts="turbo_lag")
@sizes(per_s=(0.25, 0.45), tires=(0.7, 0.9), moves=(1.2, 3.0), rests_s=(15.0, 45.0))
class MotorGetsTired(TorqueFilter):
    """A small motor moves the throttle at a pace, and its winding gets hot by moving. `hot`: a hot winding
    carries less current, and the pace falls. While the pedal rests it cools. per_s: of the full command, when
    cold; tires: of that, lost when hot; moves: full ways that heat it; rests_s: until it has cooled.
    Source: Hughes and Drury, Electric Motors and Drives (2013), on torque and current of warm windings; a
    small motor, sizes are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        first = self.rng(1822).uniform(0.2, 0.8, len(self.setting.start_m))
        s.hot = np.resize(first, len(u))

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        most = p.per_s * (1.0 - p.tires * s.hot) * self.full * dt
        given = np.clip(pedal, s.given - most, s.given + most)
        moved = np.abs(given - s.given) / self.full
        s.hot = np.clip(s.hot + moved / p.moves - dt * s.hot / p.rests_s, 0.0, 1.0)
        return np.asarray(given)


@law("y_cab_tugs_at_its_cable", needs="suburban hills", name="unknown")
@sizes(per_g=(2.0, 4.0), rocks_rads=(1.1, 2.2), dull=(0.08, 0.2), most=(0.15, 0.25), slack=(0.004, 0.012))
class CabTugsAtItsCable(Hidden, lean=0.0, pace=0.0):
    """The pedal stands in a cab on soft springs, and a cable goes from there to the engine on the frame.
    `lean` g of the cab: pulling leans it back and slackens the cable, braking and lifting tightens it. So the
    engine's torque swings after each change. per_g: of the pedal's way; slack: g of lean that does nothing.
    Source: Lemerle, Boulanger and Poirot, A Simplified Method to Design Suspended Cabs, J. Sound and
    Vibration 253 (2002), on modes of cabs; the cable and its sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration / GRAVITY + view.grade, -0.3, 0.3)
        push = p.rocks_rads**2 * (felt - s.lean)
        s.pace = s.pace + dt * (push - 2.0 * p.dull * p.rocks_rads * s.pace)
        s.lean = np.clip(s.lean + dt * s.pace, -0.4, 0.4)
        beyond = np.sign(s.lean) * np.maximum(np.abs(s.lean) - p.slack, 0.0)
        pedal = self.pedal(view)
        tugs = np.clip(-p.per_g * beyond, -p.most, p.most) * np.minimum(pedal / 0.1, 1.0)
        tugs = np.clip(tugs, -pedal, 1.0 - pedal)
        return self.at_wheels(view, tugs * self.truck.peak_torque) * moving(view)
