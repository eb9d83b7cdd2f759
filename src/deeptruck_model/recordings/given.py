"""Recordings as arguments of a Python call: recordings, or bags to read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from deeptruck_model import checks
from deeptruck_model.checks import calls
from deeptruck_model.errors import InputError
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.recordings.several import read_all

Drives: TypeAlias = Sequence[Recording] | Sequence[str | Path] | str | Path


def drives(
    given: Any, name: str = "recordings", *, rate_hz: float = 10.0, among: Any = ()
) -> list[Recording]:
    """The recordings in `given`: recordings, a bag, or several bags, which are read at `rate_hz`.

    `among` are the other arguments of the call: bags of equal name among them get distinct names. Raises
    InputError for anything else, and as `read` does.
    """
    parts = _parts(given)
    if parts is not None and all(isinstance(part, Recording) for part in parts):
        return [part for part in parts if isinstance(part, Recording)]
    if parts is not None and all(isinstance(part, str | Path) for part in parts):
        others = [part for part in _parts(among) or () if isinstance(part, str | Path)]
        return read_all(parts, rate_hz=rate_hz, among=others)
    raise InputError(
        f"{name} must be recordings, as read('monday') gives, or paths of bags, not {calls.shown(given)}"
    )


def _parts(given: Any) -> list[Any] | None:
    if isinstance(given, str | Path | Recording):
        return [given]
    return list(given) if isinstance(given, Iterable) else None


def check_paths_apart(recordings: Any, held_out: Any) -> None:
    """Raises InputError for a bag that is both fitted and held out, before any is read."""
    fitted, held = (
        [Path(part) for part in _parts(given) or () if isinstance(part, str | Path)]
        for given in (recordings, held_out)
    )
    checks.held_out(fitted, held)
