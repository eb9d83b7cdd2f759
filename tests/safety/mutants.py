"""One change at a time: every operator, comparison, boundary, constant and condition of a module."""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "src" / "truck_bridge" / "safety"
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


def path_of(module: str) -> Path:
    """Of a module of the safety core by its name, or of a path below src."""
    return SOURCE / f"{module}.py" if "/" not in module else SOURCE.parents[1] / module


def _parse(module: str) -> ast.Module:
    return ast.parse(path_of(module).read_text())


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


def mutants(module: str, text: str | None = None) -> list[Mutant]:
    """Every mutant of a module: one of the safety core by its name, or a path below src.

    `text` is another version of its source.
    """
    found = []
    for number, place in enumerate(_places(_parse(module) if text is None else ast.parse(text))):
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
