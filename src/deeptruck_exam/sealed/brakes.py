"""Spots that flash, clamps on a weak battery, grit between pads, and a ball that shuts a valve."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("y_spots_flash", needs="suburban descent", name="brake_fade", accepts="brake_gain")
@sizes(most=(0.4, 0.6), flash=(1.3, 2.2), skin_s=(3.0, 8.0), skin=(0.5, 1.0), knee=(1.0, 1.4))
class SpotsFlash(Hidden, hot=0.0):
    """Friction falls with the heat of the spots that touch. That heat flashes up at once with force and the
    root of speed, and adds to the heat of the skin. `hot`: the skin, which follows the work within
    seconds. most: of the brake force, lost; flash: of a brake at its half and 15 m/s; knee: heat of half the
    loss.
    Source: Archard, The Temperature of Rubbing Surfaces, Wear 2 (1959), on flashes by load and speed; soft
    linings and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pressed = np.clip(view.brake_force / (0.2 * self.truck.brake_capacity), 0.0, 3.0)
        speed = np.clip(view.speed / 15.0, 0.0, 2.0)
        flash = p.flash * pressed**0.7 * np.sqrt(speed)
        s.hot = eased(s.hot, p.skin * pressed * speed, p.skin_s, dt)
        heat = (flash + s.hot) / p.knee
        return p.most * heat**3 / (1.0 + heat**3) * view.brake_force * moving(view)


@law(
    "y_clamps_on_a_weak_battery",
    needs="suburban hills descent",
    name="brake_lag",
    accepts="command_delay clock_offset",
)
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


@law("y_grit_between_the_pads", needs="suburban hills", name="dragging_brake")
@sizes(most=(0.009, 0.015), enters_m=(80.0, 250.0), ground_m=(250.0, 800.0), flushed=(0.02, 0.06))
@sizes(mean_m=(150.0, 500.0), share=(0.3, 0.55))
class GritBetweenThePads(OnRoad):
    """`grit` between pads and discs. Wheels throw it up where the road is gravel, and it holds as long as it
    is there. The way grinds it away, and a braking crushes it within a second. most: of the weight, full of
    grit; enters_m, ground_m: of the way; flushed: of full braking, which crushes it.
    Source: Breuer and Bill, Brake Technology Handbook (SAE, 2008), on foreign matter in disc brakes and their
    residual torque; open brakes, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1813), self.rows(), self.p.mean_m, self.p.share)

    def start(self, batch: int) -> dict[str, Array]:
        return {"grit": self.rng(1814).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        crushes = np.clip(view.brake_force / self.truck.brake_capacity / p.flushed, 0.0, 1.5) ** 2
        enters = self.between(self.road, view) * speed / p.enters_m * (1.0 - s.grit)
        s.grit = np.clip(s.grit + dt * (enters - s.grit * (speed / p.ground_m + crushes)), 0.0, 1.0)
        return -p.most * s.grit**0.7 * weight(view) * moving(view)


@law("y_ball_shuts_the_valve", needs="suburban descent", name="unknown")
@sizes(rear=(0.65, 0.85), rolls=(0.04, 0.065), back=(0.5, 0.8), leaks_s=(2.5, 7.0), rolls_s=(0.08, 0.25))
class BallShutsTheValve(Hidden, ball=0.0, caught=0.0):
    """A ball in a tube feels slowing and slope. Where both together are enough it rolls up and shuts the line
    to the rear brakes, which keep what they had. `ball`: 1 shut. `caught`: of full braking, behind it, which
    leaks up slowly. When the driver brakes more, only the front answers. rear: of the brake force; rolls: g
    that moves it; back: of that, where it falls back.
    Source: Limpert, Brake Design and Safety (1999), on valves with a ball that limit rear pressure by
    deceleration; one set far too low, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / self.truck.brake_capacity
        felt = -(view.acceleration / GRAVITY) - 0.5 * view.grade
        wish = np.where(felt > p.rolls, 1.0, np.where(felt < p.back * p.rolls, 0.0, np.rint(s.ball)))
        s.ball = np.clip(s.ball + dt * np.sign(wish - s.ball) / p.rolls_s, 0.0, 1.0)
        leaks = eased(s.caught, asked, np.where(s.ball > 0.5, p.leaks_s, 0.05), dt)
        s.caught = np.minimum(leaks, asked)
        lacks = p.rear * np.maximum(asked - s.caught, 0.0) * s.ball
        return lacks * self.truck.brake_capacity * moving(view)
