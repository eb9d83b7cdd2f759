"""Torque converters and clutches that slip."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Setting, Sizes, State, eased, moving
from deeptruck_exam.effects.planting import Planted, hidden, planted, sizes
from deeptruck_model.trucks import View

law = partial(hidden, name="torque_converter_slip", trucks="freightliner", gateable=False)


@planted(
    "torque_converter_slip",
    "first",
    "suburban hills highway",
    name="torque_converter_slip",
    accepts="driveline_loss",
    trucks="freightliner",
)
@sizes(capacity=(0.35, 0.75))
def lockup_fails(setting: Setting, p: Sizes) -> Planted:
    """Source: Hrovat and Tobler, Bond Graph Modeling of Automotive Torque Converters, J. Franklin Institute
    319 (1985); here the lock-up clutch is inoperative and worn blades lower the capacity."""
    return Planted(
        parameters={
            "lockup_gear": 7.0,
            "stall_capacity": setting.truck.stall_capacity * p.capacity,
        }
    )


@planted(
    "stator_freewheels",
    "second",
    "suburban hills",
    name="torque_converter_slip",
    accepts="driveline_loss",
    trucks="freightliner",
)
@sizes(left=(0.05, 0.3), late=(1.35, 1.7))
def stator_freewheels(setting: Setting, p: Sizes) -> Planted:
    """Source: Stator whose one-way clutch does not hold: no torque multiplication below coupling (Naunheimer
    et al., Automotive Transmissions, 2011, on converters); lock-up postponed to higher speeds, chosen
    here."""
    truck = setting.truck
    return Planted(
        parameters={
            "stall_torque_ratio": 1.0 + p.left * (truck.stall_torque_ratio - 1.0),
            "coupling_ratio": 0.9 * truck.coupling_ratio,
            "lockup_speed": truck.lockup_speed * p.late,
            "lockup_release_speed": truck.lockup_release_speed * p.late,
        }
    )


@law("glazed_lockup_clutch", "fifth", "suburban hills highway", accepts="driveline_loss torque_limit")
@sizes(holds=(0.33, 0.52), left=(0.5, 0.75), heats_j=(0.12e6, 0.5e6), cools_s=(15.0, 45.0))
class GlazedLockupClutch(Hidden, hot=0.0):
    """holds: of peak torque, cold; left: of what slips, as drag of the oil in the gap.
    Source: Lock-up linings glaze and slip above a torque, which heat lowers: the slip heats the lining, and
    more of it slips (Holgerson, Influence of Operating Conditions on Friction and Temperature Characteristics
    of a Wet Clutch Engagement, TriboTest 7, 2000); capacities are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        capacity = p.holds * self.truck.peak_torque * (1.0 - 0.45 * s.hot)
        over = np.maximum(view.engine_torque - capacity, 0.0)
        lost = (1.0 - p.left * np.exp(-over / (0.8 * capacity))) * over
        s.hot += dt * (lost * view.engine_speed * 0.3 / p.heats_j - s.hot / p.cools_s)
        s.hot = np.clip(s.hot, 0.0, 1.0)
        return -self.at_wheels(view, lost) * (view.speed > 2.0) * moving(view)


@law("drains_while_standing", "sixth", "suburban", accepts="driveline_loss shift_interruption")
@sizes(slips=(0.35, 0.6), drains_s=(3.0, 9.0), fills_s=(5.0, 14.0), needs_fill=(0.7, 0.95))
class DrainsWhileStanding(Hidden):
    """slips: of the torque, with an empty one; none once it is filled to `needs_fill`.
    Source: Converters whose check valve leaks drain into the sump while the truck stands and fill again by
    the charge pump, which the engine turns (workshop manuals of heavy automatics on drain-back; fill of a
    coupling sets its torque: Naunheimer and others, Automotive Transmissions, 2011); sizes chosen here."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        return {"fill": self.rng(513).uniform(0.0, 0.5, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pumps = np.clip(view.engine_speed / 120.0, 0.4, 1.6) / p.fills_s
        s.fill += dt * np.where(view.speed < 0.3, -s.fill / p.drains_s, pumps * (1.0 - s.fill))
        empty = np.clip(1.0 - s.fill / p.needs_fill, 0.0, 1.0)
        lost = p.slips * np.sqrt(empty) * np.maximum(view.engine_torque, 0.0)
        return -self.at_wheels(view, lost) * moving(view)


@law("converter_by_its_test_code", "seventh", "suburban", accepts="driveline_loss shift_interruption")
@sizes(stall_rads=(165.0, 215.0), open_s=(3.5, 8.0), below_mps=(6.0, 10.0))
class ConverterByItsTestCode(Hidden, pump=-1.0, gear=0.0, since=0.0):
    """`pump` rad/s; the turbine turns as the simulator has the engine. stall_rads: at peak torque; open_s:
    after a change.
    Source: SAE J643, Hydrodynamic Drive Test Code: the pump's torque with its speed squared, by capacity and
    torque ratio over the ratio of speeds; open after every change of gear and at low speed, while the
    simulator believes it locked."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        turbine = np.maximum(view.engine_speed, 1.0)
        s.since = np.where(view.gear != s.gear, 0.0, s.since + dt)
        s.gear = view.gear.copy()
        is_open = (s.since < p.open_s) | (view.speed < p.below_mps)
        pump = np.where((s.pump < 0.0) | ~is_open, turbine, s.pump)
        over = np.clip(turbine / np.maximum(pump, 1.0), 0.0, 1.2)
        takes = self.truck.peak_torque * (pump / p.stall_rads) ** 2 * np.clip(1.0 - over**6, -0.5, 1.0)
        gives = takes * np.maximum(1.5 - (1.5 - 1.0) * over / 0.85, 1.0)
        s.pump = np.maximum(pump + dt * (view.engine_torque - takes) / 2.5, 50.0)
        felt = np.where(is_open, gives - view.engine_torque, 0.0)
        most = 0.8 * self.truck.peak_torque
        return self.at_wheels(view, np.clip(felt, -most, most)) * np.clip(view.speed - 0.5, 0, 1)


