"""How often names can be identified at all, by level, and what an unknown law costs: many oracles."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from deeptruck_exam.folder import LIMIT
from deeptruck_exam.jobs import in_parallel
from deeptruck_exam.laws import EFFECTS
from deeptruck_model import files

LEVELS = ("noise", "wrong_parameters", "absorbed", "closed_loop", "one_condition", "rare", "decoy")
# As the tool weighs names: by nats over the larger of TEMPER and COARSE times the best, in sets of CREDIBLE.
TEMPER, COARSE, CREDIBLE = 3.0, 0.05, 0.8


@dataclass(frozen=True)
class Limited:
    """What an oracle found in one case: the log evidence of laws, nats; `nats` is what the effect explains
    beyond free parameters."""

    level: str
    seed: int
    key: str
    name: str
    nats: float
    laws: Mapping[str, float]


@dataclass(frozen=True)
class Limits:
    """Right first and in the credible set, the set's mean size, and the mean log score."""

    cases: int
    first: float
    in_set: float
    size: float
    log_score: float


def limited(level: str, seed: int) -> Limited | None:
    """The oracle's evidence in one case; None where its law needs a leader."""
    from deeptruck_exam.cases.build import build_case
    from deeptruck_exam.oracle.oracle import Oracle

    built = build_case(level, seed)
    (effect,) = built.plan.effects
    if effect.leader:
        return None
    evidence = Oracle(built, seed).evidence()
    laws = {key: round(nats, 3) for key, nats in evidence.laws.items()}
    return Limited(level, seed, effect.key, effect.name, built.nats_left, laws)


def scored(cases: Sequence[Limited], *, law_known: bool) -> Limits:
    """How often the laws' evidence gives the right name, with or without the hidden law among them."""
    ranked = [_ranked(c, law_known) for c in cases]
    right = [next((p for n, p in r if n == c.name), 1e-4) for c, r in zip(cases, ranked, strict=True)]
    sets = [_credible(r) for r in ranked]
    return Limits(
        len(cases),
        float(np.mean([r[0][0] == c.name for c, r in zip(cases, ranked, strict=True)])),
        float(np.mean([c.name in s for c, s in zip(cases, sets, strict=True)])),
        float(np.mean([len(s) for s in sets])),
        float(np.mean([math.log(max(p, 1e-4)) for p in right])),
    )


def _ranked(case: Limited, law_known: bool) -> list[tuple[str, float]]:
    """Names and their probabilities, the most probable first."""
    from deeptruck_exam.oracle.oracle import Evidence

    names = {key: EFFECTS[key].name for key in case.laws}
    nats = Evidence(case.laws, names).of_names(() if law_known else (case.key,))
    logs = np.array(list(nats.values())) / max(TEMPER, COARSE * max(nats.values()))
    p = np.exp(logs - logs.max())
    return sorted(zip(nats, (p / p.sum()).tolist(), strict=True), key=lambda item: -item[1])


def _credible(ranked: Sequence[tuple[str, float]]) -> set[str]:
    out, mass = set[str](), 0.0
    for name, p in ranked:
        if mass >= CREDIBLE:
            break
        out.add(name)
        mass += p
    return out


def run(out: Path, cases: int, seed: int, jobs: int) -> list[Limited]:
    """The limits of so many cases, the same number of each level; one file each, so that a stopped run goes
    on. Raises InputError where `out` holds something else."""
    each = math.ceil(cases / len(LEVELS))
    plan = [(level, seed + k) for k in range(each) for level in LEVELS][:cases]
    with LIMIT.in_place(out):
        in_parallel(_kept, [(out, *job) for job in plan], jobs)
        found = [c for c in (_read(_place(out, *job)) for job in plan) if c is not None]
        files.rewrite(out / "limit.json", json.dumps(_table(found), indent=1).encode())
    return found


def _place(out: Path, level: str, seed: int) -> Path:
    return out / f"{level}-{seed}.json"


def _kept(out: Path, level: str, seed: int) -> None:
    place = _place(out, level, seed)
    if not place.exists():
        found = limited(level, seed)
        files.write(place, json.dumps(asdict(found) if found else None).encode())


def _read(place: Path) -> Limited | None:
    found = json.loads(place.read_text())
    return Limited(**found) if found else None


def _table(found: Sequence[Limited]) -> dict[str, dict[str, dict[str, float]]]:
    """Limits by level, with the hidden law known and without."""
    some = {level: [c for c in found if c.level == level] for level in LEVELS} | {"all": list(found)}
    return {
        which: {
            level: asdict(scored(cases, law_known=which == "known law"))
            for level, cases in some.items()
            if cases
        }
        for which in ("known law", "unknown law")
    }


def show(found: Sequence[Limited]) -> None:
    """Print the table."""
    table = Table("", "level", "cases", "first", "in set", "set size", "log score")
    for which, levels in _table(found).items():
        for level, v in levels.items():
            numbers = [f"{v[n]:.2f}" for n in ("first", "in_set", "size", "log_score")]
            table.add_row(which, level, f"{v['cases']:.0f}", *numbers)
    Console().print(table)
