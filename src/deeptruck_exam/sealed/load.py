"""Grain that runs out, a stack that leans, and a sledge on its film of water."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, eased, moving, weight
from deeptruck_exam.effects.places import OnRoad, sections
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_model.trucks import View

law = partial(hidden, family="sealed")


@law("k_grain_runs_out", needs="suburban hills", name="payload_change", accepts="mass")
@sizes(grain=(0.3, 0.45), known=(0.1, 0.4), empties_s=(90.0, 240.0), frees=(0.5, 0.9), mean_m=(300.0, 900.0))
class GrainRunsOut(OnRoad, runs=0.0):
    """`full`: grain in a body whose hatch is not tight. It runs out at one rate however much is above, but
    it arches over the gap where nothing shakes it: on smooth stretches and at stands it stops. Each drive
    begins with what another one left. grain: of the mass; known: of it, to the simulator; frees: shaking that
    breaks arches.
    Source: Beverloo, Leniger and van de Velde, The Flow of Granular Solids through Orifices, Chemical
    Engineering Science 15 (1961), and Mankoc and others, Role of Vibrations in the Jamming and Unjamming of
    Grains Discharging from a Silo, Phys. Rev. E 80 (2009); sizes are chosen here."""

    def prepare(self) -> None:
        rng = self.rng(1451)
        number = sections(rng, self.rows(), self.p.mean_m)
        rough = rng.choice([0.2, 0.6, 1.0, 1.4], (self.rows(), int(number.max()) + 1))
        self.road = np.take_along_axis(rough, number, axis=1)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "full": self.rng(1452).choice([0.0, 0.2, 0.7, 1.0, 1.0], batch)}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        shaken = self.read(self.road, view) * np.clip(view.speed / 12.0, 0.0, 1.4)
        s.runs = eased(s.runs, np.where(shaken > p.frees, 1.0, 0.0), 2.0, dt)
        s.full = np.maximum(s.full - dt * s.runs / p.empties_s, 0.0)
        return -p.grain * (s.full - p.known) * view.mass * felt * moving(view)


@law("k_stack_leans", needs="suburban", name="load_slosh")
@sizes(share=(0.35, 0.5), omega=(2.4, 4.0), left=(0.2, 0.4), yields_m=(0.04, 0.1), damps=(0.03, 0.08))
class StackLeans(Hidden, x=0.0, v=0.0, z=0.0):
    """`x` m that a stack of wrapped pallets leans ahead, `v` of that, `z` m of it that the wrapping holds
    before it slips. It gives, slips and stays leaning until it is pushed back. share: of the mass; omega:
    rad/s of its swing; left: of the stiffness, once it slips.
    Source: Wen, Method for Random Vibration of Hysteretic Systems, J. Engineering Mechanics Division 102
    (1976); stacks on a floor, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        felt = np.clip(view.acceleration + GRAVITY * view.grade, -4.0, 4.0)
        holds = p.omega**2 * (p.left * s.x + (1.0 - p.left) * s.z)
        before = s.v
        s.v = (s.v - dt * (felt + holds)) / (1.0 + dt * 2.0 * p.damps * p.omega)
        s.v = np.clip(s.v, -2.0, 2.0)
        slips = np.minimum(np.abs(s.z) / p.yields_m, 1.0) ** 2 * (0.5 + 0.5 * np.sign(s.v * s.z))
        s.x = np.clip(s.x + dt * s.v, -0.9, 0.9)
        s.z = np.clip(s.z + dt * s.v * (1.0 - slips), -p.yields_m, p.yields_m)
        pace = np.clip((s.v - before) / dt, -4.0, 4.0)
        return -p.share * view.mass * pace * moving(view)


@law("k_sledge_on_its_film", needs="suburban hills highway", name="unknown")
@sizes(
    dry=(0.008, 0.015), film=(0.45, 0.7), sucks=(0.004, 0.008), melts_m=(200.0, 700.0), dries_s=(20.0, 60.0)
)
@sizes(freezes_s=(4.0, 15.0), grips=(0.01, 0.025), tears_m=(4.0, 15.0))
class SledgeOnItsFilm(Hidden, wet=0.3, stuck=0.0):
    """A sledge is towed over a winter road. Its runners rub dry until they have melted a film, `wet`, which
    carries them well and sucks the more, the faster; it freezes away when slow. At stands the runners freeze
    down, `stuck`, and have to be torn off. dry, sucks, grips: of the weight, the second at 20 m/s; film: of
    the dry friction, spared.
    Source: Colbeck, A Review of the Processes that Control Snow Friction, CRREL Monograph 92-2 (1992): dry
    friction, lubrication and capillary drag; a sledge behind a truck, sizes are chosen here."""

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        speed = np.maximum(view.speed, 0.0)
        melts, dries = speed / p.melts_m, 1.0 / p.dries_s
        s.wet = eased(s.wet, melts / (melts + dries), 1.0 / (melts + dries), dt)
        rests = speed < 0.3
        s.stuck = eased(
            s.stuck, np.where(rests, 1.0, 0.0), np.where(rests, p.freezes_s, p.tears_m / (speed + 0.1)), dt
        )
        costs = p.dry * (1.0 - p.film * s.wet) + p.sucks * s.wet * (speed / 20.0) ** 1.5 + p.grips * s.stuck
        return -costs * weight(view) * moving(view)
