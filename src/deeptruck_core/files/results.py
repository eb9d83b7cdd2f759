"""Result folders: complete or absent, and never in place of what another command wrote.

A result is written to the draft `.NAME.unfinished` next to it and renamed when it is complete. A marker in
the folder names the command. A command replaces only a folder with its own marker, as a whole, and only with
--overwrite.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from deeptruck_core.errors import InputError
from deeptruck_core.files.lock import ELSEWHERE, reserved
from deeptruck_core.files.single import ADVICE, RENAME, advice, aside, check_free, check_writable, removing

OVERWRITE_HELP = "Replace an older result of this command, with all that lies in its folder, by the new one."
MARKER = ".deeptruck.json"
kept: list[Path] = []  # drafts that this process left, with a file to go on from


@dataclass(frozen=True)
class Result:
    """The kind of a folder that one command writes.

    `what` is its name in messages, with article: "a mismatch result"; it is unique among commands.
    `elsewhere` is the advice in messages to choose another path. A draft with a file of one of the names in
    `resumes_from` is kept where the run fails, so that it can be resumed.
    """

    what: str
    elsewhere: str = ELSEWHERE
    resumes_from: tuple[str, ...] = ()

    def check(self, out: Path, *, overwrite: bool = False, resume: bool = False) -> None:
        """Raises InputError unless this command may write `out`: it is new, an empty folder or, with
        `overwrite`, an older result of this command; and its draft has nothing to `resume`, or that is meant.
        Nothing is changed."""
        if out.name in ("", ".."):
            raise InputError(f"{out} is no new folder's name; {self.elsewhere}")
        draft = unfinished(out)
        check_writable(out, f"{draft.name}.99", self.elsewhere)
        check_outside(out, self.elsewhere)
        if out.is_symlink():
            raise InputError(f"{out} is a symbolic link; give the folder it points to, {out.resolve()}")
        if out.exists() and not out.is_dir():
            raise InputError(f"{out} is a file; {self.elsewhere}")
        if os.path.ismount(out):
            raise InputError(f"{out} is a mount point, which nothing can replace; give a new folder in it")
        if os.path.lexists(draft) and not self.marked(draft):
            raise InputError(f"{draft} is no unfinished work on {self.what}; move it, or {self.elsewhere}")
        if self.begun(out) and not resume and not overwrite:
            raise InputError(
                f"{out} was begun and not finished (in {draft}); add --resume to go on with it, or "
                "--overwrite to begin anew"
            )
        names = sorted(path.name for path in out.iterdir()) if out.is_dir() else []
        command, _ = _marker(out)
        if names and command is None:
            raise InputError(
                f"{out} holds {names[0]} but no {MARKER} that can be read, which says what command wrote it; "
                f"{self.elsewhere}, or remove it yourself"
            )
        if names and command != self.what:
            raise InputError(f"{out} holds {command}, not {self.what}; {self.elsewhere}, or remove it")
        if names and not overwrite:
            raise InputError(f"{out} holds {self.what} already; {self.elsewhere}, or add --overwrite")

    def begun(self, out: Path) -> bool:
        """Whether an earlier run for `out` left work that can be resumed."""
        return any((unfinished(out) / name).is_file() for name in self.resumes_from)

    @contextmanager
    def replacing(self, out: Path, *, overwrite: bool = False, resume: bool = False) -> Iterator[Path]:
        """A draft folder that takes the place of `out` if the block succeeds; with `resume` that of an
        earlier run, if there is one.

        Raises InputError as `check` does, where another run is writing `out`, and on a full disk. If
        something else appeared at `out` meanwhile, the new result is kept as NAME.new.
        """
        out = _straight(out)
        draft = unfinished(out)

        def leave() -> None:
            if self.begun(out):
                kept.append(draft)
            else:
                shutil.rmtree(draft, ignore_errors=True)

        with reserved(out, self.elsewhere):
            self.check(out, overwrite=overwrite, resume=resume)
            try:
                if not resume:
                    shutil.rmtree(draft, ignore_errors=True)
                with removing(leave):
                    draft.mkdir(parents=True, exist_ok=True)
                    self.mark(draft, at_work=True)
                    yield draft
                    self.mark(draft)
                    self._publish(draft, out, overwrite)
            except OSError as error:
                resumes = "make room and go on with --resume" if self.resumes_from else ADVICE
                raise InputError(
                    f"cannot write {out}: {error.strerror or error}; {advice(error, resumes)}"
                ) from None

    @contextmanager
    def in_place(self, out: Path) -> Iterator[None]:
        """Lock `out` for work that continues there from run to run, with files that are complete
        individually. Raises InputError as `check` with `overwrite`."""
        out = _straight(out)
        with reserved(out, self.elsewhere):
            self.check(out, overwrite=True)
            try:
                out.mkdir(parents=True, exist_ok=True)
                self.mark(out, at_work=True)
            except OSError as error:
                raise InputError(f"cannot write {out}: {error.strerror}; {advice(error)}") from None
            yield

    @contextmanager
    def recording(
        self, out: Path, *, overwrite: bool = False, whole: Callable[[Path], bool]
    ) -> Iterator[None]:
        """Let the block write `out` itself, as a recorder does, whose unfinished work is worth keeping.

        An older result is NAME.old meanwhile: it is removed if the new one is `whole`, comes back if there is
        none, and is kept otherwise. Raises InputError as `check` does, and where another run writes `out`.
        """
        out = _straight(out)
        with reserved(out, self.elsewhere):
            self.check(out, overwrite=overwrite)
            older = aside(out.with_name(f"{out.name}.old"))
            try:
                with suppress(FileNotFoundError):
                    out.rename(older)
                yield
            finally:
                if older.exists() and not os.path.lexists(out):
                    older.rename(out)
                elif older.exists() and whole(out):
                    _remove(older)
                elif older.exists():
                    _note(f"{out} is not finished; the older one is kept as {older}")

    def mark(self, folder: Path, *, at_work: bool = False) -> None:
        """Write the marker of a finished folder, or of one in which this command is at work; may
        raise OSError."""
        (folder / MARKER).write_text(json.dumps({"what": self.what, "at_work": at_work}) + "\n")

    def marked(self, folder: Path) -> bool:
        """Whether `folder` has a marker of this command."""
        return not folder.is_symlink() and _marker(folder)[0] == self.what

    def _publish(self, draft: Path, out: Path, overwrite: bool) -> None:
        """Rename a finished draft to `out` if that is still free, else to NAME.new. An older result is
        NAME.old until then."""
        older = aside(out.with_name(f"{out.name}.old"))
        try:
            self.check(out, overwrite=overwrite, resume=True)
            with suppress(FileNotFoundError):
                out.rename(older)
            draft.rename(out)
        except BaseException as error:  # also where the user interrupts it
            if older.exists() and not out.exists():
                older.rename(out)
            if not draft.exists():
                raise
            place = draft.rename(aside(out.with_name(f"{out.name}.new")))
            says = f"the new one is whole, it is kept as {place}"
            if isinstance(error, InputError | OSError):
                raise InputError(f"{error}; {says}") from None
            _note(says)
            raise
        _remove(older)


def check_new(path: Path) -> None:
    """Raises InputError if the single file `path` exists, cannot be written, or would be added to a finished
    result; nothing is changed."""
    check_free(path)
    check_outside(path, RENAME)


def check_outside(path: Path, elsewhere: str = ELSEWHERE) -> None:
    """Raises InputError if `path` would be added to a finished result."""
    for folder in path.absolute().parents:
        command, finished = _marker(folder)
        if finished:
            raise InputError(f"{path} would lie in {folder}, {command}; {elsewhere}")


def unfinished(out: Path) -> Path:
    """Path of the draft of `out`."""
    return out.parent / f".{out.name}.unfinished"


def is_finished(folder: Path) -> bool:
    """Whether a folder holds a complete result."""
    return _marker(folder)[1]


def _marker(folder: Path) -> tuple[str | None, bool]:
    """The command that wrote a folder, None without a readable marker, and whether it has finished it."""
    marker = folder / MARKER
    try:
        content = {} if marker.is_symlink() else json.loads(marker.read_text())
        return str(content["what"]), not content.get("at_work", False)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None, False


def _straight(out: Path) -> Path:
    """The same path without '..', because 'a/../a' does not exist while a is being renamed."""
    return Path(os.path.realpath(out.parent)) / out.name if ".." in out.parts else out


def _remove(older: Path) -> None:
    shutil.rmtree(older, ignore_errors=True)
    if older.exists():
        _note(f"{older} cannot be removed whole; remove it yourself")


def _note(text: str) -> None:
    print(f"note: {text}", file=sys.stderr)
