"""Forces of laws along driven drives: of the grammar to train on, of the catalogue to score."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from scipy.signal import lfilter

from deeptruck_exam.cases.build import DT, MOTION_SD, Built, accelerations, information
from deeptruck_exam.cases.plan import FIT
from deeptruck_exam.cases.trace import Trace, setting_of
from deeptruck_exam.grammar import grammar
from deeptruck_exam.grammar.signals import Signals
from deeptruck_exam.laws import EFFECTS, Effect
from deeptruck_exam.laws.law import Array
from deeptruck_exam.teach.distorted import distorted
from deeptruck_exam.worlds import trucks

EACH, NAMELESS = 18, 90  # grammar laws along one base: of each name, and without a name
DISTORTED = 0.4  # share of them whose force is distorted
WEAK, LEAST = 150.0, (150.0, 3000.0)  # nats: a law that leaves less is scaled to leave some of these
INACTIVE = 1e-3  # nats: one that leaves less does not act along these drives, and is not scaled
BLOCK = 2  # samples of a drive to a row of the evidence
LATE_S = 0.15  # at most, of the sensors through which a force is seen


@dataclass(frozen=True)
class Injected:
    """The name and key of a law, and its acceleration along stacked drives (n,), m/s^2."""

    name: str
    key: str
    acceleration: Array


class Injection:
    """A driven world with nothing missing, to which laws are added."""

    def __init__(self, built: Built, rng: np.random.Generator) -> None:
        self._built, self._rng = built, rng
        self._nominal = trucks.make(built.plan.truck, built.plan.values)
        self._trace = Trace.of(self._nominal, built.drives, setting_of(built))
        self._keep = float(np.exp(-DT / max(rng.uniform(0.0, LATE_S), 1e-3)))
        self._led = bool(np.isfinite(built.leader_m).any())

    def of_grammar(self) -> Iterator[Injected]:
        """Laws of every name the grammar has for these drives, a share of them distorted."""
        signals = Signals.of_trace(self._trace, self._built.drives.u.shape[1])
        for name in grammar.names(leader=self._led):
            if name == "torque_converter_slip" and self._built.plan.truck != "freightliner":
                continue
            for _ in range(NAMELESS if name == "unknown" else EACH):
                law = grammar.draw(name, self._rng)
                force = law.acceleration(signals)
                if self._rng.random() < DISTORTED:
                    force = distorted(force, self._rng)
                yield Injected(name, law.key, self._rows(self._noticeable(force)))

    def _noticeable(self, force: Array) -> Array:
        """The force, made larger where it would not be seen."""
        nats = information(force[:FIT], MOTION_SD)
        wanted = float(np.exp(self._rng.uniform(*np.log(LEAST))))
        return force * np.sqrt(wanted / nats) if INACTIVE < nats < WEAK else force

    def of_catalogue(self) -> Iterator[Injected]:
        """Every textbook law that these drives can have, once, as it is written."""
        for law in EFFECTS.values():
            fits = self._built.plan.truck in law.trucks and (self._led or not law.leader)
            if law.kind == "missing_physics" and fits and law.key != "slope_not_recorded":
                yield Injected(law.name, law.key, self._rows(self._replayed(law)))

    def _replayed(self, law: Effect) -> Array:
        planted = law.build(self._trace.setting, SimpleNamespace(**law.draw(self._rng)))
        if not planted.filters and not planted.parameters:
            return self._trace.acceleration(planted.forces)[0]
        truck = self._nominal.with_parameters(dict(planted.parameters))
        truck = truck.with_forces(list(planted.forces), list(planted.filters))
        drives = self._built.drives
        return accelerations(truck, drives) - accelerations(self._nominal, drives)

    def _rows(self, acceleration: Array) -> Array:
        """As a sensor that is a little late sees it, in means over the rows of the evidence, (n,)."""
        n = self._built.extra.shape[1]
        whole = np.zeros((len(acceleration), n))
        whole[:, : min(n, acceleration.shape[1])] = acceleration[:, :n]
        seen = lfilter([1.0 - self._keep], [1.0, -self._keep], whole, axis=1)
        return seen.reshape(len(seen), n // BLOCK, BLOCK).mean(axis=2).ravel()
