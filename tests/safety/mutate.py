"""Mutation test of the safety core: `python tests/safety/mutate.py [--jobs N]`.

Every operator, comparison, boundary, constant, condition and statement of the core is changed, one at a
time, and the core's tests run against it in a forked process. A mutant that no test notices is a survivor.
Survivors that change nothing a truck could notice are listed in docs/can_bridge.md with the reason, and here
in ALIKE. Exit code 1 when any other survives.

A whole run writes docs/results/bridge_mutation.md with a digest of the core; CI refuses a core that differs
from it, and runs a sample (`--sample N`) that the digest draws.
"""

from __future__ import annotations

import argparse
import ast
import copy
import hashlib
import importlib.abc
import importlib.machinery
import io
import os
import random
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCE = HERE.parents[1] / "src" / "truck_bridge" / "safety"
PROMISE = ("frames", "engagement", "handing_back", "losing", "arming")
TESTS = {  # for each module, the tests most likely to notice first
    "core": (*PROMISE, "exact_times", "limits", "hearing"),
    "hearing": ("hearing", *PROMISE, "limits"),
    "motion": ("motion", "limits", *PROMISE),
    "checks": ("hearing", *PROMISE, "limits"),
    "tables": ("limits", *PROMISE, "hearing"),
}
RESULT = HERE.parents[1] / "docs" / "results" / "bridge_mutation.md"
SECONDS = 90  # a mutant that runs longer hangs, and is noticed

# Survivors that are alike to the original: module, the changed line, what it becomes.
_STEP = "step = abs(motion.value - axis.rest) > axis.limits.rate * motion.elapsed(now) + axis.demand.scale"
_IDLE = "idle = axis.idle_at_rest and abs(demand - axis.rest) < axis.demand.scale / 2"
ALIKE: set[tuple[str, str, str]] = {
    (module, before, before.replace(old, new, 1))
    for module, before, old, new in (
        # where two results of floating-point sums are compared, equality decides nothing
        ("motion", "if abs(move) > rate * elapsed + quantum:", ">", ">="),
        ("motion", "inside = low + quantum < value < high - quantum", "<", "<="),
        ("motion", "inside = low + quantum < value < high - quantum", "value <", "value <="),
        (
            "motion",
            "return 'jerk' if inside and bend > self.axis.limits.jerk * elapsed ** 2 + quantum else ''",
            ">",
            ">=",
        ),
        ("motion", "away = abs(value - rest) > abs(self.value - rest) + quantum", ">", ">="),
        (
            "motion",
            "return away or abs(value - self.value) > self.axis.limits.fade * self.elapsed(now) + quantum",
            ">",
            ">=",
        ),
        ("motion", "near = abs(self._planned - self.value) <= 0.51 * self.axis.demand.scale", "<=", "<"),
        ("hearing", "if arrivals.count * heard.period_s <= TOO_OFTEN:", "<=", "<"),
        ("core", "return 'too early' if now - motion.time < 0.5 * axis.period_s else ''", "<", "<="),
        ("core", _STEP, ">", ">="),
        ("core", _IDLE, "<", "<="),
        # no axis of our vehicles has a rest other than 0 (motion.py is tested with one that has)
        ("core", _STEP, "motion.value - axis.rest", "motion.value + axis.rest"),
        ("core", _IDLE, "demand - axis.rest", "demand + axis.rest"),
        # a value that arming, engaging or the first command sets before it is used
        ("core", "self._commanded = -math.inf", "self._commanded = -math.inf", "pass"),
        ("core", "self._commanded = -math.inf", "-math", "math"),
        ("core", "self._now = self._engaged_at = self._faded_at = -math.inf", "-math", "math"),
        # the first arrival of all sets it
        ("hearing", "count: int = 0", "0", "1"),
        # both branches agree where they meet
        ("motion", "if x <= x1:", "<=", "<"),
        # a speed that every engagement sets before it is used
        ("motion", "self.start(axis.rest, 0.0, -math.inf)", "0.0", "1.0"),
        # one byte more than the number fills
        (
            "checks",
            "total = sum(word.to_bytes(8, 'little')[:7]) + counter + sum(can_id.to_bytes(4, 'big'))",
            "(8",
            "(9",
        ),
        (
            "checks",
            "total = sum(word.to_bytes(8, 'little')[:7]) + counter + sum(can_id.to_bytes(4, 'big'))",
            "(4",
            "(5",
        ),
    )
}

