"""Tandems that tramp, twin tyres, wheels in the air, an axle that does not come back, and power hop."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.places import CELL_M, Bends, OnRoad, smooth_stretches
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import ou_series
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("e_tandem_tramps", needs="highway", name="rolling_resistance_speed", accepts="drag_area")
@sizes(drags=(0.006, 0.012), from_mps=(16.0, 19.0), stiffens=(3.0, 8.0), damping=(0.8, 1.6))
class TandemTramps(Hidden, real=0.0, imaginary=0.0):
    """`real`, `imaginary`: amplitude of two axles that swing on their beam, struck by wheels out of round
    once a turn. Stops make it stiffer as it swings, so that the swing grows with speed, ever more, until it
    breaks down; it comes back at a lower speed. drags: of the weight, at an amplitude of 1; stiffens: rad/s.
    Source: Kovacic and Brennan (ed.), The Duffing Equation (2011), on jumps of a stiffening resonance, and
    Cebon, Handbook of Vehicle-Road Interaction (1999), on walking-beam tandems that lack damping; sizes are
    chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        swing = s.real + 1j * s.imaginary
        faster = (np.maximum(view.speed, 0.0) - p.from_mps) / self.truck.wheel_radius
        struck = 1.15 * p.damping * np.clip(view.speed / p.from_mps, 0.0, 1.5) ** 2
        turns = np.clip(faster - p.stiffens * np.abs(swing) ** 2, -60.0, 60.0)
        keep = np.exp(dt * (-p.damping - 1j * turns))
        swing = swing * keep + dt * struck
        swing = swing * np.minimum(1.0, 1.4 / np.maximum(np.abs(swing), 1e-9))
        s.real, s.imaginary = swing.real.copy(), swing.imag.copy()
        return -p.drags * np.abs(swing) ** 2 * weight(view) * moving(view)


@law("e_inner_twin_takes_over", name="rolling_resistance_warmup")
@sizes(
    cold=(0.010, 0.018), falls=(0.7, 1.4), warms_m=(1500.0, 4500.0), cools_s=(200.0, 500.0), tilts=(0.3, 0.8)
)
class InnerTwinTakesOver(Hidden):
    """`inner`, `outer`: warmth of twin tyres, 0 cold to about 1. The warmer one is harder and carries more,
    which warms it more; the outer one has the wind. cold: of the weight, beyond warm tyres; tilts: of the
    load, for a difference of 1.
    Source: The Pneumatic Tire, ed. Gent and Walter, NHTSA DOT HS 810 561 (2006), on rolling loss with load
    and temperature, and Cebon, Handbook of Vehicle-Road Interaction (1999), on twin tyres that share a load
    by their pressures; sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        rng = self.rng(1071)
        inner = 0.7 * rng.beta(0.5, 1.0, batch)  # after pauses of any length
        return {"inner": inner, "outer": inner * rng.uniform(0.5, 1.0, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        tilt = np.clip(p.tilts * (s.inner - s.outer), -0.45, 0.45)
        losses = {"inner": (1.0 + tilt, 0.7), "outer": (1.0 - tilt, 1.3)}
        resists = np.zeros(len(speed))
        for name, (load, wind) in losses.items():
            warm = getattr(s, name)
            loss = load**1.2 * np.exp(-p.falls * warm)
            resists += (
                0.5 * load**1.2 * np.maximum(np.exp(-2.5 * p.falls * warm) - np.exp(-2.5 * p.falls), 0.0)
            )
            cools = wind * (0.5 + speed / 30.0) * warm / p.cools_s
            setattr(s, name, np.clip(warm + dt * (2.2 * loss * speed / p.warms_m - cools), 0.0, 1.3))
        return -p.cold * resists * weight(view) * moving(view)


@law("e_diagonal_wheels_hang", needs="suburban hills", name="wheel_slip")
@sizes(grip=(0.22, 0.34), twists=(0.4, 0.7), inertia=(0.04, 0.09), apart_m=(80.0, 260.0))
class DiagonalWheelsHang(OnRoad, spins=0.0, lost=0.0, twist=0.0):
    """Where the ground is twisted one driven wheel presses little, and an open differential gives the other
    no more pull than that one holds. `spins` m/s of it over the road. twists: of a wheel's load, standard
    deviation in a bad stretch.
    Source: Wong, Theory of Ground Vehicles (2008), on the traction of driven axles whose wheels hold unlike,
    with an open differential; wet gravel tracks, sizes are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1072), self.p
        rough = smooth_stretches(rng, self.rows(), (0.5 * p.apart_m, 1.5 * p.apart_m), (90.0, 300.0))
        waves = ou_series(rng, rough.shape, CELL_M, 12.0)
        self.road = p.twists * np.sqrt(rough) * waves
        self.bad = np.sqrt(rough)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        bad = self.read(self.bad, view)
        s.twist = s.twist + dt * (self.read(self.road, view) - s.twist) / 0.12
        least = np.clip(1.0 - np.abs(s.twist), 0.08, 1.0)
        grip = p.grip + 0.5 * (1.0 - np.clip(2.0 * bad, 0.0, 1.0))
        slides = 1.0 - 0.25 * np.clip(s.spins / 1.5, 0.0, 1.0)
        holds = grip * slides * least * self.truck.drive_axle_share * weight(view)
        pull = np.maximum(view.traction_force, 0.0)
        turning = np.clip((pull - holds) / (p.inertia * view.mass), -12.0, 12.0)
        s.spins = np.clip(s.spins + dt * turning, 0.0, 5.0)
        s.lost = s.lost + dt * (np.maximum(pull - holds, 0.0) - s.lost) / 0.12
        all_wheels = (0.35 + 0.65 * least) * grip * weight(view)
        held = np.maximum(view.brake_force - all_wheels, 0.0)
        return held * moving(view) - np.minimum(s.lost, pull)


