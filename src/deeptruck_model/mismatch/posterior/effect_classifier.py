"""Probabilities of names from the evidence of every kernel: a small ensemble of networks.

It was trained on several hundred laws of several authors, each added to drives with nothing missing (the
training is a command of the exam; its card stands beside the weights). Evidence alone favours the nearest
form; a law that has no form in the library is near several, and the network has learned which.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf, softmax

from deeptruck_model.mismatch.posterior.kernel_features import KernelFeatures
from deeptruck_model.mismatch.posterior.kernels import NOTHING

Array = NDArray[np.float64]

WEIGHTS = Path(__file__).with_name("effect_classifier.npz")
PER_KERNEL, WHOLE = 5, 2  # features of each kernel, and of all together, in either part of its input
GIVEN = 2  # features of names that are given
FARTHEST = 3.0  # sds of a feature from its mean in training: beyond, it says no more
FLATTENING = (
    0.7  # exponent of probabilities on driven trucks; chosen on development cases of left-out families
)
NOWHERE = -30.0  # log probability of a name that cannot be


@dataclass(frozen=True)
class Layer:
    """Weights (members, in, out) and biases (members, out) of every member of the ensemble."""

    weight: Array
    bias: Array


@dataclass(frozen=True)
class EffectClassifier:
    """An ensemble of networks beside the evidence itself. `keys` are the kernels it looks at, `names` its
    answers; `mean` and `sd` (d,) scale its features; `trust` (members,) weighs the evidence."""

    keys: tuple[str, ...]
    names: tuple[str, ...]
    mean: Array
    sd: Array
    trust: Array
    layers: tuple[Layer, ...]

    @staticmethod
    def load(path: Path = WEIGHTS) -> EffectClassifier:
        with np.load(path) as a:
            layers = tuple(
                Layer(a[f"weight{k}"].astype(float), a[f"bias{k}"].astype(float))
                for k in range(sum(n.startswith("weight") for n in a.files))
            )
            keys, names = (tuple(a[n].tolist()) for n in ("keys", "names"))
            mean, sd, trust = (a[n].astype(float) for n in ("mean", "sd", "trust"))
        return EffectClassifier(keys, names, mean, sd, trust, layers)

    def probabilities(self, f: KernelFeatures) -> Array:
        """Of each name (N, names), given that it is one of those that kernels stand for, or nothing more
        where names are given."""
        return self.of(f.features(self.keys), f.by_evidence(self.names), f.possible(self.names))

    def of(self, seen: Array, evidence: Array, known: NDArray[np.bool_]) -> Array:
        """The same from `features`, `by_evidence` and `possible`."""
        x = self.scaled(seen, self.mean, self.sd, len(self.keys))
        each = [trust * evidence + self._through(x, k) for k, trust in enumerate(self.trust)]
        members = [softmax(np.where(known, logits, NOWHERE), axis=1) for logits in each]
        out: Array = np.mean(members, axis=0)
        return out

    def flattened(self, f: KernelFeatures) -> Array:
        """The same for trucks driven with what is missing, which differ more from the training data:
        less probable that it is the first name, as probable that anything is missing at all."""
        p = self.probabilities(f)
        more = np.array([name != NOTHING for name in self.names])
        out = np.where(more, p**FLATTENING, 0.0)
        out *= p[:, more].sum(axis=1, keepdims=True) / out.sum(axis=1, keepdims=True)
        return np.where(more, out, p)

    @staticmethod
    def scaled(seen: Array, mean: Array, sd: Array, kernels: int) -> Array:
        """Features (N, d) in sds from their mean. A kernel that is not there, as where no gear is known, says
        what is usual; and nothing says more than what is far."""
        there = seen[:, -kernels:] > 0.5
        each = np.concatenate([np.tile(there, PER_KERNEL), np.ones((len(seen), WHOLE), bool)], axis=1)
        always = np.ones((len(seen), GIVEN + kernels), dtype=bool)
        known = np.concatenate([each, each, always], axis=1)
        out: Array = np.clip(np.where(known, (seen - mean) / sd, 0.0), -FARTHEST, FARTHEST)
        return out

    def _through(self, x: Array, member: int) -> Array:
        for k, layer in enumerate(self.layers):
            x = x @ layer.weight[member] + layer.bias[member]
            if k + 1 < len(self.layers):
                x = 0.5 * x * (1.0 + erf(x / np.sqrt(2.0)))  # Hendrycks and Gimpel's GELU
        return x


@cache
def effect_classifier() -> EffectClassifier:
    """The one that is shipped."""
    return EffectClassifier.load()
