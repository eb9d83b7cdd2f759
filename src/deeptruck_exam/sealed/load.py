"""Loads that are exchanged or move, tools and trailers that push and hold."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Array, Hidden, Sizes, State, moving, weight
from deeptruck_exam.effects.planting import hidden, sizes
from deeptruck_exam.effects.series import spells, within
from deeptruck_model.trucks import View


@hidden("n_skips_by_turns", "sealed", "suburban", name="payload_change", accepts="mass")
@sizes(full=(0.2, 0.4), empty=(0.15, 0.35), takes_s=(1.5, 4.0))
class SkipsByTurns(Hidden, stood=0.0, stops=0.0):
    """Each stand that lasts exchanges a full skip for an empty one, or an empty one for a full one, of other
    masses every time. full, empty: of the known mass, above and below it.
    Source: Roll-on roll-off and skip rounds (Bodin, Mingozzi, Baldacci and Ball, The Rollon-Rolloff Vehicle
    Routing Problem, Transportation Science 34, 2000); masses are chosen here."""

    def prepare(self) -> None:
        rng, shape = self.rng(911), (self.setting.batch, 200)
        turn = (np.arange(200) + rng.integers(0, 2, (self.setting.batch, 1))) % 2
        self.loads = np.where(turn == 1, self.p.full, -self.p.empty) * rng.uniform(0.7, 1.1, shape)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "load": self.loads[:, 0].copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        stood = np.where(view.speed < 0.1, s.stood + dt, 0.0)
        s.stops = s.stops + ((stood >= p.takes_s) & (s.stood < p.takes_s))
        s.stood = stood
        now = self.loads[np.arange(len(stood)), s.stops.astype(int) % self.loads.shape[1]]
        s.load = s.load + dt * (now - s.load) / 0.4
        felt = view.acceleration + GRAVITY * (view.grade + self.truck.rolling_resistance)
        return -s.load * view.mass * felt * moving(view)


@hidden("n_flexitank_creeps", "sealed", "suburban", name="load_slosh")
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


@hidden("n_skid_trailer_locks_its_wheels", "sealed", "highway suburban", name="unknown")
@sizes(force=(0.025, 0.05), every_m=(120.0, 350.0), locks_s=(1.0, 2.5), fades_mps=(15.0, 40.0))
class SkidTrailerLocksItsWheels(Hidden, left=0.0, locked=0.0):
    """A trailer that measures skid resistance locks its wheels for a moment, every so many metres. force: of
    the weight, at walking pace; fades_mps: speed over which wet friction falls.
    Source: ASTM E274, Standard Test Method for Skid Resistance of Paved Surfaces Using a Full-Scale Tire; a
    heavy one that tests at any speed, intervals and sizes are chosen here."""

    def prepare(self) -> None:
        self.first_m = self.rng(912).uniform(0.0, self.p.every_m, self.setting.batch)

    def start(self, batch: int) -> dict[str, Array]:
        return {**super().start(batch), "next": self.first_m.copy()}

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        begins = view.distance > s.next
        s.next = np.where(begins, view.distance + p.every_m, s.next)
        s.left = np.where(begins, p.locks_s, np.maximum(s.left - dt, 0.0))
        s.locked = s.locked + dt * ((s.left > 0.0) - s.locked) / 0.15
        grips = np.exp(-np.maximum(view.speed, 0.0) / p.fades_mps)
        return -p.force * s.locked * grips * weight(view) * moving(view)


@hidden("n_jet_of_the_monitor", "sealed", "suburban hills", name="unknown")
@sizes(thrust=(0.012, 0.028), sweeps_rad=(0.5, 1.6), turns_s=(12.0, 40.0), sprays_s=(20.0, 60.0))
class JetOfTheMonitor(Hidden, pressure=0.0):
    """A jet pushes the truck the other way; the nozzle is swept from side to side about any direction.
    thrust: of the weight.
    Source: Momentum of a jet, mass flow times speed, as tables of nozzle reaction give it (Fire Protection
    Handbook, NFPA); a monitor that sprays on the way, spells and sizes are chosen here."""

    def prepare(self) -> None:
        rng, p, batch = self.rng(913), self.p, self.setting.batch
        self.spells = spells(rng, batch, (0.6 * p.sprays_s, 1.4 * p.sprays_s), (10.0, 40.0))
        self.aim = rng.choice([0.0, 0.0, np.pi], batch) + rng.normal(0.0, 0.4, batch)
        self.phase = rng.uniform(0.0, 2.0 * np.pi, batch)

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.pressure = s.pressure + dt * (within(self.spells, view.time) - s.pressure) / 1.2
        swept = p.sweeps_rad * np.sin(2.0 * np.pi * view.time / p.turns_s + self.phase)
        return -p.thrust * s.pressure * np.cos(self.aim + swept) * weight(view) * moving(view)


@hidden("n_brush_has_its_own_speed", "sealed", "suburban", name="unknown")
@sizes(rubs=(0.012, 0.025), tip_mps=(5.0, 10.0), soft_mps=(0.8, 3.0), down_s=(25.0, 70.0))
class BrushHasItsOwnSpeed(Hidden, down=0.0):
    """It pushes a truck that is slower than its bristles and holds a faster one. rubs: of the weight.
    Source: Coulomb friction by the sign of the sliding speed, smoothed by bristles that bend (Persson,
    Sliding Friction, 2000); a sweeper's broom that is driven at a set speed, sizes are chosen here."""

    def prepare(self) -> None:
        p = self.p
        self.spells = spells(
            self.rng(914), self.setting.batch, (0.6 * p.down_s, 1.4 * p.down_s), (10.0, 40.0)
        )

    def newtons(self, p: Sizes, s: State, view: View, dt: float) -> Array:
        s.down = s.down + dt * (within(self.spells, view.time) - s.down) / 1.5
        slides = np.tanh((p.tip_mps - view.speed) / p.soft_mps)
        return p.rubs * s.down * slides * weight(view) * moving(view)
