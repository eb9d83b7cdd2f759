"""A file that a command writes anew whenever its work goes on, in a folder that it holds."""

from __future__ import annotations

import sys
from pathlib import Path

from deeptruck_model.files import ledger
from deeptruck_model.files.single import aside, write


def rewrite(path: Path, content: bytes) -> None:
    """Write a file of work that goes on. What stands there and is not as this command left it is the user's:
    it is set aside first, beside the folder, and said. Raises InputError where it cannot be written."""
    if path.is_file() and not _is_ours(path, content):
        kept = aside(path.parent.with_name(f"{path.parent.name}.{path.name}.before"))
        path.rename(kept)
        print(f"note: {path} was changed since this command wrote it; it is kept as {kept}", file=sys.stderr)
    write(path, content)
    ledger.note_written(path)


def _is_ours(path: Path, content: bytes) -> bool:
    known = ledger.written_last(path)
    return (known is not None and known == ledger.print_of(path)) or path.read_bytes() == content
