"""Mutation test of the safety core: `python tests/safety/mutate.py [--jobs N]`.

Every operator, comparison, boundary, constant, condition and statement of the core is changed, one at a
time, and the core's tests run against it in a forked process. A mutant that no test notices is a survivor.
Survivors that change nothing a truck could notice are listed with the reason in
mutants_alike.py. Exit code 1 when any other survives.

A whole run writes docs/results/bridge_mutation.md with a digest of the core; CI refuses a core that differs
from it, and runs a sample (`--sample N`) that the digest draws. `--since COMMIT` runs only mutants that the
core of that commit did not have, and writes that the rest are carried over from its run; with `--sample` it
writes of how many they were drawn.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.abc
import importlib.machinery
import io
import os
import random
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from mutants import SOURCE, Mutant, mutants, path_of
from mutants_alike import ALIKE

HERE = Path(__file__).resolve().parent
PROMISE = ("frames", "engagement", "handing_back", "losing", "arming")
TESTS = {  # for each module, the tests most likely to notice first
    "core": ("stopping", "who_ends_it", *PROMISE, "demands", "exact_times", "limits", "hearing"),
    "demands": ("demands", "losing"),
    "ending": ("stopping", "who_ends_it"),
    "hearing": ("hearing", "stopping", *PROMISE, "limits"),
    "motion": ("motion", "limits", "stopping", *PROMISE),
    "checks": ("hearing", *PROMISE, "limits"),
    "tables": ("stopping", "who_ends_it", "limits", *PROMISE, "hearing", "demands"),
}
RESULT = HERE.parents[1] / "docs" / "results" / "bridge_mutation.md"
SECONDS = 300  # of the processor: a mutant that runs longer hangs, and is detected


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.SourceLoader):
    """Supplies the mutated module and nothing else."""

    def __init__(self, mutant: Mutant) -> None:
        self.name, self.mutant = f"truck_bridge.safety.{mutant.module}", mutant

    def find_spec(self, fullname: str, path: object, target: object = None) -> object:
        return importlib.machinery.ModuleSpec(fullname, self) if fullname == self.name else None

    def get_filename(self, fullname: str) -> str:
        return f"<mutant of {fullname}>"

    def get_data(self, path: str) -> bytes:
        return b""

    def source_to_code(self, data: object, path: object, **_: object) -> object:  # type: ignore[override]
        return compile(self.mutant.tree(), str(path), "exec")


def detected(mutant: Mutant) -> bool:
    """Whether one of the tests fails with a mutant."""
    return _fails(mutant.module, mutant)


def _fails(module: str, mutant: Mutant | None) -> bool:
    """Run a module's tests in a forked process, with a mutant in its place or as it is; True if one fails."""
    child = os.fork()
    if child:
        return os.waitpid(child, 0)[1] != 0
    code = 3
    try:
        import signal

        signal.setitimer(signal.ITIMER_VIRTUAL, SECONDS)
        os.environ["SAFETY_VEHICLES"] = "trucksim"  # has every kind of checksum; one vehicle is enough
        if mutant is not None:
            sys.meta_path.insert(0, _Finder(mutant))
        code = _run_tests(module)
    finally:
        os._exit(code)


def _run_tests(module: str) -> int:
    import pytest

    options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:cov", "-o", "addopts="]
    options += ["--import-mode=importlib", "--no-header", "--tb=no", f"--confcutdir={HERE}"]
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        for test in TESTS[module]:
            code = int(pytest.main([*options, str(HERE / f"test_{test}.py")]))
            if code:
                return code
    return 0


def digest() -> str:
    """Of the core's source."""
    sources = [path.read_bytes() for path in sorted(SOURCE.glob("*.py"))]
    return hashlib.sha256(b"".join(sources)).hexdigest()


def _new(found: list[Mutant], commit: str) -> list[Mutant]:
    """The mutants that the core of a commit did not have."""
    before: Counter[tuple[str, str, str]] = Counter()
    for module in TESTS:
        name = f"{commit}:./{path_of(module).name}"
        text = subprocess.run(["git", "show", name], cwd=SOURCE, capture_output=True, text=True, check=False)
        before.update((m.module, m.before, m.after) for m in mutants(module, text.stdout))
    new = []
    for mutant in found:
        key = (mutant.module, mutant.before, mutant.after)
        if before[key] > 0:
            before[key] -= 1
        else:
            new.append(mutant)
    return new


def _write(
    count: int, survivors: list[Mutant], new: int, carried: int, since: str, sample: int | None
) -> None:
    listed = [f"- {m.module}.py:{m.line}: `{m.before}` as `{m.after}`" for m in survivors] or ["None."]
    command = f"python tests/safety/mutate.py{f' --since {since}' if since else ''}"
    command += f" --sample {sample}" if sample is not None else ""
    lines = [
        "# Mutation of the safety core",
        "",
        f"`{command}`: {count} of {new} mutants, {count - len(survivors)} detected.",
        *([f"Carried over from the run at {since}, which detected all: {carried}."] if since else []),
        f"Core (SHA-256 of its files): `{digest()}`.",
        "",
        "## Survivors",
        "",
        *listed,
        "",
        f"{len(ALIKE)} mutants that change nothing a truck could notice are not run: "
        "`tests/safety/mutants_alike.py`.",
    ]
    RESULT.write_text("\n".join(lines) + "\n")


def main() -> int:
    """Run all mutants, or a sample."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sample", type=int, help="only so many mutants, drawn by the digest")
    parser.add_argument("--since", help="only mutants that the core of this commit did not have")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--module", choices=list(TESTS))
    options = parser.parse_args()
    found = [m for name in TESTS if options.module in (None, name) for m in mutants(name)]
    found = [m for m in found if (m.module, m.before, m.after) not in ALIKE]
    whole = len(found)
    if options.since:
        found = _new(found, options.since)
    new = len(found)
    if options.sample is not None:
        found = random.Random(digest()).sample(found, min(options.sample, len(found)))
    import cantools  # noqa: F401 - loaded once, before the forks
    import pytest  # noqa: F401

    if broken := [name for name in dict.fromkeys(m.module for m in found) if _fails(name, None)]:
        print(f"the tests of {', '.join(broken)} fail without a mutant, so that they would notice all")
        return 2
    with ThreadPoolExecutor(options.jobs) as pool:
        verdicts = list(pool.map(detected, found))
    survivors = [m for m, seen in zip(found, verdicts, strict=True) if not seen]
    for mutant in survivors:
        print(f"survived: {mutant.module}.py:{mutant.line}\n  {mutant.before}\n  {mutant.after}")
    print(f"{len(found)} mutants, {len(found) - len(survivors)} detected, {len(survivors)} survived")
    print(f"{len(ALIKE)} more are alike to the original and not run")
    if (options.sample is None or options.since) and options.module is None:
        _write(len(found), survivors, new, whole - new, options.since or "", options.sample)
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
