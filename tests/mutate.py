"""Mutation test of any room: `python tests/mutate.py truck_bridge/j1939 --draw 50 --seed 1`.

Draws changes of single operators, comparisons, constants, conditions and statements by seed from files or
folders below `src`, makes each in a copy of it, and runs the tests that mirror the file, the long ones
too with `--long`. Prints the survivors. Those that change nothing are listed in mutants_alike.yaml with a
reason and are not drawn. Exit code 1 when a mutant survives.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import yaml

TESTS = Path(__file__).resolve().parent
SOURCE = TESTS.parent / "src"
sys.path.append(str(TESTS / "safety"))

from mutants import Mutant, mutants  # noqa: E402

ALIKE = TESTS / "mutants_alike.yaml"
SECONDS = 900  # a mutant whose tests run longer hangs, and is noticed


def drawn(rooms: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """`count` mutants of the files in these rooms, or all where there are fewer, in the order of the draw."""
    files = sorted({path for room in rooms for path in _files(SOURCE / room)})
    listed = {(one["file"], one["before"], one["after"]) for one in yaml.safe_load(ALIKE.read_text()) or ()}
    found = [one for path in files for one in mutants(path.relative_to(SOURCE).as_posix())]
    found = [one for one in found if (one.module, one.before, one.after) not in listed]
    return random.Random(seed).sample(found, min(count, len(found)))


def tests_of(file: str) -> Path:
    """The tests that mirror a source file: test_NAME.py, else the nearest folder of tests above.

    A folder of tests has the path of its source folder, or its name only, as tests/safety.
    """
    path = Path(file)
    nearest = (TESTS / path.parent, TESTS / path.parent.name)
    above = (TESTS / folder for folder in path.parents if folder != Path())
    places = (*(folder / f"test_{path.stem}.py" for folder in nearest), *nearest, *above)
    return next(place for place in places if place.exists())


def survives(one: Mutant, copy: Path, moment: int, *, long: bool) -> bool:
    """Whether the tests pass on the mutant; `copy` is a copy of the source, and whole again afterwards.

    `moment` (s) becomes the file's time, by which Python sees that its byte code is old.
    """
    place, original = copy / one.module, (SOURCE / one.module).read_text()
    place.write_text(ast.unparse(one.tree()))
    os.utime(place, (moment, moment))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(copy), os.environ.get("PYTHONPATH", "")])}
    words = ["-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider", "--tb=no"]
    words += ["-m", "not hours"] if long else []
    try:
        run = subprocess.run(
            [sys.executable, *words, str(tests_of(one.module))],
            cwd=TESTS.parent, env=environment, capture_output=True, timeout=SECONDS, check=False,
        )  # fmt: skip
        return run.returncode == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        place.write_text(original)


def _files(place: Path) -> list[Path]:
    if not place.exists():
        raise SystemExit(f"{place} does not exist; give files or folders below src")
    return [place] if place.is_file() else sorted(place.rglob("*.py"))


def main() -> int:
    """Draw, run, and print what survived."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("rooms", nargs="+", help="files or folders below src")
    parser.add_argument("--draw", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--long", action="store_true", help="run the long tests too")
    given = parser.parse_args()
    chosen, survivors = drawn(given.rooms, given.draw, given.seed), []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "src"
        shutil.copytree(SOURCE, copy, ignore=shutil.ignore_patterns("*.egg-info"))
        for number, one in enumerate(chosen, 1):
            left = survives(one, copy, 10**9 + number, long=given.long)
            survivors += [one] if left else []
            says = f"{'SURVIVES' if left else 'noticed'} {one.module}:{one.line}: {one.before} -> {one.after}"
            print(f"{number}/{len(chosen)} {says}", flush=True)
    print(f"{len(chosen)} mutants, {len(survivors)} survive")
    return bool(survivors)


if __name__ == "__main__":
    sys.exit(main())
