"""Training samples: drives with nothing missing, and kernel evidence of laws that are added to them."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from deeptruck_exam.cases.build import DT, build
from deeptruck_exam.cases.case import interface_of, measure
from deeptruck_exam.cases.plan import FIT, MINUTES, Plan, draw_plan
from deeptruck_exam.laws.catalogue import UNKNOWN
from deeptruck_exam.laws.law import Array
from deeptruck_exam.teach.injected import Injected, Injection
from deeptruck_exam.worlds import trucks
from deeptruck_model import files
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch import LIBRARY, NOTHING, CleanDrives, Given, KernelFeatures, Seen
from deeptruck_model.recordings import Recording

Source = Literal["grammar", "laws"]
SCALES = (-1.2, 0.3)  # of the logarithm of what a law's size is multiplied by
PARAMETER_SD = (0.004, 0.05)  # relative: parameters are nearly right where names are weighed
ABSORBED = 0.25  # share of laws that the parameters were tuned to, in part
WRONG = (0.03, 0.2)  # relative, of a parameter that is the answer
SECOND, SECOND_NAMES = 0.2, 6  # share of samples with a second effect that is known; names of these
STYLES = (0.55, 0.2, 0.25)  # bases driven by people, by cruise control, behind a leader
FAULTS = ("grade_bias", "clock_offset")  # that are forces to the tool
LEFT_OVER = 0.1  # share of samples once more, beside names that they may be taken for
SEEN = {  # of Seen, and the type each is stored as
    "nats": np.float32,
    "sign": np.float32,
    "size": np.int8,
    "directions": np.float32,
    "noise": np.float32,
}
FAULT_DRAWS = 3


@dataclass(frozen=True)
class Samples:
    """Kernel evidence along one base; `names` (N,) are the answers, `laws` (N,) their keys."""

    kernels: KernelFeatures
    names: NDArray[np.str_]
    laws: NDArray[np.str_]

    def save(self, path: Path) -> None:
        f, packed = self.kernels, io.BytesIO()
        arrays: dict[str, Any] = {"keys": np.array(f.keys), "chance": f.chance}
        arrays |= {"names": self.names, "laws": self.laws}
        arrays |= {f"given_{n}": x for n, x in vars(f.given).items()}
        for part, seen in (("held", f.held), ("free", f.free)):
            arrays |= {f"{part}_{n}": getattr(seen, n).astype(kind) for n, kind in SEEN.items()}
        np.savez_compressed(packed, **arrays)
        files.write(path, packed.getvalue())

    @staticmethod
    def load(path: Path) -> Samples:
        """Raises InputError for a file of another version, which lacks some arrays."""
        try:
            with np.load(path) as a:
                held, free = (_seen({n: a[f"{part}_{n}"] for n in SEEN}) for part in ("held", "free"))
                given = Given(*(a[f"given_{n}"] for n in ("there", "explained", "overlap")))
                f = KernelFeatures(tuple(a["keys"].tolist()), a["chance"], held, free, given)
                return Samples(f, a["names"], a["laws"])
        except KeyError:
            raise InputError(f"{path} was made by another version; delete it, and run this again") from None

    def of(self, rows: NDArray[np.bool_]) -> Samples:
        """Some of them."""
        return Samples(self.kernels.of(rows), self.names[rows], self.laws[rows])


def _seen(arrays: Mapping[str, Array]) -> Seen:
    nats, sign, directions, noise = (arrays[n].astype(float) for n in ("nats", "sign", "directions", "noise"))
    return Seen(nats, sign, arrays["size"].astype(np.intp), directions, noise)


@dataclass(frozen=True)
class _Labelled:
    """One residual (n,), what is missing in it, and the names that are known."""

    residual: Array
    name: str
    law: str
    beside: tuple[str, ...] = ()


_Weighed = tuple[_Labelled, KernelFeatures]


def samples(source: Source, seed: int) -> Samples:
    """Kernel evidence of a hundred and more laws along one base: of the grammar, or of the catalogue."""
    with threadpool_limits(1):
        rng = np.random.default_rng([seed, 5])
        plan = _plan(seed, rng)
        built = build(plan)
        interface = interface_of(plan)
        recordings = [Recording(f"drive_{k}", DT, c, interface) for k, c in enumerate(measure(built))]
        simulator = trucks.make(plan.truck, plan.simulator_values, grade=plan.grade)
        drives = CleanDrives(simulator, recordings, FIT)
        injection = Injection(built, rng)
        if source == "laws":
            first = [_of_law(f, None, drives, rng) for f in injection.of_catalogue()]
            return _joined(_weighed(drives, first))
        forces = list(injection.of_grammar())
        others = [f for f in forces if f.name != UNKNOWN]
        seconds = [others[k] for k in rng.permutation(len(others))[:SECOND_NAMES]]
        made = [
            *(_of_law(f, seconds[rng.integers(len(seconds))], drives, rng) for f in forces),
            *_of_faults(drives, rng),
            *_of_parameters(drives, seconds, rng),
        ]
        weighed = _weighed(drives, made)
        return _joined([*weighed, *_weighed(drives, list(_left_over(weighed, rng)))])


def _plan(seed: int, rng: np.random.Generator) -> Plan:
    plan = draw_plan("nothing_missing", seed, None, "physics", MINUTES)
    style = str(rng.choice(["human", "cruise", "acc"], p=STYLES))
    styles = [style if rng.random() < 0.8 else "human" for _ in plan.styles]
    close = float(rng.uniform(0.7, 1.3))
    return replace(plan, styles=styles, headway_s=close if style == "acc" else plan.headway_s)


def _of_law(f: Injected, second: Injected | None, drives: CleanDrives, rng: np.random.Generator) -> _Labelled:
    """A law of some size beside parameters that are a little off; sometimes with a second that is known."""
    force = f.acceleration * np.exp(rng.uniform(*SCALES))
    parameters = np.stack(list(drives.sensitivity.values()), axis=1)
    sd = np.exp(rng.uniform(*np.log(PARAMETER_SD)))
    residual = drives.residual + force + parameters @ rng.normal(0.0, sd, parameters.shape[1])
    if rng.random() < ABSORBED:
        residual -= rng.uniform(0.5, 1.0) * parameters @ np.linalg.lstsq(parameters, force, rcond=None)[0]
    if second is not None and rng.random() < SECOND and second.name != f.name:
        return _Labelled(residual + second.acceleration, f.name, f.key, (second.name,))
    return _Labelled(residual, f.name, f.key)


def _of_faults(drives: CleanDrives, rng: np.random.Generator) -> list[_Labelled]:
    """Faults of sensors that are forces to the tool."""
    drawn = [(name, drives.fault(name, rng)) for name in FAULTS for _ in range(FAULT_DRAWS)]
    return [_Labelled(drives.residual + x, name, f"fault {name}") for name, x in drawn if x is not None]


def _of_parameters(
    drives: CleanDrives, seconds: Sequence[Injected], rng: np.random.Generator
) -> Iterator[_Labelled]:
    """Parameters that are wrong either way; half of them beside a law that is known."""
    for name, column in drives.sensitivity.items():
        for sign in (-1.0, 1.0):
            residual = drives.residual + column * sign * rng.uniform(*WRONG)
            second = seconds[int(rng.integers(len(seconds)))]
            known = rng.random() < 0.5
            beside = (second.name,) if known else ()
            residual = residual + second.acceleration if known else residual
            yield _Labelled(residual, name, f"parameter {name}", beside)


def _left_over(first: Sequence[_Weighed], rng: np.random.Generator) -> Iterator[_Labelled]:
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


def _weighed(drives: CleanDrives, some: Sequence[_Labelled]) -> list[_Weighed]:
    """Each with its evidence: those beside the same names at once.

    What needs a signal that these drives lack, as drafting needs a gap, has no name here.
    """
    out = []
    for beside in sorted({m.beside for m in some}):
        group = [m for m in some if m.beside == beside]
        together = drives.kernel_features(np.stack([m.residual for m in group], axis=1), beside)
        possible = together.names | {UNKNOWN, NOTHING}
        labelled = [m if m.name in possible else replace(m, name=UNKNOWN) for m in group]
        out += [(m, together.of([k])) for k, m in enumerate(labelled)]
    return out


def _joined(some: Sequence[_Weighed]) -> Samples:
    names, laws = (np.array([getattr(m, n) for m, _ in some]) for n in ("name", "law"))
    return Samples(side_by_side([f for _, f in some]), names, laws)


def side_by_side(each: Sequence[KernelFeatures]) -> KernelFeatures:
    """Evidence by the same kernels as one of many residuals."""
    held, free = (_end_to_end([getattr(f, part) for f in each]) for part in ("held", "free"))
    names = ("there", "explained", "overlap")
    given = Given(*(np.concatenate([getattr(f.given, n) for f in each]) for n in names))
    return replace(each[0], held=held, free=free, given=given)


def _end_to_end(each: Sequence[Seen]) -> Seen:
    return _seen({n: np.concatenate([getattr(seen, n) for seen in each], axis=-1) for n in SEEN})
