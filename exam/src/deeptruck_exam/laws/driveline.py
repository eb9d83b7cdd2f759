"""Driveline: backlash, losses, shifts, converter, rotating inertia."""

from __future__ import annotations

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_exam.laws.catalogue import Planted, law, sizes
from deeptruck_exam.laws.law import Law, Setting, Sizes, State, moving, weight
from deeptruck_model.trucks import View


@law("driveline_backlash", "suburban hills")
@sizes(gap_s=(0.15, 0.5), shuffle_hz=(1.5, 3.0), damping=(0.10, 0.25), clonk=(0.3, 0.7))
class DeadZone(Law, side=1.0, since=99.0, jump=0.0):
    """A dead zone at torque reversal, then a damped shuffle of 1.5 to 3 Hz when the teeth meet.
    Source: Lagerberg and Egardt, IEEE Trans. Control Syst. Technol. 15 (2007)."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        side = np.where(np.abs(view.traction_force) > 200.0, np.sign(view.traction_force), s.side)
        crossed = side != s.side
        s.since = np.where(crossed, 0.0, s.since + dt)
        s.side = side
        open_now = s.since < p.gap_s
        s.jump = np.where(open_now, view.traction_force, s.jump)
        t = s.since - p.gap_s
        omega = 2.0 * np.pi * p.shuffle_hz
        size = np.clip(s.jump, -0.08 * weight(view), 0.08 * weight(view))  # at most 0.08 g
        ring = p.clonk * size * np.exp(-p.damping * omega * t) * np.cos(omega * t)
        return np.where(open_now, -view.traction_force, np.where(t < 4.0, ring, 0.0)) * moving(view)


@law("driveline_backlash", "suburban hills")
@sizes(play_rad=(0.8, 2.2), wind_up_s=(0.10, 0.35), knock=(0.3, 0.9))
class IntegratedBacklash(Law, side=1.0, way=0.0, rate=0.0, share=1.0, hit=0.0):
    """The play is crossed by integrating the speed difference, so that a slower torque reversal has a longer
    time without torque; then shafts wind up. play_rad is at the flywheel.
    Source: Nordin and Gutman, Controlling Mechanical Systems with Backlash, Automatica 38 (2002)."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        side = np.where(np.abs(view.traction_force) > 50.0, np.sign(view.traction_force), s.side)
        s.way = np.where(side != s.side, p.play_rad, s.way)
        s.side = side
        free = s.way > 0.0
        push = np.abs(view.engine_torque) / self.truck.engine_inertia  # rad/s^2
        s.rate = np.where(free, s.rate + dt * np.clip(push, 4.0, 150.0), 0.0)
        before = s.way
        s.way = np.maximum(s.way - dt * s.rate, 0.0)
        meets = (before > 0.0) & (s.way == 0.0)
        s.hit = np.where(meets, s.rate, s.hit * (1.0 - dt / 0.06))  # the impulse lasts 0.06 s
        s.share = np.where(s.way > 0.0, 0.0, s.share + dt * (1.0 - s.share) / p.wind_up_s)
        knock = p.knock * self.truck.engine_inertia * s.hit * view.ratio / self.truck.wheel_radius / 0.06
        knock = np.minimum(knock, 0.06 * weight(view))
        return ((s.share - 1.0) * view.traction_force + s.side * knock * (s.way == 0.0)) * moving(view)


