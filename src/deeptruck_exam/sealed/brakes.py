"""Foundation brakes, their actuators, and systems that brake of their own accord."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View


@hidden("n_axles_share_unequally", "sealed", "descent", name="brake_fade")
@sizes(uneven=(0.3, 0.6), loss=(0.3, 0.5), heats_jpkg=(250.0, 600.0), cools_s=(150.0, 450.0))
class AxlesShareUnequally(Hidden):
    """Three groups of axles, of which one takes most, gets hot first and leaves the work to the others.
    heats_jpkg: work for each kg of truck that would heat equal shares to where half of `loss` is lost.
    Source: Fancher, Winkler and Campbell, The Influence of Braking Strategy on Brake Temperatures in Mountain
    Descents (UMTRI, 1992), on brakes that share unequally; logistic loss and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"hot": np.zeros((3, batch))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        share = (1.0 + p.uneven * np.array([[1.0], [0.0], [-1.0]])) / 3.0
        lost = p.loss / (1.0 + np.exp(-(s.hot - 1.0) / 0.15))
        lost = lost - p.loss / (1.0 + np.exp(1.0 / 0.15))
        work = view.brake_force * np.maximum(view.speed, 0.0) / (p.heats_jpkg * view.mass)
        s.hot = s.hot + dt * (3.0 * share * (1.0 - lost) * work - s.hot / p.cools_s)
        return np.maximum((share * lost).sum(axis=0), 0.0) * view.brake_force * moving(view)


@hidden(
    "n_spindle_needs_time", "sealed", "suburban descent", name="brake_lag",
    accepts="command_delay clock_offset",
)  # fmt: skip
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


@hidden("n_fluid_is_trapped", "sealed", "suburban descent hills", name="dragging_brake")
@sizes(most=(0.014, 0.026), heats_jpkg=(50.0, 180.0), feeds=(0.4, 1.1), cools_s=(25.0, 80.0))
class FluidIsTrapped(Hidden, hot=0.0):
    """most: of the weight; feeds: how far its own drag keeps it hot, over what it loses at 15 m/s.
    Source: Limpert, Brake Design and Safety, on compensating ports: where one stays shut, fluid that warms
    cannot go back and holds the brakes on, which warms it more; rates and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        braked = view.brake_force * speed / (p.heats_jpkg * view.mass)
        itself = p.feeds * s.hot * speed / 15.0 / p.cools_s
        cools = s.hot * (0.5 + 0.5 * speed / 15.0) / p.cools_s
        s.hot = np.clip(s.hot + dt * ((braked + itself) * (1.0 - s.hot) - cools), 0.0, 1.0)
        return -p.most * s.hot * weight(view) * moving(view)


@hidden("n_assist_is_mistaken", "sealed", "suburban descent", name="unknown")
@sizes(gain=(0.35, 0.8), from_gps=(0.035, 0.07), comes_s=(0.1, 0.3))
class AssistIsMistaken(Hidden, slow=0.0, on=0.0, level=0.0):
    """A quick application is taken for an emergency and helped until the pedal is let go. from_gps: g a
    second.
    Source: Kiesewetter, Klinkner, Reichelt and Steiner, Der neue Brake Assist von Mercedes-Benz, ATZ 99
    (1997): full braking once the pedal's speed passes a threshold; a threshold that is too low and a help
    that is small are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.brake_force / weight(view)
        s.slow = s.slow + dt * (asked - s.slow) / 0.25
        quick = (asked - s.slow) / 0.25 > p.from_gps
        s.on = np.where(asked < 0.003, 0.0, np.where(quick, 1.0, s.on))
        s.level = s.level + dt * (s.on - s.level) / p.comes_s
        return -p.gain * s.level * view.brake_force * moving(view)


@hidden("n_snubs_by_itself", "sealed", "descent", name="unknown")
@sizes(depth=(0.02, 0.04), power_wpkg=(5.0, 7.5), until=(0.68, 0.86), comes_s=(0.3, 1.0))
class SnubsByItself(Hidden, on=0.0, level=0.0):
    """It brakes while the slope gives more power than it likes, until that is well below. depth: of the
    weight.
    Source: Grade severity rating of trucks: safe speed falls with slope, since brakes bear a power (Bowman,
    FHWA-IP-88-015, 1989); a descent control with service brakes, its limits are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        power = -9.81 * view.grade * view.speed
        s.on = np.where(power > p.power_wpkg, 1.0, np.where(power < p.until * p.power_wpkg, 0.0, s.on))
        s.level = s.level + dt * (s.on - s.level) / p.comes_s
        return -p.depth * s.level * weight(view) * moving(view)


@hidden("n_retarder_on_the_lamps", "sealed", "suburban descent", name="unknown")
@sizes(most=(0.025, 0.05), knee_mps=(4.0, 9.0), stays_s=(1.0, 3.0), heats_s=(15.0, 50.0))
class RetarderOnTheLamps(Hidden, left=0.0, flux=0.0, hot=0.0):
    """Any braking switches it on, whole, and it stays on for a while after. most: of the weight.
    Source: Eddy-current retarders of trailers switched with the stop lamps (Limpert, Brake Design and Safety,
    on retarders; torque over speed with a maximum, and less when hot); a relay that drops late, sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        lamps = view.brake_force > 0.003 * weight(view)
        s.left = np.where(lamps, p.stays_s, np.maximum(s.left - dt, 0.0))
        s.flux = s.flux + dt * ((s.left > 0.0) - s.flux) / 0.35
        pace = np.maximum(view.speed, 0.0) / p.knee_mps
        force = p.most * s.flux * 2.0 * pace / (1.0 + pace**2) / (1.0 + s.hot)
        s.hot = s.hot + dt * (force / p.most - 0.5 * s.hot) / p.heats_s
        return -force * weight(view) * moving(view)
