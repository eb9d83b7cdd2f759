"""A law of the grammar: drawn by name and random numbers, and added to driven drives as an acceleration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
import yaml

from deeptruck_exam.grammar.shapes import CURVES, GATES, MEMORIES
from deeptruck_exam.grammar.signals import CARRIERS, DRIVERS, Signals
from deeptruck_exam.grammar.special import SPECIAL
from deeptruck_exam.laws.law import Array
from deeptruck_exam.laws.series import ou_series

GATED = {"always": 0.72, "regime": 0.12, "intervals": 0.08, "drives": 0.08}  # where a form has no gate
CHANGES = {"fixed": 0.6, "each drive": 0.25, "drifting": 0.15}
EACH_DRIVE_SD, DRIFT_SD, DRIFT_S = 0.4, 0.35, 60.0  # of the logarithm of a size


@dataclass(frozen=True)
class GrammarLaw:
    """One form of a name with every choice made but for the random series; `seed` is of these."""

    name: str
    form: int
    carrier: str
    size: float
    sign: float
    loses: str
    loses_s: float
    driver: str
    memory: str
    memory_s: float
    curve: str
    gate: str
    change: str
    seed: int

    @property
    def key(self) -> str:
        """What a training sample is called, so that every form of a name counts alike."""
        return f"{self.name}-{self.form}-{self.carrier}"

    def newtons(self, s: Signals) -> Array:
        """Force (batch, n) along the drives, N, positive forwards."""
        rng = np.random.default_rng(self.seed)
        if self.carrier in SPECIAL:
            force = SPECIAL[self.carrier](s, self.size, rng)
        else:
            force = self.size * CARRIERS[self.carrier](s)
        if self.loses:
            force = MEMORIES[self.loses](force, self.loses_s, s.dt, rng) - force
        if self.driver:
            driver = DRIVERS[self.driver](s)
            if self.memory != "none":
                driver = MEMORIES[self.memory](driver, self.memory_s, s.dt, rng)
            most = float(np.quantile(driver, 0.98))
            force = force * CURVES[self.curve](driver / max(most, 1e-6), rng)
        force = force * GATES[self.gate](s, rng)
        if self.change == "each drive":
            force = force * np.exp(rng.normal(0.0, EACH_DRIVE_SD, (len(force), 1)))
        elif self.change == "drifting":
            force = force * np.exp(DRIFT_SD * ou_series(rng, force.shape, s.dt, DRIFT_S))
        return self.sign * force

    def acceleration(self, s: Signals) -> Array:
        """The same as an acceleration (batch, n), m/s^2."""
        return np.asarray(self.newtons(s) / s.effective_mass)


@cache
def forms() -> Mapping[str, Sequence[Mapping[str, Any]]]:
    """The content of grammar.yaml: forms by name."""
    text = (resources.files(__package__) / "grammar.yaml").read_text(encoding="utf-8")
    read: Mapping[str, Sequence[Mapping[str, Any]]] = yaml.safe_load(text)
    return read


def names(*, leader: bool = True) -> tuple[str, ...]:
    """Names that laws can be drawn for; without a leader those that need none."""
    return tuple(name for name, some in forms().items() if leader or not some[0].get("leader"))


def draw(name: str, rng: np.random.Generator) -> GrammarLaw:
    """A law of this name, every choice at random."""
    form = int(rng.integers(len(forms()[name])))
    f = forms()[name][form]

    def one(key: str, default: Sequence[str] = ("",)) -> str:
        return str(rng.choice(list(f.get(key, default))))

    def between(key: str) -> float:
        low, high = f.get(key, (1.0, 1.0))
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    sign = float(f["sign"] or rng.choice([-1.0, 1.0]))
    loses = one("loses")
    gate = one("gate") if "gate" in f else _drawn(GATED, rng)
    change = "each drive" if f.get("change") else _drawn(CHANGES, rng)
    return GrammarLaw(
        name,
        form,
        one("carrier"),
        between("size"),
        -sign if f.get("negate") else sign,
        loses,
        between("loses_s"),
        one("by"),
        one("memory", ("none",)),
        between("memory_s"),
        one("curve", ("power",)),
        gate,
        change,
        int(rng.integers(2**31)),
    )


def several(count: int, rng: np.random.Generator, *, leader: bool = True) -> list[GrammarLaw]:
    """`count` laws of different names, as a drive with none to three of them has."""
    some = names(leader=leader)
    return [draw(some[k], rng) for k in rng.permutation(len(some))[:count]]


def _drawn(chances: Mapping[str, float], rng: np.random.Generator) -> str:
    return str(rng.choice(list(chances), p=list(chances.values())))
