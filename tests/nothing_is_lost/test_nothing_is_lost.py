"""Nothing of the user's is lost, wherever a run fails and wherever it lies, but in an older result that
--overwrite replaces; that is whole or replaced whole."""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import redirect_stderr, suppress
from pathlib import Path

import lost_files
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lost_files import ERRORS, KIND, OWN, Place, place

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.files import MARKER

SHAPES = ("file", "read-only", "link", "link to a folder", "folder")
QUICK = settings(derandomize=True, max_examples=250, suppress_health_check=list(HealthCheck))


FOREIGN = (  # names that a user may give, drawn also from the command's own in wrong places
    *("notes.txt", ".hidden", "metadata.yaml.before", MARKER, "index.html", *OWN),
    *(name for file in OWN for name in (f"{file}/{file}", f"deep/er/{file}", f"{file}.bak")),
    *("seeds/notes.txt", "tensorboard/1/notes.txt", "seeds", "tensorboard"),
)


@st.composite
def users(draw: st.DrawFn, edits: bool) -> list[tuple[str, str]]:
    """Where something of the user's lies, relative to the folder beside `out`, and what it is."""
    inside = st.sampled_from(FOREIGN)
    shapes = st.sampled_from((*SHAPES, "in our place") if edits else SHAPES)
    names = "notes.txt out.txt out.old/a out.new/a out.unfinished/a .out.unfinished .out out .a.tmp"
    beside = st.sampled_from(names.split())
    folder = st.sampled_from(("out", "out", ".out.unfinished"))
    path = st.one_of(st.tuples(folder, inside).map("/".join), beside)
    return draw(st.lists(st.tuples(path, shapes), max_size=3))


FAILURES = st.one_of(
    st.none(),
    st.tuples(st.integers(0, 400), st.sampled_from(sorted(ERRORS)), st.just(False)),
    st.tuples(st.integers(0, 400), st.just("interrupted"), st.just(True)),
)
COMPUTING = st.sampled_from(("well", "well", "full", "interrupted", "refused", "a file comes"))


def compute(here: Place, folder: Path, how: str) -> None:
    """What the command does in the block: it writes its files, or half of them and fails."""
    for name in OWN if how in ("well", "a file comes") else OWN[:1]:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("newer")
    if how == "a file comes" and here.out != folder and here.out.is_dir():
        here.put_foreign(here.out / "came.txt", "file")
    elif how == "refused":
        raise InputError("no")
    elif how in ERRORS:
        raise ERRORS[how]()


def replaced(here: Place, overwrite: bool, how: str, anew: bool) -> None:
    with here.kind.replacing(here.out, overwrite=overwrite) as draft:
        compute(here, draft, how)


def gone_on(here: Place, overwrite: bool, how: str, anew: bool) -> None:
    with here.kind.replacing(here.out, overwrite=overwrite, resume=not anew) as draft:
        compute(here, draft, how)


def recorded(here: Place, overwrite: bool, how: str, anew: bool) -> None:
    def whole(bag: Path) -> bool:
        return (bag / "metadata.yaml").exists()

    with here.kind.recording(here.out, overwrite=overwrite, whole=whole):
        here.out.mkdir()
        here.kind.mark(here.out, at_work=True)
        compute(here, here.out, how)
        here.kind.mark(here.out)


Way = Callable[[Place, bool, str, bool], None]
WAYS: tuple[Way, ...] = (replaced, gone_on, recorded)


@given(data=st.data())
@QUICK
def test_what_the_user_put_there_is_there_afterwards(data: st.DataObject) -> None:
    way = data.draw(st.sampled_from(WAYS))
    older, marker, overwrite, anew = (data.draw(st.booleans()) for _ in range(4))
    with place(KIND) as here:
        if older:
            here.put_older(marker=marker)
        for name, shape in data.draw(users(edits=not overwrite)):
            here.put_foreign(here.root / name, shape)
        before, says = here.content(here.out), io.StringIO()
        how, failure = data.draw(COMPUTING), data.draw(FAILURES)
        with redirect_stderr(says), suppress(InputError, OSError, KeyboardInterrupt):
            if failure is None:
                way(here, overwrite, how, anew)
            else:
                at, error, after = failure
                with lost_files.failing(at, error, after=after):
                    way(here, overwrite, how, anew)
        whole = here.content(here.out) == dict.fromkeys(OWN, "newer")
        gone = here.out if older and marker and overwrite and whole else None  # with all that lay in it
        lost = [path for path in here.lost(says.getvalue()) if gone not in path.parents]
        assert not lost, says.getvalue()
        assert_whole(here, before, way)


def assert_whole(here: Place, before: dict[str, str], way: Way) -> None:
    """`out` is what it was, or the newer result; a recorder's may be unfinished, beside the older one."""
    newer = dict.fromkeys(OWN, "newer")
    now = here.content(here.out) if here.out.is_dir() and not here.out.is_symlink() else before
    if way is recorded and now not in (before, newer):
        now = here.content(here.root / "out.old")
    assert now in (before, newer)


@given(name=st.sampled_from(("a.csv", "new/a.csv")), failure=FAILURES, how=COMPUTING, there=st.booleans())
@QUICK
def test_a_single_file_never_takes_the_place_of_another(
    name: str, failure: tuple[int, str, bool] | None, how: str, there: bool
) -> None:
    with place(KIND) as here:
        path = here.root / name
        if there:
            here.put_foreign(path, "file")
        here.put_foreign(here.root / ".a.csv", "file")
        at, error, after = failure or (10**6, "full", False)
        with (
            suppress(InputError, OSError, KeyboardInterrupt),
            lost_files.failing(at, error, after=after),
            files.new_file(path) as draft,
        ):
            draft.write_text("newer")
            if how == "a file comes":
                here.put_foreign(path, "file")
            elif how in ERRORS:
                raise ERRORS[how]()
        assert not here.lost("")
        assert path in here.foreign or not path.exists() or path.read_text() == "newer"
