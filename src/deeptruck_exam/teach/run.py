"""From seeds to an effect classifier and its card: bases in parallel, kept, so that a stopped run goes on."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from deeptruck_exam.folder import CLASSIFIER
from deeptruck_exam.jobs import in_parallel
from deeptruck_exam.teach import acceptance, learning
from deeptruck_exam.teach.samples import Samples, Source, samples
from deeptruck_model import files
from deeptruck_model.mismatch import EffectClassifier

WEIGHTS, CARD, ACCEPTANCE = "effect_classifier.npz", "effect_classifier.json", "acceptance.md"
JUDGED_SEED = 2000  # above the training's: other trucks, roads and drivers


def run(out: Path, bases: int, judged: int, seed: int, jobs: int) -> dict[str, Any]:
    """Make the bases, train, judge on the laws, and write weights, card and acceptance table.

    Raises InputError where `out` holds something else."""
    plan: list[tuple[Source, int]] = [("grammar", seed + k) for k in range(bases)]
    plan += [("laws", seed + JUDGED_SEED + k) for k in range(judged)]
    with CLASSIFIER.in_place(out):
        in_parallel(_kept, [(_place(out, *job), *job) for job in plan], jobs)
        parts = {job: Samples.load(_place(out, *job)) for job in plan}
        training = [part for (source, _), part in parts.items() if source == "grammar"]
        scored = [part for (source, _), part in parts.items() if source == "laws"]
        command = (
            f"python -m deeptruck_exam.command classifier --bases {bases} --judged {judged} --seed {seed}"
        )
        return _trained(out, training, scored, command)


def _place(out: Path, source: Source, seed: int) -> Path:
    return out / f"base-{source}-{seed}.npz"


def _kept(place: Path, source: Source, seed: int) -> None:
    if not place.exists():
        samples(source, seed).save(place)


def _trained(
    out: Path, training: Sequence[Samples], scored: Sequence[Samples], command: str
) -> dict[str, Any]:
    keys = tuple(sorted({key for p in training for key in p.kernels.keys}))
    names = tuple(sorted({name for p in training for name in p.names.tolist()}))
    whole = learning.training_set(training, keys, names)
    new, shipped = learning.trained(whole, keys, names), EffectClassifier.load()
    files.rewrite(out / WEIGHTS, learning.packed(new))
    ways = {
        "new": acceptance.of_classifier(new),
        "shipped": acceptance.of_classifier(shipped),
        "evidence alone": acceptance.of_evidence(names),
    }
    found = acceptance.judged(scored, ways)
    failed = acceptance.failures(found["all"]["new"], found["all"]["shipped"])
    card = {
        "trained_by": command,
        "trained_on": "laws of the grammar added to drives with nothing missing",
        "bases": len(training),
        "residuals": len(whole.answer),
        "names": names,
        "judged_on": "the sixty textbook laws, in fresh worlds",
        "scores": {t: {w: asdict(s) for w, s in by.items()} for t, by in found.items()},
        "not_reached": failed,
    }
    files.rewrite(out / CARD, json.dumps(card, indent=1).encode())
    files.rewrite(out / ACCEPTANCE, ("\n".join([*acceptance.table(found), "", *_verdict(failed)])).encode())
    return card


def _verdict(failed: Sequence[str]) -> list[str]:
    return [f"Not accepted: {'; '.join(failed)}." if failed else "Accepted."]


def show(card: dict[str, Any]) -> None:
    """Print the acceptance table."""
    for title, ways in card["scores"].items():
        for way, s in ways.items():
            print(title, way, {n: round(x, 2) for n, x in s.items()})
    print(*_verdict(card["not_reached"]))
