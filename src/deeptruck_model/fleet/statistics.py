"""Tests which trucks differ from their siblings, with control of false discoveries.

Trucks are screened by the evidence on their fitted drives, and tested by that on held-out drives, which the
screening did not use: candidates are judged by the rank of their held-out evidence among sound trucks
(conformal p-values: Bates, Candès, Lei, Romano and Sesia, Annals of Statistics 51, 2023, first as
arXiv:2104.08279). These p-values are positively dependent, so that Benjamini and Hochberg's procedure
controls the false discovery rate. Families and names are tested within discovered trucks, at a level lowered
by the share discovered (Benjamini and Bogomolov, JRSS B 76, 2014).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import zeta
from scipy.stats import binomtest, false_discovery_control, median_abs_deviation

from deeptruck_core.arrays import Mask

Nats = Mapping[str, float]

LEVEL = 0.05  # of false among all discoveries, where none is stated
OUTLYING = 3.0  # robust standard deviations above the median of fitted evidence, from which a truck is tested
LEAST_SPREAD = 0.5  # nats: a smaller robust standard deviation is no smaller
LEAST_SHARE = 0.5  # of the median held-out driving of the siblings, below which a truck is not compared
LEAST_SIBLINGS = 5  # fewer say nothing of the spread
DECAY = 1.6  # of the levels of a series of batches, as Ramdas and others (SAFFRON, ICML 2018) advise


@dataclass(frozen=True)
class Seen:
    """A truck's evidence (nats by name) on its fitted and on its held-out drives, the hours held out, and
    whether it is known to be sound (None: not stated)."""

    fitted: Nats
    held_out: Nats
    hours: float
    sound: bool | None = None


@dataclass(frozen=True)
class Tested:
    """Test result of one truck. `role` is 'reference', 'tested' or why it was neither. `p` and `q` (adjusted
    by Benjamini and Hochberg) are those of the truck, `families` and `names` those of discoveries within it.
    """

    role: str
    fitted: float
    held_out: float
    p: float | None = None
    q: float | None = None
    differs: bool = False
    families: Mapping[str, float] | None = None
    names: Mapping[str, float] | None = None


REFERENCE, TESTED = "reference", "tested"
TOO_LITTLE, TOO_FEW = "too little held-out driving", "too few siblings"


def total(nats: Nats, names: Sequence[str] | None = None) -> float:
    """Log evidence of 'one of these names, equally likely', over none; -inf without any."""
    values = [v for n, v in nats.items() if names is None or n in names]
    return float(np.logaddexp.reduce(values) - math.log(len(values))) if values else -math.inf


def p_value(value: float, references: Sequence[float]) -> float:
    """Conformal p-value: the probability that a truck exchangeable with the references has at least this
    value; at least 1 / (n + 1)."""
    return (1 + int(np.sum(np.asarray(references) >= value))) / (len(references) + 1)


def discovered(p: Sequence[float], level: float) -> Mask:
    """Which hypotheses Benjamini and Hochberg's procedure rejects at a level, (n,)."""
    if not len(p):
        return np.zeros(0, dtype=bool)
    out: Mask = false_discovery_control(np.asarray(p)) <= level + 1e-12
    return out


def level_of_batch(level: float, batch: int, tested: int, discoveries: int) -> float:
    """Level of the Benjamini-Hochberg procedure for batch number `batch` (from 1), which has `tested`
    hypotheses, of a sequence whose false discovery rate is `level`; each earlier discovery raises it."""
    return level * batch**-DECAY / float(zeta(DECAY)) * (tested + discoveries) / tested


def least_references(tested: int, found: int, level: float) -> int:
    """Number of references needed so that `found` of `tested` trucks can be discovered at a level."""
    return math.ceil(tested / (level * found) - 1 - 1e-9)


