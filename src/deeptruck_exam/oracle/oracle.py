"""What could be identified at all: every law is a candidate, with its form and places known.

A case is driven, and every law is asked for its force along the same drives, for sizes drawn from its ranges
and drawn anew about the best ones. The evidence of a law is a mean over these draws, with a factor near one
and the truck's own parameters marginalised; the evidence of a name is that of its laws. With the case's own
law among them this is the limit of what the drives identify; without it, what an unknown law costs.

Left out: faults of the sensors and laws that need a leader. The noise is the exam's: white, over a second.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.cases.build import MOTION_SD, Built, accelerations, second_means
from deeptruck_exam.cases.gates import CONDITIONS, Open, Windows
from deeptruck_exam.cases.trace import Trace, setting_of
from deeptruck_exam.laws import EFFECTS, Effect
from deeptruck_exam.laws.catalogue import Planted
from deeptruck_exam.laws.law import Array, Setting
from deeptruck_exam.worlds import trucks

DRAWS, FEW_DRAWS = 12, 2  # of sizes; of laws with a chance of their own, which are made one by one
REFINED, ROUNDS, NEARER = 10, 2, 0.3  # laws drawn anew, how often, and how much nearer each time
FACTOR_SD = 0.3  # of the factor about one by which a drawn law may act
FREE = {"mass": 0.3, "drag_area": 0.3, "rolling_resistance": 0.4, "torque_gain": 0.15, "brake_gain": 0.25}
STEP = 0.02  # relative, of the sensitivities
NOTHING = "nothing"


@dataclass(frozen=True)
class Evidence:
    """Log evidence (nats, against nothing missing) of laws by key, and the name of each."""

    laws: Mapping[str, float]
    names: Mapping[str, str]

    def of_names(self, without: Iterable[str] = ()) -> dict[str, float]:
        """Log evidence by name: the mean over its laws, but for those left out."""
        gone, by_name = set(without), dict[str, list[float]]()
        for key, nats in self.laws.items():
            if key not in gone:
                by_name.setdefault(self.names[key], []).append(nats)
        return {NOTHING: 0.0, **{name: _log_mean(np.array(nats)) for name, nats in by_name.items()}}


class Oracle:
    """A driven case, and the evidence of each law in it."""

    def __init__(self, built: Built, seed: int = 0) -> None:
        """`built` hides one effect, which is a force, a filter or a parameter."""
        self.built, self.rng = built, np.random.default_rng([seed, 9])
        self.nominal = trucks.make(built.plan.truck, built.plan.values)
        self.fit = slice(0, built.plan.fit)
        self.trace = Trace.of(self.nominal, built.drives, setting_of(built))
        self.many = self.trace.repeated(DRAWS)
        self.plain = accelerations(self.nominal, built.drives)
        self.openings = self._openings()
        noise = self.rng.normal(0.0, MOTION_SD, second_means(built.extra)[self.fit].shape)
        self.y = (second_means(built.extra)[self.fit] + noise).ravel()
        self._weigh_parameters()
        self.known = {e.key: s for e, s in zip(built.plan.effects, built.sizes, strict=True)}

    def evidence(self, among: Iterable[str] = tuple(EFFECTS)) -> Evidence:
        """The evidence of every law that can be, among these keys."""
        laws = {key: EFFECTS[key] for key in among if self._can_be(EFFECTS[key])}
        found = {key: self._evidence(law, law.ranges) for key, law in laws.items()}
        best = sorted(found, key=lambda key: -found[key][0])[:REFINED]
        for key in {*best, *self.known} & set(laws):
            found[key] = self._refined(laws[key], *found[key])
        return Evidence({k: e[0] for k, e in found.items()}, {k: e.name for k, e in laws.items()})

    def _can_be(self, e: Effect) -> bool:
        return e.kind != "measurement_fault" and not e.leader and self.built.plan.truck in e.trucks

    def _refined(
        self, law: Effect, nats: float, best: Mapping[str, float]
    ) -> tuple[float, Mapping[str, float]]:
        """The evidence from sizes drawn nearer and nearer to the best, weighed by the share of the prior that
        they are drawn from."""
        share = 1.0
        for k in range(1, ROUNDS + 1):
            near = {n: _about(best[n], *law.ranges[n], NEARER**k) for n in law.ranges}
            share = float(np.prod([_part(near[n], law.ranges[n]) for n in near]))
            there, at = self._evidence(law, near)
            if there + np.log(max(share, 1e-300)) > nats:
                nats, best = there + float(np.log(share)), at
            elif there > nats:
                best = at
        return nats, best

    def _evidence(
        self, law: Effect, ranges: Mapping[str, tuple[float, float]]
    ) -> tuple[float, Mapping[str, float]]:
        """Log evidence of a law with sizes from these ranges, and the best of them."""
        drawn = {n: self.rng.uniform(low, high, DRAWS) for n, (low, high) in ranges.items()}
        if law.key in self.known:  # that it can be met is no matter of luck
            drawn = {n: np.append(x[:-1], self.known[law.key][n]) for n, x in drawn.items()}
        columns = self._columns(law, drawn)  # (draws, openings, m)
        nats = np.array([[self._gain(column) for column in row] for row in columns])
        best = int(np.argmax(nats.max(axis=1)))
        return _log_mean(nats.ravel()), {n: float(x[best + DRAWS - len(nats)]) for n, x in drawn.items()}

    def _columns(self, law: Effect, drawn: Mapping[str, Array]) -> Array:
        """What a law does with each set of sizes, (draws, openings, m): means over seconds."""
        if law.kind == "parameter_error":
            return self._one_by_one(law, drawn, DRAWS)
        setting, batch = Watched.of(self.many.setting), self.trace.setting.batch
        try:
            sizes = SimpleNamespace(**{n: np.repeat(x, batch) for n, x in drawn.items()})
            planted = law.build(setting, sizes)
            if planted.filters or planted.parameters or setting.by_chance:
                raise ValueError("one by one")
            out = self.many.acceleration(planted.forces, self._many_openings())
        except (ValueError, TypeError, IndexError):
            return self._one_by_one(law, drawn, FEW_DRAWS)
        split = out.reshape(len(out), DRAWS, batch, -1)
        return np.stack([[self._rows(split[o, d]) for o in range(len(out))] for d in range(DRAWS)])

    def _one_by_one(self, law: Effect, drawn: Mapping[str, Array], draws: int) -> Array:
        """The same of the last draws, each in the case's own setting, so that its chances are known."""
        out = []
        for d in range(DRAWS - draws, DRAWS):
            planted = law.build(self.trace.setting, SimpleNamespace(**{n: x[d] for n, x in drawn.items()}))
            out.append(self._alone(planted))
        return np.array(out)

    def _alone(self, planted: Planted) -> Array:
        if not planted.filters and not planted.parameters:
            whole = self.trace.acceleration(planted.forces, self.openings)
        else:
            truck = self.nominal.with_parameters(dict(planted.parameters))
            truck = truck.with_forces(list(planted.forces), list(planted.filters))
            driven = accelerations(truck, self.built.drives) - self.plain
            whole = np.stack([driven] * (1 + len(self.openings)))
        return np.array([self._rows(x) for x in whole])

    def _rows(self, acceleration: Array) -> Array:
        n = self.built.extra.shape[1]
        padded = np.zeros((len(acceleration), n))
        padded[:, : min(n, acceleration.shape[1])] = acceleration[:, :n]
        return second_means(padded)[self.fit].ravel()

    def _openings(self) -> tuple[Open, ...]:
        """Conditions under which laws may act, where this case has one; its windows, where it has those."""
        plan = self.built.plan
        if plan.level == "rare":
            return (self._windows(),)
        return tuple(CONDITIONS.values()) if plan.condition else ()

    def _windows(self) -> Windows:
        """Where the case's effect acts, by the effect itself."""
        acts = np.abs(self.built.extra) > 0.2 * np.abs(self.built.extra).max()
        wide = np.stack([np.convolve(row, np.ones(21), mode="same") > 0 for row in acts])
        return _windows(wide)

    def _many_openings(self) -> tuple[Open, ...]:
        if self.built.plan.level != "rare":
            return self.openings
        one = self._windows()
        return (Windows(np.tile(one.start_s, (DRAWS, 1)), np.tile(one.end_s, (DRAWS, 1))),)

    def _weigh_parameters(self) -> None:
        """Make ready to marginalise the truck's parameters, each by the size that is plausible."""
        values = self.nominal.parameters()
        out = []
        for name in trucks.TUNABLE:
            moved = self.nominal.with_parameters({name: values[name] * (1.0 + STEP)})
            out.append(self._rows(accelerations(moved, self.built.drives) - self.plain) / STEP * FREE[name])
        rows = np.stack(out)
        root = np.linalg.cholesky(np.eye(len(out)) + rows @ rows.T / MOTION_SD**2)
        self.whitened = np.linalg.solve(root, rows) / MOTION_SD
        self.seen = self.whitened @ self.y / MOTION_SD

    def _gain(self, column: Array) -> float:
        """Nats for a column with a factor of one give or take FACTOR_SD, parameters marginalised."""
        if not np.isfinite(column).all():
            return -1e6
        across = self.whitened @ column / MOTION_SD
        cc = float(column @ column) / MOTION_SD**2 - float(across @ across)
        cy = float(column @ self.y) / MOTION_SD**2 - float(across @ self.seen)
        h = cc + FACTOR_SD**-2
        return (
            0.5 * (cy + FACTOR_SD**-2) ** 2 / h - 0.5 * FACTOR_SD**-2 - 0.5 * float(np.log(h * FACTOR_SD**2))
        )


