"""Loads that move."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, index, moving
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, name="load_slosh")


@law("load_slosh", "first", "suburban")
@sizes(share=(0.15, 0.40), pendulum_m=(1.2, 4.5), damping=(0.02, 0.10))
class Pendulum(Hidden, angle=0.0, rate=0.0):
    """The liquid is part of the known mass; what is unknown is that it swings.
    Source: Dodge, The New Dynamic Behavior of Liquids in Moving Containers, SwRI (2000): equivalent pendulum,
    its sine kept; contact with the bulkhead is chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        omega2 = GRAVITY / p.pendulum_m
        bulkhead = 400.0 * np.sign(s.angle) * np.maximum(np.abs(s.angle) - 0.6, 0.0)
        turning = (
            -omega2 * np.sin(s.angle)
            - 2.0 * p.damping * np.sqrt(omega2) * s.rate
            - view.acceleration * np.cos(s.angle) / p.pendulum_m
            - bulkhead
        )
        s.rate += dt * turning
        s.angle += dt * s.rate
        return -p.share * view.mass * p.pendulum_m * turning * np.cos(s.angle) * moving(view)


@law("baffled_tank", "second", "suburban")
@sizes(share=(0.35, 0.65), length_m=(4.5, 9.0), fill=(0.12, 0.30), baffles=(0.3, 1.2))
class BaffledTank(Hidden):
    """Two waves at a time, which die the faster the higher they are. share: liquid over gross mass; fill:
    depth over length; baffles: 1/m.
    Source: Ibrahim, Liquid Sloshing Dynamics (2005): frequencies and masses of the first and third
    antisymmetric mode of a rectangular tank; damping of baffles with the square of the flow, chosen here."""

    def prepare(self) -> None:
        n = np.array([[1.0], [3.0]])
        depth = n * np.pi * self.p.fill
        self.omega2 = n * np.pi * GRAVITY / self.p.length_m * np.tanh(depth)
        self.part = 8.0 * np.tanh(depth) / (n**2 * np.pi**2 * depth)

    def start(self, batch: int) -> dict[str, Array]:
        return {"way": np.zeros((2, batch)), "rate": np.zeros((2, batch))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        damping = (p.baffles * np.abs(s.rate) + 0.02 * np.sqrt(self.omega2)) * s.rate
        driven = -self.omega2 * s.way - damping - np.clip(view.acceleration, -6.0, 6.0)
        s.rate += dt * driven
        s.way = np.clip(s.way + dt * s.rate, -1.5, 1.5)
        # the liquid is part of the known mass: what it does not follow of the truck's motion is missing
        moved = (self.part * driven).sum(axis=0)
        return -p.share * view.mass * moved * moving(view)


@law("bore_in_the_tank", "third", "suburban")
@sizes(share=(0.25, 0.50), length_m=(4.0, 8.5), depth_m=(0.45, 1.1), back=(0.55, 0.9))
class BoreInTheTank(Hidden):
    """Square waves, not sines: `mean` is the acceleration of the liquid's centre, as long ago as the wave
    takes.
    Source: Stoker, Water Waves (1957): shallow water carries a change of speed from wall to wall at the
    wave's own speed; d'Alembert's solution between two walls that give back a part, which is chosen here."""

    def prepare(self) -> None:
        self.takes_s = self.p.length_m / np.sqrt(GRAVITY * self.p.depth_m)
        self.cells = max(2, round(self.takes_s / 0.01))

    def start(self, batch: int) -> dict[str, Array]:
        past = np.zeros((self.cells, batch))
        return {"speed": past, "mean": past.copy(), "at": np.full(1, -1)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        if s.at[0] < 0:
            s.speed[:] = view.speed
        s.at[0] = (s.at[0] + 1) % self.cells
        cell = int(s.at[0])
        changed = (view.speed - s.speed[cell]) / self.takes_s
        mean = (1.0 + p.back) * changed - p.back * s.mean[cell]
        s.speed[cell], s.mean[cell] = view.speed, mean
        lag = np.clip(view.acceleration - mean, -2.5, 2.5)
        # the liquid is part of the known mass: only what it does not follow of the truck's motion is missing
        return p.share * view.mass * lag * moving(view)


@law("through_swash_plates", "fourth", "suburban")
@sizes(share=(0.35, 0.65), length_m=(2.0, 4.0), depth_m=(0.6, 1.3), orifice=(0.15, 0.6))
class ThroughSwashPlates(Hidden):
    """`flow` (2, batch) m/s between compartments, `level` (3, batch) m above the mean. length_m: of one
    compartment; orifice: 1/m.
    Source: Compartments joined by holes in swash plates (UN Regulation ADR 6.8.2.1.22 on surge plates;
    Idelchik, Handbook of Hydraulic Resistance, on orifices): liquid columns of some inertia driven by the
    tilt of the surface, braked by the square of their flow; three compartments, sizes chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"flow": np.zeros((2, batch)), "level": np.zeros((3, batch))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        head = GRAVITY * (s.level[:-1] - s.level[1:]) / p.length_m
        driven = head - np.clip(view.acceleration, -5.0, 5.0) - p.orifice * s.flow * np.abs(s.flow)
        driven -= 0.15 * s.flow  # films on the walls
        s.flow = np.clip(s.flow + dt * driven, -2.5, 2.5)
        rises = dt * p.depth_m / p.length_m * s.flow
        s.level[:-1] -= rises
        s.level[1:] += rises
        s.level = np.clip(s.level, -0.8 * p.depth_m, 0.8 * p.depth_m)
        # the liquid is part of the known mass: what it does not follow of the truck's motion is missing
        return -p.share * view.mass * driven.mean(axis=0) * moving(view)


@law("rows_of_small_tanks", "fifth", "suburban")
@sizes(share=(0.35, 0.6), slowest_hz=(0.45, 0.7), spread=(1.3, 1.9), breaks=(0.3, 1.2))
class RowsOfSmallTanks(Hidden):
    """`at`, `rate` (5, batch): m and m/s of five groups of containers.
    Source: Containers of a cubic metre on a platform: each sloshes at its own frequency by its own fill
    (Housner, Dynamic Pressures on Accelerated Fluid Containers, Bull. Seismol. Soc. Am. 47, 1957), so that
    the row falls out of step; breaking waves damp with the square of speed; fills chosen here."""

    def prepare(self) -> None:
        hertz = self.p.slowest_hz * self.p.spread ** np.linspace(0.0, 1.0, 5)
        self.omega = 2.0 * np.pi * hertz[:, None]

    def start(self, batch: int) -> dict[str, Array]:
        return {"at": np.zeros((5, batch)), "rate": np.zeros((5, batch))}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = self.omega**2 * s.at + (0.06 * self.omega + p.breaks * np.abs(s.rate)) * s.rate
        driven = -np.clip(view.acceleration, -5.0, 5.0) - pull
        s.rate = np.clip(s.rate + dt * driven, -2.0, 2.0)
        s.at = np.clip(s.at + dt * s.rate, -0.5, 0.5)
        # the mass is known; what it moves otherwise than the truck is not
        return -p.share * view.mass * driven.mean(axis=0) * moving(view)


@law("concrete_yields", "seventh", "suburban")
@sizes(share=(0.35, 0.6), yields=(0.12, 0.35), creeps_s=(0.25, 0.8), back=(0.5, 1.6))
class ConcreteYields(Hidden, at=0.0, pace=0.0):
    """`at` m and `pace` m/s of the load's middle; it may rest anywhere within its yield. yields: m/s2; back:
    1/s2.
    Source: Tattersall and Banfill, The Rheology of Fresh Concrete (1983): a Bingham body stays where it is
    until a yield stress is passed, then creeps by what is beyond it; half a drum of a stiff mix, with its own
    slope pushing it back."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pushed = -np.clip(view.acceleration, -4.0, 4.0) - GRAVITY * view.grade - p.back * s.at
        free = np.sign(pushed) * np.maximum(np.abs(pushed) - p.yields, 0.0)
        runs = np.where(s.pace == 0.0, free, pushed - p.yields * np.tanh(s.pace / 0.02))
        turning = np.clip(runs - s.pace / p.creeps_s, -5.0, 5.0)
        s.pace = np.clip(s.pace + dt * turning, -1.5, 1.5)
        s.at = np.clip(s.at + dt * s.pace, -1.2, 1.2)
        return -p.share * view.mass * turning * moving(view)


@law("n_flexitank_creeps", "ninth", "suburban")
@sizes(share=(0.3, 0.55), hz=(0.3, 0.65), soft=(0.15, 0.45), relaxes_s=(0.4, 1.6))
class FlexitankCreeps(Hidden, way=0.0, rate=0.0, set=0.0):
    """share: of the mass; soft: of its stiffness that does not relax. `set` is what the bag has given.
    Source: Flügge, Viscoelasticity (1975): the standard solid, a spring beside a spring and a dashpot in a
    row; liquid in a bag within a container, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stiff = (2.0 * np.pi * p.hz) ** 2
        spring = stiff * (p.soft * s.way + (1.0 - p.soft) * (s.way - s.set))
        driven = -spring - 0.15 * s.rate - np.clip(view.acceleration, -4.0, 4.0)
        s.set = s.set + dt * (s.way - s.set) / p.relaxes_s
        s.rate = s.rate + dt * driven
        s.way = np.clip(s.way + dt * s.rate, -2.0, 2.0)
        return -p.share * view.mass * np.clip(driven, -4.0, 4.0) * moving(view)


@law("t_liquid_swirls", "tenth", "suburban")
@sizes(share=(0.28, 0.5), hz=(0.35, 0.65), damping=(0.02, 0.07), softens=(0.8, 2.5))
class LiquidSwirls(Hidden, x=0.0, y=0.0, vx=0.0, vy=0.0):
    """Swings fore and aft pass into swings aside and come back. softens: 1/m2; share: of the mass.
    Source: Miles, Resonantly Forced Surface Waves in a Circular Cylinder, J. Fluid Mech. 149 (1984): both
    swings of a round tank have one frequency, which falls as they grow, and feed each other; upright tanks,
    the road's unrest aside and sizes are chosen here."""

    def prepare(self) -> None:
        shape = (self.setting.batch, int(self.setting.duration_s / 0.1) + 20)
        self.aside = 0.2 * ou_series(self.rng(986), shape, 0.1, 1.5)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        omega = 2.0 * np.pi * p.hz
        soft = omega**2 * np.maximum(1.0 - p.softens * (s.x**2 + s.y**2), 0.4)
        cross = 0.6 * omega**2 * p.softens * s.x * s.y
        damps = 2.0 * p.damping * omega
        driven = -soft * s.x + cross * s.y - damps * s.vx - np.clip(view.acceleration, -4.0, 4.0)
        beside = self.aside[:, index(view, self.aside, 0.1)]
        s.vx = np.clip(s.vx + dt * driven, -2.5, 2.5)
        s.vy = np.clip(s.vy + dt * (-soft * s.y - cross * s.x - damps * s.vy + beside), -2.5, 2.5)
        s.x, s.y = np.clip(s.x + dt * s.vx, -0.8, 0.8), np.clip(s.y + dt * s.vy, -0.8, 0.8)
        return -p.share * view.mass * np.clip(driven, -4.0, 4.0) * moving(view)


@law("e_powder_settles", "eleventh", "suburban")
@sizes(share=(0.45, 0.65), hz=(0.35, 0.65), thick=(0.04, 0.10), settles_s=(60.0, 200.0), shakes=(0.3, 0.7))
class PowderSettles(Hidden, x=0.0, v=0.0):
    """`air` in the powder: 1 as it comes from the silo, when it flows like water, to 0, when it lies still.
    It leaves by itself, and shaking keeps it in. thick: damping, full of air; shakes: of the air lost, that
    1 m/s2 brings back.
    Source: Geldart, Types of Gas Fluidization, Powder Technology 7 (1973): fine powders stay fluid for
    minutes as their air leaves; cement in tanks, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "air": self.rng(1052).uniform(0.35, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -4.0, 4.0)
        brings = p.shakes * np.minimum(np.abs(view.acceleration), 2.0) * (1.0 - s.air)
        s.air = np.clip(s.air + dt * (brings - s.air) / p.settles_s, 0.0, 1.0)
        omega = 2.0 * np.pi * p.hz
        damping = p.thick + 0.7 * (1.0 - s.air) ** 2
        driven = -(omega**2) * s.x - 2.0 * damping * omega * s.v - felt
        s.v = np.clip(s.v + dt * driven, -2.5, 2.5)
        s.x = np.clip(s.x + dt * s.v, -0.9, 0.9)
        flows = 1.2 * s.air / (s.air + 0.2)
        pushes = (omega**2) * s.x + 2.0 * damping * omega * s.v + felt
        return p.share * flows * view.mass * np.clip(pushes, -4.0, 4.0) * moving(view)


@law("w_pipe_between_tanks", "twelfth", "suburban")
@sizes(share=(0.35, 0.6), hz=(0.16, 0.34), turns=(0.25, 0.8), rubs=(0.03, 0.10), room_m=(0.5, 1.1))
class PipeBetweenTanks(Hidden, x=0.0, v=0.0):
    """`x` m that the middle of the liquid has moved from the rear tank to the front one, `v` of that. A bend
    and a valve in the pipe hold fast flows more than slow ones, and a full tank stops it. share: of the mass;
    turns: 1/m, loss with the square of `v`; rubs: damping of slow flows.
    Source: Sakai, Takaeda and Tamaki, Tuned Liquid Column Damper, Int. Conf. Highrise Buildings, Nanjing
    (1989): a column in a U that an orifice damps; tanks of a road sprinkler, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -4.0, 4.0)
        omega = 2.0 * np.pi * p.hz
        beyond = s.x - np.clip(s.x, -p.room_m, p.room_m)
        holds = (2.0 * p.rubs * omega + p.turns * np.abs(s.v)) * s.v
        pace = -(omega**2) * s.x - 40.0 * beyond - holds - 3.0 * s.v * (beyond != 0.0) - 0.8 * felt
        pace = np.clip(pace, -4.0, 4.0)
        s.v = np.clip(s.v + dt * pace, -2.5, 2.5)
        s.x = np.clip(s.x + dt * s.v, -p.room_m - 0.3, p.room_m + 0.3)
        return -p.share * view.mass * pace * moving(view)


@law("z_two_liquids", "seventeenth", "suburban")
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


@law("h_roof_floats_on_it", "nineteenth", "suburban")
@sizes(share=(0.35, 0.5), swings_rads=(1.6, 3.0), rubs=(0.12, 0.28), slowly=(0.4, 0.7), dull=(0.02, 0.06))
class RoofFloatsOnIt(Hidden, x=0.0, v=0.0):
    """A liquid under a roof that floats on it. The seal of that roof rubs dry on the walls: it holds all of
    the liquid still under gentle driving, and lets it swing under harsh driving, until its swing is small.
    `x` m, `v`: the liquid's middle. share: of the mass; rubs: m/s2 that the seal holds; slowly: of that,
    while it glides.
    Source: Ibrahim, Liquid Sloshing Dynamics (2005), on lids that float and damp, and Den Hartog, Mechanical
    Vibrations (1956), on swings with dry friction; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        push = -felt - p.swings_rads**2 * s.x - 2.0 * p.dull * p.swings_rads * s.v
        holds = p.rubs * (p.slowly + (1.0 - p.slowly) * np.exp(-np.abs(s.v) / 0.05))
        free = s.v + dt * push
        after = np.sign(free) * np.maximum(np.abs(free) - dt * holds, 0.0)
        gains = (after - s.v) / dt
        s.v = np.clip(after, -2.5, 2.5)
        s.x = np.clip(s.x + dt * s.v, -2.0, 2.0)
        return np.asarray(np.clip(-p.share * gains, -2.0, 2.0) * view.mass * moving(view))


@law("b_water_between_two_cushions", "twentieth", "suburban")
@sizes(share=(0.3, 0.45), soft_rads=(1.6, 2.8), room_m=(0.35, 0.7), leaks_s=(4.0, 14.0), dull=(0.06, 0.14))
class WaterBetweenTwoCushions(Hidden, x=0.0, v=0.0, rear=1.0):
    """A long closed tank is full but for air at both its ends, and the water is a piston between these two
    cushions: soft about its middle, and ever harder as one is pressed. Air leaks slowly from the pressed
    cushion to the other along the roof. `x` of the room, `v` of that in a second; `rear`: of the air, over
    that ahead. share: of the mass.
    Source: Wylie and Streeter, Fluid Transients in Systems (1993), on columns between pockets of air, which
    are pressed by a power law; the tank and sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -3.0, 3.0)
        x = np.clip(s.x, -0.75, 0.75)
        ahead, behind = (2.0 - s.rear) * (1.0 - x) ** -1.4, s.rear * (1.0 + x) ** -1.4
        s.rear = np.clip(s.rear + dt * (ahead - behind) / (4.0 * p.leaks_s), 0.6, 1.4)
        gains = -felt / p.room_m - p.soft_rads**2 / 2.8 * (ahead - behind) - 2.0 * p.dull * p.soft_rads * s.v
        s.v = np.clip(s.v + dt * gains, -4.0, 4.0)
        s.x = np.clip(s.x + dt * s.v, -0.75, 0.75)
        return np.asarray(np.clip(-p.share * gains * p.room_m, -2.0, 2.0) * view.mass * moving(view))
