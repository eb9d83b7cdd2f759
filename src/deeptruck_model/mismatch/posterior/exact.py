"""Sizes by exact runs: what is stated is set into the simulator as it runs, and refined there.

The simulator is driven, forced, along the drives with its parameters, its command paths and the constants of
forms changed. Gauss-Newton steps on the whitened residual lead to the sizes, each kept only if it is better.
Beside them stay free, with their priors, what ordinary sensors do to time, parameters near their values,
the form error, and what is slow. Errors of a law last longer than the noise, so that intervals are those of
blocks of driving (Liang and Zeger, Biometrika 73, 1986).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.constants import GRAVITY
from deeptruck_model.mismatch.mechanisms import Column, Mechanism, Variant, build, candidate_term
from deeptruck_model.mismatch.mechanisms.record import Form
from deeptruck_model.mismatch.posterior.posterior import NO_NAME, SLOPE, Posterior
from deeptruck_model.mismatch.posterior.regression import FREE, changed_by
from deeptruck_model.mismatch.posterior.sampler import SIZES
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.residual.commands import changed
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import Rerun
from deeptruck_model.mismatch.residual.gather import accepted, driven_at
from deeptruck_model.mismatch.residual.noise import TAIL, whiten
from deeptruck_model.mismatch.residual.timing import sensor_terms
from deeptruck_model.simulators import Simulator

MOST_STEPS, HALVINGS = 10, 2  # Gauss-Newton steps, and how often one that is worse is halved
REWEIGHED = 6  # times that rows are weighted anew beside what they leave
SETTLED = 0.1  # standard deviations of a step that is the last
STEP = 0.05  # of the logarithm of a constant, for its derivative
CONSTANT_SD = 0.7  # of the logarithm of a constant that has no limits of its own
SLOPE_SHARE, SLOPE_BIAS = 0.02, 0.0005  # prior sds of what a sensor of slope is off by
WIDER = 1.5  # times standard deviations, because the noise of sensors is not quite as modelled
REACH = 2.0  # sds between the middle of a constant's limits and either one


@dataclass(frozen=True)
class Part:
    """One form of a mechanism in the simulator, and the coefficients of its columns."""

    mechanism: Mechanism
    variant: Variant
    b: tuple[float, ...]

    @cached_property
    def columns(self) -> list[Column]:
        return build(self.mechanism, (self.variant,))

    @property
    def paths(self) -> list[tuple[str, float]]:
        """Names and amounts of the command paths that it changes; none if it is a force."""
        return [(x.path, x.amount) for c in self.columns if isinstance(x := c.expression, Rerun)]

    @property
    def constants(self) -> dict[str, tuple[float, float]]:
        """The middle and standard deviation of the logarithm of each constant that is fitted."""
        if any(c.exact for c in self.columns):  # whose constants say where they are linear
            return {}
        form, values = self.mechanism.forms[self.variant.form], dict(self.variant.constants)
        limits = form.fitted if isinstance(form, Form) else {}
        if isinstance(form, Form) and not limits:
            known = {n: x for n, x in values.items() if isinstance(x, float) and x}
            return {n: (float(np.log(abs(x))), CONSTANT_SD) for n, x in known.items()}
        ends = {n: np.log(each) for n, each in limits.items()}
        return {n: (float(x.mean()), float(np.ptp(x)) / 2.0 / REACH) for n, x in ends.items()}

    @property
    def whole(self) -> list[bool]:
        """Which coefficients are one, because a constant is the size."""
        return [bool(self.paths) or (bool(self.constants) and c.mean == 1.0) for c in self.columns]

    def at(self, logs: Mapping[str, float], b: Sequence[float]) -> Part:
        """The same form with other constants, of which the logarithms are given, and coefficients."""
        values = dict(self.variant.constants)
        values |= {n: float(np.sign(values[n]) * np.exp(z)) for n, z in logs.items()}
        return Part(self.mechanism, replace(self.variant, constants=tuple(values.items())), tuple(b))

    def force(self, e: Evidence) -> Array:
        """Its acceleration (n,), m/s^2; zero for a path, which acts in the simulator."""
        if self.paths:
            return np.zeros(len(e))
        out: Array = candidate_term(self.mechanism, self.variant, e).columns @ np.array(self.b)
        for k, size in enumerate(self.b):
            out = out + self._beyond(k, size, e)
        return out

    def slopes(self, e: Evidence) -> Array:
        """The change (n, k) of its acceleration by each coefficient."""
        out = candidate_term(self.mechanism, self.variant, e).columns.copy()
        for k, b in enumerate(self.b):
            out[:, k] += (self._beyond(k, b + STEP, e) - self._beyond(k, b - STEP, e)) / (2.0 * STEP)
        return out

    def _beyond(self, k: int, size: float, e: Evidence) -> Array:
        """What the force of a coefficient has beyond its linear part, (n,)."""
        column = self.columns[k]
        if column.exact is None:
            return np.zeros(len(e))
        return (column.exact(size) + column.expression * -size).rows(e)


@dataclass(frozen=True)
class Setting:
    """What is set in the simulator: relative changes of its parameters from those given, and forms."""

    moved: Mapping[str, float] = field(default_factory=dict)
    parts: tuple[Part, ...] = ()


@dataclass(frozen=True)
class Unknown:
    """One number that is fitted: a parameter's linear change, or a coefficient or the logarithm of a constant
    of the part `part`; with its prior and where it starts."""

    of: Any  # name of the parameter or constant, or place of the coefficient
    part: int | None
    is_constant: bool
    mean: float
    sd: float
    start: float


class Exact:
    """A simulator along the drives of a posterior, with `free` parameters and the sizes of `parts` to fit."""

    def __init__(
        self,
        simulator: Simulator,
        prepared: Sequence[Prepared],
        p: Posterior,
        given: Mask,
        free: Sequence[str] = (),
        parts: Sequence[Part] = (),
    ) -> None:
        """`given` are the draws (m,) from which what is slow beside is taken."""
        self.simulator, self.prepared, self.e, self.p = simulator, prepared, p.regression.e, p
        self.parts, self.rows = tuple(parts), p.regression.rows
        self._weight = 1.0 / (p.regression.series.relative[self.rows] * p.noise.sigma)
        self._paths = any(part.paths for part in parts)
        self._fixed = self._white(_beside(p, given, {*free, *(q.mechanism.effect for q in parts)}))
        self.unknown = [*self._parameters(free), *(u for i in range(len(parts)) for u in self._sizes(i))]
        self.precision = np.array([1.0 / u.sd**2 for u in self.unknown])
        self.least = np.array([0.0 if self._is_signed(u) else -np.inf for u in self.unknown])

    def _is_signed(self, u: Unknown) -> bool:
        return u.part is not None and not u.is_constant and self.parts[u.part].columns[u.of].sign > 0

    def _parameters(self, free: Sequence[str]) -> list[Unknown]:
        as_given = {n: 1.0 / (1.0 + self.e.moved.get(n, 0.0)) - 1.0 for n in free}
        return [Unknown(n, None, False, as_given[n], FREE[n], 0.0) for n in free]

    def _sizes(self, i: int) -> list[Unknown]:
        part = self.parts[i]
        each = zip(part.columns, part.whole, part.b, strict=True)
        sizes = [Unknown(k, i, False, c.mean, c.sd, b) for k, (c, whole, b) in enumerate(each) if not whole]
        now = dict(part.variant.constants)
        return sizes + [
            Unknown(n, i, True, middle, sd, float(np.log(abs(now[n]))))
            for n, (middle, sd) in part.constants.items()
        ]

    def setting(self, x: Array) -> Setting:
        """What these numbers (k,) mean, within physical limits."""
        moved: dict[str, float] = {}
        logs: list[dict[str, float]] = [{} for _ in self.parts]
        b = [[1.0 if w else v for w, v in zip(q.whole, q.b, strict=True)] for q in self.parts]
        for u, value in zip(self.unknown, x.tolist(), strict=True):
            if u.part is None:
                further = changed_by(u.of, value, self.p.regression.mass_gain)
                moved[u.of] = float(
                    np.clip(self.e.total_change(u.of, further), *self.e.vehicle.possible(u.of))
                )
            elif u.is_constant:
                logs[u.part][u.of] = float(np.clip(value, u.mean - REACH * u.sd, u.mean + REACH * u.sd))
            else:
                b[u.part][u.of] = value
        moved = accepted(self.simulator, {n: c for n, c in moved.items() if c})
        return Setting(moved, tuple(q.at(z, w) for q, z, w in zip(self.parts, logs, b, strict=True)))

    def run(self, s: Setting) -> Evidence:
        """The evidence with the simulator driven as set."""
        own, along = self.simulator.parameters(), self.prepared
        values = {n: own[n] * (1.0 + c) for n, c in s.moved.items() if n in own}
        for name, amount in (path for part in s.parts for path in part.paths):
            along = [replace(drive, u=changed(drive, name, amount)) for drive in along]
        return driven_at(self.simulator.with_parameters(values) if values else self.simulator, along, self.e)

    def left(self, s: Setting, e: Evidence) -> Array:
        """What is left (n,), m/s^2; parameters that the simulator does not have scale its forces."""
        out, own = e.residual, self.simulator.parameters()
        for part in s.parts:
            out = out - part.force(e)
        for u in self.unknown:
            if u.part is None and u.of not in own:
                out = out - self.e.sensitivity[u.of] * (s.moved.get(u.of, 0.0) - self.e.moved.get(u.of, 0.0))
        return out

    def slopes(self, x: Array, s: Setting, e: Evidence) -> Array:
        """Change of the acceleration (n, k) by each unknown."""
        out = np.zeros((len(e), len(x)))
        columns = [q.slopes(e) for q in s.parts]
        for j, u in enumerate(self.unknown):
            if u.part is None:
                out[:, j] = np.nan_to_num(self.e.sensitivity[u.of])
            elif not u.is_constant:
                out[:, j] = columns[u.part][:, u.of]
            else:
                step = STEP if x[j] < u.mean else -STEP
                there = self.setting(x + step * (np.arange(len(x)) == j))
                if s.parts[u.part].paths:
                    out[:, j] = (self.run(there).simulated - e.simulated) / step
                else:
                    out[:, j] = (there.parts[u.part].force(e) - s.parts[u.part].force(e)) / step
        return out

    def _white(self, x: Array) -> Array:
        return whiten(np.nan_to_num(x), self.p.noise.ar, self.rows, self._weight)

    def _at(self, x: Array) -> _At:
        s = self.setting(x)
        e = self.run(s)
        timing, prior = sensor_terms(e, of_commands=not self._paths)
        y = self._white(self.left(s, e) - timing @ prior.mean)
        N = np.concatenate([self._fixed, self._white(timing * prior.sd)], axis=1)
        left, own, wide = y, np.eye(N.shape[1]), 1.0
        for _ in range(REWEIGHED):
            weight = (TAIL + 1.0) / (TAIL * wide**2 + left**2)
            b = np.linalg.solve((N.T * weight) @ N + own, N.T @ (weight * y))
            left = y - N @ b
            wide *= max(float(np.sqrt(np.mean(weight * left**2))), 1.0 / wide)
        off = x - np.array([u.mean for u in self.unknown])
        loss = (TAIL + 1.0) * float(np.log1p((left / wide) ** 2 / TAIL).sum())
        loss += 2.0 * len(left) * np.log(wide) + float(b @ b + self.precision @ off**2)
        root = np.sqrt(weight)
        return _At(s, e, root, y * root, N * root[:, None], 0.5 * loss)

    def fit(self) -> Fitted:
        """Gauss-Newton steps from the start, and delays of whole samples where these are better."""
        k = len(self.unknown)
        mean = np.array([u.mean for u in self.unknown])
        x = np.maximum([u.start for u in self.unknown], self.least)
        at = self._at(x)
        for step in range(MOST_STEPS + 1):
            slopes, A, H = self._linear(x, at)
            pull = A.T @ at.y
            pull[:k] -= self.precision * (x - mean)
            sd, change = np.sqrt(np.diag(np.linalg.inv(H))[:k]), np.zeros(len(pull))
            moves = np.ones(len(pull), dtype=bool)
            moves[:k] = (x > self.least) | (pull[:k] > 0.0)
            change[moves] = np.linalg.solve(H[np.ix_(moves, moves)], pull[moves])
            change = np.maximum(x + change[:k], self.least) - x
            if step == MOST_STEPS or (np.abs(change) < SETTLED * sd).all():
                break
            for halved in range(HALVINGS + 1):
                there = self._at(x + change * 0.5**halved)
                if there.loss < at.loss:
                    break
            else:
                break
            x, at = x + change * 0.5**halved, there
        whole = self._of_whole_samples(x)
        if not np.array_equal(whole, x) and (there := self._at(whole)).loss < at.loss:
            x, at = whole, there
            slopes, A, H = self._linear(x, at)
        return Fitted(self, x, at.setting, at.e, at.root, at.y, A, H, slopes)

    def _linear(self, x: Array, at: _At) -> tuple[Array, Array, Array]:
        """Slopes (n, k), whitened columns (m, k + q), and the precision of their coefficients."""
        slopes = self.slopes(x, at.setting, at.e)
        A = np.concatenate([self._white(slopes) * at.root[:, None], at.N], axis=1)
        H = A.T @ A + np.diag(np.concatenate([self.precision, np.ones(at.N.shape[1])]))
        return slopes, A, H

    def _of_whole_samples(self, x: Array) -> Array:
        """The same numbers with every delay that of whole samples: a command between two, which stands for a
        delay in between, was never given, and an engine may be on for it that was off."""
        out, dt = x.copy(), self.prepared[0].dt
        for j, u in enumerate(self.unknown):
            paths = self.parts[u.part].paths if u.part is not None and u.is_constant else []
            if paths and all(path.startswith("delay") for path, _ in paths):
                out[j] = np.log(max(round(float(np.exp(x[j])) / dt), 1) * dt)
        return out


@dataclass(frozen=True)
class _At:
    """A simulator as set: its evidence; the whitened residual y (m,) and columns N (m, q) of what is beside,
    both times `root`, by which innovations that are far off count less; and the loss, nats."""

    setting: Setting
    e: Evidence
    root: Array
    y: Array
    N: Array
    loss: float


@dataclass(frozen=True)
class Fitted:
    """Fitted numbers x (k,) and what is set with them; the evidence there, the whitened residual y (m,) and
    columns A (m, k + q) of the unknowns and of what is beside, times `root`, their precision H, and the
    slopes (n, k)."""

    of: Exact
    x: Array
    setting: Setting
    e: Evidence
    root: Array
    y: Array
    A: Array
    H: Array
    slopes: Array

    @cached_property
    def covariance(self) -> Array:
        """Covariance (k, k) of the numbers, from what is left in blocks of driving."""
        k = len(self.x)
        N = self.A[:, k:]
        left = self.y - N @ np.linalg.solve(N.T @ N + np.eye(N.shape[1]), N.T @ self.y)
        block = self.of.p.regression.blocks()
        scores = np.zeros((block.max(initial=0) + 1, self.A.shape[1]))
        np.add.at(scores, block, self.A * left[:, None])
        precision = np.concatenate([self.of.precision, np.ones(N.shape[1])])
        inverse = np.linalg.inv(self.H)
        spread = inverse @ (scores.T @ scores + np.diag(precision)) @ inverse
        return np.asarray(WIDER**2 * spread[:k, :k])

    def places(self, name: str) -> list[int]:
        """The places of the numbers of a parameter or a mechanism."""
        parts = self.of.parts
        return [
            j
            for j, u in enumerate(self.of.unknown)
            if name == (u.of if u.part is None else parts[u.part].mechanism.effect)
        ]

    def change(self, parameter: str) -> tuple[float, float]:
        """The relative change of a parameter from the one given, and its standard deviation."""
        (j,) = self.places(parameter)
        e, gain = self.of.e, self.of.p.regression.mass_gain
        further = changed_by(parameter, float(self.x[j]), gain)
        steeper = (1.0 + gain * further) ** 2 if parameter == "mass" else 1.0
        sd = (1.0 + e.moved.get(parameter, 0.0)) * steeper * float(np.sqrt(self.covariance[j, j]))
        return self.setting.moved.get(parameter, 0.0), sd

    def force(self, name: str) -> Array:
        """The acceleration (n,) that a mechanism or a parameter adds, m/s^2; a path by a run without it."""
        parts = self.setting.parts
        own = [q for q in parts if q.mechanism.effect == name]
        if not own:
            (j,) = self.places(name)
            as_given = self.of.unknown[j].mean
            return np.asarray(self.slopes[:, j] * (self.x[j] - as_given))
        out = np.sum([q.force(self.e) for q in own], axis=0)
        if any(q.paths for q in own):
            without = replace(self.setting, parts=tuple(q for q in parts if q.mechanism.effect != name))
            out = out + self.e.simulated - self.of.run(without).simulated
        return np.asarray(out)

    def relative_sd(self, name: str) -> float:
        """Standard deviation of the size of a mechanism's force, relative to the size."""
        at = self.places(name)
        X, force = self.slopes[self.of.rows][:, at], self.force(name)[self.of.rows]
        along = force @ X / max(float(force @ force), 1e-12)
        variance = float(along @ self.covariance[np.ix_(at, at)] @ along)
        return float(np.sqrt(max(variance, 0.0)))

    def left_out(self, away: Mask, without: str = "") -> Array:
        """What is left (n,) with the numbers fitted without the drives `away`, perhaps without one name."""
        k = len(self.x)
        train = ~away[self.of.e.record[self.of.rows]]
        keep = np.ones(self.A.shape[1], dtype=bool)
        y, left, x = self.y, self.of.left(self.setting, self.e), self.x
        if without:
            keep[self.places(without)] = False
            force = self.force(without)
            y, left = y + self.of._white(force) * self.root, left + force
        A = self.A[train][:, keep]
        precision = np.concatenate([self.of.precision, np.ones(len(keep) - k)])[keep]
        pull = A.T @ y[train]
        off = (x - np.array([u.mean for u in self.of.unknown]))[keep[:k]]
        pull[: len(off)] -= self.of.precision[keep[:k]] * off
        change = np.linalg.solve(A.T @ A + np.diag(precision), pull)[: len(off)]
        return np.asarray(left - self.slopes[:, keep[:k]] @ change)


