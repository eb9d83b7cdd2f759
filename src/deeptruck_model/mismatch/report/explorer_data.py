"""What the page's explorer draws: the channels of every drive, the simulated speed and the missing force."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.signals import SPEED, Said, Speed
from deeptruck_model.mismatch.correction.fit_result import Errors
from deeptruck_model.mismatch.report.found import Mismatch
from deeptruck_model.mismatch.residual.evidence import DriveRows, Evidence, unit

MOST_ROWS = 60000  # of all drives together; more are averaged: 1 h 40 min at ten samples a second
AROUND_S = 20.0  # of the run that is shown first on either side
LEAST_OFF = 0.05  # m/s of a free run: two lines that differ less are one to the eye
CODES = 65534  # that a value is rounded to, of the range of its column
SPEEDS = ("speed", "simulated speed", "corrected speed")
UNITS = {"missing": "m/s²", "explained": "m/s²", **dict.fromkeys(SPEEDS, "m/s")}
DRAWN_FINER = ("speed", "time", "place")  # signals that have the samples of the recording, or are not drawn


@dataclass(frozen=True)
class Run:
    """The free run of the simulator as given that is off most, as the page shows it first."""

    drive: str
    start_s: float
    end_s: float
    says: str


def worst(found: Mismatch) -> Run | None:
    """The free run that is off most; None if none is off by LEAST_OFF."""
    best, most = None, LEAST_OFF
    for key, held_out in (("before", True), ("fitted", False)):
        errors, drives = found.errors.get(key), _of(found, held_out)
        if errors is None or not len(errors.speed):
            continue
        rms = np.sqrt(np.mean(errors.speed**2, axis=1))
        k = int(rms.argmax())
        if rms[k] > most:
            drive, dt = drives[errors.recording[k]][1], found.prepared[0].dt
            start_s = drive.start_s + dt * float(errors.start[k])
            end_s, most = start_s + dt * errors.speed.shape[1], float(rms[k])
            when = f"Farthest off in {drive.name}, {start_s:.0f} to {end_s:.0f} s, by "
            best = Run(drive.name, start_s, end_s, Said(when, Speed(most), " (rms) in a free run."))
    return best


def text(found: Mismatch, e: Evidence, first: Run | None) -> str:
    """All drives and channels as one JSON text that can stand within a script element.

    Recorded channels and free runs have the samples of the recording, what is missing and signals of the
    comparison its longer steps.
    """
    v, dt = found.result, found.prepared[0].dt
    per = -(-sum(len(p.recording) for p in found.prepared) // MOST_ROWS)
    forces = [f.force for f in v.findings if f.force is not None]
    slow = {"missing": e.residual} | ({"explained": np.sum(forces, axis=0)} if forces else {})
    slow = {n: np.where(e.valid, x, np.nan) for n, x in slow.items()}
    slow |= {n: x for n, x in e.signals.items() if ":" not in n and n not in DRAWN_FINER}
    drives: list[dict[str, Any]] = [
        {
            "name": s.name,
            "start": round(s.start_s, 2),
            "seconds": round((s.stop - s.start) * e.dt, 2),
            "columns": {
                **{n: packed(x[s.rows], e.dt, 1) for n, x in slow.items() if np.isfinite(x[s.rows]).any()},
                **{n: packed(x, dt, per) for n, x in _recorded(found, k, s.held_out).items()},
            },
        }
        for k, s in enumerate(e.drives)
        if s.stop - s.start > 2
    ]
    names = list(dict.fromkeys(n for d in drives for n in d["columns"]))
    command = "brake_command" if v.findings and v.findings[0].family == "brakes" else "engine_command"
    content = {
        "drives": drives,
        "events": [{"drive": x.recording, "from": x.start_s, "to": x.end_s} for x in v.events],
        "segments": [{"drive": s.recording, "from": s.start_s, "to": s.end_s} for s in v.segments],
        "first": first and {
            "drive": first.drive, "from": max(first.start_s - AROUND_S, 0.0), "to": first.end_s + AROUND_S,
        },
        "units": {n: UNITS.get(n) or unit(n, e.command_units) for n in names},
        "channel": command if command in names else "missing",
    }  # fmt: skip
    return json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _of(found: Mismatch, held_out: bool) -> list[tuple[int, DriveRows]]:
    """The drives that are held out, or those that are fitted, with their place among all."""
    drives = found.evidence.drives if found.evidence is not None else ()
    return [(k, s) for k, s in enumerate(drives) if s.held_out == held_out]


def _recorded(found: Mismatch, k: int, held_out: bool) -> dict[str, Array]:
    """Recorded channels (n,) of the drive `k`, and the speed of free runs along it, m/s, NaN between them."""
    p = found.prepared[k]
    out = {n: x for n, x in p.recording.channels.items() if np.ndim(x) == 1} | {"speed": p.y[:, SPEED]}
    place = [i for i, _ in _of(found, held_out)].index(k)
    runs = {SPEEDS[1]: "before", SPEEDS[2]: "after"} if held_out else {SPEEDS[1]: "fitted"}
    for name, key in runs.items():
        if key in found.errors:
            out[name] = out["speed"] + along(found.errors[key], place, len(p.recording))
    return {n: x for n, x in out.items() if np.isfinite(x).any()}


def along(errors: Errors, place: int, length: int) -> Array:
    """Speed errors (length,) of the free runs along one recording; where two meet, of the one that began
    earlier in the list."""
    out = np.full(length, np.nan)
    for k in np.flatnonzero(errors.recording == place)[::-1]:
        start = errors.start[k]
        out[start : start + errors.speed.shape[1]] = errors.speed[k]
    return out


def packed(x: NDArray[Any], dt: float, per: int) -> dict[str, Any]:
    """A column as 16 bit codes in base64, least byte first: `low` + `by` times the code, 65535 where nothing
    is known. Of `per` samples the mean; `step` in s."""
    rows = len(x) // per * per
    blocks = np.asarray(x[:rows], np.float64).reshape(-1, per)
    known = np.isfinite(blocks)
    count = known.sum(axis=1)
    means = np.where(known, blocks, 0.0).sum(axis=1) / np.maximum(count, 1)
    some = means[count > 0]
    low, high = (float(some.min()), float(some.max())) if len(some) else (0.0, 0.0)
    by = (high - low) / CODES
    codes = np.where(count > 0, np.round((means - low) / (by or 1.0)), CODES + 1).astype("<u2")
    return {
        "step": round(per * dt, 4),
        "low": low,
        "by": by,
        "codes": base64.b64encode(codes.tobytes()).decode(),
    }
