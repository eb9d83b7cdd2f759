"""From seeds to a recogniser and its card: bases in parallel, each kept, so that a stopped run goes on."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from deeptruck_exam.effects.law import Array
from deeptruck_exam.effects.planting import FAMILIES
from deeptruck_exam.folder import RECOGNISER
from deeptruck_exam.jobs import end_with_the_run
from deeptruck_exam.teaching import learning
from deeptruck_exam.teaching.injected import STRAYED
from deeptruck_exam.teaching.learning import Lesson
from deeptruck_exam.teaching.samples import UNKNOWN, Samples, samples
from deeptruck_model import files
from deeptruck_model.mismatch import NOTHING, Recogniser

WEIGHTS, CARD, WITHOUT = "recogniser.npz", "recogniser.json", "recogniser-without-{}.npz"
BESIDE = "beside known names"  # where nothing more may be missing
FEWER = 3  # members of an ensemble that only judges families
JUDGES = 6  # ensembles that share the families among them, each untaught by its own


def run(out: Path, bases: int, seed: int, jobs: int) -> dict[str, Any]:
    """Make the bases, learn, and write weights and card.

    Raises InputError where `out` holds something else."""
    plan = [(FAMILIES[k % len(FAMILIES)], seed + k) for k in range(bases)]
    context = get_context("spawn")
    with RECOGNISER.in_place(out):
        with ProcessPoolExecutor(jobs, context, end_with_the_run) as pool:
            waiting = [pool.submit(_kept, _place(out, *job), *job) for job in plan]
            for k, done in enumerate(as_completed(waiting), 1):
                done.result()
                Console(stderr=True).print(f"base {k} of {len(plan)}")
        return _taught(out, [Samples.load(_place(out, *job)) for job in plan], seed, jobs)


def _place(out: Path, family: str, seed: int) -> Path:
    return out / f"base-{family}-{seed}.npz"


def _kept(place: Path, family: str, seed: int) -> None:
    if not place.exists():
        samples(family, seed).save(place)


def _taught(out: Path, parts: Sequence[Samples], seed: int, jobs: int) -> dict[str, Any]:
    keys = tuple(sorted({key for p in parts for key in p.fingerprint.keys}))
    names = tuple(sorted({name for p in parts for name in p.names.tolist()}))
    whole = learning.lesson(parts, keys, names)
    families = sorted({p.world for p in parts})
    _learn(out, whole, keys, names, families, jobs)
    judges = [(Recogniser.load(out / WITHOUT.format(k)), fs) for k, fs in enumerate(_shared_out(families))]
    by = {family: judge for judge, some in judges for family in some}
    card = {
        "taught_by": f"python -m deeptruck_exam.command recogniser --bases {len(parts)} --seed {seed}",
        "bases": len(parts),
        "residuals": len(whole.answer),
        "laws": len({law.removesuffix(STRAYED) for p in parts for law in p.laws.tolist()}),
        "families": families,
        "names": names,
        "unseen_families": _unseen(whole, by, names),
    }
    files.rewrite(out / CARD, json.dumps(card, indent=1).encode())
    return card


def _learn(
    out: Path,
    whole: Lesson,
    keys: tuple[str, ...],
    names: tuple[str, ...],
    families: Sequence[str],
    jobs: int,
) -> None:
    """Weights by all, and by all but some families: in parallel, each in a process of its own."""
    judges = [(WITHOUT.format(k), some, FEWER) for k, some in enumerate(_shared_out(families))]
    tasks = [(WEIGHTS, [], learning.MEMBERS), *judges]
    with (
        TemporaryDirectory() as apart,
        ProcessPoolExecutor(jobs, get_context("spawn"), end_with_the_run) as pool,
    ):
        lessons = Path(apart) / "lessons.npz"
        whole.save(lessons)
        waiting = [pool.submit(_learned, lessons, keys, names, out / n, f, m) for n, f, m in tasks]
        for k, done in enumerate(as_completed(waiting), 1):
            done.result()
            Console(stderr=True).print(f"network {k} of {len(tasks)}")


def _shared_out(families: Sequence[str]) -> list[Sequence[str]]:
    """The families that each ensemble judges, and is not taught by."""
    return [families[k::JUDGES] for k in range(min(JUDGES, len(families)))]


def _learned(
    lessons: Path,
    keys: tuple[str, ...],
    names: tuple[str, ...],
    place: Path,
    left_out: Sequence[str],
    members: int,
) -> None:
    import torch

    torch.set_num_threads(1)
    whole = Lesson.load(lessons)
    some = learning.without(left_out, whole)
    files.rewrite(place, learning.packed(learning.learned(some, keys, names, members)))


def _unseen(whole: Lesson, by: Mapping[str, Recogniser], names: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """Scores on families it had not seen, in worlds it had not seen: of the network and of evidence alone."""
    network, evidence, rows = learning.unseen(whole, by)
    named, beside = whole.answer != names.index(UNKNOWN), whole.possible[:, names.index(NOTHING)]
    alone = rows & ~beside
    parts = {"all": alone, "with a name": alone & named, "unknown": alone & ~named, BESIDE: rows & beside}
    return {
        title: {way: _score(whole.of(some), p[some], names) for way, p in _ways(network, evidence)}
        for title, some in parts.items()
        if some.any()
    }


def _ways(network: Array, evidence: Array) -> list[tuple[str, Array]]:
    return [("network", network), ("evidence alone", evidence)]


def _score(some: Lesson, p: Array, names: tuple[str, ...]) -> dict[str, float]:
    found = learning.score(p, some.answer, learning.weights(some, names))
    return {name: round(float(x), 3) for name, x in asdict(found).items()} | {
        "residuals": int(np.size(some.answer))
    }


def show(card: dict[str, Any]) -> None:
    """Print what families that were left out say of it."""
    table = Table("laws", "by", "first", "in the set", "its size", "log score", "calibration error")
    for title, ways in card["unseen_families"].items():
        for way, s in ways.items():
            numbers = [f"{s[n]:.2f}" for n in ("first", "in_set", "size", "log_score", "calibration")]
            table.add_row(title, way, *numbers)
    Console().print(table)
