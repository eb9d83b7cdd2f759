"""Gearboxes, axles, plays, and machines beside the engine."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

RANGE_RATIO = 3.05  # of the gearbox alone, between its low and its high range


@hidden("n_range_group_is_slow", "sealed", "suburban", name="shift_interruption", trucks="trucksim volvo")
@sizes(range_s=(0.6, 1.4), split_s=(0.02, 0.2), down=(1.0, 1.6), back_s=(0.4, 1.0))
class RangeGroupIsSlow(Hidden, box=0.0, left=-9.0):
    """Changes within a range are nearly as quick as known; those from one range to the other wait.
    Source: Group gearboxes with a range change behind (Naunheimer, Bertsche, Ryborz and Novak, Automotive
    Transmissions, 2011, on commercial vehicles): a large piston and a synchroniser of a large step; a worn
    one, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        engaged = (view.shifting == 0.0) & (view.ratio > 0.0)
        box = view.ratio / self.truck.final_drive
        stepped = engaged & (s.box > 0.0) & (np.abs(box - s.box) > 0.02)
        crossed = (box > RANGE_RATIO) != (s.box > RANGE_RATIO)
        wait = np.where(crossed, p.range_s * np.where(box > s.box, p.down, 1.0), p.split_s)
        s.left = np.where(stepped, wait, np.maximum(s.left - dt * engaged, -9.0))
        s.box = np.where(engaged, box, s.box)
        back = np.clip(-s.left / p.back_s, 0.0, 1.0) ** 2
        return -(1.0 - back) * np.maximum(view.traction_force, 0.0)


@hidden("n_oil_leaves_the_play", "sealed", "suburban hills", name="driveline_backlash")
@sizes(per_s=(22.0, 60.0), thin=(1.2, 3.0))
class OilLeavesThePlay(Hidden, at=1.0):
    """`at`: from one flank, -1, to the other, 1. per_s: for a pull of the weight; thin: power by which torque
    returns as the film thins. A weak pull takes long.
    Source: Squeeze films (Hamrock, Schmid and Jacobson, Fundamentals of Fluid Film Lubrication, 2004): flanks
    of a wide play press viscous oil out at a pace in proportion to the torque; sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pull, most = view.traction_force, 0.12 * weight(view)
        s.at = np.clip(s.at + dt * p.per_s * pull / weight(view), -1.0, 1.0)
        carried = (0.5 + 0.5 * np.sign(pull) * s.at) ** p.thin
        return np.clip((carried - 1.0) * pull, -most, most) * moving(view)


@hidden(
    "n_lockup_opens_on_lift", "sealed", "suburban hills", name="torque_converter_slip",
    accepts="driveline_loss", trucks="freightliner", gateable=False,
)  # fmt: skip
@sizes(lost=(0.35, 0.7), couples_mps=(6.0, 18.0), shuts_s=(3.0, 9.0), coast=(0.4, 0.8))
class LockupOpensOnLift(Hidden, pulls=99.0, slips=0.0):
    """Closed again some seconds after the pedal was. It couples the better, the faster one drives.
    Source: Lock-up clutches that open in overrun and shut after a delay under load (Naunheimer, Bertsche,
    Ryborz and Novak, Automotive Transmissions, 2011, on control of converters); slip with the root of the
    load, delays and sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.pulls = np.where(self.pedal(view) < 0.03, 0.0, s.pulls + dt)
        s.slips = s.slips + dt * ((s.pulls < p.shuts_s) - s.slips) / 0.3
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        lost = p.lost * np.sqrt(load) / (1.0 + np.maximum(view.speed, 0.0) / p.couples_mps)
        pull, push = np.maximum(view.traction_force, 0.0), np.maximum(-view.traction_force, 0.0)
        return s.slips * (p.coast * push - lost * pull) * moving(view)


@hidden(
    "n_fluid_in_the_flywheel", "sealed", "suburban hills", name="rotating_inertia",
    accepts="mass payload_change",
)  # fmt: skip
@sizes(share=(0.06, 0.15), more=(0.2, 0.45), half_mps=(9.0, 18.0), flows_s=(1.5, 7.0))
class FluidInTheFlywheel(Hidden):
    """Fluid goes outwards as it turns faster, and comes back late. share, more: of the mass, as felt at the
    road; half_mps: where half of it is out.
    Source: Van de Ven, Fluidic Variable Inertia Flywheel (2009): momentum is inertia times speed, and both
    change; a flywheel geared to an axle, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {"out": np.full(batch, np.nan)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pace = (np.maximum(view.speed, 0.0) / p.half_mps) ** 2
        wanted = pace / (1.0 + pace)
        s.out = np.where(np.isnan(s.out), wanted, s.out)
        goes = (wanted - s.out) / p.flows_s
        s.out = s.out + dt * goes
        holds = (p.share + p.more * s.out) * np.clip(view.acceleration, -4.0, 4.0)
        holds = holds + p.more * np.clip(goes, -0.08, 0.08) * view.speed
        return -view.mass * holds * (view.speed > 0.5) * moving(view)


@hidden("n_pinion_runs_dry", "sealed", "hills suburban", name="driveline_loss", accepts="torque_gain")
@sizes(wet=(0.02, 0.05), dry=(0.18, 0.35), from_slope=(0.0, 0.012), dries_s=(4.0, 15.0), wets_s=(3.0, 12.0))
class PinionRunsDry(Hidden, bare=0.0):
    """Uphill and in hard pulls the oil of the axle runs to its rear. wet, dry: share of the traction.
    Source: Oil level and tilt of axles (SAE J1266, Axle Efficiency Test Procedure; service manuals on filling
    with the truck level): a low sump leaves the pinion's bearings bare; rates and losses are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tilt = view.grade + np.clip(view.acceleration, -3.0, 3.0) / GRAVITY
        wanted = np.clip((tilt - p.from_slope) / 0.02, 0.0, 1.0)
        s.bare = s.bare + dt * (wanted - s.bare) / np.where(wanted > s.bare, p.dries_s, p.wets_s)
        rubs = p.wet + (p.dry - p.wet) * s.bare
        return -rubs * np.abs(view.traction_force) * moving(view)


@hidden("n_load_point_is_shifted", "sealed", "highway suburban hills", name="unknown")
@sizes(gain=(0.5, 1.0), best=(0.3, 0.5), most=(0.07, 0.16), store_s=(8.0, 25.0))
class LoadPointIsShifted(Hidden, torque=0.0):
    """An electric machine on the shaft pushes where much is asked of the engine and charges where little is,
    as far as its battery goes. best, most: of peak torque; store_s: of peak power.
    Source: Guzzella and Sciarretta, Vehicle Propulsion Systems (2013), on load point shifting in parallel
    hybrids; a small battery, sizes are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "cell": self.rng(931).uniform(0.2, 0.8, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = view.engine_torque / self.truck.peak_torque
        room = np.where(load > p.best, s.cell, 1.0 - s.cell)
        works = (self.pedal(view) > 0.03) & (view.brake_force <= 0.0) & (view.shifting == 0.0)
        wanted = np.clip(p.gain * (load - p.best), -p.most, p.most) * np.clip(room / 0.15, 0.0, 1.0) * works
        s.torque = s.torque + dt * (wanted - s.torque) / 0.4
        pace = view.engine_speed * self.truck.peak_torque / self.truck.peak_power
        s.cell = np.clip(s.cell - dt * s.torque * pace / p.store_s, 0.0, 1.0)
        return self.at_wheels(view, s.torque * self.truck.peak_torque) * moving(view)
