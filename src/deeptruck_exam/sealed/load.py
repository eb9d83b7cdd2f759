"""Sand that is blown off, a tank of two liquids, and a joint that is damped in bends."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import Bends
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")
LOADS = 83  # throws of dice for each drive


@law("z_sand_blows_off", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(most=(0.24, 0.38), lifts_mps=(6.0, 9.5), blows_s=(20.0, 60.0), stays_s=(2.0, 5.0), loads_s=(2.0, 5.0))
class SandBlowsOff(Hidden, still=0.0):
    """`sand`: of a load of dry sand without a sheet, which nobody has weighed. Above a speed the wind of
    driving lifts its grains, ever more with speed. At each longer stand it is loaded anew, to some height.
    most: of the mass, a full load; lifts_mps: where grains begin to jump; blows_s: until two thirds are gone
    at twice that; stays_s: of a stand.
    Source: Bagnold, The Physics of Blown Sand and Desert Dunes (1941), on flow of sand above a threshold of
    wind; a quick loss, sizes are chosen here."""

    def prepare(self) -> None:
        self.heaps = self.rng(1751).uniform(0.4, 1.0, (self.setting.batch, LOADS))

    def start(self, batch: int) -> dict[str, Array]:
        first = np.resize(self.heaps[:, 0], batch)
        return {**super().start(batch), "sand": first, "loads": np.ones(batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        before, s.still = s.still, np.where(view.speed < 0.2, s.still + dt, 0.0)
        begins = (before <= p.stays_s) & (s.still > p.stays_s)
        s.loads = np.where(begins, (s.loads + 1.0) % LOADS, s.loads)
        row = np.arange(len(view.speed)) % len(self.heaps)
        heap = self.heaps[row, s.loads.astype(int)]
        s.sand = np.where(s.still > p.stays_s, eased(s.sand, heap, p.loads_s, dt), s.sand)
        fast = np.clip(view.speed / p.lifts_mps, 0.0, 3.0)
        s.sand = s.sand * np.exp(-dt * np.maximum(fast**2 - 1.0, 0.0) * fast / (6.0 * p.blows_s))
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -p.most * s.sand * view.mass * np.clip(felt, -4.0, 4.0) * moving(view)


@law("z_two_liquids", needs="suburban", name="load_slosh")
@sizes(top=(0.08, 0.15), deep=(0.28, 0.42), top_rads=(2.2, 3.6), deep_rads=(0.3, 0.55), dull=(0.05, 0.12))
class TwoLiquids(Hidden, x=0.0, v=0.0, y=0.0, w=0.0):
    """Oil lies on water in one tank. `x` m, `v`: the surface, which swings within seconds; `y`, `w`: what
    lies between the liquids. They are nearly as heavy as each other, so this swings very slowly, and far.
    Walls bound it, and both die away slowly. top, deep: of the mass; dull: of critical damping.
    Source: Turner, Buoyancy Effects in Fluids (1973), on waves between two layers, and Abramson, The Dynamic
    Behavior of Liquids in Moving Containers, NASA SP-106 (1966); sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        pushes = np.zeros_like(felt)
        for share, takes, omega, far, at, pace in (
            (p.top, 1.0, p.top_rads, 0.5, "x", "v"),
            (p.deep, 0.5, p.deep_rads, 2.5, "y", "w"),
        ):
            place, speed = getattr(s, at), getattr(s, pace)
            spring = omega**2 * place * (1.0 + (place / far) ** 2)
            gains = -takes * felt - spring - 2.0 * p.dull * omega * speed
            after = np.clip(speed + dt * gains, -2.5, 2.5)
            setattr(s, at, np.clip(place + dt * after, -4.0, 4.0))
            setattr(s, pace, after)
            pushes = pushes - share * (after - speed) / dt
        return np.asarray(np.clip(pushes, -2.0, 2.0) * view.mass * moving(view))


@law("z_joint_is_damped", needs="suburban hills highway", name="unknown")
@sizes(damps=(0.05, 0.11), rubs=(0.004, 0.008), tightest=(0.008, 0.016), soft=(0.02, 0.06), long_m=(4.0, 8.0))
class JointIsDamped(Bends, bent=0.0):
    """`bent`: angle between two halves of a bus with a joint, rebuilt for freight. It is damped, so that
    the halves do not fold. Oil is pressed through its bores only while the angle changes: at both ends of
    each bend, and not along it. damps: of the weight, with the square of the pace, at 0.1 rad/s; rubs: of
    it, while it turns; long_m: of the way, until the rear half has followed.
    Source: Hübner, articulation systems with hydraulic dampers for buses, and Milliken and Milliken, Race
    Car Vehicle Dynamics (1995), on angles and curvature; a stiff damper, sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(1752), self.p.tightest)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        wish = p.long_m * self.read(self.bend, view) * np.minimum(1.0, 12.0 / np.maximum(speed, 1.0))
        before = s.bent
        s.bent = eased(s.bent, wish, p.long_m / np.maximum(speed, 0.5), dt)
        pace = np.abs(s.bent - before) / dt
        holds = p.rubs * np.tanh(pace / (0.1 * p.soft)) + p.damps * np.minimum(pace / 0.1, 1.0) ** 2
        return -holds * weight(view) * moving(view)
