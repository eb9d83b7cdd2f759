"""A file that is there as a whole or not at all."""

from __future__ import annotations

from pathlib import Path

from deeptruck_model.errors import InputError


def write(path: Path, content: bytes, advice: str = "make room or choose another --out") -> None:
    """Write beside `path` and rename, folders made: a full disk or a kill leaves what was there before.

    Raises InputError with one line, which ends with `advice`, where that cannot be written.
    """
    unfinished = path.with_name(f".{path.name}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished.write_bytes(content)
        unfinished.replace(path)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}; {advice}") from None
    finally:
        _remove(unfinished)


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError:  # its folder is none, or cannot be written: then there is nothing to remove
        return
