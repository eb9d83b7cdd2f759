"""A kind of result, published and recorded for the tests beside this file."""

from __future__ import annotations

from pathlib import Path

from deeptruck_core import files

KIND = files.Result("a test result", resumes_from=("resume",))
OTHER = files.Result("another result")


def publish(out: Path, *, overwrite: bool = False, **content: str) -> None:
    with KIND.replacing(out, overwrite=overwrite) as draft:
        for name, text in content.items():
            (draft / name).write_text(text)


def record(out: Path, content: str, *, is_whole: bool = True) -> None:
    """Record into `out` as a recorder does."""
    with KIND.recording(out, overwrite=True, whole=lambda _: is_whole):
        out.mkdir()
        (out / "a").write_text(content)
        KIND.mark(out)
