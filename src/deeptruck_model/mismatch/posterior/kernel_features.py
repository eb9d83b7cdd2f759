"""What every kernel gives for one residual: evidence, sign, size, and how many directions are identified.

A force that follows one name's physics, in whatever form, is explained in part by other names too; how much
each of them explains is what the effect classifier is trained on. `kernel_evidence` computes it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.posterior.kernels import NOTHING

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Rows = NDArray[np.bool_] | Sequence[int]

SIZES = np.array([0.05, 0.15, 0.4, 1.0, 2.5])  # of a kernel beside its prior sd, equally likely
TEMPERATURE = 3.0  # nats between names count by the larger of this and ...
FORM_ERROR = 0.05  # ... this share of the most
FURTHEST = 8.0  # of such, by which a kernel may be worse


@dataclass(frozen=True)
class Seen:
    """What each of k kernels says of each of N residuals, all (k, N).

    `nats`: log evidence beside noise alone, over all sizes; `sign`: what the signs of its forces are worth,
    nats; `size`: the place of the best in SIZES; `directions`: how many of its directions the data identify.
    `noise` (N,): the precision of the noise beside the best kernel, relative to the noise model's, at most
    one."""

    nats: Array
    sign: Array
    size: Places
    directions: Array
    noise: Array

    @property
    def unit(self) -> Array:
        """By how many nats (N,) one name beats another by one."""
        out: Array = np.maximum(TEMPERATURE, FORM_ERROR * self.nats.max(axis=0))
        return out

    def of(
        self,
        rows: NDArray[np.bool_] | Sequence[int] | slice,
        kernels: NDArray[np.bool_] | slice = slice(None),
    ) -> Seen:
        """Of some of the residuals, by some of the kernels."""
        nats, sign, directions = (x[kernels][:, rows] for x in (self.nats, self.sign, self.directions))
        return Seen(nats, sign, self.size[kernels][:, rows], directions, self.noise[rows])

    def features(self, at: Sequence[int], known: Sequence[int], wide: int) -> Array:
        """By how much each kernel is worse than the best, its share of what that explains, its sign, size and
        directions, at the places `at` of the `known` ones among `wide`; and how much is explained, (d, N).
        """
        most = self.nats.max(axis=0)
        each = np.stack(
            [
                np.maximum((self.nats - most) / self.unit, -FURTHEST) + FURTHEST,
                np.clip(self.nats / np.maximum(most, 1.0), -0.3, 1.0),
                np.clip(self.sign / self.unit, -FURTHEST, 2.0),
                self.size / (len(SIZES) - 1.0) - 0.5,
                np.log(self.directions) / 3.0,
            ]
        )
        out = np.zeros((len(each), wide, len(most)))
        out[:, at] = each[:, known]
        whole = np.stack([np.log(np.maximum(most, 1.0)) / 8.0, self.noise])
        return np.concatenate([out.reshape(len(each) * wide, len(most)), whole])


@dataclass(frozen=True)
class Given:
    """Of N residuals, each (N,): whether they stand beside names that are given (`there`), so that nothing
    more may be missing; the nats that these explain; and how far what is left acts where they act, 0 to 1. A
    form that is not quite right leaves the more the more it explains, and leaves it where it acts."""

    there: NDArray[np.bool_]
    explained: Array
    overlap: Array

    @property
    def features(self) -> Array:
        """As a network sees it, (2, N)."""
        return np.stack([np.log(np.maximum(self.explained, 1.0)) / 8.0, self.overlap])

    def of(self, rows: Rows) -> Given:
        """Of some of the residuals."""
        return Given(self.there[rows], self.explained[rows], self.overlap[rows])


@dataclass(frozen=True)
class KernelFeatures:
    """What kernels say of residuals, by their `keys`: beside parameters that are `held` near what they are,
    and that are `free`. `chance` (k,): prior odds of the kernels."""

    keys: tuple[str, ...]
    chance: Array
    held: Seen
    free: Seen
    given: Given

    @property
    def names(self) -> frozenset[str]:
        """What its kernels stand for."""
        return frozenset(key.partition(",")[0] for key in self.keys)

    def of(self, rows: Rows) -> KernelFeatures:
        """Of some of the residuals."""
        parts = (self.held.of(rows), self.free.of(rows), self.given.of(rows))
        return KernelFeatures(self.keys, self.chance, *parts)

    def possible(self, names: Sequence[str]) -> NDArray[np.bool_]:
        """Which names can be the answer, (N, names)."""
        there = self.given.there
        out = np.tile([name in self.names for name in names], (len(there), 1))
        if NOTHING in names:
            out[:, list(names).index(NOTHING)] = there
        return out

    def features(self, keys: Sequence[str]) -> Array:
        """What a network sees of these kernels, (N, d): what they say, beside held and beside free
        parameters, what is given, and which of them there are."""
        known = [k for k, key in enumerate(self.keys) if key in keys]
        at = [list(keys).index(self.keys[k]) for k in known]
        there = np.zeros((len(keys), len(self.held.noise)))
        there[at] = 1.0
        seen = [part.features(at, known, len(keys)) for part in (self.held, self.free)]
        return np.concatenate([*seen, self.given.features, there]).T

    def by_evidence(self, names: Sequence[str]) -> Array:
        """Log of what evidence alone says of each name against the best, (N, names), in tempered nats."""
        parts = [self._gaps(part, names) for part in (self.held, self.free)]
        either = np.logaddexp(*parts)
        gap: Array = np.maximum(either - either.max(axis=0), -FURTHEST).T
        return gap

    def _gaps(self, part: Seen, names: Sequence[str]) -> Array:
        """The same by one part, (names, N)."""
        evidence = (part.nats + part.sign + np.log(self.chance)[:, None]) / part.unit
        out = np.full((len(names), evidence.shape[1]), -np.inf)
        out[[name == NOTHING for name in names]] = 0.0
        for k, key in enumerate(self.keys):
            name = key.partition(",")[0]
            if name in names:
                at = list(names).index(name)
                out[at] = np.logaddexp(out[at], evidence[k])
        out -= out.max(axis=0)
        return out
