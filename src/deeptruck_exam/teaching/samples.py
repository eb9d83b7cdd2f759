"""What the recogniser learns from: drives with nothing missing, and fingerprints of laws along them."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from deeptruck_exam.cases import interface_of, measure
from deeptruck_exam.construction import DT, Built, build
from deeptruck_exam.effects.law import Array
from deeptruck_exam.effects.planting import Effect
from deeptruck_exam.plans import FIT, Plan, draw_plan
from deeptruck_exam.teaching.injected import Injected, Injection
from deeptruck_exam.worlds import trucks
from deeptruck_model import files
from deeptruck_model.mismatch import LIBRARY, NOTHING, CleanDrives, Fingerprint, Given, Seen
from deeptruck_model.recordings import Recording

MINUTES = 4.0
NAMED, NAMELESS = 90, 20  # laws along one base, with a name and without
SCALES = (-1.2, 0.3)  # of the logarithm of what a law's size is multiplied by
PARAMETER_SD = (0.004, 0.05)  # relative: parameters are nearly right where names are weighed
ABSORBED = 0.25  # share of laws that the parameters were tuned to, in part
WRONG = (0.03, 0.2)  # relative, of a parameter that is the answer
SECOND, SECOND_NAMES = 0.3, 8  # share of samples with a second effect that is known; names of these
STYLES = (0.55, 0.2, 0.25)  # bases driven by people, by cruise control, behind a leader
FAULTS = ("grade_bias", "clock_offset")  # that are forces to the tool
LEFT_OVER = 0.4  # share of samples once more, beside names that they may be taken for
UNKNOWN = "unknown"
SEEN = {"nats": np.float32, "sign": np.float32, "size": np.int8, "told": np.float32, "noise": np.float32}
FAULT_DRAWS = 3


@dataclass(frozen=True)
class Samples:
    """Fingerprints along one base; `names` (N,) are the answers, `laws` (N,) their keys, `families` (N,)
    theirs, or what else was added; `world` is that of the base."""

    fingerprint: Fingerprint
    names: NDArray[np.str_]
    laws: NDArray[np.str_]
    families: NDArray[np.str_]
    world: str

    def save(self, path: Path) -> None:
        f, packed = self.fingerprint, io.BytesIO()
        arrays: dict[str, Any] = {"keys": np.array(f.keys), "chance": f.chance, "world": np.array(self.world)}
        arrays |= {"names": self.names, "laws": self.laws, "families": self.families}
        arrays |= {f"given_{n}": x for n, x in vars(f.given).items()}
        for part, seen in (("held", f.held), ("free", f.free)):
            arrays |= {f"{part}_{n}": getattr(seen, n).astype(kind) for n, kind in SEEN.items()}
        np.savez_compressed(packed, **arrays)
        files.write(path, packed.getvalue())

    @staticmethod
    def load(path: Path) -> Samples:
        with np.load(path) as a:
            held, free = (_seen({n: a[f"{part}_{n}"] for n in SEEN}) for part in ("held", "free"))
            given = Given(*(a[f"given_{n}"] for n in ("there", "explained", "overlap")))
            f = Fingerprint(tuple(a["keys"].tolist()), a["chance"], held, free, given)
            return Samples(f, a["names"], a["laws"], a["families"], str(a["world"]))

    def of(self, rows: NDArray[np.bool_]) -> Samples:
        """Some of them."""
        some = self.fingerprint.of(rows)
        return Samples(some, self.names[rows], self.laws[rows], self.families[rows], self.world)


def _seen(arrays: Mapping[str, Array]) -> Seen:
    nats, sign, told, noise = (arrays[n].astype(float) for n in ("nats", "sign", "told", "noise"))
    return Seen(nats, sign, arrays["size"].astype(np.intp), told, noise)


@dataclass(frozen=True)
class _Labelled:
    """One residual (n,), what is missing in it, and the names that are known beside it."""

    residual: Array
    name: str
    law: str
    family: str
    beside: tuple[str, ...] = ()


_Fingered = tuple[_Labelled, Fingerprint]


def samples(family: str, seed: int) -> Samples:
    """Fingerprints of some hundred laws along a base in the world of a family."""
    with threadpool_limits(1):
        rng = np.random.default_rng([seed, 5])
        built = build(_plan(family, seed, rng))
        interface = interface_of(built.plan)
        recordings = [Recording(f"drive_{k}", DT, c, interface) for k, c in enumerate(measure(built))]
        simulator = trucks.make(built.plan.truck, built.plan.believed, grade=built.plan.grade)
        drives = CleanDrives(simulator, recordings, FIT)
        forces = _forces(built, rng)
        others = [f for f in forces if _name(f) != UNKNOWN]
        seconds = [others[k] for k in rng.permutation(len(others))[:SECOND_NAMES]]
        made = [
            *(_of_law(f, seconds[rng.integers(len(seconds))], drives, rng) for f in forces),
            *_of_faults(drives, rng),
            *_of_parameters(drives, seconds, rng),
        ]
        first = _fingerprints(drives, made)
        again = _fingerprints(drives, list(_left_over(first, rng)))
        return replace(_joined([_samples(part) for part in (first, again)]), world=family)


def _plan(family: str, seed: int, rng: np.random.Generator) -> Plan:
    plan = draw_plan("nothing_missing", seed, None, "physics", MINUTES, 0, family)
    style = str(rng.choice(["human", "cruise", "acc"], p=STYLES))
    styles = [style if rng.random() < 0.8 else "human" for _ in plan.styles]
    close = float(rng.uniform(0.7, 1.3))
    return replace(plan, styles=styles, headway_s=close if style == "acc" else plan.headway_s)


def _forces(built: Built, rng: np.random.Generator) -> list[Injected]:
    injection = Injection(built, rng)
    laws = injection.laws()
    chosen = [*_some(laws, False, NAMED, rng), *_some(laws, True, NAMELESS, rng)]
    return [*injection.forces(chosen), *injection.slopes()]


def _some(laws: Sequence[Effect], nameless: bool, most: int, rng: np.random.Generator) -> list[Effect]:
    some = [law for law in laws if (law.name == UNKNOWN) == nameless]
    return [some[k] for k in rng.permutation(len(some))[:most]]


def _name(f: Injected) -> str:
    return f.law.name


def _of_law(f: Injected, second: Injected, drives: CleanDrives, rng: np.random.Generator) -> _Labelled:
    """A law of some size beside parameters that are a little off; sometimes with a second that is known."""
    law = f.law
    force = f.acceleration * np.exp(rng.uniform(*SCALES))
    parameters = np.stack(list(drives.sensitivity.values()), axis=1)
    sd = np.exp(rng.uniform(*np.log(PARAMETER_SD)))
    residual = drives.residual + force + parameters @ rng.normal(0.0, sd, parameters.shape[1])
    if rng.random() < ABSORBED:
        residual -= rng.uniform(0.5, 1.0) * parameters @ np.linalg.lstsq(parameters, force, rcond=None)[0]
    if rng.random() < SECOND and _name(second) != law.name:
        return _Labelled(residual + second.acceleration, law.name, f.key, law.family, (_name(second),))
    return _Labelled(residual, law.name, f.key, law.family)


def _of_faults(drives: CleanDrives, rng: np.random.Generator) -> list[_Labelled]:
    """Faults of sensors that are forces to the tool."""
    drawn = [(name, drives.fault(name, rng)) for name in FAULTS for _ in range(FAULT_DRAWS)]
    return [
        _Labelled(drives.residual + x, name, f"fault {name}", "faults") for name, x in drawn if x is not None
    ]


def _of_parameters(
    drives: CleanDrives, seconds: Sequence[Injected], rng: np.random.Generator
) -> Iterator[_Labelled]:
    """Parameters that are wrong either way; half of them beside a law that is known."""
    for name, column in drives.sensitivity.items():
        for sign in (-1.0, 1.0):
            residual = drives.residual + column * sign * rng.uniform(*WRONG)
            second = seconds[int(rng.integers(len(seconds)))]
            known = rng.random() < 0.5
            beside = (_name(second),) if known else ()
            residual = residual + second.acceleration if known else residual
            yield _Labelled(residual, name, f"parameter {name}", "parameters", beside)


def _left_over(first: Sequence[_Fingered], rng: np.random.Generator) -> Iterator[_Labelled]:
    """Some of them once more, beside their own name, when nothing more is missing however far a law is from
    its form; and beside the name that evidence alone takes them for, when what is missing still is."""
    for m, f in first:
        names = sorted(f.names & set(LIBRARY) - set(m.beside))
        if rng.random() > LEFT_OVER or not names:
            continue
        taken = names[int(np.argmax(f.by_evidence(names)[0]))]
        if taken != m.name:
            yield replace(m, beside=tuple(sorted((*m.beside, taken))))
        if m.name in names:
            yield replace(m, name=NOTHING, beside=tuple(sorted((*m.beside, m.name))))


def _fingerprints(drives: CleanDrives, some: Sequence[_Labelled]) -> list[_Fingered]:
    """Each with its fingerprint: those beside nothing at once, others each beside its own names."""
    alone = [m for m in some if not m.beside]
    beside = [m for m in some if m.beside]
    out = [(m, drives.fingerprints(m.residual[:, None], m.beside)) for m in beside]
    if not alone:
        return out
    together = drives.fingerprints(np.stack([m.residual for m in alone], axis=1))
    return [*((m, together.of([k])) for k, m in enumerate(alone)), *out]


def _samples(some: Sequence[_Fingered]) -> Samples:
    names, laws, families = (np.array([getattr(m, n) for m, _ in some]) for n in ("name", "law", "family"))
    return Samples(side_by_side([f for _, f in some]), names, laws, families, "")


def side_by_side(each: Sequence[Fingerprint]) -> Fingerprint:
    """Fingerprints by the same kernels as one of many residuals."""
    held, free = (_end_to_end([getattr(f, part) for f in each]) for part in ("held", "free"))
    names = ("there", "explained", "overlap")
    given = Given(*(np.concatenate([getattr(f.given, n) for f in each]) for n in names))
    return replace(each[0], held=held, free=free, given=given)


def _end_to_end(each: Sequence[Seen]) -> Seen:
    return _seen({n: np.concatenate([getattr(seen, n) for seen in each], axis=-1) for n in SEEN})


def _joined(parts: Sequence[Samples]) -> Samples:
    names, laws, families = (
        np.concatenate([getattr(p, n) for p in parts]) for n in ("names", "laws", "families")
    )
    return Samples(side_by_side([p.fingerprint for p in parts]), names, laws, families, "")
