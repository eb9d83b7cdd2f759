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
    merge,
    shapes,
)
from deeptruck_model.mismatch.noise import Fit, Prior, Series, fit, whiten
from deeptruck_model.mismatch.regimes import Gate, Products, Regimes, gated

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TEMPER = 3.0  # evidence is this much too sure, the noise model being approximate; priors are charged likewise
POSSIBLE = (-0.7, 2.0)  # relative change of a parameter from the simulator's
RETUNE_RANGE = (-0.6, 1.0)  # no truck is further off; what asks for more is no parameter error
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
FEW_COLUMNS = 3  # of shapes that are confined to a regime before they are fitted
CONFINED = 3  # so many shapes of each mechanism
OWN_REGIME = 0.15  # share of what a mechanism does that must lie in its regime: no slip of a locked converter
WORTH_A_REGIME = 6.0  # nats
FITTED = 8  # mechanisms that are fitted in full in each round
SECOND_SHAPES = 9  # among the first of these, more than one shape of a mechanism
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
        """Posterior covariance of the coefficients of an effect, as much wider as evidence is too sure, or as
        recordings disagree, whichever is the more."""
        part = dict(self.layout)[name]
        own = TEMPER * self.fit.covariance[part, part]
        sd = np.sqrt(np.diag(own))
        wider = np.maximum(self.fit.between[part] / np.maximum(sd, 1e-12), 1.0)
        out: Array = own * np.outer(wider, wider)
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
        self.regimes = Regimes.of(evidence, self.series.usable())
        self._shapes: dict[str, list[Shape]] = {}
        self._memo: tuple[Model, Fit, tuple[Array, Array, Array, Array]] | None = None
        self._models: dict[tuple[object, ...], Model] = {}

    def shapes(self, mechanism: Mechanism) -> list[Shape]:
        """All shapes of a mechanism on this evidence, made once."""
        if mechanism.effect not in self._shapes:
            self._shapes[mechanism.effect] = shapes(mechanism, self.e)
        return self._shapes[mechanism.effect]

    def model(
        self, named: tuple[Shape, ...], free: frozenset[str], start: Fit | None = None, *, again: bool = False
    ) -> Model:
        """Fit one explanation, from the noise of `start`. Fitted `again` from another start, the better one
        stays: noise that swallows a force and a force that leaves little noise are both optima."""
        key = (tuple((n.mechanism.effect, id(n)) for n in named), free)
        known = self._models.get(key)
        if known is None or again:
            X, prior, layout = self._design(named, free)
            found = fit(self.series, X, prior, start)
            cost = TEMPER * sum(np.log(n.trials) - np.log(n.mechanism.chance(self.e)) for n in named)
            model = Model(named, free, found, found.evidence - float(cost), layout)
            beyond = {p for p in free if not self._possible(p, model)}
            model = self.model(named, free - beyond, start, again=again) if beyond else model
            self._models[key] = model if known is None or model.score > known.score else known
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

    def screen(self, base: Model, noise: Model | None = None) -> list[tuple[float, Shape]]:
        """Approximate gain of the best shapes of every mechanism on top of `base`, best first; the noise is
        that of `noise`, or of `base`."""
        out = []
        taken = any(comes_and_goes(n) for n in base.named)
        for mechanism in self.library:
            if mechanism.effect not in base.effects:
                scored = self.screen_shapes(base, self.shapes(mechanism), noise)
                laws = [item for item in scored if not comes_and_goes(item[1])]
                out += laws[:SCREENED] + self._screen_confined(base, laws, noise)
                if not taken:  # two forces that come and go as they like cannot be told from one
                    out += [item for item in scored if comes_and_goes(item[1])][:1]
        return sorted(out, key=lambda item: -item[0])

    def _screen_confined(
        self, base: Model, laws: list[tuple[float, Shape]], noise: Model | None
    ) -> list[tuple[float, Shape]]:
        """The best law of a mechanism that gains clearly more where it acts in one regime alone; or none."""
        few = [s for _, s in laws if s.columns.shape[1] <= FEW_COLUMNS][:CONFINED]
        few = [s for s in few if s.mechanism.effect not in ONE_SIZE]
        regimes = [r for s in few for r in self.screen_regimes(base, s, noise)[:1]]
        better = [r for r in regimes if r[0] > laws[0][0] + WORTH_A_REGIME]
        return sorted(better, key=lambda item: -item[0])[:1]

    def screen_shapes(
        self, base: Model, options: Sequence[Shape], noise: Model | None = None
    ) -> list[tuple[float, Shape]]:
        """Approximate gain of each shape on top of `base`, best first."""
        noise = noise or base
        yw, Xw, H0, weight = self._whitened(base, noise)
        use = self.series.usable()
        scored = []
        for s in options:
            C = whiten(s.columns, noise.fit.ar)[use] * weight[:, None]
            products = Products(C.T @ C, C.T @ yw, Xw.T @ C)
            gain = _approximate_gain(products, Xw.T @ yw, H0, s)
            scored.append((gain - TEMPER * float(np.log(s.trials)), s))
        return sorted(scored, key=lambda item: -item[0])

    def screen_regimes(
        self, base: Model, shape: Shape, noise: Model | None = None
    ) -> list[tuple[float, Shape]]:
        """Approximate gain of a shape confined to one side of each border, best first; the best alone are
        made. The noise is that of `noise`, or of `base`."""
        if any(isinstance(c.expression, Rerun) for c in shape.parts) or "gate" in shape.settings:
            return []
        noise = noise or base
        yw, Xw, H0, weight = self._whitened(base, noise)
        C = whiten(shape.columns, noise.fit.ar)[self.series.usable()] * weight[:, None]
        Xty = Xw.T @ yw
        least = OWN_REGIME * float(np.sum(C**2))
        scored: list[tuple[float, Gate]] = [
            (_approximate_gain(products, Xty, H0, shape), gate)
            for gate, products in self.regimes.products(C, yw, Xw)
            if np.trace(products.CtC) > least
        ]
        scored = sorted(scored, key=lambda item: -item[0])[:SCREENED]
        made = [(gain, gated(shape, gate, self.e, self.regimes.count)) for gain, gate in scored]
        return [(gain - TEMPER * float(np.log(s.trials)), s) for gain, s in made]

    def _whitened(self, base: Model, noise: Model | None = None) -> tuple[Array, Array, Array, Array]:
        """Residual and columns of `base` in units of the noise, its inverse precision, and the weights."""
        fit = (noise or base).fit
        if self._memo is None or self._memo[0] is not base or self._memo[1] is not fit:
            X, prior, _ = self._design(base.named, base.free)
            use = self.series.usable()
            z = fit.innovations[use]
            weight = np.sqrt(6.0 / (5.0 + z**2)) / (self.series.relative[use] * fit.sigma)
            Xw = whiten(X, fit.ar)[use] * weight[:, None]
            yw = whiten(self.series.y - X @ base.fit.b, fit.ar)[use] * weight
            H0: Array = np.linalg.inv(Xw.T @ Xw + np.diag(1 / prior.sd**2)).astype(np.float64)
            self._memo = (base, fit, (yw, Xw, H0, weight))
        return self._memo[2]

    def candidates(self, base: Model) -> list[Model]:
        """Every mechanism added to `base`, fitted in full with its parameters free and held, best first.

        The noise beside `base` alone holds what is missing, and so hides some of the names for it; they are
        looked for again under the noise beside the best of the first.
        """
        best = self._fitted(base, self.screen(base), {})
        if best:
            leader = max(best.values(), key=lambda m: m.score)
            best = self._fitted(base, self.screen(base, leader), best, leader)
        leading = sorted(best.values(), key=lambda m: -m.score)
        for model in leading[:LEADING]:
            held = self.model(model.named, base.free, base.fit)
            if held.score > model.score:
                best[model.effects[-1]] = held
        return sorted(best.values(), key=lambda m: -m.score)

    def _fitted(
        self,
        base: Model,
        screened: list[tuple[float, Shape]],
        best: dict[str, Model],
        leader: Model | None = None,
    ) -> dict[str, Model]:
        """The best model of each of the first FITTED effects that were screened, and of those in `best`; from
        the noise of the leader where there is one."""
        everything = frozenset(self.parameters)
        best, seen = dict(best), set[str]()
        for rank, (_, shape) in enumerate(screened):
            effect = shape.mechanism.effect
            if effect not in seen and len(seen) >= FITTED:
                continue
            if effect in seen and rank >= SECOND_SHAPES and not comes_and_goes(shape):
                continue
            seen.add(effect)
            named, start = (*base.named, shape), (leader or base).fit
            model = self.model(named, everything, start, again=leader is not None)
            if effect not in best or model.score > best[effect].score:
                best[effect] = model
        return best

    def enriched(self, model: Model) -> Model:
        """The same explanation with its last mechanism given more freedom where that pays.

        First it may be confined to a regime of driving, then widened by more of its shapes.
        """
        last = model.named[-1]
        if last.mechanism.effect in ONE_SIZE:
            return model
        model = self._confined(model)
        if comes_and_goes(last):
            return model
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
        base = self.model(tuple(others), model.free, model.fit)
        confined = [s for _, s in self.screen_regimes(base, self._everywhere(last), model)]
        options = [self.model((*others, s), model.free, model.fit) for s in confined]
        best = max(options, key=lambda m: m.score, default=model)
        return best if best.score > model.score + WORTH_A_SHAPE else model

    def _everywhere(self, shape: Shape) -> Shape:
        """The shape that was confined to a regime, without it: its border was chosen under other noise."""
        plain = {k: v for k, v in shape.settings.items() if k != "gate"}
        return next((s for s in self.shapes(shape.mechanism) if s.settings == plain), shape)

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


def _approximate_gain(products: Products, Xty: Array, H0: Array, s: Shape) -> float:
    """Evidence gained by more columns, all whitened and weighted; signs respected one by one."""
    XtC = products.XtC
    A = products.CtC - XtC.T @ H0 @ XtC
    at_zero = products.Cty - XtC.T @ (H0 @ Xty)
    P = 1 / s.prior.sd**2
    m = s.prior.mean
    H = A + np.diag(P)
    g = at_zero - A @ m
    step = np.linalg.solve(H, g)
    if (s.prior.sign > 0).any() and ((step + m) * s.prior.sign < 0).all():
        return -10.0
    gain = 0.5 * float(g @ step) - 0.5 * float(np.linalg.slogdet(H)[1] - np.log(P).sum())
    return gain + float(at_zero @ m - 0.5 * m @ A @ m)  # moving by the prior mean itself counts too
