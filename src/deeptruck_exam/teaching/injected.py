"""Forces of many laws along drives that have been driven: what is added to recordings to learn names from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from scipy.signal import lfilter

from deeptruck_exam import worlds
from deeptruck_exam.construction import DT, Built
from deeptruck_exam.effects import EFFECTS
from deeptruck_exam.effects.law import GRAVITY, Array
from deeptruck_exam.effects.planting import SEALED, Effect, Planted
from deeptruck_exam.gates import CONDITIONS
from deeptruck_exam.oracle import Watched
from deeptruck_exam.teaching.strayed import strayed
from deeptruck_exam.trace import Trace, setting_of
from deeptruck_exam.worlds import trucks
from deeptruck_model.trucks import PhysicsTruck

DRAWS, ROADS = 4, 6  # of the sizes of a law; of roads
GATED = 0.3  # of the laws that can act under one condition also do
BLOCK = 2  # samples of a drive to a row of the evidence
LATE_S = 0.15  # at most, of the sensors through which a force is seen
STRAYED = "~"  # at the end of a key: the law strayed from its author's form


@dataclass(frozen=True)
class Injected:
    """A law's key, marked where it strayed from it, and its acceleration along stacked drives (n,), m/s^2."""

    key: str
    acceleration: Array

    @property
    def law(self) -> Effect:
        return EFFECTS[self.key.removesuffix(STRAYED)]


class Injection:
    """A driven world with nothing missing, asked for what laws would do to it."""

    def __init__(self, built: Built, rng: np.random.Generator) -> None:
        self._built, self._rng = built, rng
        self._nominal = trucks.make(built.plan.truck, built.plan.values)
        self._trace = Trace.of(self._nominal, built.drives, setting_of(built))
        self._many = self._trace.repeated(DRAWS)
        self._plain = self._driven(self._nominal)
        self._keep = float(np.exp(-DT / max(rng.uniform(0.0, LATE_S), 1e-3)))

    def laws(self) -> list[Effect]:
        """What can be missing in this truck on these drives."""
        led = bool(np.isfinite(self._built.leader_m).any())
        return [
            e
            for e in EFFECTS.values()
            if e.kind == "missing_physics"
            and self._built.plan.truck in e.trucks
            and (led or not e.leader)
            and e.family != SEALED
            and e.key != "road_grade"  # its slope is in the drive itself: see `slopes`
        ]

    def forces(self, laws: Sequence[Effect]) -> Iterator[Injected]:
        """Each law with several draws of its sizes; one of a filter, or a law with a chance of its own."""
        for law in laws:
            sizes = [law.draw(self._rng) for _ in range(DRAWS)]
            try:
                yield from self._at_once(law, sizes)
            except (ValueError, TypeError, IndexError):
                yield self._alone(law, sizes[0])

    def slopes(self) -> Iterator[Injected]:
        """Roads with slopes that nobody recorded, where no slope is."""
        if self._built.plan.grade:
            return
        plan, drives = self._built.plan, self._built.drives
        world = worlds.of(plan.forms, plan.simulator, plan.seed)
        for _ in range(ROADS):
            road = world.draw_roads(self._rng, list(plan.scenarios), flat=False)
            slope = np.stack([road.grade_at(x) for x in drives.channels["distance"].T], axis=1)
            yield Injected("road_grade", self._rows(-GRAVITY * slope))

    def _at_once(self, law: Effect, sizes: Sequence[dict[str, float]]) -> list[Injected]:
        """All draws side by side. Raises ValueError for a law that has to be asked alone."""
        setting, batch = Watched.of(self._many.setting), self._trace.setting.batch
        drawn = {n: np.repeat([s[n] for s in sizes], batch) for n in law.ranges}
        planted = law.build(setting, SimpleNamespace(**drawn))
        if _drives_otherwise(planted) or setting.by_chance:
            raise ValueError(f"{law.key} is asked alone")
        conditions = list(CONDITIONS.values())
        gate = (
            [conditions[self._rng.integers(len(conditions))]]
            if law.gateable and self._rng.random() < GATED
            else []
        )
        always, *gated = self._many.acceleration(planted.forces, gate)
        each = always.reshape(DRAWS, batch, -1)
        found = [Injected(law.key, self._rows(each[0]))]
        found += [Injected(law.key + STRAYED, self._rows(strayed(one, self._rng))) for one in each[1:]]
        return found + [Injected(law.key, self._rows(one.reshape(DRAWS, batch, -1)[0])) for one in gated]

    def _alone(self, law: Effect, sizes: dict[str, float]) -> Injected:
        planted = law.build(self._trace.setting, SimpleNamespace(**sizes))
        if not _drives_otherwise(planted):
            return Injected(law.key, self._rows(self._trace.acceleration(planted.forces)[0]))
        truck = self._nominal.with_parameters(dict(planted.parameters))
        truck = truck.with_forces(list(planted.forces), list(planted.filters))
        return Injected(law.key, self._rows(self._driven(truck) - self._plain))

    def _driven(self, truck: PhysicsTruck) -> Array:
        d = self._built.drives
        return truck.rollout(d.u, d.w, d.y[:, 0], d.y, inside=False).y[:, :, 0]

    def _rows(self, acceleration: Array) -> Array:
        """As a sensor that is a little late sees it, in means over the rows of the evidence, (n,)."""
        n = self._built.extra.shape[1]
        whole = np.zeros((len(acceleration), n))
        whole[:, : min(n, acceleration.shape[1])] = acceleration[:, :n]
        seen = lfilter([1.0 - self._keep], [1.0, -self._keep], whole, axis=1)
        return seen.reshape(len(seen), n // BLOCK, BLOCK).mean(axis=2).ravel()


def _drives_otherwise(planted: Planted) -> bool:
    """Whether it changes commands or parameters, and not forces alone."""
    return bool(planted.filters or planted.parameters)