SWAPS: dict[type[ast.AST], tuple[type[ast.AST], ...]] = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
    ast.Add: (ast.Sub,),
    ast.Sub: (ast.Add,),
    ast.Mult: (ast.Div,),
    ast.Div: (ast.Mult,),
    ast.BitAnd: (ast.BitOr,),
    ast.BitOr: (ast.BitAnd,),
    ast.BitXor: (ast.BitAnd,),
    ast.LShift: (ast.RShift,),
    ast.RShift: (ast.LShift,),
    ast.And: (ast.Or,),
    ast.Or: (ast.And,),
}
NAMES = {"min": "max", "max": "min", "any": "all", "all": "any"}


def _swaps(node: ast.AST) -> Iterator[ast.AST]:
    """Changed copies of one node."""
    for name in ("op", "ops"):
        operators = getattr(node, name, None)
        listed = operators if isinstance(operators, list) else [operators]
        for place, operator in enumerate(listed):
            for other in SWAPS.get(type(operator), ()):
                changed = copy.deepcopy(node)
                if isinstance(operators, list):
                    changed.ops[place] = other()  # type: ignore[attr-defined]
                else:
                    changed.op = other()  # type: ignore[attr-defined]
                yield changed
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        yield copy.deepcopy(node.operand)
    if isinstance(node, ast.Name) and node.id in NAMES:
        yield ast.Name(NAMES[node.id], node.ctx)
    if isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield ast.Constant(not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        yield ast.Constant(node.value + 1)
    if isinstance(node, ast.IfExp):
        yield copy.deepcopy(node.body)
        yield copy.deepcopy(node.orelse)
    if isinstance(node, ast.If):
        changed = copy.deepcopy(node)
        changed.test = ast.UnaryOp(ast.Not(), changed.test)
        yield changed
    if isinstance(node, ast.Assign | ast.AugAssign) or _is_call(node):
        yield ast.Pass()


def _is_call(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)


def _judged(tree: ast.Module) -> Iterator[ast.AST]:
    """All nodes that run: no imports, docstrings, annotations or class-level defaults of plain tables."""
    skipped: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.AnnAssign):
            skipped |= {id(inner) for inner in ast.walk(node.annotation)}
        if isinstance(node, ast.FunctionDef):
            parts = [a.annotation for a in (*node.args.args, *node.args.kwonlyargs) if a.annotation]
            parts += [node.returns] if node.returns else []
            parts += node.decorator_list
            skipped |= {id(inner) for part in parts for inner in ast.walk(part)}
        if isinstance(node, ast.ClassDef):
            skipped |= {id(inner) for part in node.decorator_list for inner in ast.walk(part)}
    for node in ast.walk(tree):
        if id(node) not in skipped and not isinstance(node, ast.Import | ast.ImportFrom):
            yield node


@dataclass(frozen=True)
class Mutant:
    """One change: the number of the node in its module, and which of the node's changes."""

    module: str
    node: int
    change: int
    line: int
    before: str
    after: str

    def tree(self) -> ast.Module:
        """The module with the change made."""
        tree = _parse(self.module)
        place = _places(tree)[self.node]
        place.put(list(_swaps(place.node))[self.change])
        return ast.fix_missing_locations(tree)


@dataclass
class _Place:
    """A node, where it hangs, and the statement around it."""

    node: ast.AST
    parent: ast.AST
    field: str
    index: int | None
    statement: ast.stmt

    def put(self, other: ast.AST) -> None:
        if self.index is None:
            setattr(self.parent, self.field, other)
        else:
            getattr(self.parent, self.field)[self.index] = other


