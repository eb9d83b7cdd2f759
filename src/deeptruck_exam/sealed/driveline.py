"""An axle that fords chill, an engine that rocks, down-changes that wait, a weak coil, and discs in a row."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, windows
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
DISCS = 4


@law("h_fords_chill_the_axle", needs="hills suburban highway", name="driveline_loss", accepts="torque_gain")
@sizes(
    most=(0.008, 0.0135), thins=(1.6, 2.8), warms_s=(25.0, 70.0), chills_s=(3.0, 9.0), mean_m=(120.0, 350.0)
)
@sizes(share=(0.15, 0.35))
class FordsChillTheAxle(OnRoad):
    """`warm`: oil in an axle, that its own churning and load warm. Where the road runs through water the
    housing is chilled at once, and the oil is thick again for a minute. most: of the weight, at 15 m/s with
    cold oil; thins: power of the warmth; chills_s: in water.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on churning by viscosity,
    and Incropera and DeWitt, Fundamentals of Heat and Mass Transfer (1996), on wet walls; sizes are chosen
    here."""

    def prepare(self) -> None:
        self.road = windows(self.rng(1931), self.rows(), self.p.mean_m, self.p.share)

    def start(self, batch: int) -> dict[str, Array]:
        return {"warm": self.rng(1932).uniform(0.0, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        fast = np.clip(view.speed / 15.0, 0.0, 1.8)
        load = np.clip(np.abs(view.engine_torque) / self.truck.peak_torque, 0.0, 1.1)
        thick = np.exp(-p.thins * s.warm)
        warms = (0.9 * load + 0.6 * fast * thick) * fast * (1.0 - s.warm) / p.warms_s
        s.warm = np.clip(
            s.warm + dt * (warms - self.between(self.road, view) * s.warm / p.chills_s), 0.0, 1.0
        )
        return -p.most * thick * np.sqrt(fast) * (0.6 + 0.4 * load) * weight(view) * moving(view)


@law("h_engine_rocks_in_its_mounts", needs="suburban hills", name="driveline_backlash")
@sizes(soft=(0.16, 0.3), rocks_rads=(4.0, 8.0), dull=(0.2, 0.45), passes=(0.05, 0.2))
class EngineRocksInItsMounts(Hidden, lean=0.0, pace=0.0):
    """`lean` of an engine in torn mounts, -1 and 1 where it lies against its stops. Each time the torque
    turns round it has to rock over to the other side, and gives the shaft little until it lies there. It
    gets there the sooner, the harder it is asked. soft: of peak torque, that holds it at a stop; passes: of
    the torque, on the way.
    Source: Yu, Naganathan and Dukkipati, A Literature Review of Automotive Vehicle Engine Mounting Systems,
    Mechanism and Machine Theory 36 (2001); torn mounts, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = view.engine_torque / self.truck.peak_torque / p.soft
        push = p.rocks_rads**2 * (np.clip(asked, -2.5, 2.5) - 0.5 * s.lean)
        s.pace = s.pace + dt * (push - 2.0 * p.dull * p.rocks_rads * s.pace)
        lean = np.clip(s.lean + dt * s.pace, -1.0, 1.0)
        s.pace = np.where(np.abs(lean) >= 1.0, 0.0, s.pace)
        s.lean = lean
        lies = np.clip(np.sign(view.engine_torque) * s.lean, 0.0, 1.0) ** 3
        lacks = (1.0 - p.passes) * (1.0 - lies) * view.engine_torque
        return -self.at_wheels(view, lacks) * np.clip(view.speed, 0.0, 1.0)


