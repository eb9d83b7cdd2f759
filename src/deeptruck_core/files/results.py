"""Result folders: complete or absent, and never in place of what the command did not write.

A result is written to the draft `.NAME.unfinished` next to it and renamed when complete. Its marker names the
command and the files that were written; an older result is replaced only with --overwrite, after all other
checks, if it holds these files and no other. An edit of one of them is not detected.

NAME.new         a complete result whose name was taken at the end, or a recording in place of an older one
NAME.old         the older result while it is replaced; it stays if its recorder never finished it
NAME.unfinished  the draft of a killed run that was not resumed
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from deeptruck_core.errors import InputError
from deeptruck_core.files.lock import ELSEWHERE, free, reserved, writing
from deeptruck_core.files.single import ADVICE, RENAME, advice, aside, check_free, check_writable, removing
from deeptruck_core.reading import typed

OVERWRITE_HELP = "Replace what this command wrote there, your edits in it too, once the new one is complete."
MARKER = ".deeptruck.json"
ANY = ("**/*",)
kept: list[Path] = []  # drafts that this process left, with a file to go on from


@dataclass(frozen=True)
class Marker:
    """The command that made a folder, and the files that it wrote, relative to the folder; None while it is
    at work there."""

    what: str
    files: tuple[str, ...] | None

    @staticmethod
    def read(folder: Path) -> Marker | None:
        """The marker in `folder`; None if there is no readable one."""
        path = folder / MARKER
        try:
            if path.is_symlink() or not path.is_file():
                return None
            content = json.loads(path.read_text())
            listed = None if content.get("at_work") else content["files"]
            return Marker(str(content["what"]), None if listed is None else tuple(map(str, listed)))
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None


@dataclass(frozen=True)
class Result:
    """The kind of a folder that one command writes.

    `what` is its name in messages, with article: "a mismatch result"; it is unique among commands.
    `elsewhere` is the advice in messages to choose another path. `resumes_from` are patterns of files from
    any of which unfinished work can be resumed.
    """

    what: str
    elsewhere: str = ELSEWHERE
    resumes_from: tuple[str, ...] = ANY

    def check(self, out: Path, *, overwrite: bool = False) -> bool:
        """Whether an older result of this kind exists at `out`; called before anything is computed or read.

        Raises InputError for a link, a file, a path that cannot be written, a folder without a marker or with
        that of another command, a file that this command did not write (named), an older result without
        `overwrite`, or another run that is writing there.
        """
        out = _straight(out)
        free(out, self.elsewhere)
        return self._older(out, overwrite) is not None

    def check_start(self, out: Path, *, resume: bool = False, overwrite: bool = False) -> None:
        """Like `check`, for a command whose unfinished work can be resumed: also raises InputError for such
        work without `resume` or `overwrite`."""
        self.check(out, overwrite=overwrite)
        if resume:
            self._check_draft(unfinished(out))
        elif self.begun(out) and not overwrite:
            raise InputError(
                f"{out} was begun and not finished (in {unfinished(out)}); add --resume to go on with it, or "
                "--overwrite to begin anew"
            )

    def begun(self, out: Path) -> bool:
        """Whether an earlier run for `out` left work that can be resumed."""
        return _holds(unfinished(out), self.resumes_from)

    @contextmanager
    def replacing(self, out: Path, *, overwrite: bool = False) -> Iterator[Path]:
        """A draft folder that replaces `out` if the block succeeds, and is removed otherwise.

        `out` is locked against other runs until then. Raises InputError as `check` does, on a full disk, and
        if something else appeared at `out` meanwhile; the new result is then kept as NAME.new.
        """
        with self._drafted(_straight(out), overwrite, False, (), ADVICE) as draft:
            yield draft

    @contextmanager
    def going_on(self, out: Path, *, overwrite: bool = False, resume: bool = True) -> Iterator[Path]:
        """Like `replacing`, but if the block fails or is killed, a draft with a file of `resumes_from` is
        kept. The block finds it again with `resume`; otherwise it is set aside as NAME.unfinished."""
        cure = "make room and go on with --resume"
        with self._drafted(_straight(out), overwrite, resume, self.resumes_from, cure) as draft:
            yield draft

    @contextmanager
    def in_place(self, out: Path) -> Iterator[None]:
        """Lock `out` for work that continues there from run to run, with files that are complete
        individually. Raises InputError as `check` does, except for an older result, with which the work
        continues."""
        with self._held(out, overwrite=True):
            if not self.marked(out):
                self.mark(out)
            yield

    @contextmanager
    def recording(
        self, out: Path, *, overwrite: bool = False, whole: Callable[[Path], bool]
    ) -> Iterator[Path]:
        """A folder for a writer whose unfinished work is worth keeping, such as a recorder.

        It is `out`, or NAME.new next to an older result that is kept until the new one is `whole`. The writer
        locks and marks the folder. A new result that is incomplete is kept, and a message says so. Raises
        InputError as `check` does.
        """
        out = _straight(out)
        older = self.check(out, overwrite=overwrite)
        with writing(out, self.elsewhere) if older else reserved(out, self.elsewhere):
            self._older(out, overwrite and older)  # another run may have written it meanwhile
            if not older:
                with suppress(FileNotFoundError):
                    out.rmdir()  # an empty one
                yield out
                return
            newer = aside(out.with_name(f"{out.name}.new"))
            try:
                yield newer
            finally:
                if newer.exists() and whole(newer):
                    self._publish(newer, out, overwrite)
                elif newer.exists():
                    _note(
                        f"{out} is the older one; the new one is not finished, it is kept as {newer}: "
                        f"'deeptruck-model repair {typed(newer)}' mends it"
                    )

    def mark(self, folder: Path, files: Iterable[str] | None = None) -> None:
        """Write the marker of a finished folder with these `files`, or of one in which this command is at
        work. Raises OSError."""
        content = {"what": self.what, "files": None if files is None else sorted({*files} - {MARKER})}
        marker = folder / MARKER
        if marker.is_symlink():  # somebody else's, whose file stays as it is
            marker.unlink()
        marker.write_text(json.dumps(content, indent=1) + "\n")

    def marked(self, folder: Path) -> bool:
        """Whether `folder` has a marker of this command."""
        known = Marker.read(folder)
        return known is not None and known.what == self.what

    @contextmanager
    def _held(self, out: Path, overwrite: bool) -> Iterator[None]:
        """Lock `out` against other runs within the block; a new name is occupied by an empty folder
        meanwhile."""
        self.check(out, overwrite=overwrite)
        new = not out.exists()

        def remove_empty() -> None:
            with suppress(OSError):  # it holds what was written
                if new:
                    out.rmdir()

        with removing(remove_empty):
            try:
                out.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputError(f"cannot write {out}: {error.strerror}; {advice(error)}") from None
            with writing(out, self.elsewhere):
                self._older(out, overwrite)  # another run may have written it meanwhile
                yield

    @contextmanager
    def _drafted(
        self, out: Path, overwrite: bool, resume: bool, resumes_from: tuple[str, ...], where_full: str
    ) -> Iterator[Path]:
        """A draft that replaces `out` if the block succeeds; otherwise it is removed, unless it holds a file
        of `resumes_from` or was there before."""
        draft = unfinished(out)

        def leave() -> None:
            if _holds(draft, resumes_from):
                kept.append(draft)
            elif new and not is_finished(draft):
                shutil.rmtree(draft, ignore_errors=True)

        with self._held(out, overwrite):
            if resume:
                self._check_draft(draft)
            try:
                if not resume and {path.name for path in _files(draft)} - {MARKER}:
                    place = draft.rename(aside(out.with_name(f"{out.name}.unfinished")))
                    _note(f"what a run of {out} had begun is kept as {place}; remove it")
                new = not (resume and draft.exists())
                with removing(leave):
                    draft.mkdir(exist_ok=True)
                    self.mark(draft)
                    yield draft
                    self.mark(draft, (_name(path, draft) for path in _files(draft)))
                    self._publish(draft, out, overwrite)
            except OSError as error:
                cure = advice(error, where_full)
                raise InputError(f"cannot write {out}: {error.strerror or error}; {cure}") from None

    def _check_draft(self, draft: Path) -> None:
        known = Marker.read(draft)
        if known is not None and known.what != self.what:
            raise InputError(f"{draft} is unfinished work on {known.what}; move it, or {self.elsewhere}")

    def _publish(self, draft: Path, out: Path, overwrite: bool) -> None:
        """Rename a finished folder to `out` if that is still free; else keep it as NAME.new.

        An older result is first renamed to NAME.old, restored if the new one cannot be put in place, and
        afterwards removed file by file, so that a file added meanwhile is kept and reported. Raises
        InputError if `out` is not free.
        """
        old, older = None, None
        try:
            if (older := self._older(out, overwrite)) is not None:
                old = aside(out.with_name(f"{out.name}.old"))
                out.rename(old)
            draft.rename(out)
        except BaseException as error:  # also where the user interrupts it
            if old is not None and old.exists() and not out.exists():
                old.rename(out)
            if not draft.exists():
                raise
            place = draft
            with suppress(OSError):
                if draft == unfinished(out):
                    place = draft.rename(aside(out.with_name(f"{out.name}.new")))
            says = f"the new one is whole, it is kept as {place}"
            if isinstance(error, InputError):
                raise InputError(f"{error}; {says}") from None
            if isinstance(error, OSError):
                raise InputError(f"cannot write {out}: {error.strerror or error}; {says}") from None
            _note(says)
            raise
        if old is None or older is None:
            return
        if older.files is None:
            _note(f"the older {out.name} was not finished; it is kept as {old}, remove it")
        elif not remove(old, older.files):
            _note(f"{old} keeps what this command did not write")

    def _older(self, out: Path, overwrite: bool) -> Marker | None:
        """The marker of an older result at `out` that may be replaced; None if there is none."""
        if out.name in ("", ".."):
            raise InputError(f"{out} is no new folder's name; {self.elsewhere}")
        draft = unfinished(out)
        check_writable(out, f"{draft.name}.99", self.elsewhere)
        if out.is_symlink():
            raise InputError(f"{out} is a symbolic link; give the folder it points to, {out.resolve()}")
        if out.exists() and not out.is_dir():
            raise InputError(f"{out} is a file; {self.elsewhere}")
        if os.path.ismount(out):
            raise InputError(
                f"{out} is a mount point, which no result can take the place of; give a new folder in it"
            )
        if os.path.lexists(draft) and (draft.is_symlink() or not draft.is_dir()):
            raise InputError(f"{draft} is no folder, but unfinished work is kept there; move it")
        check_outside(out, self.elsewhere)
        if not out.is_dir() or not any(out.iterdir()):
            return None
        older = self._owned(out)
        if not overwrite:
            raise InputError(f"{out} holds {self.what} already; {self.elsewhere}, or add --overwrite")
        for folder in (out, *(path for path in out.rglob("*") if path.is_dir())):
            if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
                raise InputError(f"{folder} may not be changed, so it cannot be replaced; {self.elsewhere}")
        return older

    def _owned(self, folder: Path) -> Marker:
        """The marker of a folder. Raises InputError if there is none or that of another command, and, naming
        it, for a file that the marker does not list."""
        marker = Marker.read(folder)
        if marker is None:
            first = min((p.name for p in folder.iterdir() if p.name != MARKER), default="nothing")
            raise InputError(
                f"{folder} holds {first} but no {MARKER} that can be read, which says what this command "
                f"wrote; {self.elsewhere}, or remove it yourself"
            )
        inside = None if marker.what == self.what else marker.what
        if inside is None and marker.files is not None:
            listed = {MARKER, *marker.files}
            ways = {way.as_posix() for name in listed for way in Path(name).parents}
            inside = next(
                (
                    _name(path, folder)
                    for path in sorted(folder.rglob("*"))
                    if path.is_symlink() or _name(path, folder) not in (ways if path.is_dir() else listed)
                ),
                None,
            )
        if inside is not None:
            raise InputError(
                f"{folder} holds {inside}, which is no part of {self.what}; move it, or {self.elsewhere}"
            )
        return marker


def check_new(path: Path) -> None:
    """Raises InputError if the single file `path` exists, cannot be written, or would be added to a finished
    result; nothing is changed."""
    check_free(path)
    check_outside(path, RENAME)


def check_outside(path: Path, elsewhere: str = ELSEWHERE) -> None:
    """Raises InputError if `path` is a part of a finished result, or would be added to one."""
    for folder in path.absolute().parents:
        known = Marker.read(folder)
        if known is not None and known.files is not None:
            raise InputError(f"{path} would lie in {folder}, {known.what}; {elsewhere}")


def unfinished(out: Path) -> Path:
    """Path of the draft of `out`."""
    return out.parent / f".{out.name}.unfinished"  # '.' has no name that could be exchanged


def final(path: Path) -> Path:
    """The final name of a draft, or of a recording next to an older one; another path is unchanged."""
    return path.with_name(re.sub(r"^\.(.+)\.unfinished$|^(.+)\.new\d*$", r"\1\2", path.name))


def remove(folder: Path, names: Iterable[str]) -> bool:
    """Remove these files, the marker and the folders that become empty; returns whether nothing is left."""
    for path in [path for path in _files(folder) if _name(path, folder) in {*names, MARKER}]:
        with suppress(OSError):
            path.unlink()
    inside = sorted((p for p in folder.rglob("*") if p.is_dir() and not p.is_symlink()), reverse=True)
    for empty in (*inside, folder):
        with suppress(OSError):
            empty.rmdir()
    return not folder.exists()


def _straight(out: Path) -> Path:
    """The same path without '..', because 'a/../a' does not exist while a is being renamed."""
    return Path(os.path.realpath(out.parent)) / out.name if ".." in out.parent.parts else out


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir())


def _name(path: Path, folder: Path) -> str:
    return path.relative_to(folder).as_posix()


def is_finished(folder: Path) -> bool:
    """Whether a result folder is complete."""
    known = Marker.read(folder)
    return known is not None and known.files is not None


def _holds(folder: Path, patterns: Iterable[str]) -> bool:
    """Whether a file in `folder` matches one of the patterns."""
    return any(found.is_file() for name in patterns for found in folder.glob(name))


def _note(text: str) -> None:
    print(f"note: {text}", file=sys.stderr)