@law("e_rear_steer_stays_turned", needs="suburban hills highway", name="unknown")
@sizes(drags=(0.010, 0.022), rubs=(0.3, 0.6), shakes_m=(250.0, 900.0), length_m=(6.0, 12.0))
class RearSteerStaysTurned(Bends, turned=0.0):
    """A steered rear axle follows a bend and is held by its rusty pivots where it was left, until shaking or
    a bend the other way brings it back; the truck drives on askew. drags: of the weight, askew by half; rubs:
    of the full angle, that friction holds.
    Source: LeBlanc, El-Gindy and Woodrooffe, Self-Steering Axles: Theory and Practice, SAE 891980: centring
    against friction decides what is left of an angle; drag with its square; sizes are chosen here."""

    def prepare(self) -> None:
        self.bend = self.draw_bends(self.rng(1073), 1.0)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        asked = self.setting.direction * self.read(self.bend, view)
        way = dt * np.maximum(view.speed, 0.0)
        goal = np.clip(s.turned, asked - p.rubs, asked + p.rubs)
        s.turned = s.turned + np.minimum(way / p.length_m, 1.0) * (goal - s.turned)
        s.turned = s.turned - way / p.shakes_m * (s.turned - asked)
        return -p.drags * (s.turned - asked) ** 2 / 0.25 * weight(view) * moving(view)


@law("e_power_hop", needs="suburban hills", name="unknown")
@sizes(from_pull=(0.018, 0.035), hops=(0.4, 0.75), lost=(0.2, 0.4), hz=(1.0, 1.8), grows=(1.2, 3.0))
class PowerHop(Hidden, x=0.05, v=0.0):
    """Under a hard pull the driven axle winds up on its springs, lets go and winds up again; it dies away as
    the pull falls. `x` of its swing, a limit cycle. from_pull: over weight; hops: of the pull, at full swing;
    lost: of it, in the mean.
    Source: Zoz and Grisso, Traction and Tractor Performance, ASAE Distinguished Lecture 27 (2003), on power
    hop, and Strogatz, Nonlinear Dynamics and Chaos (2015), on limit cycles; worn torque rods of a truck,
    sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull = np.maximum(view.traction_force, 0.0)
        beyond = np.clip(pull / (p.from_pull * weight(view)) - 1.0, -1.0, 1.0)
        omega = 2.0 * np.pi * p.hz * (1.0 - 0.15 * np.clip(beyond, 0.0, 1.0))
        size = s.x**2 + (s.v / omega) ** 2
        feeds = p.grows * (beyond - size)
        s.v = np.clip(s.v + dt * (-(omega**2) * s.x + feeds * s.v), -20.0, 20.0)
        s.x = np.clip(s.x + dt * s.v, -1.5, 1.5)
        kept = np.clip(0.03 / np.maximum(np.sqrt(size), 1e-6), 1.0, 3.0)  # roads never let it rest
        s.x, s.v = s.x * kept, s.v * kept
        swings = np.clip((size - 0.01) / 0.05, 0.0, 1.0)
        share = swings * (p.hops * s.x - p.lost * np.minimum(size, 1.5))
        return pull * np.clip(share, -0.95, 0.9) * moving(view)