@law("h_engine_has_to_catch_up", needs="suburban hills", name="shift_interruption", accepts="torque_limit")
@sizes(base_s=(0.9, 1.6), per_step_s=(5.5, 9.0), warm=(0.4, 0.7), forgets_s=(3.0, 8.0), deep=(0.75, 0.95))
class EngineHasToCatchUp(Hidden, gear=0.0, ratio=1.0, left=0.0, boost=0.0, cut=0.0):
    """Before a lower gear is closed the engine has to turn faster, and it gets there by its own little pull:
    the wider the step, the longer the truck rolls. `boost` of pulls of late lets it rev up quickly. Upward
    changes are as they should be. base_s: of each change down; per_step_s: more, for a doubling of the
    ratio; warm: of that time, saved by boost; deep: of the pull, lost meanwhile.
    Source: Pettersson and Nielsen, Gear Shifting by Engine Control, IEEE Trans. Control Systems Technology 8
    (2000), on synchronising by the engine; a slow engine, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        begins = (view.gear < s.gear - 0.5) & (view.speed > 0.5)
        step = np.clip(np.log2(np.maximum(view.ratio, 0.1) / np.maximum(s.ratio, 0.1)), 0.0, 1.0)
        lasts = p.base_s + p.per_step_s * step * (1.0 - p.warm * s.boost)
        s.left = np.where(begins, lasts, np.maximum(s.left - dt, 0.0))
        s.gear, s.ratio = view.gear.copy(), view.ratio.copy()
        s.boost = eased(s.boost, np.clip(1.2 * self.power_share(view), 0.0, 1.0), p.forgets_s, dt)
        s.cut = eased(s.cut, np.where(s.left > 0.0, p.deep, 0.0), 0.12, dt)
        return -s.cut * np.maximum(view.traction_force, 0.0) * moving(view)


@law(
    "h_coil_gets_hot",
    needs="suburban hills highway",
    name="torque_converter_slip",
    accepts="driveline_loss",
    trucks="freightliner",
    gateable=False,
)
@sizes(holds=(0.42, 0.58), falls=(0.6, 0.85), heats_s=(8.0, 25.0), cools_s=(30.0, 80.0), slides=(0.5, 0.8))
class CoilGetsHot(Hidden, lost=0.0):
    """A valve sets the pressure of the lock-up clutch by the current through its coil. `hot`: the coil, by
    the engine's heat and its own. Hot wire lets less current through, the clutch is pressed less, and torque
    beyond what it holds makes it slip. holds: of peak torque, cold; falls: of that, lost when hot; slides: of
    the torque beyond, that is lost.
    Source: Bosch Automotive Handbook (2014), on solenoids, whose current falls with their heat, and
    Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on lock-up clutches;
    sizes are chosen here."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "hot": self.rng(1933).uniform(0.1, 0.9, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        heats = (0.15 + 1.3 * np.clip(self.power_share(view), 0.0, 1.0)) * (1.0 - s.hot) / p.heats_s
        air = 0.4 + 0.6 * np.clip(view.speed / 15.0, 0.0, 1.5)
        s.hot = np.clip(s.hot + dt * (heats - s.hot * air / p.cools_s), 0.0, 1.0)
        holds = p.holds * (1.0 - p.falls * s.hot) * self.truck.peak_torque
        over = np.maximum(view.engine_torque - holds, 0.0)
        s.lost = eased(s.lost, p.slides * over, 0.2, dt)
        return -self.at_wheels(view, np.minimum(s.lost, np.maximum(view.engine_torque, 0.0))) * moving(view)


@law(
    "h_discs_drag_each_other", needs="suburban hills", name="rotating_inertia", accepts="mass payload_change"
)
@sizes(heavy=(0.35, 0.55), drags_s=(0.35, 0.8), rubs_s=(60.0, 200.0), fresh=(0.1, 0.3))
class DiscsDragEachOther(Hidden):
    """Heavy discs stand one behind the other on a shaft, each in oil and driven by the one before it. A short
    pull turns the first alone, and a long one all of them. `rims` m/s, as at the road. heavy: of the mass,
    all together; drags_s: until a disc follows the one before it; rubs_s: until they would stop; fresh: of
    that time, faster with thick oil after a stop.
    Source: Carslaw and Jaeger, Conduction of Heat in Solids (1959), on what passes from layer to layer, and
    Inman, Engineering Vibration (2013), on rows of discs; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"rims": np.full((DISCS, batch), -1.0)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        s.rims = np.where(s.rims < 0.0, speed, s.rims)
        thick = 1.0 + p.fresh * np.exp(-speed / 4.0)
        before = np.concatenate([speed[None], s.rims[:-1]])
        drives = thick * (before - s.rims) / p.drags_s
        passed = np.concatenate([drives[1:], np.zeros((1, len(speed)))])
        s.rims = np.maximum(s.rims + dt * (drives - passed - s.rims / p.rubs_s), 0.0)
        felt = np.clip(drives[0], -4.0, 4.0)
        return -p.heavy / DISCS * view.mass * felt * moving(view)
