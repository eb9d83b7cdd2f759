"""Foundation brakes, their air and their wear."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View


@hidden("s_powder_between", "sealed", "descent", name="brake_fade")
@sizes(loss=(0.35, 0.6), builds_jpkg=(120.0, 380.0), washes_m=(900.0, 2500.0))
class PowderBetween(Hidden, layer=0.0):
    """builds_jpkg: brake work for each kg of truck.
    Source: Godet, The Third-Body Approach, Wear 100 (1984): debris lies between the rubbing faces, grows with
    the work done and leaves with the way; brake powders and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lost = p.loss * s.layer**1.5
        speed = np.maximum(view.speed, 0.0)
        work = (1.0 - lost) * view.brake_force * speed / (p.builds_jpkg * view.mass)
        s.layer = np.clip(s.layer + dt * (work * (1.0 - s.layer) - speed * s.layer / p.washes_m), 0.0, 1.0)
        return lost * view.brake_force * moving(view)


@hidden(
    "s_pulsed_valves", "sealed", "suburban descent", name="brake_lag", accepts="command_delay clock_offset"
)
@sizes(step=(0.015, 0.035), pulse_s=(0.15, 0.35), share=(0.7, 1.0), vents=(1.0, 2.0))
class PulsedValves(Hidden, held=0.0, clock=0.0, wanted=0.0):
    """step: of the full force, for each pulse.
    Source: Pneumatic brakes driven by on-off valves rise and fall by pulses (Kienhöfer, Miller and Cebon,
    Design Concepts for an Alternative Heavy Vehicle ABS System, Vehicle System Dynamics 46, 2008); slow
    valves, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        full = self.truck.brake_capacity
        asked = view.brake_force / full
        s.clock = s.clock + dt
        pulse = s.clock >= p.pulse_s
        step = np.clip(asked - s.wanted, -p.vents * p.step, p.step)
        s.wanted = np.where(pulse, s.wanted + step, s.wanted)
        s.clock = np.where(pulse, s.clock - p.pulse_s, s.clock)
        s.held = s.held + dt * (s.wanted - s.held) / 0.12
        return p.share * full * (asked - s.held) * moving(view)


@hidden("s_wedge_climbs", "sealed", "suburban descent hills", name="dragging_brake")
@sizes(most=(0.012, 0.024), seed=(0.04, 0.15), way_m=(90.0, 260.0), shakes_m=(500.0, 1500.0))
class WedgeClimbs(Hidden, climbs=0.0, tired=0.0):
    """most: of the weight. It bites by itself over the way after a braking and shakes loose later.
    Source: Self-energised brakes wedge themselves once touched (Roberts and others, Testing the Mechatronic
    Wedge Brake, SAE 2004-01-2766); a wedge without return spring, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        rolled = dt * np.maximum(view.speed, 0.0)
        braked = view.brake_force > 0.006 * weight(view)
        s.tired = np.where(braked, 0.0, np.minimum(s.tired + rolled / p.shakes_m, 1.0))
        grows = s.climbs * (1.0 - s.climbs) / p.way_m - 3.0 * s.tired**2 * s.climbs / p.way_m
        s.climbs = np.where(braked, p.seed, np.clip(s.climbs + rolled * grows, 0.0, 1.0))
        return -p.most * s.climbs * weight(view) * ~braked * moving(view)


@hidden("s_start_aid_stays", "sealed", "suburban hills", name="unknown")
@sizes(force=(0.02, 0.05), lets_go_s=(2.0, 6.0), from_s=(0.3, 1.0))
class StartAidStays(Hidden, stood=0.0, held=0.0):
    """force: of the weight. Only a start after a stand has it.
    Source: Hill start aids hold pressure in the cylinders until a start is recognised (Automotive Handbook,
    Bosch, on automatic brake functions); one that bleeds off slowly, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stands = view.speed < 0.1
        s.stood = np.where(stands, s.stood + dt, 0.0)
        bleeds = s.held * (1.0 - dt / p.lets_go_s)
        s.held = np.where(stands & (s.stood > p.from_s), 1.0, np.where(s.held > 0.01, bleeds, 0.0))
        return -p.force * s.held * weight(view) * np.clip(view.speed / 0.5, 0.0, 1.0)
