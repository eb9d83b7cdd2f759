"""The one rule of every command that writes: whole or not there, and nothing of the user's is lost.

A result is written into a draft beside its place and renamed at the end. An older result is replaced only
where the user says --overwrite, only after all else was checked, and only where each entry of it is one that
the same command wrote. It is renamed aside until the new one stands. Standard library only.
"""

from __future__ import annotations

import errno
import fcntl
import glob
import itertools
import json
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from deeptruck_model.errors import InputError

ADVICE = "make room or choose another --out"
ELSEWHERE = "choose another --out"
RENAME = "choose another name"
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_DRAFT = re.compile(r"^\.(.+?)(\.\w{8}\.tmp|\.tmp|\.unfinished|\.\d+\.old)$")  # .NAME.tmp and the like
OVERWRITE_HELP = "Replace what this command wrote there, once the new one is whole."
LEDGER = ".deeptruck.json"  # in every published folder: what it is, and which files the command wrote there


@dataclass(frozen=True)
class Result:
    """A folder that one command writes.

    `what` names it in messages, with its article: "a mismatch result"; no two commands have the same.
    `names` are the files that it may hold where there is no ledger: in unfinished work, or in a copy without
    it. They are relative to the folder; `*` stands for any part of one name, never for a '/'. `elsewhere` is
    how messages advise another place.
    """

    what: str
    names: tuple[str, ...] = ()
    elsewhere: str = ELSEWHERE

    def check(self, out: Path, *, overwrite: bool = False) -> bool:
        """Whether an older result of this kind stands at `out`; called before anything is computed or read.

        Raises InputError for a link, a file, a place that cannot be written, an entry that this command did
        not write (named), an older result without `overwrite`, or another run that is writing there.
        """
        free(out)
        return self._check(out, overwrite)

    @contextmanager
    def replacing(self, out: Path, *, overwrite: bool = False) -> Iterator[Path]:
        """A draft folder that takes the place of `out` when the block ends well, and vanishes when not.

        `out` is held against other runs until then. Raises InputError as `check`, and on a full disk.
        """
        with self._held(out, overwrite):
            draft = None
            _tell_left_over(out)
            try:
                draft = Path(tempfile.mkdtemp(prefix=f".{out.name}.", suffix=".tmp", dir=out.parent))
                draft.chmod(0o777 & ~_umask())
                yield draft
                self._publish(draft, out, overwrite)
            except OSError as error:
                raise InputError(f"cannot write {out}: {error.strerror or error}; {advice(error)}") from None
            finally:
                if draft is not None:
                    shutil.rmtree(draft, ignore_errors=True)

    @contextmanager
    def going_on(self, out: Path, *, overwrite: bool = False) -> Iterator[Path]:
        """As `replacing`, but where the block fails or is killed the draft stays, to be gone on with.

        Its name is `unfinished(out)`; a file of somebody else in it refuses the run, by name. Whoever does
        not want to go on calls `forget` first.
        """
        with self._held(out, overwrite):
            draft = unfinished(out)
            _tell_left_over(out)
            self._ours(draft)
            try:
                draft.mkdir(exist_ok=True)
                (draft / LEDGER).unlink(missing_ok=True)  # of a run that died as it was to publish
                yield draft
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
            yield

    @contextmanager
    def aside(self, out: Path, *, overwrite: bool = False, whole: Callable[[Path], bool]) -> Iterator[None]:
        """`out` free for a writer whose unfinished work stands under its final name, as that of a recorder.

        An older result waits beside `out`. At the end it is removed where the new one is `whole`, put back
        where none came into being, and kept beside an unfinished one, which is said. Whoever writes `out`
        holds it and signs it. Raises InputError as `check`.
        """
        old: Path | None = None
        files: list[str] = []
        try:
            if self.check(out, overwrite=overwrite) or out.is_dir():
                with writing(out):
                    self._check(out, overwrite)
                    files, old = self._ours(out), _beside(out)
                    out.rename(old)
            _tell_left_over(out, old)
            yield
        finally:
            if old is not None and old.exists():
                self._settle(out, old, files, whole)

    def _settle(self, out: Path, old: Path, files: list[str], whole: Callable[[Path], bool]) -> None:
        if not out.exists():
            old.rename(out)
        elif not whole(out):
            print(f"note: {out} is not finished; the older one is kept as {old}", file=sys.stderr)
        elif not _remove(old, files):
            print(f"note: {old} keeps what this command did not write", file=sys.stderr)

    def signed(self, folder: Path) -> bool:
        """Whether the ledger in `folder` says that this command made it."""
        with suppress(OSError, ValueError, KeyError, TypeError):
            return bool(json.loads((folder / LEDGER).read_text())["what"] == self.what)
        return False

    def clear(self, folder: Path, *inside: str) -> None:
        """Remove what this command wrote in `folder`, or in these folders inside it.

        Raises InputError for a file of somebody else, by its name; then nothing is removed.
        """
        if folder.exists() or folder.is_symlink():
            within = tuple(f"{name}/" for name in inside)
            found = self._ours(folder)
            _remove(folder, [name for name in found if not within or name.startswith(within)])

    def forget(self, out: Path) -> None:
        """Remove what a run left unfinished. Raises InputError for a file of somebody else there."""
        if (draft := unfinished(out)).exists():
            _remove(draft, self._ours(draft))

    def _check(self, out: Path, overwrite: bool) -> bool:
        if out.name in ("", ".."):
            raise InputError(f"{out} is no new folder's name; {ELSEWHERE}")
        if out.is_symlink():
            raise InputError(f"{out} is a symbolic link; give the folder it points to, {out.resolve()}")
        if out.exists() and not out.is_dir():
            raise InputError(f"{out} is a file; {self.elsewhere}")
        if _is_mounted(out):
            raise InputError(
                f"{out} is a mount point, which no result can take the place of; give a new folder in it"
            )
        check_writable(out, self.elsewhere)
        if not out.is_dir() or not any(out.iterdir()):
            return False
        self._ours(out)
        if not overwrite:
            raise InputError(f"{out} holds {self.what} already; {self.elsewhere}, or add --overwrite")
        for folder in (out, *(path for path in out.rglob("*") if path.is_dir())):
            if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
                raise InputError(f"{folder} may not be changed, so it cannot be replaced; {self.elsewhere}")
        return True

    def _ours(self, folder: Path) -> list[str]:
        """The files in `folder`, relative to it. Raises InputError, naming it, for one of somebody else."""
        if folder.is_symlink():
            raise InputError(f"{folder} is a symbolic link; remove it, or {self.elsewhere}")
        listed = self._listed(folder)
        patterns = [name.split("/") for name in (*(self.names if listed is None else listed), LEDGER)]
        files = []
        for path in sorted(folder.rglob("*")):
            parts = path.relative_to(folder).parts
            if path.is_symlink() or not any(_fits(parts, pattern, path) for pattern in patterns):
                raise self._foreign(folder, "/".join(parts))
            if not path.is_dir():
                files.append("/".join(parts))
        return files

    def _listed(self, folder: Path) -> list[str] | None:
        """The files of the ledger in `folder`; None where there is none. Raises InputError for that of
        another command."""
        try:
            ledger = json.loads((folder / LEDGER).read_text())
            what, names = str(ledger["what"]), [glob.escape(str(name)) for name in ledger["files"]]
        except (OSError, ValueError, KeyError, TypeError):
            return None
        if what != self.what:
            raise self._foreign(folder, what)
        return names

    def _foreign(self, folder: Path, inside: str) -> InputError:
        return InputError(
            f"{folder} holds {inside}, which is no part of {self.what}; move it, or {self.elsewhere}"
        )

    @contextmanager
    def _held(self, out: Path, overwrite: bool) -> Iterator[None]:
        self.check(out, overwrite=overwrite)
        new = not out.exists()
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot write {out}: {error.strerror}; {advice(error)}") from None
        try:
            with writing(out):
                self._check(out, overwrite)  # another run may have written it meanwhile
                yield
        finally:
            if new:
                with suppress(OSError):  # it holds what was written
                    out.rmdir()

    def _publish(self, draft: Path, out: Path, overwrite: bool) -> None:
        """Rename a finished folder to `out`, with the list of its files in it.

        An older result is renamed aside first, back where the new one cannot be put, and removed file by file
        once the new one stands: a file that came meanwhile is kept, and said.
        """
        self.sign(draft)
        old = None
        try:
            if self._check(out, overwrite):
                files, old = self._ours(out), _beside(out)
                out.rename(old)
            draft.rename(out)
        except BaseException:  # also where the user interrupts it
            if old is not None and old.exists() and not out.exists():
                old.rename(out)
            raise
        if old is not None and not _remove(old, files):
            print(f"note: {old} keeps what this command did not write", file=sys.stderr)

    def sign(self, folder: Path, coming: tuple[str, ...] = ()) -> None:
        """Write the ledger of a folder: what this is, its files, and those that are still `coming`."""
        files = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if not p.is_dir()} | {*coming}
        ledger = {"what": self.what, "files": sorted(files - {LEDGER})}
        (folder / LEDGER).write_text(json.dumps(ledger, indent=1) + "\n")