def _parse(module: str) -> ast.Module:
    return ast.parse((SOURCE / f"{module}.py").read_text())


def _places(tree: ast.Module) -> list[_Place]:
    """Every node that runs, in a fixed order."""
    wanted = {id(node) for node in _judged(tree)}
    found: list[_Place] = []

    def walk(parent: ast.AST, statement: ast.stmt | None) -> None:
        for name, value in ast.iter_fields(parent):
            for index, node in enumerate(value if isinstance(value, list) else [value]):
                if isinstance(node, ast.AST):
                    around = node if isinstance(node, ast.stmt) else statement
                    if id(node) in wanted and around is not None:
                        place = index if isinstance(value, list) else None
                        found.append(_Place(node, parent, name, place, around))
                    walk(node, around)

    walk(tree, None)
    return found


def mutants(module: str) -> list[Mutant]:
    """Every mutant of a module."""
    found = []
    for number, place in enumerate(_places(_parse(module))):
        before = ast.unparse(place.statement).splitlines()
        for change, other in enumerate(_swaps(place.node)):
            whole = place.node is place.statement
            if not whole:
                place.put(other)
            after = ast.unparse(other if whole else place.statement).splitlines()
            if not whole:
                place.put(place.node)
            pairs = [(old, new) for old, new in zip(before, after, strict=False) if old != new]
            if pairs:
                old, new = pairs[0]
                line = getattr(place.node, "lineno", place.statement.lineno)
                found.append(Mutant(module, number, change, line, old.strip(), new.strip()))
    return found


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


def noticed(mutant: Mutant) -> bool:
    """Run the tests against one mutant in a forked process; True when one of them fails."""
    child = os.fork()
    if child:
        return os.waitpid(child, 0)[1] != 0
    code = 3
    try:
        import signal

        signal.alarm(SECONDS)
        os.environ["SAFETY_VEHICLES"] = "trucksim"  # has every kind of checksum; one vehicle is enough
        sys.meta_path.insert(0, _Finder(mutant))
        code = _run_tests(mutant.module)
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


def _write(count: int, survivors: list[Mutant]) -> None:
    listed = [f"- {m.module}.py:{m.line}: `{m.before}` as `{m.after}`" for m in survivors] or ["None."]
    alike = [f"- {module}.py: `{before}` as `{after}`" for module, before, after in sorted(ALIKE)]
    lines = [
        "# Mutation of the safety core: measured",
        "",
        f"`python tests/safety/mutate.py`: {count} mutants, {count - len(survivors)} noticed.",
        f"Core (SHA-256 of its files): `{digest()}`.",
        "",
        "## Survivors",
        "",
        *listed,
        "",
        "## Alike to the original, and therefore not run",
        "",
        *alike,
    ]
    RESULT.write_text("\n".join(lines) + "\n")


def main() -> int:
    """Run all mutants, or a sample."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sample", type=int, help="only so many mutants, drawn by the digest")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--module", choices=list(TESTS))
    options = parser.parse_args()
    found = [m for name in TESTS if options.module in (None, name) for m in mutants(name)]
    found = [m for m in found if (m.module, m.before, m.after) not in ALIKE]
    if options.sample is not None:
        found = random.Random(digest()).sample(found, min(options.sample, len(found)))
    import cantools  # noqa: F401 - loaded once, before the forks
    import pytest  # noqa: F401

    with ThreadPoolExecutor(options.jobs) as pool:
        verdicts = list(pool.map(noticed, found))
    survivors = [m for m, seen in zip(found, verdicts, strict=True) if not seen]
    for mutant in survivors:
        print(f"survived: {mutant.module}.py:{mutant.line}\n  {mutant.before}\n  {mutant.after}")
    print(f"{len(found)} mutants, {len(found) - len(survivors)} noticed, {len(survivors)} survived")
    print(f"{len(ALIKE)} more are alike to the original and not run")
    if options.sample is None and options.module is None:
        _write(len(found), survivors)
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
