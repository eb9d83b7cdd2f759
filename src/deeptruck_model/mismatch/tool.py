"""The whole job: check the data, locate, name, model, show the fit improve, write the verdict."""

from __future__ import annotations

import csv
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from deeptruck_model.errors import InputError
from deeptruck_model.mismatch import (
    correction,
    data_checks,
    findings,
    formula,
    identifiability,
    locate,
    own_error,
)
from deeptruck_model.mismatch.correct import CorrectedTruck
from deeptruck_model.mismatch.evidence import Evidence
from deeptruck_model.mismatch.explain import Explanation, explain, first_guess
from deeptruck_model.mismatch.improvement import Errors
from deeptruck_model.mismatch.residual import PARAMETERS, Prepared, gather, prepare
from deeptruck_model.mismatch.search import Search
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]

HELD_OUT_SHARE = 0.3
LEAST_S = 60.0
EXCLUDE = (
    "DEEPTRUCK_MISMATCH_EXCLUDE"  # comma-separated effects to leave out of the library: for examinations
)
RETUNE_RANGE = (-0.6, 1.0)  # no truck is further off; what asks for more is no parameter error
RETUNE = 0.05  # beyond this relative change parameters are set in the simulator, and all is linearised again


@dataclass(frozen=True)
class Mismatch:
    """Everything the tool found: the verdict as in verdict.json, and what the report draws."""

    verdict: dict[str, Any]
    evidence: Evidence | None
    explanation: Explanation | None
    findings: tuple[findings.Finding, ...]
    segments: tuple[locate.Segment, ...]
    errors: dict[str, Errors]
    corrected: CorrectedTruck | None
    prepared: tuple[Prepared, ...]


def find_mismatch(
    simulator: Simulator,
    recordings: Sequence[Recording],
    held_out: Sequence[Recording] = (),
    *,
    seed: int = 0,
    say: Callable[[str], None] = lambda step: None,
) -> Mismatch:
    """Compare a simulator with recordings. On data that is merely poor the verdict is `undetermined`.

    Raises InputError where simulator and recordings do not belong together.
    """
    with threadpool_limits(1):
        return _find(simulator, recordings, held_out, seed, say)


def _find(
    simulator: Simulator,
    recordings: Sequence[Recording],
    held_out: Sequence[Recording],
    seed: int,
    say: Callable[[str], None],
) -> Mismatch:
    say("checking the data")
    _same_signals(simulator, [*recordings, *held_out])
    drives, flags, caveats = _with_held_out(list(recordings), list(held_out), simulator.dt)
    drives, rejected = data_checks.clean(drives)
    measured = data_checks.acceleration_is_measured(drives)
    faults = data_checks.sensor_faults(drives) if measured else []
    prepared = [prepare(data_checks.mended(r, faults), measured) for r in drives]
    fitted = [p for p, out in zip(prepared, flags, strict=True) if not out]
    reason = _unusable(fitted, rejected)
    data: dict[str, Any] = {
        "rejected": [{"rule": r.rule, "samples": r.samples} for r in rejected],
        "coverage": "coverage.png",
    }
    if reason:
        found = [findings.from_sensor(f) for f in faults]
        verdict = _verdict(
            "measurement_fault" if found else "undetermined", found, [], [], {}, data, [*caveats, reason]
        )
        return Mismatch(verdict, None, None, tuple(found), (), {}, None, tuple(prepared))
    say("driving the simulator along the recordings")
    exclude = [name for name in os.environ.get(EXCLUDE, "").split(",") if name]
    evidence, explanation = _explained(simulator, prepared, flags, seed, exclude, say)
    if evidence.other_gear:
        rule = "the simulator drives in another gear than was recorded"
        data["rejected"].append({"rule": rule, "samples": evidence.other_gear})
    own = simulator.parameters()
    found = [findings.from_sensor(f) for f in faults]
    found += [findings.from_cause(c, evidence, explanation, own) for c in explanation.causes]
    found = identifiability.with_manoeuvres(found)
    for f in found:
        if f.cause is not None and f.cause.predictable:
            f.data.update(formula.describe(evidence, explanation))
    say("locating it")
    shown = tuple(f.cause for f in found if f.cause is not None)
    offset = len(found) - len(shown)
    segments = locate.segments(evidence, shown)
    total = evidence.residual
    regimes = locate.regimes(
        evidence, sum((c.force for c in shown), start=np.zeros(len(evidence))) if shown else total
    )
    say("correcting the simulator and driving it free")
    tuned, corrected = correction.correct(simulator, evidence, explanation, fitted)
    held = [p for p, out in zip(prepared, flags, strict=True) if out]
    errors, corrected, fit = correction.shown(simulator, tuned, corrected, held)
    if shown and not corrected.validated:
        caveats.append(
            "the corrected simulator does not predict the held-out recordings better: nothing may be applied"
        )
    if not found:
        data["smallest_visible"] = identifiability.smallest_visible(evidence, explanation)
    listed = [
        {
            "recording": s.recording,
            "start_s": round(s.start_s, 2),
            "end_s": round(s.end_s, 2),
            "finding": s.finding + offset,
            "mean_force_n": round(s.mean_force_n, 1),
        }
        for s in segments
    ]
    kind = _overall(found)
    verdict = _verdict(kind, found, listed, [vars(r) for r in regimes], fit, data, caveats)
    return Mismatch(
        verdict, evidence, explanation, tuple(found), tuple(segments), errors, corrected, tuple(prepared)
    )