@dataclass(frozen=True)
class Watched(Setting):
    """A setting that knows whether a law drew from chance."""

    drawn: tuple[list[int], ...] = ([],)

    @staticmethod
    def of(s: Setting) -> Watched:
        return Watched(**{n: getattr(s, n) for n in Setting.__dataclass_fields__}, drawn=([],))

    @property
    def by_chance(self) -> bool:
        return bool(self.drawn[0])

    def rng(self, salt: int) -> np.random.Generator:
        self.drawn[0].append(salt)
        return super().rng(salt)


def _windows(acts: NDArray[np.bool_]) -> Windows:
    """The segments in which rows (batch, n) of truth values are set."""
    spans = []
    for row in acts:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(int), [0]])))
        spans.append((edges[::2] * 0.1, edges[1::2] * 0.1))
    most = max(1, *(len(s) for s, _ in spans))
    start, end = np.full((len(acts), most), np.inf), np.full((len(acts), most), np.inf)
    for k, (s, e) in enumerate(spans):
        start[k, : len(s)], end[k, : len(e)] = s, e
    return Windows(start, end)


def _about(at: float, low: float, high: float, share: float) -> tuple[float, float]:
    """A part of a range about a place in it."""
    half = 0.5 * share * (high - low)
    return max(low, at - half), min(high, at + half)


def _part(near: tuple[float, float], whole: tuple[float, float]) -> float:
    width = whole[1] - whole[0]
    return 1.0 if width == 0.0 else (near[1] - near[0]) / width


def _log_mean(nats: Array) -> float:
    top = float(nats.max())
    return top + float(np.log(np.mean(np.exp(nats - top))))
