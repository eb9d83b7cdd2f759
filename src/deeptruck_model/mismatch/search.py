"""Which mechanisms, beside which parameter errors, explain the residual: a search by evidence.

Every model is a set of shapes beside the simulator's own parameters, which are either held (they may move by
HELD) or free (by the FREE share that is physically plausible). Log evidence is the sum of the log
probabilities with which each part of the data is predicted from the rest, so it ranks by prediction and
charges for every coefficient.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.evidence import Evidence
from deeptruck_model.mismatch.expression import Rerun
from deeptruck_model.mismatch.mechanisms import (
    LIBRARY,
    Mechanism,
    Shape,
    comes_and_goes,
    gated,
    gates,
    merge,
    shapes,
)
from deeptruck_model.mismatch.noise import Fit, Prior, Series, fit, whiten

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TEMPER = 3.0  # evidence is this much too sure, the noise model being approximate; priors are charged likewise
POSSIBLE = (-0.7, 2.0)  # relative change of a parameter from the simulator's
HELD = 0.01
FREE = {"mass": 0.3, "drag_area": 0.3, "rolling_resistance": 0.4, "torque_gain": 0.15, "brake_gain": 0.25}
# Filters of ordinary speed sensors and message periods make every response a little late (s); that is no
# finding.
LATE_S = 0.15
SENSOR_LAG = Prior(np.array([0.03, 0.03]), np.array([0.06, 0.06]), np.zeros(2))
SCREENED = 2  # shapes of each mechanism that are fitted in full
MORE_SHAPES = 2  # further shapes a mechanism may be widened by
WORTH_A_SHAPE = 4.0  # nats a further shape of the same mechanism must gain
# Several delays side by side are any filter, and no delay; a sensor is off always or not at all.
ONE_SIZE = ("command_delay", "clock_offset", "grade_bias")
MOST_COLUMNS = 8  # profiles with more columns are wide enough as they are
FITTED = 8  # mechanisms that are fitted in full in each round
SECOND_SHAPES = 6  # among the first of these, more than one shape of a mechanism
LEADING = 4  # mechanisms also tried without freeing the parameters


@dataclass(frozen=True)
class Model:
    """A fitted explanation. `free`: simulator parameters set free; `score`: evidence with priors, in nats."""

    named: tuple[Shape, ...]
    free: frozenset[str]
    fit: Fit
    score: float
    layout: tuple[tuple[str, slice], ...] = field(default=())

    @property
    def effects(self) -> tuple[str, ...]:
        return tuple(n.mechanism.effect for n in self.named)

    def coefficients(self, name: str) -> Array:
        """Posterior mean of the coefficients of an effect."""
        return self.fit.b[dict(self.layout)[name]]

    def change(self, parameter: str) -> float:
        """Relative change of a parameter of the simulator that was run."""
        return float(self.coefficients(f"parameter:{parameter}")[0])

    def change_sd(self, parameter: str) -> float:
        """Posterior sd of `change`."""
        return float(np.sqrt(self.covariance(f"parameter:{parameter}")[0, 0]))

    def covariance(self, name: str) -> Array:
        """Posterior covariance of the coefficients of an effect, as much wider as evidence is too sure."""
        part = dict(self.layout)[name]
        out: Array = TEMPER * self.fit.covariance[part, part]
        return out


class Search:
    """Fits models on one body of evidence and remembers them."""

    def __init__(self, evidence: Evidence, *, exclude: Iterable[str] = (), only: Mask | None = None) -> None:
        self.e = evidence
        self.parameters = tuple(evidence.sensitivity)
        late = [-evidence.difference(evidence.simulated), evidence.rerun("delay_all", LATE_S) / LATE_S]
        self._late = np.stack(late, axis=1)
        self.series: Series = evidence.series(1e9, only)
        first = fit(self.series, *self._design((), frozenset(self.parameters))[:2])
        self.series = evidence.series(first.sigma, only)
        self.library = [
            m for name, m in LIBRARY.items() if name not in set(exclude) and evidence.has(*m.needs)
        ]
        self._shapes: dict[str, list[Shape]] = {}
        self._memo: tuple[Model, tuple[Array, Array, Array, Array]] | None = None
        self._models: dict[tuple[object, ...], Model] = {}

    def shapes(self, mechanism: Mechanism) -> list[Shape]:
        """All shapes of a mechanism on this evidence, made once."""
        if mechanism.effect not in self._shapes:
            self._shapes[mechanism.effect] = shapes(mechanism, self.e)
        return self._shapes[mechanism.effect]

    def model(self, named: tuple[Shape, ...], free: frozenset[str], start: Fit | None = None) -> Model:
        """Fit one explanation."""
        key = (tuple((n.mechanism.effect, id(n)) for n in named), free)
        if key not in self._models:
            X, prior, layout = self._design(named, free)
            found = fit(self.series, X, prior, start)
            cost = TEMPER * sum(np.log(n.trials) - np.log(n.mechanism.chance(self.e)) for n in named)
            model = Model(named, free, found, found.evidence - float(cost), layout)
            beyond = {p for p in free if not self._possible(p, model)}
            self._models[key] = self.model(named, free - beyond, start) if beyond else model
        return self._models[key]

    def _possible(self, parameter: str, model: Model) -> bool:
        """Whether a parameter stays within what a truck can have: no rolling resistance is negative."""
        low, high = POSSIBLE
        return low < self.e.total_change(parameter, model.change(parameter)) < high

    def background(self, named: tuple[Shape, ...]) -> Model:
        """The best model with these mechanisms and any set of free parameters that a greedy search finds."""
        best = self.model(named, frozenset())
        everything = self.model(named, frozenset(self.parameters))
        grown = best
        while True:
            options = [
                self.model(named, grown.free | {p}, grown.fit) for p in self.parameters if p not in grown.free
            ]
            step = max(options, key=lambda m: m.score, default=grown)
            if step.score < grown.score + 1.0:
                break
            grown = step
        return max((best, grown, everything), key=lambda m: m.score)

    def screen(self, base: Model) -> list[tuple[float, Shape]]:
        """Approximate gain of the best shapes of every mechanism on top of `base`, best first."""
        out = []
        taken = any(comes_and_goes(n) for n in base.named)
        for mechanism in self.library:
            if mechanism.effect not in base.effects:
                # two forces that come and go as they like cannot be told from one
                options = [s for s in self.shapes(mechanism) if not (taken and comes_and_goes(s))]
                out += self.screen_shapes(base, options)[:SCREENED]
        return sorted(out, key=lambda item: -item[0])

    def screen_shapes(self, base: Model, options: Sequence[Shape]) -> list[tuple[float, Shape]]:
        """Approximate gain of each shape on top of `base` under its noise, best first."""
        yw, Xw, H0, weight = self._whitened(base)
        use = self.series.usable()
        scored = []
        for s in options:
            C = whiten(s.columns, base.fit.ar)[use] * weight[:, None]
            scored.append((_approximate_gain(C, yw, Xw, H0, s) - TEMPER * float(np.log(s.trials)), s))
        return sorted(scored, key=lambda item: -item[0])

    def _whitened(self, base: Model) -> tuple[Array, Array, Array, Array]:
        """Residual and columns of `base` in units of its noise, its inverse precision, and the weights."""
        if self._memo is None or self._memo[0] is not base:
            X, prior, _ = self._design(base.named, base.free)
            use = self.series.usable()
            z = base.fit.innovations[use]
            weight = np.sqrt(6.0 / (5.0 + z**2)) / (self.series.relative[use] * base.fit.sigma)
            Xw = whiten(X, base.fit.ar)[use] * weight[:, None]
            yw = whiten(self.series.y - X @ base.fit.b, base.fit.ar)[use] * weight
            H0: Array = np.linalg.inv(Xw.T @ Xw + np.diag(1 / prior.sd**2)).astype(np.float64)
            self._memo = (base, (yw, Xw, H0, weight))
        return self._memo[1]

    def candidates(self, base: Model) -> list[Model]:
        """Every mechanism added to `base`, fitted in full with its parameters free and held, best first."""
        everything = frozenset(self.parameters)
        best: dict[str, Model] = {}
        for rank, (_, shape) in enumerate(self.screen(base)):
            effect = shape.mechanism.effect
            if (effect not in best and len(best) >= FITTED) or (effect in best and rank >= SECOND_SHAPES):
                continue
            model = self.model((*base.named, shape), everything, base.fit)
            if effect not in best or model.score > best[effect].score:
                best[effect] = model
        leading = sorted(best.values(), key=lambda m: -m.score)
        for model in leading[:LEADING]:
            held = self.model(model.named, base.free, base.fit)
            if held.score > model.score:
                best[model.effects[-1]] = held
        return sorted(best.values(), key=lambda m: -m.score)

    def enriched(self, model: Model) -> Model:
        """The same explanation with its last mechanism given more freedom where that pays.

        First it may be confined to a regime of driving, then widened by more of its shapes.
        """
        last = model.named[-1]
        if comes_and_goes(last) or last.mechanism.effect in ONE_SIZE:
            return model
        model = self._confined(model)
        for _ in range(MORE_SHAPES):
            *others, last = model.named
            taken = [str(part) for part in last.settings.get("parts", [last.settings])]
            options = [
                self.model((*others, merge(last, s)), model.free, model.fit)
                for s in self.shapes(last.mechanism)
                if str(s.settings) not in taken and s.columns.shape[1] <= MOST_COLUMNS
            ]
            best = max(options, key=lambda m: m.score, default=model)
            if best.score < model.score + WORTH_A_SHAPE:
                break
            model = best
        return model

    def _confined(self, model: Model) -> Model:
        *others, last = model.named
        if last.columns.shape[1] > MOST_COLUMNS or any(isinstance(c.expression, Rerun) for c in last.parts):
            return model
        regimes = gates(self.e)
        base = self.model(tuple(others), model.free, model.fit)
        options = [gated(last, g, self.e, len(regimes)) for g in regimes]
        scored = self.screen_shapes(base, options)
        best = max(
            (self.model((*others, s), model.free, model.fit) for _, s in scored[:2]), key=lambda m: m.score
        )
        return best if best.score > model.score + WORTH_A_SHAPE else model

    def prediction(self, model: Model) -> Array:
        """What a model says the residual is, (n,)."""
        X, _, _ = self.design(model)
        out: Array = X @ model.fit.b
        return out

    def gain_of(self, model: Model, column: Array) -> float:
        """Nats gained by one more column (n,) that should enter with a factor near one."""
        X, prior, _ = self.design(model)
        extra = Prior(np.array([0.7]), np.array([0.4]), np.array([1.0]))
        found = fit(self.series, np.column_stack([X, column]), Prior.join(prior, extra), model.fit)
        return found.evidence - model.fit.evidence

    def design(self, model: Model) -> tuple[Array, Prior, tuple[tuple[str, slice], ...]]:
        """Columns (n, k), prior and layout of a model."""
        return self._design(model.named, model.free)

    def _design(
        self, named: tuple[Shape, ...], free: frozenset[str]
    ) -> tuple[Array, Prior, tuple[tuple[str, slice], ...]]:
        blocks = [n.columns for n in named] + [self.e.sensitivity[p][:, None] for p in self.parameters]
        blocks.append(self._late)
        names = (
            [n.mechanism.effect for n in named] + [f"parameter:{p}" for p in self.parameters] + ["sensor lag"]
        )
        sd = np.array([FREE[p] if p in free else HELD for p in self.parameters])
        as_given = np.array([1.0 / (1.0 + self.e.moved.get(p, 0.0)) - 1.0 for p in self.parameters])
        prior = Prior.join(*(n.prior for n in named), Prior(as_given, sd, np.zeros(len(sd))), SENSOR_LAG)
        layout, at = [], 0
        for name, block in zip(names, blocks, strict=True):
            layout.append((name, slice(at, at + block.shape[1])))
            at += block.shape[1]
        X = np.concatenate(blocks, axis=1)
        return X, prior, tuple(layout)


def _approximate_gain(C: Array, y: Array, X: Array, H0: Array, s: Shape) -> float:
    """Evidence gained by adding columns C to X, all whitened and weighted; signs respected one by one."""
    XtC = X.T @ C
    A = C.T @ C - XtC.T @ H0 @ XtC
    g = C.T @ y - XtC.T @ (H0 @ (X.T @ y))
    P = 1 / s.prior.sd**2
    H = A + np.diag(P)
    g = g - A @ s.prior.mean
    step = np.linalg.solve(H, g)
    if (s.prior.sign > 0).any() and ((step + s.prior.mean) * s.prior.sign < 0).all():
        return -10.0
    gain = 0.5 * float(g @ step) - 0.5 * float(np.linalg.slogdet(H)[1] - np.log(P).sum())
    # moving by the prior mean itself changes the likelihood too
    m = s.prior.mean
    return gain + float((C.T @ y - XtC.T @ (H0 @ (X.T @ y))) @ m - 0.5 * m @ A @ m)
