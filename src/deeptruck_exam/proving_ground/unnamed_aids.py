"""Seventh effects for which no library name exists: machines and controls that act by themselves."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.hidden import Array, moving, weight
from deeptruck_exam.proving_ground.law import Law, unnamed
from deeptruck_model.trucks import View


@unnamed(
    "tests_itself_after_a_start",
    source="Antilock systems test their modulators as a truck drives off (UN Regulation No. 13, annex 13, on"
    " checks at rest and by 10 km/h or so): axle after axle is pressed for a moment; a control unit that"
    " does it with the brakes on and too late",
    ranges={"force": (0.035, 0.08), "from_mps": (2.5, 5.5), "each_s": (0.5, 1.2), "pulses": (3.0, 6.99)},
    needs=("suburban",),
)
class SelfTestAfterAStart(Law, ready=1.0, runs=1e3, press=0.0):
    """Once after each time it was slower than walking."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        begins = (s.ready > 0.0) & (view.speed > p.from_mps)
        s.ready = np.where(begins, 0.0, np.where(view.speed < 1.5, 1.0, s.ready))
        s.runs = np.where(begins, 0.0, s.runs + dt)
        count = s.runs / p.each_s
        wanted = (count < int(p.pulses)) & (count % 1.0 < 0.6)
        s.press = s.press + dt * (wanted - s.press) / 0.08
        return -p.force * s.press * weight(view) * moving(view)


@unnamed(
    "expander_pushes_late",
    source="Teng, Regner and Cowland, Waste Heat Recovery of Heavy-Duty Diesel Engines by Organic Rankine"
    " Cycle Part I, SAE 2007-01-0537: an expander geared to the drive gives power as its boiler has heat,"
    " half a minute after the engine's, also when nobody asks; a large one",
    ranges={"most_w": (45e3, 85e3), "boils_s": (8.0, 25.0), "from_heat": (0.05, 0.13), "span": (0.15, 0.35)},
    needs=("hills", "suburban"),
)
class ExpanderPushesLate(Law, heat=0.1, opens=0.0):
    """A bypass shuts it off while the driver brakes."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        power = np.maximum(view.engine_torque, 0.0) * view.engine_speed / self.truck.peak_power
        s.heat += dt * (power - s.heat) / p.boils_s
        wanted = np.clip((s.heat - p.from_heat) / p.span, 0.0, 1.0) * (view.brake_force <= 0.0)
        s.opens += dt * (wanted - s.opens) / np.where(wanted < s.opens, 0.3, 1.0)
        force = p.most_w * s.opens / np.maximum(view.speed, 6.0)
        return force * np.clip(view.speed - 1.0, 0.0, 1.0)


@unnamed(
    "filled_gaps_are_paid_back",
    source="Torque filling by an electric axle in hybrid trucks (Guzzella and Sciarretta, Vehicle Propulsion"
    " Systems, 2013, on parallel hybrids): what a change of gear leaves out is given by capacitors, and"
    " taken back afterwards at a steady power",
    ranges={"fills": (0.5, 1.1), "lasts_s": (1.0, 2.6), "most_w": (60e3, 140e3), "back_w": (10e3, 28e3)},
    needs=("suburban", "hills"),
)
class FilledGapsArePaidBack(Law, pull=0.0, left=0.0, owes=0.0, gives=0.0):
    """`owes` J to the capacitors; `pull` N that was there before the change."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        shifts, speed = view.shifting > 0.0, np.maximum(view.speed, 1.0)
        pull = np.maximum(view.traction_force, 0.0)
        s.pull = np.where(shifts, s.pull, s.pull + dt * (pull - s.pull) / 0.15)
        s.left = np.where(shifts, p.lasts_s, np.maximum(s.left - dt, 0.0))
        fades = np.clip(s.left / p.lasts_s, 0.0, 1.0)
        wanted = np.minimum(p.fills * s.pull * fades, p.most_w / speed) * (view.brake_force <= 0.0)
        s.gives = s.gives + dt * (wanted * (s.left > 0.0) - s.gives) / 0.12
        takes = np.minimum(p.back_w / np.maximum(speed, 5.0), 0.03 * weight(view))
        takes = takes * ((s.left <= 0.0) & (s.owes > 0.0))
        s.owes = np.maximum(s.owes + dt * speed * (s.gives - takes), 0.0)
        return (s.gives - takes) * np.clip(view.speed - 1.0, 0.0, 1.0)


@unnamed(
    "generates_unasked",
    source="Jahns, Caliskan, Uncontrolled Generator Operation of Interior PM Synchronous Machines Following"
    " High-Speed Inverter Shutdown, IEEE Trans. Ind. Appl. 35 (1999): a machine brakes once its voltage is"
    " above the battery's, which charging raises, and goes on far below that speed",
    ranges={"power_wpkg": (1.2, 3.0), "from_mps": (13.5, 19), "until": (0.62, 0.85)},
    needs=("highway", "hills"),
)
class GeneratesUnasked(Law, on=0.0, current=0.0, charge=0.0):
    """Less force at more speed, once it has begun."""

    def newtons(self, view: View, dt: float) -> Array:
        p, s = self.p, self.s
        begins = p.from_mps * (1.0 + 0.1 * np.minimum(s.charge, 1.0))
        over = view.speed > begins
        s.on = np.where(over, 1.0, np.where(view.speed < p.until * begins, 0.0, s.on))
        s.current += dt * (s.on - s.current) / 0.3
        power = p.power_wpkg * view.mass * s.current
        s.charge += dt * power / view.mass / 150.0 - dt * s.charge / 120.0
        return -power / np.maximum(view.speed, 5.0) * moving(view)
