"""Is a newly trained classifier as good as the one that is shipped? Both judged on the same samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.laws.catalogue import UNKNOWN
from deeptruck_exam.laws.law import Array
from deeptruck_exam.teach.learning import NOWHERE, answered, weights, with_evidence
from deeptruck_exam.teach.samples import Samples
from deeptruck_model.mismatch import NOTHING, EffectClassifier, KernelFeatures

CREDIBLE = 0.8
WORSE = {"first": 0.03, "in_set": 0.03, "log_score": 0.1}  # at most, than the shipped one; nats
CALIBRATION = 0.06  # at most
LEAST = 1e-3  # a smaller probability counts as this in the log score


@dataclass(frozen=True)
class Score:
    """Share of answers that are most probable and that are in the smallest set of CREDIBLE probability, its
    mean size, the mean log score (nats), and the expected calibration error of the most probable."""

    samples: int
    first: float
    in_set: float
    size: float
    log_score: float
    calibration: float


Probabilities = Callable[[KernelFeatures], tuple[Array, tuple[str, ...]]]


def of_classifier(by: EffectClassifier) -> Probabilities:
    return lambda f: (by.probabilities(f), by.names)


def of_evidence(names: tuple[str, ...]) -> Probabilities:
    """The evidence alone, over the same names."""

    def probabilities(f: KernelFeatures) -> tuple[Array, tuple[str, ...]]:
        evidence = np.where(f.possible(names), f.by_evidence(names), NOWHERE)
        p = np.exp(evidence - evidence.max(axis=1, keepdims=True))
        return p / p.sum(axis=1, keepdims=True), names

    return probabilities


def judged(parts: Sequence[Samples], ways: Mapping[str, Probabilities]) -> dict[str, dict[str, Score]]:
    """Scores of each way on all samples, on those with a name, and on those without."""
    parts = [with_evidence(part) for part in parts]
    out: dict[str, dict[str, Score]] = {}
    for way, by in ways.items():
        found = [by(part.kernels) for part in parts]
        names = found[0][1]
        p = np.concatenate([x for x, _ in found])
        answers = [a for part in parts for a in answered(part)]
        answer = np.array([names.index(a) if a in names else names.index(UNKNOWN) for a in answers])
        laws = np.array([f"{a} {law}" for a, law in zip(answers, _laws(parts), strict=True)])
        possible = np.concatenate([part.kernels.possible(names) for part in parts])
        named = answer != names.index(UNKNOWN)
        alone = ~possible[:, names.index(NOTHING)] if NOTHING in names else np.ones(len(p), bool)
        for title, rows in (("all", alone), ("with a name", alone & named), ("unknown", alone & ~named)):
            if rows.any():
                weight = weights(answer[rows], laws[rows], possible[rows], names)
                out.setdefault(title, {})[way] = score(p[rows], answer[rows], weight)
    return out


def _laws(parts: Sequence[Samples]) -> list[str]:
    return [law for part in parts for law in part.laws.tolist()]


def score(p: Array, answer: NDArray[np.intp], weight: Array) -> Score:
    """Of probabilities (N, names) for the answers (N,), each of a weight (N,)."""
    order = np.argsort(-p, axis=1)
    before = np.cumsum(np.take_along_axis(p, order, axis=1), axis=1)
    size = (before < CREDIBLE).sum(axis=1) + 1
    rank = (order == answer[:, None]).argmax(axis=1)
    right, most = rank == 0, p.max(axis=1)
    bins = np.minimum((most * 10).astype(int), 9)
    gaps = [abs(float(weight[bins == b] @ (right - most)[bins == b])) for b in range(10)]

    def mean(values: Array) -> float:
        return float(np.average(values, weights=weight))

    of_answer = p[np.arange(len(p)), answer]
    return Score(
        len(p),
        mean(right),
        mean(rank < size),
        mean(size),
        mean(np.log(np.maximum(of_answer, LEAST))),
        float(sum(gaps) / weight.sum()),
    )


def failures(new: Score, shipped: Score) -> list[str]:
    """What the new one does not reach; empty where it is accepted."""
    out = [
        f"{name} {getattr(new, name):.2f}, shipped {getattr(shipped, name):.2f}"
        for name, by in WORSE.items()
        if getattr(new, name) < getattr(shipped, name) - by
    ]
    if new.calibration > CALIBRATION:
        out.append(f"calibration error {new.calibration:.2f}, at most {CALIBRATION}")
    return out


HEAD = (
    "samples",
    "classifier",
    "N",
    "most probable",
    "in the set",
    "its size",
    "log score",
    "calibration error",
)


def table(found: Mapping[str, Mapping[str, Score]]) -> list[str]:
    """Lines of a Markdown table."""
    lines = [f"| {' | '.join(HEAD)} |", "| --- " * len(HEAD) + "|"]
    for title, ways in found.items():
        for way, s in ways.items():
            numbers = [f"{x:.2f}" for x in list(asdict(s).values())[1:]]
            lines.append(f"| {title} | {way} | {s.samples} | {' | '.join(numbers)} |")
    return lines
