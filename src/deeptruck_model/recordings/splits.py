"""Splits recordings by time, and hashes data sets."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence

import numpy as np

from deeptruck_model.errors import InputError
from deeptruck_model.recordings.recording import Recording


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