def unfinished(out: Path) -> Path:
    """Where work that can be gone on with is kept until `out` can be written whole."""
    return out.with_name(f".{out.name}.unfinished")


def begun(out: Path) -> bool:
    """Whether a run that was to write `out` left work behind; a folder without a file is none."""
    return any(not path.is_dir() for path in unfinished(out).rglob("*"))


def check_writable(path: Path, elsewhere: str = ELSEWHERE) -> None:
    """Raises InputError where `path` could not be made or written; nothing is touched."""
    above = next(p for p in path.absolute().parents if p.exists() or p.is_symlink())
    if not above.is_dir():
        raise InputError(f"cannot write {path}: {above} is no folder; {elsewhere}")
    if not os.access(above, os.W_OK | os.X_OK):
        raise InputError(f"cannot write {path}: {above} may not be changed; {elsewhere}")


def check_new(path: Path) -> None:
    """Raises InputError where the single file `path` exists or cannot be written; nothing is touched."""
    if path.exists() or path.is_symlink():
        raise InputError(f"{path} exists already; {RENAME} or remove it")
    check_writable(path, RENAME)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """A draft that becomes the single file `path` when the block ends well; it never replaces another.

    Raises InputError as `check_new`, and on a full disk.
    """
    check_new(path)
    draft = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        number, name = tempfile.mkstemp(prefix=f".{path.stem}.", suffix=path.suffix, dir=path.parent)
        os.close(number)
        draft = Path(name)
        draft.chmod(0o666 & ~_umask())
        yield draft
        check_new(path)
        draft.rename(path)
    except OSError as error:
        cure = advice(error, f"make room or {RENAME}", RENAME)
        raise InputError(f"cannot write {path}: {error.strerror or error}; {cure}") from None
    finally:
        if draft is not None:
            draft.unlink(missing_ok=True)


