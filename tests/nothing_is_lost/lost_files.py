"""A place with files of the user in it, a run that fails somewhere, and what is left of both."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from deeptruck_core.files import MARKER, Result, unfinished

KIND = Result("a result")  # kinds differ in their name alone
STEPS = ("rename", "replace", "mkdir", "unlink", "rmdir", "chmod", "listdir", "scandir", "stat", "open")
ERRORS: dict[str, Callable[[], BaseException]] = {
    "full": lambda: OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)),
    "denied": lambda: PermissionError(errno.EACCES, os.strerror(errno.EACCES)),
    "interrupted": KeyboardInterrupt,
}


@contextmanager
def failing(at: int, error: str, *, after: bool) -> Iterator[None]:
    """The `at`-th call that looks at or changes the disk raises, before or after it has done its work."""
    true = {name: getattr(os, name) for name in STEPS}
    calls = 0

    def guarded(name: str) -> Callable[..., Any]:
        def call(*given: Any, **named: Any) -> Any:
            nonlocal calls
            calls += 1
            if calls != at + 1:
                return true[name](*given, **named)
            if after:  # only an interrupt comes once the work is done
                true[name](*given, **named)
                raise KeyboardInterrupt
            raise ERRORS[error]()

        return call

    try:
        for name in STEPS:
            setattr(os, name, guarded(name))
        yield
    finally:
        for name, function in true.items():
            setattr(os, name, function)


OWN = ("a_0.mcap", "metadata.yaml", "seeds/1/policy.json", "tensorboard/events.out")  # what a command writes


@dataclass
class Place:
    """A folder `root` in which the command writes `root/out`."""

    kind: Result
    root: Path
    foreign: dict[Path, str] = field(default_factory=dict)

    @property
    def out(self) -> Path:
        return self.root / "out"

    def put_older(self, *, marker: bool) -> None:
        """A finished result, as the command leaves it, or a copy without its marker."""
        self.fill(self.out, "older")
        if marker:
            self.kind.mark(self.out)

    def fill(self, folder: Path, content: str) -> None:
        for name in OWN:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(content)

    def put_foreign(self, path: Path, shape: str) -> None:
        """Something of the user's at `path`, where it is free, or in the place of a finished file of ours."""
        if shape == "in our place" and path.is_file() and path not in self.foreign:
            if path.is_relative_to(self.out) and path.name != MARKER:
                self._file(path)
            return
        if any(p.is_file() or p.is_symlink() for p in (path, *path.parents)) or path.exists():
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        number = len(self.foreign)
        if shape == "link":
            target = self._file(self.root / "elsewhere" / str(number) / "target")
            path.symlink_to(target)
        elif shape == "link to a folder":
            inside = OWN[0]
            target = self._file(self.root / "elsewhere" / str(number) / inside)
            path.symlink_to(target.parent)
        elif shape == "folder":
            self._file(path / "notes.txt")
        elif not self._takes_for_its_own(path):
            self._file(path)
            if shape == "read-only":
                path.chmod(0o444)
                path.parent.chmod(0o555)

    def _takes_for_its_own(self, path: Path) -> bool:
        """A marker, and what the command writes anew where it goes on with unfinished work."""
        draft = unfinished(self.out)
        return path.name == MARKER or path in {draft / name for name in OWN}

    def _file(self, path: Path) -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"mine {len(self.foreign)}")
        self.foreign[path] = path.read_text()
        return path

    def lost(self, says: str) -> list[Path]:
        """Files of the user that are not where they stood, nor where the messages say."""
        told = [Path(word.rstrip(";,")) for word in says.split() if word.startswith(str(self.root))]
        return [path for path, text in self.foreign.items() if not self._is_there(path, text, told)]

    def _is_there(self, path: Path, text: str, told: list[Path]) -> bool:
        places, draft = [path], unfinished(self.out)
        for folder in (self.out, draft):
            if path.is_relative_to(folder):
                places += [place / path.relative_to(folder) for place in (*told, self.out, draft)]
        return any(place.is_file() and place.read_text() == text for place in places)

    def content(self, folder: Path) -> dict[str, str]:
        """The files of the command in `folder`, by name."""
        paths = (p for p in folder.rglob("*") if p.is_file() and not p.is_symlink() and p.name != MARKER)
        found = {p.relative_to(folder).as_posix(): p.read_text() for p in paths}
        return {name: text for name, text in found.items() if not text.startswith("mine")}

    def writable_again(self) -> None:
        for path in (self.root, *self.root.rglob("*")):
            if path.is_dir() and not path.is_symlink():
                path.chmod(0o755)


@contextmanager
def place(kind: Result) -> Iterator[Place]:
    with tempfile.TemporaryDirectory() as name:
        made = Place(kind, Path(name))
        try:
            yield made
        finally:
            made.writable_again()
