"""What the page's explorer draws: the channels of every drive, the simulated speed and the missing force."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.signals import SPEED
from deeptruck_model.mismatch.correction.fit_result import Errors
from deeptruck_model.mismatch.posterior.events import Event
from deeptruck_model.mismatch.report.found import Mismatch
from deeptruck_model.mismatch.residual.evidence import Evidence, unit
from deeptruck_model.mismatch.verdict.result import Segment
from deeptruck_model.mismatch.verdict.wording import spoken

MOST_ROWS = 60000  # of all drives together; more are averaged: 1 h 40 min at ten samples a second
AROUND_S = 20.0  # of a segment that is shown on either side
CODES = 65534  # that a value is rounded to, of the range of its column
SPEEDS = ("speed", "simulated speed", "corrected speed")


def text(found: Mismatch, e: Evidence) -> str:
    """All drives and channels as one JSON text that can stand within a script element.

    Recorded channels and free runs have the samples of the recording, what is missing and what mechanisms are
    made of the longer steps of the comparison.
    """
    v = found.result
    forces = [f.force for f in v.findings if f.force is not None]
    explained = np.sum(forces, axis=0) if forces else np.zeros(len(e))
    known = np.where(e.valid, 0.0, np.nan)
    slow = {"missing": e.residual + known} | ({"explained": explained + known} if forces else {})
    slow |= {n: x for n, x in e.signals.items() if not n.startswith("sensitivity:") and n not in _OWN}
    if v.budget is not None:
        slow |= {f"part: {spoken(p.part)}": p.force for p in v.budget.parts if len(p.force)}
    dt = found.prepared[0].dt
    per = -(-sum(len(p.recording) for p in found.prepared) // MOST_ROWS)
    drives: list[dict[str, Any]] = [
        {
            "name": s.name,
            "start": round(s.start_s, 2),
            "seconds": round((s.stop - s.start) * e.dt, 2),
            "columns": {
                **{n: packed(x[s.rows], e.dt, 1) for n, x in slow.items() if np.isfinite(x[s.rows]).any()},
                **{n: packed(x, dt, per) for n, x in _recorded(found, k, e).items()},
            },
        }
        for k, s in enumerate(e.drives)
        if s.stop - s.start > 2
    ]
    where: list[Segment | Event] = [*v.segments, *v.events]
    first = next((x for x in where[:1] if any(d["name"] == x.recording for d in drives)), None)
    names = list(dict.fromkeys(n for d in drives for n in d["columns"]))
    of_brakes = bool(v.findings) and v.findings[0].family == "brakes"
    commands = ("brake_command", "engine_command")[not of_brakes :]
    return json.dumps(
        {
            "drives": drives,
            "events": [{"drive": x.recording, "from": x.start_s, "to": x.end_s} for x in v.events],
            "segments": [{"drive": s.recording, "from": s.start_s, "to": s.end_s} for s in v.segments],
            "first": first
            and {
                "drive": first.recording,
                "from": max(first.start_s - AROUND_S, 0.0),
                "to": first.end_s + AROUND_S,
            },
            "labels": {n: n.replace("_", " ") for n in names},
            "units": {n: "m/s" if n in SPEEDS else _UNITS.get(n) or unit(n, e.command_units) for n in names},
            "channel": next((n for n in commands if n in names), "missing"),
        },
        allow_nan=False,
        separators=(",", ":"),
    ).replace("<", "\\u003c")


_OWN = ("speed", "time", "place")  # signals that are drawn with the samples of the recording, or not at all
_UNITS = {"missing": "m/s²", "explained": "m/s²"}


def _recorded(found: Mismatch, k: int, e: Evidence) -> dict[str, Array]:
    """Recorded channels (n,) of the drive `k`, and the speed of free runs along it, m/s, NaN between them."""
    p, held_out = found.prepared[k], [s.held_out for s in e.drives]
    r, place = p.recording, held_out[:k].count(held_out[k])
    out = {"speed": p.y[:, SPEED]} | {n: x for n, x in r.channels.items() if n != "speed" and np.ndim(x) == 1}
    runs = {SPEEDS[1]: "before", SPEEDS[2]: "after"} if held_out[k] else {SPEEDS[1]: "fitted"}
    for name, key in runs.items():
        if key in found.errors:
            out[name] = out["speed"] + _along(found.errors[key], place, len(r))
    return {n: x for n, x in out.items() if np.isfinite(x).any()}


def _along(errors: Errors, place: int, length: int) -> Array:
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
