"""The network that names a force by its fingerprint, trained, and judged on families it has not seen."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.effects.law import Array
from deeptruck_exam.teaching.injected import STRAYED
from deeptruck_exam.teaching.samples import UNKNOWN, Samples
from deeptruck_model.mismatch import NOTHING, Fingerprint, Layer, Recogniser

if TYPE_CHECKING:
    import torch

LEAST_NATS = 20.0  # less is no finding, and has no name
LOST, FEWER_SHARE = (0.05, 0.4), 0.5  # of names whose kernels go with a signal; of samples once more so
HIDDEN_SHARE = 0.12  # of the samples, once more without their name's kernels: then they are unknown
UNKNOWN_WEIGHT, FAULT_WEIGHT = 3.0, 0.5  # of a name with laws
WIDTH, DROPPED, MEMBERS = 96, 0.3, 5
EPOCHS, BATCH, RATE, DECAY = 40, 512, 4e-3, 2e-3
FIRST_TRUST = 0.6  # of the evidence itself
NOWHERE = -30.0  # log probability of a name that cannot be


@dataclass(frozen=True)
class Lesson:
    """Features (N, d), what the evidence says (N, names), which names can be (N, names), the answers (N,) and
    weights (N,); with the law, family and world of each."""

    features: NDArray[np.float32]
    evidence: NDArray[np.float32]
    possible: NDArray[np.bool_]
    answer: NDArray[np.intp]
    laws: NDArray[np.str_]
    families: NDArray[np.str_]
    worlds: NDArray[np.str_]

    def save(self, path: Path) -> None:
        np.savez(path, **vars(self))

    @staticmethod
    def load(path: Path) -> Lesson:
        with np.load(path) as a:
            return Lesson(**{n: a[n] for n in Lesson.__dataclass_fields__})

    def of(self, rows: NDArray[np.bool_]) -> Lesson:
        return Lesson(*(getattr(self, n)[rows] for n in Lesson.__dataclass_fields__))


def lesson(parts: Sequence[Samples], keys: tuple[str, ...], names: tuple[str, ...], seed: int = 0) -> Lesson:
    """All samples that tell anything, some of them once more without their own name's kernels."""
    rng = np.random.default_rng(seed)
    made = []
    for part in parts:
        part = part.of(part.fingerprint.held.nats.max(axis=0) > LEAST_NATS)
        made.append(_of(part, keys, names))
        for name in sorted(set(part.names.tolist())):
            again = (part.names == name) & (rng.random(len(part.names)) < HIDDEN_SHARE)
            if (
                again.any()
                and name not in (UNKNOWN, NOTHING)
                and part.families[again][0] not in ("faults", "parameters")
            ):
                made.append(_of(_without(part.of(again), {name}), keys, names))
        made.append(_of(_of_fewer_signals(part, rng), keys, names))
    return Lesson(*(np.concatenate([getattr(m, n) for m in made]) for n in Lesson.__dataclass_fields__))


def _of_fewer_signals(part: Samples, rng: np.random.Generator) -> Samples:
    """Some of them as where fewer signals are known: without a random part of the kernels."""
    f, share = part.fingerprint, rng.uniform(*LOST)
    lost = {n for n in sorted(f.names - {UNKNOWN}) if rng.random() < share}
    return _without(part.of(rng.random(len(part.names)) < FEWER_SHARE), lost)


def _without(part: Samples, lost: set[str]) -> Samples:
    """As where names are in no library: their kernels are gone."""
    f = part.fingerprint
    kept = np.array([key.partition(",")[0] not in lost for key in f.keys])
    keys = tuple(key for key, k in zip(f.keys, kept, strict=True) if k)
    held, free = (seen.of(slice(None), kept) for seen in (f.held, f.free))
    return replace(part, fingerprint=Fingerprint(keys, f.chance[kept], held, free, f.given))


def _of(part: Samples, keys: tuple[str, ...], names: tuple[str, ...]) -> Lesson:
    f = part.fingerprint
    there = f.names | {NOTHING}
    answers = [name if name in there else UNKNOWN for name in part.names]
    n = len(part.names)
    return Lesson(
        f.features(keys).astype(np.float32),
        f.by_evidence(names).astype(np.float32),
        f.possible(names),
        np.array([names.index(a) for a in answers]),
        np.array([f"{a} {law}" for a, law in zip(answers, part.laws, strict=True)]),
        part.families,
        np.full(n, part.world),
    )


def weights(some: Lesson, names: tuple[str, ...]) -> Array:
    """Every name counts alike, and every law of a name; that nothing more is missing as much as all that is,
    where names are given."""
    out = np.zeros(len(some.answer))
    for k, name in enumerate(names):
        own = some.answer == k
        laws, place, count = np.unique(some.laws[own], return_inverse=True, return_counts=True)
        if not len(laws):
            continue
        fault = all(law.split(" ")[1] in ("fault", "parameter") for law in laws)
        size = UNKNOWN_WEIGHT if name == UNKNOWN else FAULT_WEIGHT if fault else 1.0
        out[own] = size / len(laws) / count[place]
    if NOTHING in names:
        nothing = some.answer == names.index(NOTHING)
        more = some.possible[:, names.index(NOTHING)] & ~nothing
        out[nothing] *= out[more].sum() / max(float(out[nothing].sum()), 1e-9)
    return out / out.mean()


