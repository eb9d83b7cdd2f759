"""Result folders: complete or absent, and never in place of a user's file.

A result is written to a draft in the same folder and renamed at the end. An older result is replaced only
with --overwrite, only after all other checks, and only if its ledger shows that the same command wrote every
file in its present state.
"""

from __future__ import annotations

import glob
import os
import secrets
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from deeptruck_model._io.reading import typed
from deeptruck_model.errors import InputError
from deeptruck_model.files import ledger, places
from deeptruck_model.files.ledger import LEDGER, Ledger, check_outside
from deeptruck_model.files.lock import ELSEWHERE, free, reserved, writing
from deeptruck_model.files.places import DRAFT, unfinished
from deeptruck_model.files.single import ADVICE, advice, aside, check_writable, removing

OVERWRITE_HELP = "Replace what this command wrote there, once the new one is whole."


@dataclass(frozen=True)
class Result:
    """The kind of a folder that one command writes.

    `what` is its name in messages, with article: "a mismatch result"; it is unique among commands. `names`
    are the files that the folder may hold while the command is at work, relative to the folder; `*` stands
    for any part of one name, never for a '/'. `elsewhere` is the advice in messages to choose another path.
    `resumes_from` are files from any of which unfinished work can be resumed.
    """

    what: str
    names: tuple[str, ...] = ()
    elsewhere: str = ELSEWHERE
    resumes_from: tuple[str, ...] = ("**/*",)

    def check(self, out: Path, *, overwrite: bool = False) -> bool:
        """Whether an older result of this kind exists at `out`; called before anything is computed or read.

        Raises InputError for a link, a file, a path that cannot be written, a folder without a ledger or with
        that of another command, a file that this command did not write or that has changed since (named), an
        older result without `overwrite`, or another run that is writing there.
        """
        out = places.straight(out)
        free(out, self.elsewhere)
        return bool(self._older(out, overwrite))

    @contextmanager
    def replacing(self, out: Path, *, overwrite: bool = False) -> Iterator[Path]:
        """A draft folder that replaces `out` if the block succeeds, and is removed otherwise.

        `out` is locked against other runs until then. Raises InputError as `check` does, on a full disk, and
        if something else appeared at `out` meanwhile; the new result is then kept as NAME.new.
        """
        out = places.straight(out)
        draft = out.with_name(f".{out.name}.{secrets.token_hex(4)}.tmp")
        with self._drafted(draft, out, overwrite, (), ADVICE):
            draft.mkdir()
            self.claim(draft)
            yield draft

    @contextmanager
    def going_on(self, out: Path, *, overwrite: bool = False, resume: bool = True) -> Iterator[Path]:
        """Like `replacing`, but if the block fails or is killed the draft is kept, to be resumed.

        It is kept if it holds a file of `resumes_from`, and always after a kill. Its name is
        `unfinished(out)`; a file that the command did not write in it causes a refusal that names the file.
        Unfinished work of a killed run is set aside unless `resume`.
        """
        out = places.straight(out)
        draft = unfinished(out)
        with self._drafted(draft, out, overwrite, self.resumes_from, "make room and go on with --resume"):
            if not resume and _holds(draft):
                kept = draft.rename(places.beside(out, "unfinished"))
                _note(
                    f"what a run of {out} had begun is kept as {kept}; remove it, or rename it to "
                    f"{draft.name} and add --resume to go on with it"
                )
            draft.mkdir(exist_ok=True)
            (draft / LEDGER).unlink(missing_ok=True)  # of a run that died as it was to publish
            yield draft

    @contextmanager
    def in_place(self, out: Path) -> Iterator[None]:
        """Lock `out` for work that continues there from run to run, with files that are complete
        individually. Raises InputError as `check` does, except for an older result, with which the work
        continues."""
        with self._held(out, overwrite=True):
            if not any(out.iterdir()):
                self.claim(out)
            yield

    @contextmanager
    def recording(
        self, out: Path, *, overwrite: bool = False, whole: Callable[[Path], bool]
    ) -> Iterator[Path]:
        """A folder for a writer whose unfinished work is worth keeping, such as a recorder.

        It is `out`, or a folder next to an older result that is kept until the new one is `whole`. The writer
        locks and signs the folder. A new result that is incomplete is kept, and a message says so. Raises
        InputError as `check` does.
        """
        out = places.straight(out)
        older = self.check(out, overwrite=overwrite)
        with writing(out, self.elsewhere) if older else reserved(out, self.elsewhere):
            self._older(out, overwrite and older)  # another run may have written it meanwhile
            self._tidy(out)
            if not older:
                with suppress(FileNotFoundError):
                    out.rmdir()  # an empty one
                yield out
                return
            newer = places.beside(out, "new")
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

    def clear(self, folder: Path, *inside: str) -> None:
        """Remove the files that this command wrote in `folder`, or in the given subfolders.

        Raises InputError for a folder that it has not claimed, or, naming it, for a file that it did not
        write; then nothing is removed.
        """
        if os.path.lexists(folder):
            _, found = self._claimed(folder)
            within = tuple(f"{name}/" for name in inside)
            _remove(folder, [name for name in found if not within or name.startswith(within)])

    def forget(self, draft: Path) -> None:
        """Remove the files that this command wrote in a draft; other files stay, and a message is printed."""
        if draft.is_dir() and not _remove(draft, self._written(draft) | {LEDGER}):
            _note(f"{draft} keeps what this command did not write")

    def signed(self, folder: Path) -> bool:
        """Whether `folder` has a ledger of this command."""
        known = ledger.read(folder)
        return known is not None and known.what == self.what

    def claim(self, folder: Path, *files: str) -> None:
        """Write the ledger of a folder in which this command is at work: these `files`, or all of `names`.
        Raises OSError with the path of the result."""
        begun = Ledger(self.what, dict.fromkeys(sorted({*files} - {LEDGER})), at_work=not files)
        (folder / LEDGER).write_bytes(begun.to_bytes())

    def sign(self, folder: Path) -> None:
        """Write the ledger of a finished folder. Raises InputError if it cannot be written."""
        Ledger(self.what, ledger.prints_of(folder, self._written(folder))).put(folder)

    def begun(self, out: Path) -> bool:
        """Whether an earlier run for `out` left work that can be resumed."""
        return _holds(unfinished(out), self.resumes_from)

    def check_start(self, out: Path, *, resume: bool = False, overwrite: bool = False) -> None:
        """Like `check`, for a command whose unfinished work can be resumed; nothing is changed.

        Also raises InputError for unfinished work without `resume` or `overwrite`, and for files in its
        folder that the command did not write or that have changed since; the message names them.
        """
        self.check(out, overwrite=overwrite)
        draft = unfinished(out)
        self._check_draft(draft)
        if self.begun(out) and not (resume or overwrite):
            raise InputError(
                f"{out} was begun and not finished (in {draft}); add --resume to go on with it, or "
                "--overwrite to begin anew"
            )

    def _check_draft(self, draft: Path) -> None:
        if draft.exists() and not draft.is_dir():
            raise InputError(f"{draft} is a file, where this command keeps unfinished work; move it")
        if draft.is_dir():
            self._check_unchanged(draft, self._found(draft)[0])

    @contextmanager
    def _held(self, out: Path, overwrite: bool) -> Iterator[None]:
        """Lock `out` against other runs within the block; a new name is occupied by an empty folder
        meanwhile."""
        self.check(out, overwrite=overwrite)
        new = not out.exists()

        def remove() -> None:
            with suppress(OSError):  # it holds what was written
                if new:
                    out.rmdir()

        with removing(remove):
            try:
                out.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputError(f"cannot write {out}: {error.strerror}; {advice(error)}") from None
            with writing(out, self.elsewhere):
                self._older(out, overwrite)  # another run may have written it meanwhile
                yield

    @contextmanager
    def _drafted(
        self, draft: Path, out: Path, overwrite: bool, resumes_from: tuple[str, ...], where_full: str
    ) -> Iterator[None]:
        """A block that fills `draft`, which replaces `out` if the block succeeds; otherwise the draft is
        removed, unless it holds a file of `resumes_from`."""

        def leave() -> None:
            known = ledger.read(draft)
            if _holds(draft, resumes_from):
                places.kept.append(draft)
            elif known is None or not known.whole:
                self.forget(draft)

        with self._held(out, overwrite):
            self._tidy(out)
            self._check_draft(draft)
            try:
                with removing(leave):
                    yield
                    self.sign(draft)
                    self._publish(draft, out, overwrite)
            except OSError as error:
                cure = advice(error, where_full)
                raise InputError(f"cannot write {out}: {error.strerror or error}; {cure}") from None

    def _publish(self, draft: Path, out: Path, overwrite: bool) -> None:
        """Rename a finished folder to `out` if that is still free; else keep it as NAME.new.

        An older result is first renamed aside, restored if the new one cannot be put in place, and afterwards
        removed file by file, so that a file added meanwhile is kept and reported. A result whose files are
        identified by name only, such as that of a killed recorder, is kept too. Raises InputError if `out` is
        not free.
        """
        old, files = None, list[str]()
        try:
            if files := self._older(out, overwrite):
                old = places.beside(out, "old")
                out.rename(old)
            draft.rename(out)
        except BaseException as error:  # also where the user interrupts it
            if old is not None and old.exists() and not out.exists():
                old.rename(out)
            if not draft.exists():
                raise
            says = f"the new one is whole, it is kept as {_visible(draft, out, 'new')}"
            if isinstance(error, InputError):
                raise InputError(f"{error}; {says}") from None
            if isinstance(error, OSError):
                raise InputError(f"cannot write {out}: {error.strerror or error}; {says}") from None
            _note(says)
            raise
        if old is not None and (known := ledger.read(old)) is not None and known.whole:
            if not _remove(old, files):
                _note(f"{old} keeps what this command did not write")
        elif old is not None:
            kept = _visible(old, out, "old")
            _note(f"the older {out.name} was not finished; it is kept as {kept}, remove it")

    def _tidy(self, out: Path) -> None:
        """Report what killed runs left next to `out`, which is locked. Files in a draft, under any name, may
        be the user's and stay; an empty draft is removed."""
        places.print_left_beside(out)
        for draft in sorted(out.parent.glob(f".{glob.escape(out.name)}.????????.tmp")):
            if self.signed(draft) and [p.name for p in draft.rglob("*")] == [LEDGER]:
                _remove(draft, [LEDGER])
            else:
                _note(f"{draft} looks like the draft of a killed run; see what is in it, and remove it")

    def _written(self, folder: Path) -> set[str]:
        """Files that this command wrote into a folder: those announced in the ledger that have names of this
        command; all files if its names are not known in advance. Other files are never removed."""
        found = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if not p.is_dir()} - {LEDGER}
        known = ledger.read(folder)
        if known is not None and known.files:
            found &= known.files.keys()
        if not self.names:
            return found
        inside, names = ledger.listed_inside(folder), [name.split("/") for name in self.names]
        return {name for name in found if name in inside or _fits(folder, folder / name, names, exact=True)}

    def _older(self, out: Path, overwrite: bool) -> list[str]:
        """The files of an older result at `out` that may be replaced; empty if there is none."""
        if out.name in ("", ".."):
            raise InputError(f"{out} is no new folder's name; {self.elsewhere}")
        check_writable(out, places.LONGEST.format(out.name), self.elsewhere)
        if out.is_symlink():
            raise InputError(f"{out} is a symbolic link; give the folder it points to, {out.resolve()}")
        if out.exists() and not out.is_dir():
            raise InputError(f"{out} is a file; {self.elsewhere}")
        if os.path.ismount(out):
            raise InputError(
                f"{out} is a mount point, which no result can take the place of; give a new folder in it"
            )
        check_outside(out, self.elsewhere)
        if not out.is_dir() or not any(out.iterdir()):
            return []
        known, files = self._claimed(out)
        if not overwrite:
            raise InputError(f"{out} holds {self.what} already; {self.elsewhere}, or add --overwrite")
        self._check_unchanged(out, known)
        for folder in (out, *(path for path in out.rglob("*") if path.is_dir())):
            if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
                raise InputError(f"{folder} may not be changed, so it cannot be replaced; {self.elsewhere}")
        return files

    def _claimed(self, folder: Path) -> tuple[Ledger | None, list[str]]:
        """As `_found`, but a folder with files must have a ledger."""
        known, files = self._found(folder)
        if known is None and any(folder.iterdir()):
            first = min((p.name for p in folder.iterdir() if p.name != LEDGER), default="nothing")
            raise InputError(
                f"{folder} holds {first} but no {LEDGER} that can be read, which says what this command "
                f"wrote; {self.elsewhere}, or remove it yourself"
            )
        return known, files

    def _check_unchanged(self, folder: Path, known: Ledger | None) -> None:
        if known is not None and (name := known.changed(folder)):
            says = f"{folder} holds {name}, which has changed since this command wrote it"
            raise InputError(f"{says}; move it, or {self.elsewhere}")

    def _found(self, folder: Path) -> tuple[Ledger | None, list[str]]:
        """The ledger of a folder, if there is one, and the paths of the files in it, relative to it.

        Raises InputError for a link, another command's folder, and, naming it, a file that this command did
        not write.
        """
        if folder.is_symlink():
            raise InputError(f"{folder} is a symbolic link; remove it, or {self.elsewhere}")
        known, files = ledger.read(folder), list[str]()
        if known is not None and known.what != self.what:
            raise self._foreign(folder, known.what)
        own = self.names if known is None or known.files is None else map(glob.escape, known.files)
        patterns = [name.split("/") for name in (*own, LEDGER)]
        exact, any_name = known is not None and known.whole, known is None and not self.names
        for path in sorted(folder.rglob("*")):
            name = path.relative_to(folder).as_posix()
            if path.is_symlink() or not (any_name or _fits(folder, path, patterns, exact=exact)):
                raise self._foreign(folder, name)
            files += [] if path.is_dir() else [name]
        return known, files

    def _foreign(self, folder: Path, inside: str) -> InputError:
        return InputError(
            f"{folder} holds {inside}, which is no part of {self.what}; move it, or {self.elsewhere}"
        )