@law("t_pump_is_worn", "tenth", "suburban hills highway", accepts="driveline_loss torque_limit")
@sizes(holds=(0.28, 0.48), firm_rads=(135.0, 175.0), thins=(0.15, 0.4), heats_j=(1.0e6, 3.0e6))
@sizes(left=(0.2, 0.5))
class PumpIsWorn(Hidden):
    """`oil`: 0 cold to 1 hot. The lock-up clutch is pressed the weaker the slower the engine and the hotter
    the oil, and slips under what it cannot hold. holds: of peak torque, at firm_rads; left: of what slips.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on converter lock-up and
    pumps; pressure of a worn pump with the square of its speed (Merritt, Hydraulic Control Systems, 1967, on
    orifices); sizes are chosen here."""

    conceal = ("engine_speed",)

    def start(self, batch: int) -> dict[str, Array]:
        return {"oil": self.rng(971).uniform(0.1, 0.6, batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        presses = np.clip((view.engine_speed / p.firm_rads) ** 2, 0.35, 1.0)
        holds = p.holds * self.truck.peak_torque * presses * (1.0 - p.thins * s.oil)
        lost = (1.0 - p.left) * np.maximum(view.engine_torque - holds, 0.0)
        s.oil = s.oil + dt * (lost * view.engine_speed / p.heats_j - (s.oil - 0.2) / 250.0)
        s.oil = np.clip(s.oil, 0.0, 1.0)
        return -self.at_wheels(view, lost) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("w_pump_draws_air", "twelfth", "hills suburban", accepts="driveline_loss torque_limit")
@sizes(tilt=(0.012, 0.03), foams_s=(1.5, 5.0), settles_s=(6.0, 20.0), holds=(0.12, 0.25), drags=(0.2, 0.5))
class PumpDrawsAir(Hidden, air=0.0):
    """`air` in the oil of a low sump, drawn in while slope and pull tilt it away from the pump. The lock-up
    clutch is pressed by that oil: what is beyond its hold slips. tilt: slope at which it begins; holds: of
    peak torque, with all air; drags: of the slip's torque, that reaches the wheels yet.
    Source: Totten (ed.), Handbook of Lubrication and Tribology I (2006), on entrained air in transmission
    fluids, and service manuals of automatic truck gearboxes on low levels uphill; sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        tilted = view.grade + np.clip(view.acceleration, -2.0, 2.0) / GRAVITY
        wants = np.clip((np.abs(tilted) - p.tilt) / 0.03, 0.0, 1.0)
        s.air = s.air + dt * (wants - s.air) / np.where(wants > s.air, p.foams_s, p.settles_s)
        holds = (1.1 - (1.1 - p.holds) * s.air) * self.truck.peak_torque
        torque = view.engine_torque
        slips = np.sign(torque) * np.maximum(np.abs(torque) - holds, 0.0) * (1.0 - p.drags)
        drag = 0.3 * s.air * np.minimum(torque, 0.0)
        return -self.at_wheels(view, slips + drag) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("x_once_it_slips_it_slips", "thirteenth", "hills suburban", accepts="driveline_loss torque_limit")
@sizes(sticks=(0.34, 0.5), slides=(0.6, 0.8), hot=(0.2, 0.4), heats_s=(4.0, 14.0), cools_s=(15.0, 50.0))
@sizes(catches=(0.6, 0.85), finds_s=(0.15, 0.4))
class OnceItSlips(Hidden, slips=0.0, heat=0.0, lost=0.0):
    """A lock-up clutch holds a torque while it sticks, and less once it slides, so that it goes on slipping
    until much less is asked; its own `heat` makes it slide the easier. sticks: of peak torque; slides: of
    that; hot: of it, lost when hot; catches: of what it slides with, where it sticks again.
    Source: Centea, Rahnejat and Menday, Non-Linear Multi-Body Dynamic Analysis for the Study of Clutch
    Torsional Vibrations (Judder), Applied Mathematical Modelling 25 (2001): friction that falls with slip;
    worn paper in a lock-up, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        torque = view.engine_torque / self.truck.peak_torque
        holds = p.sticks * (1.0 - p.hot * s.heat)
        slides = p.slides * holds
        size = np.abs(torque)
        s.slips = np.where(size > holds, 1.0, np.where(size < p.catches * slides, 0.0, s.slips))
        over = np.sign(torque) * np.maximum(size - slides, 0.0) * 0.6 * s.slips
        s.lost = s.lost + dt * (over - s.lost) / p.finds_s
        s.heat = np.clip(s.heat + dt * (4.0 * np.abs(s.lost) / p.heats_s - s.heat / p.cools_s), 0.0, 1.0)
        given = np.sign(s.lost) * np.minimum(np.abs(s.lost), size)
        return -self.at_wheels(view, given * self.truck.peak_torque) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("k_slips_against_boom", "fourteenth", "hills suburban", accepts="driveline_loss torque_limit")
@sizes(slip_rads=(16.0, 30.0), boom_rads=(125.0, 160.0), wide_rads=(10.0, 30.0), finds_s=(0.4, 1.2))
@sizes(cold=(0.3, 0.8), warms_s=(80.0, 240.0))
class SlipsAgainstBoom(Hidden, slip=0.0, warm=0.0):
    """The lock-up clutch is steered to a slip wherever the engine would boom: at low speed and under load;
    above that it is shut. Cold oil lets it overshoot. slip_rads: at full torque; boom_rads: below which it
    slips; cold: more of it, with cold oil.
    Source: Kono, Itoh, Nakamura, Yoshizawa and Osawa, Torque Converter Clutch Slip Control System, SAE
    950672; a truck's, and much slip, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.0)
        s.warm = eased(s.warm, 1.0, p.warms_s / (0.4 + load), dt)
        low = np.clip((p.boom_rads - view.engine_speed) / p.wide_rads, 0.0, 1.0)
        wish = p.slip_rads * low * np.sqrt(load) * (1.0 + p.cold * (1.0 - s.warm))
        s.slip = eased(s.slip, wish, p.finds_s, dt)
        lost = np.minimum(s.slip / np.maximum(view.engine_speed, 75.0), 0.5)
        torque = lost * np.maximum(view.engine_torque, 0.0)
        return -self.at_wheels(view, torque) * np.clip(view.speed - 1.0, 0.0, 1.0)


@law("u_locks_in_upper_gears_alone", "twenty-first", "suburban hills", accepts="driveline_loss")
@sizes(from_ratio=(1.1, 1.8), slips=(0.4, 0.6), at_rads=(120.0, 160.0), shuts_s=(0.4, 1.5))
class LocksInUpperGearsAlone(Hidden, open=0.0):
    """The lock-up clutch of an old gearbox shuts in upper gears alone; below them the fluid carries all. Its
    slip goes with torque over the square of the engine's speed. from_ratio: of the gearbox, from which it
    stays open; slips: at peak torque and at_rads; shuts_s: in an upper gear.
    Source: Naunheimer, Bertsche, Ryborz and Novak, Automotive Transmissions (2011), on lock-up by gear and on
    the performance number of converters; a loose converter, sizes are chosen here."""

    conceal = ("engine_speed",)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        low = view.ratio / self.truck.final_drive > p.from_ratio
        s.open = np.where(low, eased(s.open, 1.0, 0.15, dt), eased(s.open, 0.0, p.shuts_s, dt))
        load = np.clip(view.engine_torque / self.truck.peak_torque, 0.0, 1.1)
        turns = (p.at_rads / np.maximum(view.engine_speed, 60.0)) ** 2
        slip = np.minimum(p.slips * load * turns, 0.75)
        drives = slip * np.maximum(view.engine_torque, 0.0)
        return -self.at_wheels(view, s.open * drives) * moving(view)
