"""What recordings hold: time spent over speed, acceleration and grade; channels, ranges, gaps."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.errors import InputError
from deeptruck_model.recordings.coverage_grid import ACCELERATION_EDGES, GRADE_EDGES, SPEED_EDGES
from deeptruck_model.recordings.coverage_judgement import judgement
from deeptruck_model.recordings.not_recorded import not_recorded
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.results import COVERAGE

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Coverage:
    """`seconds` (speed, acceleration, grade) is the time spent in each cell of the edges; the last grade cell
    stands for samples without a grade. What lies outside the edges counts in the outermost cells.
    `not_recorded` are the inputs that were not recorded, `accounts` what became of all that was read,
    `drives` the recordings themselves.
    """

    seconds: Array
    recordings: list[dict[str, Any]]
    not_recorded: list[dict[str, Any]]
    accounts: list[dict[str, Any]]
    drives: Sequence[Recording]

    @property
    def duration_s(self) -> float:
        """Length of all recordings together, s."""
        return float(sum(r["duration_s"] for r in self.recordings))

    @property
    def warnings(self) -> list[str]:
        """What cannot be used although a channel of that name is there, a line each."""
        empty = [
            f"{name} of '{r['name']}' holds no valid sample"
            for r in self.recordings
            for name, channel in r["channels"].items()
            if channel["mean"] is None
        ]
        if not self._commanded:
            empty.append("no recording has a valid engine_command, without which none can be trained on")
        return empty

    @property
    def _commanded(self) -> bool:
        commands = [r["channels"].get("engine_command") for r in self.recordings]
        return any(command and command["mean"] is not None for command in commands)

    @property
    def judgement(self) -> str:
        """One sentence: whether it is enough to train on, and in which conditions it is not."""
        return judgement(self.seconds, self.duration_s, self._commanded)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "judgement": self.judgement,
            "not_recorded": self.not_recorded,
            "duration_s": self.duration_s,
            "warnings": self.warnings,
            "accounts": self.accounts,
            "recordings": self.recordings,
            "occupancy": {
                "axes": ["speed", "acceleration", "grade"],
                "speed_edges": SPEED_EDGES.round(6).tolist(),
                "acceleration_edges": ACCELERATION_EDGES.round(6).tolist(),
                "grade_edges": GRADE_EDGES.round(6).tolist(),
                "without_grade": "last index of the grade axis",
                "seconds": self.seconds.round(6).tolist(),
            },
        }

    def _repr_png_(self) -> bytes:
        """By which a notebook shows it: the figure that `save` writes."""
        from deeptruck_model.recordings.coverage_figure import draw

        return draw(self)

    def save(self, folder: str | Path, *, overwrite: bool = False) -> None:
        """Write the folder with coverage.json, coverage.png and coverage.html: all or none.

        Raises InputError where something else is there, or an older coverage without `overwrite`.
        """
        from deeptruck_model.recordings.coverage_figure import draw, draw_channels
        from deeptruck_model.recordings.coverage_page import page

        told = self.to_dict()
        content = json.dumps(told, indent=1, allow_nan=False)
        with COVERAGE.replacing(Path(folder), overwrite=overwrite) as draft:
            (draft / "coverage.json").write_text(content)
            picture = draw(self)
            (draft / "coverage.png").write_bytes(picture)
            (draft / "coverage.html").write_text(
                page(told, picture, draw_channels(self.drives)), encoding="utf-8"
            )


def coverage(recordings: Sequence[Recording]) -> Coverage:
    """What the recordings hold. Raises InputError where there are none."""
    if not recordings:
        raise InputError("there is no recording to look at")
    shape = (len(SPEED_EDGES) - 1, len(ACCELERATION_EDGES) - 1, len(GRADE_EDGES))
    seconds = np.zeros(shape)
    for recording in recordings:
        seconds += _occupancy(recording, shape)
    accounts = {id(r.account): r.account.to_dict() for r in recordings if r.account is not None}
    return Coverage(
        seconds,
        [_summary(r, before) for before, r in zip((None, *recordings), recordings, strict=False)],
        [missing.to_dict() for missing in not_recorded(recordings)],
        list(accounts.values()),
        recordings,
    )


def _occupancy(recording: Recording, shape: tuple[int, int, int]) -> Array:
    speed, acceleration = recording.channels["speed"], recording.channels["acceleration"]
    grade = recording.channels.get("grade", np.full(len(recording), np.nan))
    valid = ~(np.isnan(speed) | np.isnan(acceleration))
    cells = (
        _cell(speed[valid], SPEED_EDGES),
        _cell(acceleration[valid], ACCELERATION_EDGES),
        np.where(np.isnan(grade[valid]), shape[2] - 1, _cell(np.nan_to_num(grade[valid]), GRADE_EDGES)),
    )
    flat = np.ravel_multi_index(cells, shape)
    samples = np.bincount(flat, minlength=int(np.prod(shape))).reshape(shape)
    return np.asarray(samples * recording.dt, dtype=np.float64)


def _cell(values: Array, edges: Array) -> NDArray[np.int64]:
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)


def _summary(recording: Recording, before: Recording | None) -> dict[str, Any]:
    gap = recording.gap_after(before)
    return {
        "name": recording.name,
        "start_s": recording.start_s,
        "dt": recording.dt,
        "samples": len(recording),
        "duration_s": round(len(recording) * recording.dt, 6),
        "gap_before_s": None if gap is None else round(gap, 6),
        "interface": recording.interface.to_dict(),
        "channels": {name: _range(recording, name) for name in recording.channels},
        "notes": list(recording.notes),
    }


def _range(recording: Recording, name: str) -> dict[str, Any]:
    values = recording.channels[name]
    valid = values[~np.isnan(values)]
    return {
        "unit": recording.interface.unit(name),
        "min": float(valid.min()) if len(valid) else None,
        "max": float(valid.max()) if len(valid) else None,
        "mean": float(valid.mean()) if len(valid) else None,
        "nan_share": round(1.0 - len(valid) / len(values), 6),
    }
