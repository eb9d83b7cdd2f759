"""Nothing of the user's is lost, wherever it lies and wherever a run fails; an older result is whole or
replaced whole."""

from __future__ import annotations

import ast
import io
from collections.abc import Callable
from contextlib import redirect_stderr, suppress
from functools import cache
from pathlib import Path

import lost_files
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lost_files import ERRORS, KINDS, OWN, RECORDED, RESUMABLE, Place, place

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.files import MARKER, Result

ROOT = Path(__file__).parents[2]
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
    with here.kind.going_on(here.out, overwrite=overwrite, resume=not anew) as draft:
        compute(here, draft, how)


def recorded(here: Place, overwrite: bool, how: str, anew: bool) -> None:
    def whole(bag: Path) -> bool:
        return (bag / "metadata.yaml").exists()

    with here.kind.recording(here.out, overwrite=overwrite, whole=whole) as bag:
        bag.mkdir()
        here.kind.mark(bag)
        compute(here, bag, how)
        here.kind.mark(bag, OWN)


Way = Callable[[Place, bool, str, bool], None]
WAYS: list[tuple[Result, Way]] = [
    *((kind, replaced) for kind in KINDS if kind is not RECORDED),
    *((kind, gone_on) for kind in RESUMABLE),
    (RECORDED, recorded),
]


@given(data=st.data())
@QUICK
def test_what_the_user_put_there_is_there_afterwards(data: st.DataObject) -> None:
    kind, way = data.draw(st.sampled_from(WAYS))
    older, marker, overwrite, anew = (data.draw(st.booleans()) for _ in range(4))
    with place(kind) as here:
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
        assert not here.lost(says.getvalue()), says.getvalue()
        assert_whole(here, before, way)


def assert_whole(here: Place, before: dict[str, str], way: Way) -> None:
    """`out` is what it was, or the newer result; a recorder's may be unfinished where no older one was."""
    newer = dict.fromkeys(OWN, "newer")
    now = here.content(here.out) if here.out.is_dir() and not here.out.is_symlink() else before
    if before or way is not recorded:
        assert now in (before, newer)


def test_no_two_commands_write_the_same_kind_and_all_are_tried_here() -> None:
    made = [
        node.args[0].value
        for _, node in calls()
        if called(node) == "Result" and isinstance(node.args[0], ast.Constant)
    ]
    assert sorted(made) == sorted(kind.what for kind in KINDS)
    assert len({kind.what for kind in KINDS}) == len(KINDS)


@cache
def calls() -> list[tuple[str, ast.Call]]:
    """Every call in the source and in benchmarks, and the file that it is in."""
    packages = (ROOT / "src", ROOT / "exam", ROOT / "ros2_ws", ROOT / "examples", ROOT / "benchmarks")
    files = [path for package in packages for path in package.rglob("*.py")]
    return [
        (path.relative_to(ROOT).as_posix().removeprefix("exam/").removeprefix("src/"), node)
        for path in (*files, ROOT / "demo.py")
        if not {"build", "install"} & {*path.parts}
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
    ]


def called(node: ast.Call) -> str:
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


# Who else may delete or rename, and what: each its own work of the same run, or what it knows as its own.
ALLOWED = {
    "deeptruck_core/files/results.py": "the rule itself",
    "deeptruck_core/files/single.py": "its own draft",
    "deeptruck_model/recordings/crash_safe.py": "metadata.yaml of the bag that it has just made",
    "deeptruck_model/recordings/mcap_repair.py": "the repaired bag; what was cut off or replaced is kept",
    "deeptruck_model/deep/training.py": "the resume point of a training that diverged",
    "deeptruck_model/deep/card.py": "the resume point in the draft of its own run",
    "deeptruck_exam/folder.py": "a case that it has marked as its own and that nobody added to",
    "deeptruck_exam/cases/deep_trucks.py": "a draft with its own process's number, into the exam's own cache",
    "examples/demo/runner.py": "what a step of the demo made and nobody changed since",
    "examples/demo/page.py": "index.html of the demo's own folder",
}
DELETES = {"rmtree", "unlink", "rmdir", "removedirs", "rename", "renames", "move"}
BY_MODULE = {("os", "replace"), ("os", "remove")}


def deletes(node: ast.Call) -> bool:
    """Whether a call deletes or renames. `Path.replace` has one argument, `str.replace` and others more."""
    name = called(node)
    if not isinstance(node.func, ast.Attribute):
        return name == "rmtree"
    owner = getattr(node.func.value, "id", "")
    path_replace = name == "replace" and len(node.args) == 1 and not node.keywords
    return name in DELETES or (owner, name) in BY_MODULE or path_replace


def test_nobody_else_deletes_or_renames() -> None:
    found = {path for path, node in calls() if deletes(node) and not path.startswith("benchmarks/")}
    assert found == set(ALLOWED)


@given(name=st.sampled_from(("a.csv", "new/a.csv")), failure=FAILURES, how=COMPUTING, there=st.booleans())
@QUICK
def test_a_single_file_never_takes_the_place_of_another(
    name: str, failure: tuple[int, str, bool] | None, how: str, there: bool
) -> None:
    with place(RECORDED) as here:
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
