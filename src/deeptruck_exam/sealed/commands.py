"""A median, an air cylinder, and two who take torque: green waves and a watchman."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import STEP_S, Array, Hidden, Late, Sizes, State, TorqueFilter, moving
from deeptruck_exam.effects.places import CELL_M, CELLS, OnRoad
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("e_median_of_the_last", needs="suburban hills descent", name="command_delay", accepts="clock_offset")
@sizes(window_s=(0.8, 1.7), line_s=(0.05, 0.2))
class MedianOfTheLast(Late):
    """What is passed on is the middle one of the commands of a window: half a window late, and what lasted
    less than that never arrives.
    Source: Gallagher and Wise, A Theoretical Analysis of the Properties of Median Filters, IEEE Trans.
    Acoustics, Speech, Signal Processing 29 (1981): edges pass, impulses do not; against outliers of a pedal's
    line, windows are chosen here."""

    length = 400
    every = 4

    def prepare(self) -> None:
        middle = round(self.p.window_s / STEP_S / self.every / 2.0)
        first = round(self.p.line_s / STEP_S)
        self.steps = first + self.every * np.arange(2 * middle + 1)

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        window = s.past[(s.at - self.steps) % self.length]
        middle = len(self.steps) // 2
        return np.asarray(np.partition(window, middle, axis=0)[middle])


@law("e_cylinder_fills_with_air", needs="suburban hills", name="command_rate_limit", accepts="turbo_lag")
@sizes(fills_s=(0.9, 1.9), empties_s=(0.5, 1.1), spring=(0.15, 0.3), supply=(1.25, 1.7))
class CylinderFillsWithAir(TorqueFilter):
    """Air moves the lever against a spring: nothing happens until it is stretched, then the lever goes at one
    pace while the air chokes, and slower near its end. spring: of the pressure of a full pedal, before the
    lever moves; supply: over that pressure; fills_s: from nothing to full, choked.
    Source: Andersen, The Analysis and Design of Pneumatic Systems (1967): flow is choked below half of the
    pressure ahead; air throttles of rear-engined vehicles, sizes are chosen here."""

    def begin(self, s: State, u: Array) -> None:
        super().begin(s, u)
        s.bar = self.wanted(u[:, 0])

    def wanted(self, pedal: Array) -> Array:
        """Pressure, over that of a full pedal, which holds the lever there; none for a closed pedal."""
        share = pedal / self.full
        return np.asarray(np.where(share > 0.0, self.p.spring + (1.0 - self.p.spring) * share, 0.0))

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        wanted = self.wanted(pedal)
        ahead = np.clip((p.supply - s.bar) / (0.5 * p.supply), 0.0, 1.0) ** 0.5 / p.fills_s
        back = np.clip((s.bar + 0.15) / 0.5, 0.3, 1.0) ** 0.5 / p.empties_s
        closes = np.clip(np.abs(wanted - s.bar) / 0.2, 0.08, 1.0)
        s.bar = np.clip(wanted, s.bar - dt * back * closes, s.bar + dt * ahead * closes)
        lever = np.clip((s.bar - p.spring) / (1.0 - p.spring), 0.0, None)
        arrived = (s.bar == wanted) & (pedal >= 0.0)
        return np.asarray(np.where(arrived, np.maximum(pedal, 0.0), self.full * lever))


@law("e_rides_the_green_wave", needs="suburban hills", name="unknown")
@sizes(
    apart_m=(220.0, 420.0), cycle_s=(45.0, 80.0), red=(0.45, 0.65), ahead_m=(80.0, 160.0), takes=(0.5, 0.9)
)
class RidesTheGreenWave(OnRoad, eases=0.0):
    """An assistant hears from the signals when they turn and takes torque where the truck would come too
    early. takes: share of the pull. The lights stand where they stand, and keep their times.
    Source: Katsaros, Kernchen, Dianati and Rieck, Performance Study of a Green Light Optimized Speed Advisory
    (GLOSA) Application Using an Integrated Cooperative ITS Simulation Platform, IWCMC (2011); one that acts
    by itself, signals and shares are chosen here."""

    def prepare(self) -> None:
        rng, p = self.rng(1021), self.p
        self.lights_m = np.cumsum(p.apart_m * rng.uniform(0.6, 1.4, (self.rows(), 600)), axis=1)
        self.offset_s = rng.uniform(0.0, p.cycle_s, (self.rows(), 600))
        cells_m = (np.arange(CELLS) + 0.5) * CELL_M
        self.following = np.array([np.searchsorted(lights, cells_m) for lights in self.lights_m])
        self.back = (self.setting.direction < 0.0).astype(int)

    def ahead(self, view: View) -> tuple[Array, Array]:
        """Metres to the next light, and its offset."""
        route = self.setting.route
        light = np.clip(self.following[route, self.cell(view)] - self.back, 0, 599)
        gap = self.setting.direction * (self.lights_m[route, light] - self.place(view))
        return np.maximum(gap, 0.0), self.offset_s[route, light]

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        gap, offset = self.ahead(view)
        comes = view.time + gap / np.maximum(view.speed, 2.0)
        red = ((comes + offset) % p.cycle_s) < p.red * p.cycle_s
        wants = red * (gap < p.ahead_m) * (view.speed > 4.0)
        s.eases = s.eases + dt * (wants - s.eases) / 0.5
        return -p.takes * s.eases * np.maximum(view.traction_force, 0.0) * moving(view)


@law("e_watchman", needs="highway suburban hills", name="unknown")
@sizes(waits_s=(3.0, 6.0), moves=(0.05, 0.10), takes=(0.5, 0.9), fades_s=(1.0, 3.0))
class Watchman(Hidden, still=0.0, takes=0.0):
    """Who keeps his foot still for too long is taken for asleep: torque fades until the pedal moves. moves:
    of the full pedal, that count; waits_s: from the last of them.
    Source: UIC 641, Conditions to be Fulfilled by Automatic Vigilance Devices Used in International Traffic,
    and the risk mitigation function of UN Regulation No. 79 for trucks; times are chosen here."""

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "last": np.full(batch, -1.0)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        pedal = self.pedal(view)
        moved = (np.abs(pedal - s.last) > p.moves) | (view.brake_force > 0.0) | (view.speed < 3.0)
        s.last = np.where(moved, pedal, s.last)
        s.still = np.where(moved, 0.0, s.still + dt)
        asleep = (s.still > p.waits_s) & (pedal > 0.02)
        s.takes = s.takes + dt * np.where(asleep, (1.0 - s.takes) / p.fades_s, -s.takes / 0.4)
        return -p.takes * s.takes * np.maximum(view.traction_force, 0.0) * moving(view)
