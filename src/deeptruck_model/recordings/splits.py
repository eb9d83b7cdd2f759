"""Splits recordings by time, and hashes data sets."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence

import numpy as np

from deeptruck_core.errors import InputError
from deeptruck_model.recordings.recording import Recording

SHARED_S = 10.0  # of driving that are alike to the last digit are one drive
VARIED_M_S = 0.5  # by which the speed varies in a span that is compared
COMMANDS = ("engine_command", "brake_command")


def split(
    recordings: Sequence[Recording], fractions: tuple[float, float, float] = (0.7, 0.15, 0.15)
) -> tuple[list[Recording], list[Recording], list[Recording]]:
    """Training, validation and test parts: the first, middle and last of the driven time, never shuffled.

    A recording that contains a border is cut there; a remainder of one sample is dropped. Raises InputError
    for fractions that are negative or do not add up to 1.
    """
    if (
        not isinstance(fractions, Sequence)
        or len(fractions) != 3
        or min(fractions) < 0
        or abs(sum(fractions) - 1.0) > 1e-9
    ):
        raise InputError(f"split fractions must be three shares that add up to 1, not {fractions}")
    durations = [len(recording) * recording.dt for recording in recordings]
    borders = np.cumsum([0.0, *fractions]) * sum(durations)
    parts: tuple[list[Recording], list[Recording], list[Recording]] = ([], [], [])
    begin = 0.0
    for recording, duration in zip(recordings, durations, strict=True):
        edges = [int(np.clip(round((b - begin) / recording.dt), 0, len(recording))) for b in borders]
        edges[0], edges[-1] = 0, len(recording)
        for part, start, stop in zip(parts, edges[:-1], edges[1:], strict=True):
            if stop - start > 1:
                part.append(recording.piece(start, stop))
        begin += duration
    return parts


def refuse_shared(recordings: Sequence[Recording], held_out: Sequence[Recording] | None = None) -> None:
    """Raises InputError if two recordings share driving, see `shared`: validation would see what training
    saw, and the drive would count twice."""
    for says in shared(recordings, held_out):
        raise InputError(says)


def shared(recordings: Sequence[Recording], held_out: Sequence[Recording] | None = None) -> Iterator[str]:
    """A sentence for each recording that shares SHARED_S of driving with one before, sample for sample and
    under any name, as bags do that were uploaded twice or overlap.

    With `held_out`, only those are compared with `recordings`. Spans in which the speed hardly varies are
    alike by chance.
    """
    known: dict[tuple[float, int], Recording] = {}
    for k, r in enumerate((*recordings, *(held_out or ()))):
        length = round(SHARED_S / r.dt / 2.0)
        same, first, spans, hits = np.zeros(len(r), dtype=bool), r, 0, 0
        for span, start in _spans(r, length, 1) if held_out is None or k >= len(recordings) else ():
            spans += 1
            if other := known.get((r.dt, span)):
                same[start : start + length], first, hits = True, other, hits + 1
        if hits:  # one of `length` neighbouring spans meets a known one
            whole = hits * length > 0.9 * spans
            what = f"'{r.name}'" if whole else f"{same.sum() * r.dt:.0f} s of '{r.name}'"
            yield _says(first, r, what, held_out is not None)
        if held_out is None or k < len(recordings):
            known |= {(r.dt, span): r for span, _ in _spans(r, length, length)}


def _says(first: Recording, second: Recording, what: str, held_out: bool) -> str:
    if held_out:
        of = "" if first.name == second.name else f" is the drive '{first.name}', which"
        return (
            f"{what}{of} is to be fitted and held out; hold out drives that are not fitted, or none: "
            "then a part of them is set aside"
        )
    again = "given twice" if first.name == second.name else f"in '{first.name}' too"
    return f"{what} is {again}, as where bags were uploaded twice or overlap; give each drive once"


def _spans(r: Recording, length: int, apart: int) -> Iterator[tuple[int, int]]:
    """Hashes of spans of speed and commands, and the sample at which each begins."""
    names = ("speed", *(name for name in COMMANDS if name in r.channels))
    rows = np.round(np.column_stack([r.channels[name] for name in names]), 4)
    if len(rows) < 2 * length:
        return
    speed = np.lib.stride_tricks.sliding_window_view(rows[:, 0], length)[::apart]
    for k in np.flatnonzero(np.ptp(speed, axis=1) > VARIED_M_S):
        yield hash(rows[k * apart : k * apart + length].tobytes()), int(k) * apart


def data_hash(recordings: Sequence[Recording]) -> str:
    """SHA-256 over names, clocks, interfaces and values: equal data give equal hashes on any machine."""
    digest = hashlib.sha256()
    for recording in recordings:
        head = [recording.name, recording.dt, recording.start_s, recording.interface.to_dict()]
        digest.update(json.dumps(head, sort_keys=True).encode())
        for name in sorted(recording.channels):
            values = np.ascontiguousarray(recording.channels[name], dtype="<f8")
            digest.update(name.encode() + np.where(np.isnan(values), np.nan, values).tobytes())
    return digest.hexdigest()