def learned(
    some: Lesson, keys: tuple[str, ...], names: tuple[str, ...], members: int = MEMBERS
) -> Recogniser:
    """An ensemble that learned from all of this."""
    mean, sd = some.features.mean(axis=0), some.features.std(axis=0) + 0.05
    each = [_member(some, mean, sd, len(keys), weights(some, names), seed) for seed in range(members)]
    layers = tuple(
        Layer(np.stack([m[k][0] for m in each]), np.stack([m[k][1] for m in each])) for k in range(3)
    )
    trust = np.array([m[3][0] for m in each])
    return Recogniser(keys, names, mean.astype(float), sd.astype(float), trust, layers)


def _member(
    some: Lesson, mean: Array, sd: Array, kernels: int, weight: Array, seed: int
) -> list[tuple[Array, Array]]:
    """Weights and biases of three layers, and the trust in the evidence."""
    import torch
    from torch import nn

    torch.manual_seed(seed)
    wide, names = some.features.shape[1], some.evidence.shape[1]
    last = nn.Linear(WIDTH // 2, names)
    nn.init.zeros_(last.weight)
    net = nn.Sequential(
        nn.Dropout(0.1),
        nn.Linear(wide, WIDTH),
        nn.GELU(),
        nn.Dropout(DROPPED),
        nn.Linear(WIDTH, WIDTH // 2),
        nn.GELU(),
        nn.Dropout(DROPPED),
        last,
    )
    trust = nn.Parameter(torch.tensor(FIRST_TRUST))
    x = torch.tensor(Recogniser.scaled(some.features.astype(float), mean, sd, kernels), dtype=torch.float32)
    evidence, answer = torch.tensor(some.evidence), torch.tensor(some.answer)
    shut = torch.tensor(np.where(some.possible, 0.0, NOWHERE), dtype=torch.float32)
    w = torch.tensor(weight, dtype=torch.float32)
    _descend(net, trust, x, evidence, shut, answer, w)
    linear = [m for m in net if isinstance(m, nn.Linear)]
    out = [(m.weight.detach().numpy().T.astype(float), m.bias.detach().numpy().astype(float)) for m in linear]
    return [*out, (np.array(float(trust.detach())), np.zeros(1))]


def _descend(
    net: torch.nn.Module,
    trust: torch.nn.Parameter,
    x: torch.Tensor,
    evidence: torch.Tensor,
    shut: torch.Tensor,
    answer: torch.Tensor,
    w: torch.Tensor,
) -> None:
    import torch
    from torch.nn.functional import cross_entropy

    steps = EPOCHS * (len(x) // BATCH + 1)
    optimiser = torch.optim.AdamW([*net.parameters(), trust], RATE / 2, weight_decay=DECAY)
    rate = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, steps)
    net.train()
    for _ in range(EPOCHS):
        order = torch.randperm(len(x))
        for rows in torch.split(order, BATCH):
            logits = trust * evidence[rows] + net(x[rows]) + shut[rows]
            loss = cross_entropy(logits, answer[rows], reduction="none")
            optimiser.zero_grad()
            (loss * w[rows]).mean().backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            rate.step()
    net.eval()


@dataclass(frozen=True)
class Score:
    """Share of answers that are most probable and that are in the smallest set of `credible` probability, its
    mean size, the mean log score, and the expected calibration error of the most probable."""

    first: float
    in_set: float
    size: float
    log_score: float
    calibration: float


def score(p: Array, answer: NDArray[np.intp], weight: Array, credible: float = 0.8) -> Score:
    """Of probabilities (N, names) for the answers (N,), each of a weight (N,)."""
    order = np.argsort(-p, axis=1)
    before = np.cumsum(np.take_along_axis(p, order, axis=1), axis=1)
    size = (before < credible).sum(axis=1) + 1
    rank = (order == answer[:, None]).argmax(axis=1)
    right, most = rank == 0, p.max(axis=1)
    bins = np.minimum((most * 10).astype(int), 9)
    gaps = [abs(float(weight[bins == b] @ (right - most)[bins == b])) for b in range(10)]

    def mean(values: Array) -> float:
        return float(np.average(values, weights=weight))

    told = p[np.arange(len(p)), answer]
    return Score(
        mean(right),
        mean(rank < size),
        mean(size),
        mean(np.log(np.maximum(told, 1e-3))),
        sum(gaps) / weight.sum(),
    )


def without(some: Sequence[str], whole: Lesson) -> Lesson:
    """All of families other than some, in other worlds."""
    return whole.of(~np.isin(whole.families, some) & ~np.isin(whole.worlds, some))


def unseen(whole: Lesson, by: Mapping[str, Recogniser]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Probabilities (N, names) of samples of a family in its own world, as its author wrote them, by what has
    seen neither; what evidence alone says; and which samples (N,) these are."""
    p, rows = np.zeros(whole.evidence.shape), np.zeros(len(whole.answer), dtype=bool)
    for family, taught in by.items():
        test = (whole.families == family) & (whole.worlds == family) & ~np.char.endswith(whole.laws, STRAYED)
        if test.any():
            some = whole.of(test)
            p[test] = taught.of(some.features.astype(float), some.evidence.astype(float), some.possible)
            rows |= test
    evidence = np.where(whole.possible, whole.evidence, NOWHERE).astype(float)
    alone = np.exp(evidence - evidence.max(axis=1, keepdims=True))
    return p, alone / alone.sum(axis=1, keepdims=True), rows


def packed(by: Recogniser) -> bytes:
    """The file of weights, in half precision: it is small, and shipped."""
    half = {n: getattr(by, n).astype(np.float32) for n in ("mean", "sd", "trust")}
    for k, layer in enumerate(by.layers):
        half |= {f"weight{k}": layer.weight.astype(np.float16), f"bias{k}": layer.bias.astype(np.float16)}
    out = io.BytesIO()
    np.savez_compressed(out, keys=np.array(by.keys), names=np.array(by.names), **half)
    return out.getvalue()
