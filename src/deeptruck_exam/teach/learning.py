"""The network that names a force by its kernel evidence: trained, packed, and scored."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.laws.catalogue import UNKNOWN
from deeptruck_exam.laws.law import Array
from deeptruck_exam.teach.samples import Samples
from deeptruck_model.mismatch import NOTHING, EffectClassifier, KernelFeatures, Layer

if TYPE_CHECKING:
    import torch

LEAST_NATS = 20.0  # less is no finding, and has no name
LOST, FEWER_SHARE = (0.05, 0.4), 0.4  # of names whose kernels go with a signal; of samples once more so
HIDDEN_SHARE = 0.12  # of the samples, once more without their name's kernels: then they are unknown
UNKNOWN_WEIGHT, FAULT_WEIGHT = 3.0, 0.5  # of a name with laws
WIDTH, DROPPED, MEMBERS = 96, 0.3, 5
EPOCHS, BATCH, RATE, DECAY = 40, 512, 4e-3, 2e-3
FIRST_TRUST = 0.6  # of the evidence itself
NOWHERE = -30.0  # log probability of a name that cannot be


@dataclass(frozen=True)
class TrainingSet:
    """Features (N, d), the log evidence (N, names), which names can be (N, names), answers and laws (N,)."""

    features: NDArray[np.float32]
    evidence: NDArray[np.float32]
    possible: NDArray[np.bool_]
    answer: NDArray[np.intp]
    laws: NDArray[np.str_]


def training_set(
    parts: Sequence[Samples], keys: tuple[str, ...], names: tuple[str, ...], seed: int = 0
) -> TrainingSet:
    """All samples with any evidence, some of them once more without their own name's kernels, or with fewer
    signals."""
    rng = np.random.default_rng(seed)
    made = []
    for part in parts:
        part = with_evidence(part)
        made.append(_of(part, keys, names))
        for name in sorted(set(part.names.tolist()) - {UNKNOWN, NOTHING}):
            again = (part.names == name) & (rng.random(len(part.names)) < HIDDEN_SHARE)
            if again.any() and part.laws[again][0].split(" ")[0] not in ("fault", "parameter"):
                made.append(_of(_without(part.of(again), {name}), keys, names))
        share = rng.uniform(*LOST)
        lost = {n for n in sorted(part.kernels.names - {UNKNOWN}) if rng.random() < share}
        some = rng.random(len(part.names)) < FEWER_SHARE
        made.append(_of(_without(part.of(some), lost), keys, names))
    fields = TrainingSet.__dataclass_fields__
    return TrainingSet(*(np.concatenate([getattr(m, n) for m in made]) for n in fields))


def with_evidence(part: Samples) -> Samples:
    """Those that leave any."""
    return part.of(part.kernels.held.nats.max(axis=0) > LEAST_NATS)


def _without(part: Samples, lost: set[str]) -> Samples:
    """As where names are in no library: their kernels are gone."""
    f = part.kernels
    kept = np.array([key.partition(",")[0] not in lost for key in f.keys])
    keys = tuple(key for key, k in zip(f.keys, kept, strict=True) if k)
    held, free = (seen.of(slice(None), kept) for seen in (f.held, f.free))
    return replace(part, kernels=KernelFeatures(keys, f.chance[kept], held, free, f.given))


def _of(part: Samples, keys: tuple[str, ...], names: tuple[str, ...]) -> TrainingSet:
    f = part.kernels
    answers = answered(part)
    return TrainingSet(
        f.features(keys).astype(np.float32),
        f.by_evidence(names).astype(np.float32),
        f.possible(names),
        np.array([names.index(a) for a in answers], dtype=np.intp),
        np.array([f"{a} {law}" for a, law in zip(answers, part.laws, strict=True)]),
    )


def answered(part: Samples) -> list[str]:
    """The right answers: a name for which there is no kernel is unknown."""
    there = part.kernels.names | {NOTHING}
    return [name if name in there else UNKNOWN for name in part.names.tolist()]


def weights(answer: NDArray[np.intp], laws: NDArray[np.str_], possible: NDArray[np.bool_],
            names: tuple[str, ...]) -> Array:  # fmt: skip
    """Every name counts alike, and every law of a name; that nothing more is missing as much as all that is,
    where names are given."""
    out = np.zeros(len(answer))
    for k, name in enumerate(names):
        own = answer == k
        each, place, count = np.unique(laws[own], return_inverse=True, return_counts=True)
        if not len(each):
            continue
        fault = all(law.split(" ")[1] in ("fault", "parameter") for law in each)
        size = UNKNOWN_WEIGHT if name == UNKNOWN else FAULT_WEIGHT if fault else 1.0
        out[own] = size / len(each) / count[place]
    if NOTHING in names:
        nothing = answer == names.index(NOTHING)
        more = possible[:, names.index(NOTHING)] & ~nothing
        out[nothing] *= out[more].sum() / max(float(out[nothing].sum()), 1e-9)
    return out / out.mean()


def trained(
    some: TrainingSet, keys: tuple[str, ...], names: tuple[str, ...], members: int = MEMBERS
) -> EffectClassifier:
    """An ensemble trained on all of this."""
    mean, sd = some.features.mean(axis=0), some.features.std(axis=0) + 0.05
    weight = weights(some.answer, some.laws, some.possible, names)
    each = [_member(some, mean, sd, len(keys), weight, seed) for seed in range(members)]
    layers = tuple(
        Layer(np.stack([m[k][0] for m in each]), np.stack([m[k][1] for m in each])) for k in range(3)
    )
    trust = np.array([m[3][0] for m in each])
    return EffectClassifier(keys, names, mean.astype(float), sd.astype(float), trust, layers)


def _member(
    some: TrainingSet, mean: Array, sd: Array, kernels: int, weight: Array, seed: int
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
    x = torch.tensor(
        EffectClassifier.scaled(some.features.astype(float), mean, sd, kernels), dtype=torch.float32
    )
    evidence, answer = torch.tensor(some.evidence), torch.tensor(some.answer)
    shut = torch.tensor(np.where(some.possible, 0.0, NOWHERE), dtype=torch.float32)
    _descend(net, trust, x, evidence, shut, answer, torch.tensor(weight, dtype=torch.float32))
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


def packed(by: EffectClassifier) -> bytes:
    """The file of weights, in half precision: it is small, and shipped."""
    half = {n: getattr(by, n).astype(np.float32) for n in ("mean", "sd", "trust")}
    for k, layer in enumerate(by.layers):
        half |= {f"weight{k}": layer.weight.astype(np.float16), f"bias{k}": layer.bias.astype(np.float16)}
    out = io.BytesIO()
    np.savez_compressed(out, keys=np.array(by.keys), names=np.array(by.names), **half)
    return out.getvalue()
