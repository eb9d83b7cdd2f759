"""The files of a result: which of a folder's are its parts, and how they are removed."""

from __future__ import annotations

from contextlib import suppress
from fnmatch import fnmatchcase
from pathlib import Path

from deeptruck_model.files.places import DRAFT


def fits(parts: tuple[str, ...], pattern: list[str], path: Path, exact: bool) -> bool:
    """Whether a path is what the pattern says, a folder on the way to it, or, unless `exact`, its draft."""
    on_the_way = path.is_dir() and len(parts) < len(pattern)
    whole = path.is_file() and len(parts) == len(pattern)
    return (on_the_way or whole) and all(
        fnmatchcase(part, one) or (not exact and fnmatchcase(DRAFT.sub(r"\1", part), one))
        for part, one in zip(parts, pattern, strict=False)
    )


def remove(folder: Path, files: list[str]) -> bool:
    """Remove these files and the folders that this leaves empty; tell whether nothing was left."""
    for name in files:
        with suppress(OSError):
            (folder / name).unlink()
    inside = sorted((p for p in folder.rglob("*") if p.is_dir() and not p.is_symlink()), reverse=True)
    for empty in (*inside, folder):
        with suppress(OSError):
            empty.rmdir()
    return not folder.exists()