def _holds(folder: Path, patterns: Iterable[str] = ("**/*",)) -> bool:
    """Whether a file in `folder` matches one of the patterns."""
    return any(found.is_file() for name in patterns for found in folder.glob(name))


def _fits(folder: Path, path: Path, patterns: list[list[str]], *, exact: bool) -> bool:
    """Whether a path in `folder` matches a pattern, is a folder on the way to a match, or, unless `exact`, is
    a draft of one."""
    parts, is_folder = path.relative_to(folder).parts, path.is_dir()
    return any(
        (len(parts) < len(pattern) if is_folder else len(parts) == len(pattern) and path.is_file())
        and all(
            fnmatchcase(part, one) or (not exact and fnmatchcase(DRAFT.sub(r"\1", part), one))
            for part, one in zip(parts, pattern, strict=False)
        )
        for pattern in patterns
    )


def _remove(folder: Path, files: Iterable[str]) -> bool:
    """Remove these files and the folders that become empty; returns whether nothing is left."""
    for name in files:
        with suppress(OSError):
            (folder / name).unlink()
    inside = sorted((p for p in folder.rglob("*") if p.is_dir() and not p.is_symlink()), reverse=True)
    for empty in (*inside, folder):
        with suppress(OSError):
            empty.rmdir()
    return not folder.exists()


def _visible(place: Path, out: Path, suffix: str) -> Path:
    """Rename a hidden folder to NAME.suffix, or the next free name; returns the new path."""
    with suppress(OSError):
        return place.rename(aside(out.with_name(f"{out.name}.{suffix}")))
    return place


def _note(text: str) -> None:
    print(f"note: {text}", file=sys.stderr)