def _explained(
    simulator: Simulator,
    prepared: Sequence[Prepared],
    flags: Sequence[bool],
    seed: int,
    exclude: Sequence[str],
    say: Callable[[str], None],
) -> tuple[Evidence, Explanation]:
    """Search; where parameters are far off, set them in the simulator first and linearise again."""
    say("searching for what is missing")
    own = simulator.parameters()
    evidence = gather(simulator, prepared, flags, seed=seed)
    itself = own_error.known(simulator, prepared[0].measured_acceleration, seed)
    if itself is not None:
        say("learning the simulator's own error from the recordings it keeps")
        evidence = own_error.allow_for(evidence, itself)
    elif not own:
        evidence = replace(evidence, own_error=own_error.UNKNOWN)
    search = Search(evidence, exclude=exclude)
    guess = first_guess(search)
    change = {p: guess.change(p) for p in search.parameters if p in own}
    if any(abs(c) > RETUNE for c in change.values()):
        say("searching around the refitted parameters")
        moved = {p: float(np.clip(c, *RETUNE_RANGE)) for p, c in change.items() if abs(c) > 0.005}
        tuned = simulator.with_parameters({p: own[p] * (1 + c) for p, c in moved.items()})
        evidence = gather(tuned, prepared, flags, seed=seed, moved=moved)
        search = Search(evidence, exclude=exclude)
    explanation = explain(search)
    return evidence, explanation


def _overall(found: Sequence[findings.Finding]) -> str:
    if not found:
        return "nothing_missing"
    explaining = [f for f in found if f.data["share_of_explainable_error"] > 0]
    return str((explaining or found)[0].data["kind"])


def _verdict(
    kind: str,
    found: Sequence[findings.Finding],
    segments: list[dict[str, Any]],
    regimes: list[dict[str, Any]],
    fit: dict[str, Any],
    data: dict[str, Any],
    caveats: list[str],
) -> dict[str, Any]:
    return {
        "schema": 1,
        "verdict": kind,
        "findings": [f.data for f in found],
        "segments": segments,
        "regimes": regimes,
        "fit": fit,
        "data": data,
        "caveats": caveats,
    }


def _same_signals(simulator: Simulator, recordings: Sequence[Recording]) -> None:
    if not recordings:
        raise InputError("there is no recording to compare with; give at least one bag with data in it")
    need = {*simulator.interface.u, *simulator.interface.w}
    for r in recordings:
        missing = sorted(name for name in need if name not in r.channels)
        if missing:
            raise InputError(
                f"recording '{r.name}' lacks {', '.join(missing)}, which the simulator needs; "
                "record it or use another simulator"
            )
        for name in ("engine_command", "brake_command"):
            here, there = r.interface.unit(name), simulator.interface.unit(name)
            if name in need and here != there:
                raise InputError(
                    f"recording '{r.name}' has {name} in {here}, the simulator in {there}; "
                    "import it with the simulator's unit"
                )
        if abs(r.dt - simulator.dt) > 1e-6:
            raise InputError(
                f"recording '{r.name}' is at {1 / r.dt:g} Hz, the simulator at {1 / simulator.dt:g} Hz; "
                "resample or retrain"
            )


def _with_held_out(
    fit: list[Recording], held: list[Recording], dt: float
) -> tuple[list[Recording], list[bool], list[str]]:
    """Recordings and which of them are held out; where none was given, the last part is set aside."""
    if held:
        return fit + held, [False] * len(fit) + [True] * len(held), []
    if len(fit) >= 4:
        count = max(1, round(HELD_OUT_SHARE * len(fit)))
        return (
            fit,
            [False] * (len(fit) - count) + [True] * count,
            [f"no held-out recordings were given: the last {count} were set aside"],
        )
    pieces, flags = [], []
    for r in fit:
        cut = int(len(r) * (1 - HELD_OUT_SHARE))
        if (len(r) - cut) * dt < LEAST_S:
            pieces.append(r)
            flags.append(False)
            continue
        pieces += [replace(r.piece(0, cut)), replace(r.piece(cut, len(r)))]
        flags += [False, True]
    note = (
        "few recordings and none held out: the last 30 % of each was set aside, "
        "so what is claimed holds for the same drives only"
    )
    return pieces, flags, [note]


