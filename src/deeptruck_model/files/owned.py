"""Whose a folder is: which command made it, which of its files are that command's, and what refuses it."""

from __future__ import annotations

import glob
import os
from dataclasses import dataclass
from pathlib import Path

from deeptruck_model.errors import InputError
from deeptruck_model.files import ledger, places
from deeptruck_model.files.ledger import LEDGER, Ledger
from deeptruck_model.files.parts import fits
from deeptruck_model.files.places import unfinished
from deeptruck_model.files.single import ELSEWHERE, check_outside, check_writable, write


@dataclass(frozen=True)
class Owned:
    """The kind of a folder that one command writes.

    `what` names it in messages, with its article: "a mismatch result"; no two commands have the same.
    `names` are the files that it may hold while the command is at work. They are relative to the folder; `*`
    stands for any part of one name, never for a '/'. `elsewhere` is how messages advise another place.
    """

    what: str
    names: tuple[str, ...] = ()
    elsewhere: str = ELSEWHERE

    def signed(self, folder: Path) -> bool:
        """Whether the ledger in `folder` says that this command made it."""
        known = ledger.read(folder)
        return known is not None and known.what == self.what

    def claim(self, folder: Path, *files: str) -> None:
        """Write the ledger of a folder in which this command is at work: these `files`, or all of `names`."""
        text = ledger.by_name(self.what, {*files}) if files else ledger.at_work(self.what)
        (folder / LEDGER).write_bytes(text)

    def sign(self, folder: Path) -> None:
        """Write the ledger of a finished folder. Raises InputError where it cannot be written."""
        names = self._written(folder)
        write(folder / LEDGER, ledger.written(self.what, folder, names))

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
            if name in inside or any(fits(Path(name).parts, one, folder / name, True) for one in patterns)
        }

    def check_begun(self, out: Path) -> None:
        """Whether what an unfinished run left at `out` is a folder of this command's files alone.

        Raises InputError for a file of somebody else there, by its name.
        """
        draft = unfinished(out)
        if draft.exists() and not draft.is_dir():
            raise InputError(f"{draft} is a file, where this command keeps unfinished work; move it")
        if draft.is_dir():
            self._check_gone_on_with(draft)

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
        if places.is_mounted(out):
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
            if path.is_symlink() or not any(fits(parts, pattern, path, exact) for pattern in patterns):
                raise self._foreign(folder, "/".join(parts))
            if not path.is_dir():
                files.append("/".join(parts))
        return files

    def _foreign(self, folder: Path, inside: str) -> InputError:
        return InputError(
            f"{folder} holds {inside}, which is no part of {self.what}; move it, or {self.elsewhere}"
        )