def write(path: Path, content: bytes, where_full: str = ADVICE) -> None:
    """Write beside `path` and rename, folders made: a full disk or a kill leaves what was there before.

    For files inside a command's own folder. Raises InputError with one line where it cannot be written; it
    ends with `where_full` on a full disk.
    """
    draft = path.with_name(f".{path.name}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft.write_bytes(content)
        draft.replace(path)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}; {advice(error, where_full)}") from None
    finally:
        with suppress(OSError):  # its folder is none, or cannot be written: then there is nothing to remove
            draft.unlink(missing_ok=True)


def advice(error: BaseException, where_full: str = ADVICE, else_where: str = ELSEWHERE) -> str:
    """What mends an error of writing: room helps a full disk alone, and no folder that may not be written."""
    return where_full if getattr(error, "errno", None) in FULL else else_where


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Hold an existing folder against other runs; the hold ends with the block, or with the process.

    Raises InputError where another run holds it.
    """
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise InputError(
            f"another run is writing {folder}; wait until it has ended, or {ELSEWHERE}"
        ) from None
    try:
        yield
    finally:
        os.close(handle)


def free(folder: Path) -> None:
    """Raises InputError where a run writes into the folder; one that is not there is free."""
    if folder.is_dir() and os.access(folder, os.R_OK):
        with writing(folder):
            pass


def _fits(parts: tuple[str, ...], pattern: list[str], path: Path) -> bool:
    """Whether a path is what the pattern says, or a folder on the way to it; a killed run's drafts also."""
    on_the_way = path.is_dir() and len(parts) < len(pattern)
    whole = path.is_file() and len(parts) == len(pattern)
    return (on_the_way or whole) and all(
        fnmatchcase(part, one) or fnmatchcase(_DRAFT.sub(r"\1", part), one)
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


def _beside(out: Path) -> Path:
    """Where an older result waits: a name that is free, as a killed run may have had the same number."""
    names = (f".{out.name}.{os.getpid() + number}.old" for number in itertools.count())
    return next(place for name in names if not os.path.lexists(place := out.with_name(name)))


def _tell_left_over(out: Path, own: Path | None = None) -> None:
    """Say where killed runs left an older result, or a draft; whoever calls holds `out`. They stay."""
    name = glob.escape(out.name)
    for place in sorted(out.parent.glob(f".{name}.[0-9]*.old")):
        if place != own:
            print(
                f"note: {place} is an older {out.name}, which a run that was killed had set aside; "
                "rename it or remove it",
                file=sys.stderr,
            )
    for place in sorted(out.parent.glob(f".{name}.????????.tmp")):
        print(f"note: {place} is the draft of a run that was killed; remove it", file=sys.stderr)


def _is_mounted(folder: Path) -> bool:
    """Whether a folder is a mount point; one of the same disk, as containers have them, is only listed."""
    if not folder.is_dir():
        return False
    place = str(folder.resolve())
    with suppress(OSError):
        listed = (line.split(" ")[4] for line in Path("/proc/self/mountinfo").read_text().splitlines())
        return place in (name.replace("\\040", " ") for name in listed)
    return os.path.ismount(place)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