@law("driveline_loss", accepts="torque_gain")
@sizes(mesh=(0.05, 0.11), churning_n=(100.0, 500.0))
class MeshAndChurning(Law):
    """Mesh losses proportional to load in both directions, and churning losses. churning_n: at 20 m/s.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on losses. The exponent
    1.5 of speed lies between 1, of viscous drag, and 2, of accelerated oil."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        churning = p.churning_n * np.maximum(view.speed / 20.0, 0.0) ** 1.5
        return -(p.mesh * np.abs(view.traction_force) + churning) * moving(view)


@law("driveline_loss", accepts="torque_gain")
@sizes(
    countershaft=(0.06, 0.12),
    axle=(0.02, 0.05),
    coast=(1.5, 3.0),
    cold_nm=(30.0, 90.0),
    heat_j=(0.6e6, 2.0e6),
)
class CountershaftAndHypoid(Law, heat=0.0):
    """The direct gear has no countershaft mesh, the others two; hypoid axles lose more on the coast flank;
    the drag of cold oil decreases as the losses heat it. cold_nm: at the flywheel.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on losses."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        direct = np.abs(view.ratio / self.truck.final_drive - 1.0) < 0.05
        share = p.axle * np.where(view.traction_force < 0.0, p.coast, 1.0) + p.countershaft * ~direct
        cold = self.at_wheels(view, p.cold_nm * np.exp(-s.heat))
        lost = share * np.abs(view.traction_force) + cold
        s.heat += dt * lost * np.maximum(view.speed, 0.0) / p.heat_j
        return -lost * moving(view)


@law("shift_interruption", "suburban hills")
@sizes(hold_s=(0.3, 0.9), return_s=(0.4, 1.0))
class LateTorqueReturn(Law, since=99.0, gear=-1.0):
    """After a shift, torque is withheld until the driveline oscillation has decayed, then returns as a raised
    cosine.
    Source: Pettersson and Nielsen, Gear Shifting by Engine Control, IEEE Trans. Control Syst. Technol. 8
    (2000)."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        changed = (s.gear >= 0.0) & (view.gear != s.gear)
        s.since = np.where(changed | (view.shifting > 0.0), 0.0, s.since + dt)
        s.gear = view.gear.copy()
        back = np.clip((s.since - p.hold_s) / p.return_s, 0.0, 1.0)
        held = 0.5 * (1.0 + np.cos(np.pi * back))
        return -held * np.maximum(view.traction_force, 0.0)


@law("shift_interruption", "suburban hills")
@sizes(sync_s=(0.6, 1.8), metered=(0.25, 0.7), down=(1.0, 2.0))
class SlippingClutch(Law, ratio=0.0, open=0.0, carried=1000000.0):
    """After a change of the gear ratio the clutch slips without torque for sync_s * |ln(new / old ratio)|
    (sync_s in s; times `down` on downshifts; at most 1.5 s). Then the traction force that it carries rises by
    the mass times `metered`, m/s^3.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on shifting elements:
    speed difference times engine inertia over the clutch's slope."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        engaged = (view.shifting == 0.0) & (view.ratio > 0.0)
        step = np.log(np.maximum(view.ratio, 0.1) / np.where(s.ratio > 0.0, s.ratio, view.ratio + 0.1))
        changed = engaged & (s.ratio > 0.0) & (np.abs(step) > 0.02)
        wait = p.sync_s * np.abs(step) * np.where(step > 0.0, p.down, 1.0)
        s.open = np.where(changed, np.minimum(wait, 1.5), np.maximum(s.open - dt * engaged, 0.0))
        s.ratio = np.where(engaged, view.ratio, s.ratio)
        rate = p.metered * view.mass
        s.carried = np.where(s.open > 0.0, 0.0, np.minimum(s.carried + rate * dt, 1e6))
        pull = view.traction_force
        return (np.clip(pull, -s.carried, s.carried) - pull) * engaged * moving(view)


@law(
    "torque_converter_slip",
    "suburban hills highway",
    accepts="driveline_loss",
    trucks="freightliner",
    gateable=False,
)
@sizes(capacity=(0.35, 0.75))
def lockup_fails(setting: Setting, p: Sizes) -> Planted:
    """The lock-up clutch is inoperative and worn blades lower the capacity.
    Source: Hrovat and Tobler, Bond Graph Modeling and Computer Simulation of Automotive Torque Converters,
    J. Franklin Institute 319 (1985)."""
    return Planted(
        parameters={
            "lockup_gear": 7.0,
            "stall_capacity": setting.truck.stall_capacity * p.capacity,
        }
    )