def siblings(
    trucks: Mapping[str, Seen], family: Mapping[str, str], level: float = LEVEL
) -> dict[str, Tested]:
    """Test the trucks of one class against each other; `family` is that of each name.

    If at least LEAST_SIBLINGS trucks are stated to be sound, they are the references and all others are
    tested. Otherwise trucks whose fitted evidence exceeds the median by more than OUTLYING deviations, and
    those stated not to be sound, are tested, and the rest are references.
    """
    hours = float(np.median([t.hours for t in trucks.values()])) if trucks else 0.0
    out: dict[str, Tested] = {}
    usable: dict[str, Seen] = {}
    for name, t in trucks.items():
        if t.fitted and t.held_out and t.hours >= LEAST_SHARE * hours:
            usable[name] = t
        else:
            out[name] = Tested(TOO_LITTLE, total(t.fitted), total(t.held_out))
    references = _references(usable)
    if len(references) < LEAST_SIBLINGS:
        return out | {n: Tested(TOO_FEW, total(t.fitted), total(t.held_out)) for n, t in usable.items()}
    known = _Totals([usable[n].held_out for n in references], family)
    tested = [n for n in usable if n not in references]
    p = [p_value(total(usable[n].held_out), known.of_trucks) for n in tested]
    rejected = discovered(p, level)
    q = false_discovery_control(p) if p else np.zeros(0)
    inside = level * float(np.mean(rejected)) if len(p) else level
    for n in references:
        out[n] = Tested(REFERENCE, total(usable[n].fitted), total(usable[n].held_out))
    for n, own, adjusted, differs in zip(tested, p, q, rejected, strict=True):
        t = usable[n]
        within = known.within(t.held_out, inside) if differs else (None, None)
        out[n] = Tested(
            TESTED, total(t.fitted), total(t.held_out), own, float(adjusted), bool(differs), *within
        )
    return out


def _references(usable: Mapping[str, Seen]) -> list[str]:
    stated = [n for n, t in usable.items() if t.sound]
    if len(stated) >= LEAST_SIBLINGS or not usable:
        return stated
    fitted = {n: total(t.fitted) for n, t in usable.items()}
    values = np.array(list(fitted.values()))
    spread = max(float(median_abs_deviation(values, scale="normal")), LEAST_SPREAD)
    least = float(np.median(values)) + OUTLYING * spread
    return [n for n, v in fitted.items() if usable[n].sound or (v <= least and usable[n].sound is None)]


class _Totals:
    """Held-out evidence of the references by truck, by family and by name."""

    def __init__(self, references: Sequence[Nats], family: Mapping[str, str]) -> None:
        self.members: dict[str, list[str]] = {}
        for name in dict.fromkeys(n for r in references for n in r):
            self.members.setdefault(family.get(name, name), []).append(name)
        self.of_trucks = [total(r) for r in references]
        self.of_families = {f: [total(r, ns) for r in references] for f, ns in self.members.items()}
        self.references = references

    def within(self, own: Nats, level: float) -> tuple[dict[str, float], dict[str, float]]:
        """p-values of the discovered families of a truck, and of the names within these."""
        p = {f: p_value(total(own, ns), self.of_families[f]) for f, ns in self.members.items()}
        kept = _rejected(p, level)
        below = level * len(kept) / len(p)
        names: dict[str, float] = {}
        for f in kept:
            known = {n: [r.get(n, -math.inf) for r in self.references] for n in self.members[f] if n in own}
            names |= _rejected({n: p_value(own[n], values) for n, values in known.items()}, below)
        return kept, names


def _rejected(p: Mapping[str, float], level: float) -> dict[str, float]:
    found = discovered(list(p.values()), level)
    return {n: v for (n, v), yes in zip(p.items(), found, strict=True) if yes}


def share(found: int, of: int) -> tuple[float, float, float]:
    """A share with its 95 % interval (Wilson)."""
    interval = binomtest(found, of).proportion_ci(method="wilson")
    return found / of, float(interval.low), float(interval.high)


@dataclass(frozen=True)
class Pooled:
    """Sizes of one kind over trucks: their mean with its standard error, the sd between trucks, and each
    truck's size as fitted (`raw`) and shrunk towards the mean according to its uncertainty (`shrunk`)."""

    mean: float
    error: float
    between: float
    raw: tuple[float, ...]
    shrunk: tuple[float, ...]


def pooled(values: Sequence[float], sds: Sequence[float]) -> Pooled:
    """A random-effects mean (DerSimonian and Laird, Controlled Clinical Trials 7, 1986)."""
    x, v = np.asarray(values, dtype=float), np.asarray(sds, dtype=float) ** 2
    w = 1.0 / v
    fixed = float(w @ x / w.sum())
    scale = float(w.sum() - (w @ w) / w.sum())
    between = max(0.0, (float(w @ (x - fixed) ** 2) - (len(x) - 1)) / scale) if len(x) > 1 else 0.0
    w = 1.0 / (v + between)
    mean = float(w @ x / w.sum())
    shrunk = mean + between / (between + v) * (x - mean)
    return Pooled(mean, float(w.sum() ** -0.5), between**0.5, tuple(x.tolist()), tuple(shrunk.tolist()))