def _unusable(prepared: Sequence[Prepared], rejected: Sequence[data_checks.Rejection]) -> str | None:
    """Why nothing can be said from the recordings that are not held out, or None."""
    seconds = sum(float(p.valid.sum()) * p.dt for p in prepared)
    if seconds < LEAST_S:
        if rejected:
            most = rejected[0]
            why = f"{most.rule} ({most.samples} samples)"
            return f"only {seconds:.0f} s of usable driving; most was set aside because: {why}"
        return f"only {seconds:.0f} s of usable driving: record at least several minutes above walking pace"
    speed = np.concatenate([p.y[p.valid, 1] for p in prepared])
    if np.std(speed) < 0.3:
        return (
            "the speed is constant throughout, so no force can be told from another: "
            "accelerate, brake and coast between 5 and 25 m/s"
        )
    return None


def write(mismatch: Mismatch, out: Path) -> None:
    """Write verdict.json, profiles.csv, figures, report.html and simulator/ under `out`, all or nothing."""
    from deeptruck_model.mismatch import report

    out.parent.mkdir(parents=True, exist_ok=True)
    try:
        temporary = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    except OSError as error:
        raise InputError(f"cannot write to {out.parent}: {error.strerror}; choose another --out") from None
    try:
        (temporary / "verdict.json").write_text(json.dumps(_plain(mismatch.verdict), indent=1))
        if mismatch.evidence is not None:
            _write_profiles(mismatch, temporary / "profiles.csv")
        if mismatch.corrected is not None:
            mismatch.corrected.save(temporary / "simulator")
        report.write(mismatch, temporary)
        _replace(temporary, out)
    except OSError as error:
        raise InputError(
            f"cannot write to {out}: {error.strerror}; free some space or choose another --out"
        ) from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _replace(temporary: Path, out: Path) -> None:
    """Put the new results where older ones of this tool stood; anything else there stays and is an error."""
    if out.exists():
        if any(out.iterdir()) and not (out / "verdict.json").exists():
            raise InputError(f"{out} exists and holds other files; choose an empty or new --out")
        shutil.rmtree(out)
    temporary.chmod(0o755)
    temporary.rename(out)


def _write_profiles(m: Mismatch, path: Path) -> None:
    """The force of each finding along time and distance, one row a second, as specific force and as slope."""
    e = m.evidence
    assert e is not None
    every = max(1, round(1.0 / e.dt))
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["recording", "time_s", "distance_m", "name", "value"])
        for f in m.findings:
            if f.cause is None:
                continue
            for s in e.stretches:
                for k in range(s.start, s.stop - every + 1, every):
                    force = float(f.cause.force[k : k + every].mean())
                    value = -force / 9.80665 if f.cause.effect == "road_grade" else force * e.mass
                    rows.writerow(
                        [
                            s.name,
                            f"{e['time'][k]:.2f}",
                            f"{e['distance'][k]:.1f}",
                            f.cause.effect,
                            f"{value:.6g}",
                        ]
                    )


def _plain(x: Any) -> Any:
    """JSON data without NaN, infinities and numpy types."""
    if isinstance(x, dict):
        return {str(k): _plain(v) for k, v in x.items()}
    if isinstance(x, (list, tuple)):
        return [_plain(v) for v in x]
    if isinstance(x, (bool, np.bool_)):
        return bool(x)
    if isinstance(x, (int, np.integer)):
        return int(x)
    if isinstance(x, (float, np.floating)):
        return float(x) if np.isfinite(x) else None
    return x


def apply(directory: Path, out: Path) -> None:
    """Copy the corrected simulator of a run to `out`. Raises InputError without a passed validation."""
    try:
        verdict = json.loads((directory / "verdict.json").read_text())
    except (OSError, json.JSONDecodeError):
        raise InputError(
            f"{directory} holds no readable verdict.json; "
            f"run 'deeptruck-model mismatch --out {directory}' first"
        ) from None
    if not verdict.get("fit", {}).get("validated"):
        raise InputError(
            f"{directory} has no passed validation (held-out error did not improve), so it is not applied; "
            "record more"
        )
    if out.exists():
        raise InputError(f"{out} exists already; choose a new --out")
    shutil.copytree(directory / "simulator", out)


__all__ = ["PARAMETERS", "Mismatch", "apply", "find_mismatch", "write"]
