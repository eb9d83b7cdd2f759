"""A folder that one command writes: whole or not there, and never in the place of anything of the user's.

A result is written into a draft beside its place and renamed at the end. An older result is replaced only
where the user says --overwrite, only after all else was checked, and only where its ledger says that the same
command wrote each file of it, as it is now.
"""

from __future__ import annotations

import glob
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from deeptruck_model.errors import InputError
from deeptruck_model.files import ledger, places
from deeptruck_model.files.ledger import LEDGER, Ledger
from deeptruck_model.files.lock import ELSEWHERE, free, reserved, writing
from deeptruck_model.files.places import DRAFT, unfinished
from deeptruck_model.files.single import advice, aside, check_outside, check_writable, removing, write

OVERWRITE_HELP = "Replace what this command wrote there, once the new one is whole."


@dataclass(frozen=True)
class Result:
    """The kind of a folder that one command writes.

    `what` names it in messages, with its article: "a mismatch result"; no two commands have the same.
    `names` are the files that it may hold while the command is at work. They are relative to the folder; `*`
    stands for any part of one name, never for a '/'. `elsewhere` is how messages advise another place.
    `resumes_from` are the files by any of which unfinished work goes on; without one it begins anew.
    """

    what: str
    names: tuple[str, ...] = ()
    elsewhere: str = ELSEWHERE
    resumes_from: tuple[str, ...] = ("**/*",)

    def check(self, out: Path, *, overwrite: bool = False) -> bool:
        """Whether an older result of this kind stands at `out`; called before anything is computed or read.

        Raises InputError for a link, a file, a place that cannot be written, a folder without a ledger or
        with that of another command, a file that this command did not write or that has changed since
        (named), an older result without `overwrite`, or another run that is writing there.
        """
        out = places.straight(out)
        free(out, self.elsewhere)
        return bool(self._older(out, overwrite))

    @contextmanager
    def replacing(self, out: Path, *, overwrite: bool = False) -> Iterator[Path]:
        """A draft folder that takes the place of `out` when the block ends well, and vanishes when not.

        `out` is held against other runs until then. Raises InputError as `check`, on a full disk, and where
        something else came to `out` meanwhile: then the new result is kept beside it.
        """
        out = places.straight(out)
        draft, is_whole = places.draft(out), False

        def drop() -> None:
            if draft.exists() and not is_whole:
                self._drop(draft)

        with self._held(out, overwrite):
            self._tidy(out)
            try:
                with removing(drop):
                    draft.mkdir()
                    self.claim(draft)
                    yield draft
                    self.sign(draft)
                    is_whole = True
                    self._publish(draft, out, overwrite)
            except OSError as error:
                raise InputError(f"cannot write {out}: {error.strerror or error}; {advice(error)}") from None

    @contextmanager
    def going_on(self, out: Path, *, overwrite: bool = False) -> Iterator[Path]:
        """As `replacing`, but where the block fails or is killed the draft stays, to be gone on with.

        It stays if it holds a file of `resumes_from`, and after a kill in any case. Its name is
        `unfinished(out)`; a file of somebody else in it refuses the run, by name. Whoever does not want to go
        on calls `anew` first.
        """
        out = places.straight(out)
        draft = unfinished(out)

        def leave() -> None:
            if any(found.is_file() for name in self.resumes_from for found in draft.glob(name)):
                places.kept.append(draft)
                return
            with suppress(InputError):  # a file of somebody else came there
                self.forget(out)

        with self._held(out, overwrite):
            self._tidy(out)
            if draft.is_dir():
                self._check_gone_on_with(draft)
            try:
                with removing(leave):
                    draft.mkdir(exist_ok=True)
                    (draft / LEDGER).unlink(missing_ok=True)  # of a run that died as it was to publish
                    yield draft
                    self.sign(draft)
                    self._publish(draft, out, overwrite)
            except OSError as error:
                cure = advice(error, "make room and go on with --resume")
                raise InputError(f"cannot write {out}: {error.strerror or error}; {cure}") from None

    @contextmanager
    def in_place(self, out: Path) -> Iterator[None]:
        """`out` held for work that stays in it from run to run, and of which each file is whole by itself.

        Raises InputError as `check`, but for an older result: with that the work goes on.
        """
        with self._held(out, overwrite=True):
            if not any(out.iterdir()):
                self.claim(out)
            yield

    @contextmanager
    def recording(
        self, out: Path, *, overwrite: bool = False, whole: Callable[[Path], bool]
    ) -> Iterator[Path]:
        """Where a writer may work whose unfinished work is worth keeping, as that of a recorder.

        It is `out` itself, or beside an older result that stands there until the new one is `whole`. Whoever
        writes holds the folder and signs it. A new one that is not whole is kept, which is said. Raises
        InputError as `check`.
        """
        out = places.straight(out)
        if not self.check(out, overwrite=overwrite):
            with reserved(out, self.elsewhere):
                self._older(out, overwrite=False)  # another run may have written it meanwhile
                with suppress(FileNotFoundError):
                    out.rmdir()  # an empty one
                self._tidy(out)
                yield out
            return
        with writing(out, self.elsewhere):
            self._older(out, overwrite)
            self._tidy(out)
            newer = places.beside(out, "new")
            try:
                yield newer
            finally:
                if newer.exists():
                    self._settle(newer, out, overwrite, whole(newer))

    def _settle(self, newer: Path, out: Path, overwrite: bool, is_whole: bool) -> None:
        if not is_whole:
            print(
                f"note: {out} is the older one; the new one is not finished, it is kept as {newer}: "
                f"'deeptruck-model repair {newer}' mends it",
                file=sys.stderr,
            )
            return
        self._publish(newer, out, overwrite)

    def clear(self, folder: Path, *inside: str) -> None:
        """Remove what this command wrote in `folder`, or in these folders inside it.

        Raises InputError for a folder that it has not claimed, or a file of somebody else, by its name; then
        nothing is removed.
        """
        if folder.is_symlink() or (folder.exists() and any(folder.iterdir())):
            self._listed(folder)
        if folder.exists() or folder.is_symlink():
            within = tuple(f"{name}/" for name in inside)
            found = self._ours(folder)
            _remove(folder, [name for name in found if not within or name.startswith(within)])

    def forget(self, out: Path) -> None:
        """Remove what this run left unfinished. Raises InputError for a file of somebody else there."""
        if (draft := unfinished(out)).exists():
            _remove(draft, self._ours(draft))

    def anew(self, out: Path) -> None:
        """Make room for new work where a killed run left some: that is set aside, and said."""
        draft = unfinished(out)
        if places.begun(out):
            aside = places.beside(out, "unfinished")
            draft.rename(aside)
            print(
                f"note: what a run of {out} had begun is kept as {aside}; remove it, or rename it to "
                f"{draft.name} and add --resume to go on with it",
                file=sys.stderr,
            )
        draft.mkdir(parents=True, exist_ok=True)

    @contextmanager
    def _held(self, out: Path, overwrite: bool) -> Iterator[None]:
        self.check(out, overwrite=overwrite)
        new = not out.exists()

        def remove() -> None:
            if new:
                with suppress(OSError):  # it holds what was written
                    out.rmdir()

        with removing(remove):
            try:
                out.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputError(f"cannot write {out}: {error.strerror}; {advice(error)}") from None
            with writing(out, self.elsewhere):
                self._older(out, overwrite)  # another run may have written it meanwhile
                yield

    def _publish(self, draft: Path, out: Path, overwrite: bool) -> None:
        """Rename a finished folder to `out`, where nothing came between; else keep it beside, as NAME.new.

        An older result is renamed aside first, back where the new one cannot be put, and removed file by file
        once the new one stands: a file that came meanwhile is kept, and said. Raises InputError where `out`
        is not free any more.
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
            if draft.exists():
                self._keep(draft, out, error)
            raise
        if old is not None:
            self._remove_older(old, files, out)

    def _remove_older(self, old: Path, files: list[str], out: Path) -> None:
        """Remove an older result. One whose files are known by their names alone, as of a recorder that was
        killed, may hold others under these names: it is kept, which is said."""
        known = ledger.read(old)
        if known is None or not known.whole:
            kept = aside(out.with_name(f"{out.name}.old"))
            with suppress(OSError):
                old = old.rename(kept)
            print(
                f"note: the older {out.name} was not finished; it is kept as {old}, remove it",
                file=sys.stderr,
            )
        elif not _remove(old, files):
            print(f"note: {old} keeps what this command did not write", file=sys.stderr)

    def _keep(self, draft: Path, out: Path, error: BaseException) -> None:
        """Keep what was computed under a name that all can see. Raises InputError that says where, and why
        it is not at `out`; of an interrupt that is only printed."""
        kept = aside(out.with_name(f"{out.name}.new"))
        try:
            draft.rename(kept)
        except OSError:
            kept = draft
        says = f"the new one is whole, it is kept as {kept}"
        if isinstance(error, InputError):
            raise InputError(f"{error}; {says}") from None
        if isinstance(error, OSError):
            raise InputError(f"cannot write {out}: {error.strerror or error}; {says}") from None
        print(f"note: {says}", file=sys.stderr)

    def _drop(self, draft: Path) -> None:
        """Remove the draft of a run that failed, but for a file that is not this command's."""
        if self.names:
            if not _remove(draft, list(self._written(draft) | {LEDGER})):
                print(f"note: {draft} keeps what this command did not write", file=sys.stderr)
        else:
            shutil.rmtree(draft, ignore_errors=True)

    def _tidy(self, out: Path) -> None:
        """Say what killed runs left beside `out`, which is held. What is in a draft may be the user's, by any
        name, so all of it stays; one in which nothing was written is removed."""
        places.tell_left_beside(out)
        for draft in places.drafts(out):
            if self.signed(draft) and [p.name for p in draft.rglob("*")] == [LEDGER]:
                _remove(draft, [LEDGER])
            else:
                print(
                    f"note: {draft} looks like the draft of a killed run; see what is in it, and remove it",
                    file=sys.stderr,
                )

    def signed(self, folder: Path) -> bool:
        """Whether the ledger in `folder` says that this command made it."""
        known = ledger.read(folder)
        return known is not None and known.what == self.what

    def claim(self, folder: Path, *files: str) -> None:
        """Write the ledger of a folder in which this command is at work: these `files`, or all of `names`."""
        known = dict.fromkeys(sorted({*files} - {LEDGER}))
        (folder / LEDGER).write_bytes(Ledger(self.what, known, at_work=not files).to_bytes())

    def sign(self, folder: Path) -> None:
        """Write the ledger of a finished folder. Raises InputError where it cannot be written."""
        names = self._written(folder)
        write(folder / LEDGER, ledger.of(self.what, folder, names).to_bytes())

    def check_begun(self, out: Path) -> None:
        """Whether what an unfinished run left at `out` is a folder of this command's files alone.

        Raises InputError for a file of somebody else there, by its name.
        """
        draft = unfinished(out)
        if draft.exists() and not draft.is_dir():
            raise InputError(f"{draft} is a file, where this command keeps unfinished work; move it")
        if draft.is_dir():
            self._check_gone_on_with(draft)

    def _written(self, folder: Path) -> set[str]:
        """What this command wrote in a folder in which it was at work; where its names are not known before,
        all that is there. A file that came meanwhile is nobody's part, so that it is never removed: neither
        one of another name, nor one that the command did not say as it began."""
        found = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if not p.is_dir()} - {LEDGER}
        known = ledger.read(folder)
        if known is not None and known.files:
            found &= known.files.keys()
        if not self.names:
            return found
        patterns = [name.split("/") for name in self.names]
        inside = ledger.listed_inside(folder)
        return {
            name
            for name in found
            if name in inside or any(_fits(Path(name).parts, one, folder / name, True) for one in patterns)
        }

    def _check_gone_on_with(self, draft: Path) -> None:
        """Raises InputError for what another command wrote, or is finished and has changed since."""
        known = ledger.read(draft)
        if known is not None and known.what != self.what:
            raise self._foreign(draft, known.what)
        self._ours(draft)
        for name in (known.files or ()) if known is not None else ():
            if known is not None and (draft / name).is_file() and known.is_changed(draft, name):
                raise InputError(
                    f"{draft} holds {name}, which has changed since it was finished; move the folder"
                )

    def _older(self, out: Path, overwrite: bool) -> list[str]:
        """The files of an older result at `out`, which may be replaced; none where there is no such."""
        if out.name in ("", ".."):
            raise InputError(f"{out} is no new folder's name; {self.elsewhere}")
        if out.is_symlink():
            raise InputError(f"{out} is a symbolic link; give the folder it points to, {out.resolve()}")
        if out.exists() and not out.is_dir():
            raise InputError(f"{out} is a file; {self.elsewhere}")
        if os.path.ismount(out):
            raise InputError(
                f"{out} is a mount point, which no result can take the place of; give a new folder in it"
            )
        check_writable(out, self.elsewhere)
        check_outside(out, self.elsewhere)
        if not out.is_dir() or not any(out.iterdir()):
            return []
        known = self._listed(out)
        if not overwrite:
            raise InputError(f"{out} holds {self.what} already; {self.elsewhere}, or add --overwrite")
        self._check_replaceable(out, known)
        return self._ours(out)

    def _listed(self, out: Path) -> Ledger:
        """The ledger of a folder that is not empty. Raises InputError for one of which not all is ours."""
        known = ledger.read(out)
        if known is not None and known.what != self.what:
            raise self._foreign(out, known.what)
        if self.names or known is not None:
            self._ours(out)
        if known is None:
            first = min((p.name for p in out.iterdir() if p.name != LEDGER), default="nothing")
            raise InputError(
                f"{out} holds {first} but no {LEDGER} that can be read, which says what this command wrote; "
                f"{self.elsewhere}, or remove it yourself"
            )
        return known

    def _check_replaceable(self, out: Path, known: Ledger) -> None:
        """Raises InputError for a part of another result, a file that has changed, and what is locked."""
        if part := ledger.around(out):
            raise InputError(f"{out} is part of {part[1]}, {part[0]}; {self.elsewhere}")
        for name in known.files or ():
            if (out / name).is_file() and known.is_changed(out, name):
                raise InputError(
                    f"{out} holds {name}, which has changed since this command wrote it; move it, or "
                    f"{self.elsewhere}"
                )
        for folder in (out, *(path for path in out.rglob("*") if path.is_dir())):
            if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
                raise InputError(f"{folder} may not be changed, so it cannot be replaced; {self.elsewhere}")

    def _ours(self, folder: Path) -> list[str]:
        """The files in `folder`, relative to it. Raises InputError, naming it, for one of somebody else."""
        if folder.is_symlink():
            raise InputError(f"{folder} is a symbolic link; remove it, or {self.elsewhere}")
        known = ledger.read(folder)
        own = self.names if known is None or known.files is None else map(glob.escape, known.files)
        patterns = [name.split("/") for name in (*own, LEDGER)]
        exact = known is not None and known.whole
        files = []
        for path in sorted(folder.rglob("*")):
            parts = path.relative_to(folder).parts
            if path.is_symlink() or not any(_fits(parts, pattern, path, exact) for pattern in patterns):
                raise self._foreign(folder, "/".join(parts))
            if not path.is_dir():
                files.append("/".join(parts))
        return files

    def _foreign(self, folder: Path, inside: str) -> InputError:
        return InputError(
            f"{folder} holds {inside}, which is no part of {self.what}; move it, or {self.elsewhere}"
        )


def _fits(parts: tuple[str, ...], pattern: list[str], path: Path, exact: bool) -> bool:
    """Whether a path is what the pattern says, a folder on the way to it, or, unless `exact`, its draft."""
    on_the_way = path.is_dir() and len(parts) < len(pattern)
    whole = path.is_file() and len(parts) == len(pattern)
    return (on_the_way or whole) and all(
        fnmatchcase(part, one) or (not exact and fnmatchcase(DRAFT.sub(r"\1", part), one))
        for part, one in zip(parts, pattern, strict=False)
    )


def _remove(folder: Path, files: list[str]) -> bool:
    """Remove these files and the folders that this leaves empty; tell whether nothing was left."""
    for name in files:
        with suppress(OSError):
            (folder / name).unlink()
    inside = sorted((p for p in folder.rglob("*") if p.is_dir() and not p.is_symlink()), reverse=True)
    for empty in (*inside, folder):
        with suppress(OSError):
            empty.rmdir()
    return not folder.exists()