def _beside(p: Posterior, given: Mask, fitted: set[str]) -> Array:
    """Columns (n, q), with unit prior variance, that stay beside the names that are `fitted`, but for those
    of timing: other parameters, near their given values, the form error, and what is slow in most of the
    `given` draws (m,). A slope that is fitted is not beside itself."""
    held = [i for i, n in enumerate(p.regression.parameters) if n not in fitted]
    error = p.always[:, p.always.shape[1] - p.form_error :]
    slow = [
        x.features * np.sqrt(np.mean(SIZES[p.draws.states[given, j][on]] ** 2))
        for j, x in enumerate(p.of)
        if (x.part in NO_NAME or (x.part == SLOPE and x.name not in fitted))
        and (on := p.draws.inside[given, j]).mean() >= 0.5
    ]
    return np.concatenate([p.always[:, held], error, *_of_slope(p.regression.e), *slow], axis=1)


def _of_slope(e: Evidence) -> list[Array]:
    """Columns (n, 1) of what an ordinary sensor of slope is off by."""
    if not e.has("grade"):
        return []
    gain = GRAVITY * e.signals.get("effective_mass_gain", np.ones(len(e)))
    return [(SLOPE_SHARE * gain * np.nan_to_num(e["grade"]))[:, None], (SLOPE_BIAS * gain)[:, None]]