@law(
    "torque_converter_slip",
    "suburban",
    accepts="driveline_loss shift_interruption",
    trucks="freightliner",
    gateable=False,
)
@sizes(stall_rads=(165.0, 215.0), open_s=(3.5, 8.0), below_mps=(6.0, 10.0))
class OpenConverter(Law, pump=-1.0, gear=0.0, since=0.0):
    """The converter is open after every change of gear and at low speed, while in the simulator it is locked.
    `pump` rad/s; the turbine turns at the simulator's engine speed. stall_rads: at peak torque; open_s: after
    a change.
    Source: SAE J643, Hydrodynamic Drive Test Code: the pump's torque with its speed squared, by capacity and
    torque ratio over the ratio of speeds."""

    withheld = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turbine = np.maximum(view.engine_speed, 1.0)
        s.since = np.where(view.gear != s.gear, 0.0, s.since + dt)
        s.gear = view.gear.copy()
        is_open = (s.since < p.open_s) | (view.speed < p.below_mps)
        pump = np.where((s.pump < 0.0) | ~is_open, turbine, s.pump)
        over = np.clip(turbine / np.maximum(pump, 1.0), 0.0, 1.2)
        takes = self.truck.peak_torque * (pump / p.stall_rads) ** 2 * np.clip(1.0 - over**6, -0.5, 1.0)
        gives = takes * np.maximum(1.5 - (1.5 - 1.0) * over / 0.85, 1.0)  # 1.5 at stall, coupling at 0.85
        s.pump = np.maximum(pump + dt * (view.engine_torque - takes) / 2.5, 50.0)  # 2.5 kg m^2
        felt = np.where(is_open, gives - view.engine_torque, 0.0)
        most = 0.8 * self.truck.peak_torque
        return self.at_wheels(view, np.clip(felt, -most, most)) * np.clip(view.speed - 0.5, 0, 1)


@law("rotating_inertia", "suburban hills", accepts="mass payload_change")
@sizes(engine_kgm2=(4.0, 10.0), wheels_kgm2=(20.0, 150.0))
class HeavyFlywheel(Law):
    """Additional inertia of a heavy flywheel, which turns with the engine, and of heavy wheels.
    Source: Wong, Theory of Ground Vehicles (2008): mass factor 1.04 + 0.0025 ratio^2."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        r2 = self.truck.wheel_radius**2
        engine = p.engine_kgm2 * view.ratio**2 * (1.0 - view.shifting) * (view.speed > 1.5)
        extra = np.minimum((engine + p.wheels_kgm2) / r2, 0.8 * view.effective_mass)
        return -extra * view.acceleration * moving(view)


@law("rotating_inertia", "suburban hills", accepts="mass payload_change")
@sizes(inertia=(5.0, 12.0), coupling_s=(0.15, 0.6), wheels_kg=(200.0, 900.0))
class DampedFlywheel(Law, rotor=-1.0):
    """A second inertia behind a torsional damper. inertia: kg m2 at engine speed; wheels_kg: rim mass of dual
    wheels, as if at the tread.
    Source: Kiencke and Nielsen, Automotive Control Systems (2005), on drivelines of two inertias; Wong,
    Theory of Ground Vehicles (2008), on the mass factor of wheels."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.rotor = np.where(s.rotor < 0.0, view.engine_speed, s.rotor)
        torque = p.inertia * (view.engine_speed - s.rotor) / p.coupling_s
        s.rotor = s.rotor + dt * (view.engine_speed - s.rotor) / p.coupling_s
        locked = (view.shifting == 0.0) & (view.speed > 1.5)
        # a change of gear leaves tens of rad/s: the coupling slips beyond a quarter of full torque
        most = 0.25 * self.truck.peak_torque
        driven = self.at_wheels(view, np.clip(torque, -most, most)) * locked
        return -(driven + p.wheels_kg * np.clip(view.acceleration, -4.0, 4.0)) * moving(view)
