"""Frost on bridges, grease that leaves its bearings, rubber with crystals, and a tread that peels off."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("q_frost_on_bridges", needs="suburban hills", name="wheel_slip")
@sizes(frost=(0.08, 0.13), driven=(0.3, 0.4), mean_m=(90.0, 220.0), share=(0.25, 0.4), finds_s=(0.15, 0.4))
@sizes(warms=(0.3, 0.8))
class FrostOnBridges(OnRoad, lost=0.0, held=0.0, melts=0.0):
    """Bridges freeze before the road does. There driven wheels hold little, and so do braked ones, all of
    them; a wheel that slides warms what is under it a little. frost: grip; driven: of the weight; share: of
    the road; warms: of the grip, more after a second of sliding.
    Source: Norrman, Eriksson and Lindqvist, Relationships between Road Slipperiness, Traffic Accident Risk
    and Winter Road Maintenance Activity, Climate Research 15 (2000), and warning signs at bridges; long
    bridges, sizes are chosen here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1571), self.rows(), self.p.mean_m, self.p.share)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        ice, heavy = self.between(self.road, view), weight(view)
        grip = p.frost * (1.0 + p.warms * s.melts)
        pull, brake = np.maximum(view.traction_force, 0.0), view.brake_force
        drives, holds = grip * p.driven * heavy, grip * heavy
        spins = ice * (pull - drives * np.tanh(pull / drives))
        slides = ice * (brake - holds * np.tanh(brake / holds))
        s.lost = eased(s.lost, spins, p.finds_s, dt)
        s.held = eased(s.held, slides, p.finds_s, dt)
        slips = np.clip((s.lost + s.held) / (0.02 * heavy), 0.0, 1.0)
        s.melts = eased(s.melts, slips, np.where(slips > s.melts, 1.0, 0.5), dt)
        return (np.minimum(s.held, brake) - np.minimum(s.lost, pull)) * moving(view)


@law(
    "q_grease_leaves_its_bearings",
    needs="highway hills",
    name="rolling_resistance_speed",
    accepts="drag_area",
)
@sizes(
    most=(0.007, 0.011), power=(0.6, 0.75), thrown_mps=(16.0, 24.0), leaves_s=(15.0, 50.0), back_s=(8.0, 25.0)
)
class GreaseLeavesItsBearings(Hidden, full=1.0):
    """`full`: of the grease between the rollers of new wheel bearings. It is sheared with two thirds of a
    power of speed; fast driving throws it aside in time and they run free, slow driving lets it creep back.
    most: of the weight, at 20 m/s, full; thrown_mps: where a third of it stays.
    Source: SKF, Rolling Bearings catalogue (2018), on frictional moment with a power of 0.6 to two thirds of
    speed, starvation and replenishment; too much grease, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        stays = np.exp(-((speed / p.thrown_mps) ** 3))
        s.full = eased(s.full, stays, np.where(stays < s.full, p.leaves_s, p.back_s), dt)
        shears = np.minimum(speed / 20.0, 1.4) ** p.power
        return -p.most * (0.2 + 0.8 * s.full) * shears * weight(view) * moving(view)


@law("q_rubber_holds_crystals", name="rolling_resistance_warmup")
@sizes(most=(0.009, 0.014), warms_s=(40.0, 110.0), at=(0.3, 0.5), melts_s=(8.0, 25.0), forms_s=(60.0, 200.0))
class RubberHoldsCrystals(Hidden):
    """`crystals` that natural rubber has grown over cold nights; they make it stiff. `warm`: the tyre, 1 as
    at 20 m/s for long. Nothing happens until it is warm enough to melt them, then they go soon; at slow
    speeds they grow again. most: of the weight, all crystals; at: of `warm`, where melting begins.
    Source: Treloar, The Physics of Rubber Elasticity (1975), on crystals of natural rubber in the cold, which
    melt well above where they form; quick ones, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1572)
        return {"warm": rng.uniform(0.0, 0.3, batch), "crystals": rng.uniform(0.6, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pace = np.clip(view.speed / 20.0, 0.0, 1.3)
        s.warm = eased(s.warm, pace, p.warms_s, dt)
        melts = np.clip((s.warm - p.at) / 0.15, 0.0, 1.0) / p.melts_s
        forms = np.clip((p.at - s.warm) / 0.15, 0.0, 1.0) / p.forms_s
        s.crystals = np.clip(s.crystals + dt * (forms * (1.0 - s.crystals) - melts * s.crystals), 0.0, 1.0)
        return -p.most * s.crystals * (0.6 + 0.4 * pace) * weight(view) * moving(view)


@law("q_tread_peels_off", needs="highway hills", name="unknown")
@sizes(most=(0.018, 0.03), grows_s=(8.0, 25.0), holds_m=(300.0, 1500.0), flies=(0.7, 1.0), stays=(0.0, 0.1))
class TreadPeelsOff(Hidden, way=0.0):
    """`strip`: of a retread that has come off its casing, 1 once around. It tears the faster, the faster the
    tyre turns, beats the road and the air, and flies off in the end. The next piece holds for a while.
    most: of the weight, at 20 m/s, once around; flies: of `strip`, where it tears off; holds_m: until the
    next one begins.
    Source: NHTSA, Commercial Medium Tire Debris Study, DOT HS 811 060 (2008), on belts and treads that come
    off; times and sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1573)
        waits = self.p.holds_m * rng.uniform(-0.3, 1.0, batch)
        return {**super().start(batch), "waits": waits, "strip": np.zeros(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        pace = np.minimum(speed / 20.0, 1.3)
        s.way = s.way + dt * speed
        begun = s.way > s.waits
        s.strip = np.where(begun, s.strip + dt * pace**3 * (0.15 + 0.85 * s.strip) / p.grows_s, s.strip)
        off = s.strip > p.flies
        s.strip = np.where(off, p.stays, np.minimum(s.strip, 1.0))
        s.waits = np.where(off, s.way + p.holds_m, s.waits)
        return -p.most * s.strip * pace**2 * weight(view) * moving(view)
