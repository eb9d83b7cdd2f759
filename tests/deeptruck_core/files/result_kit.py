"""A kind of result, published and recorded for the tests beside this file."""

from __future__ import annotations

from pathlib import Path

from deeptruck_core import files

KIND = files.Result("a test result")


def publish(out: Path, *, overwrite: bool = False, **content: str) -> None:
    with KIND.replacing(out, overwrite=overwrite) as draft:
        for name, text in content.items():
            (draft / name).write_text(text)


def record(out: Path, content: str, *, is_whole: bool = True) -> Path:
    """Record into `out` as a recorder does; returns the folder in which it worked."""
    with KIND.recording(out, overwrite=True, whole=lambda _: is_whole) as place:
        place.mkdir()
        (place / "a").write_text(content)
        KIND.mark(place, ["a"])
    return place
