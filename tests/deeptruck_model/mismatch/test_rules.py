"""The numbers that decide are rules: few, used, documented, and nowhere else."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

from deeptruck_model.mismatch import rules
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.rules import Rules

ROOT = Path(__file__).parents[3]
TOOL = ROOT / "src" / "deeptruck_model" / "mismatch"
DECIDING = ("decide.py", "names.py", "findings.py", "tree.py", "witnesses.py")
ALLOWED = {0, 1}


def compared_numbers(path: Path) -> Iterator[float]:
    """Numbers, written out or by a constant of the file, that something is compared with."""
    tree = ast.parse(path.read_text())
    constants = {
        target.id: node.value.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            for side in (node.left, *node.comparators):
                value = side.value if isinstance(side, ast.Constant) else None
                value = constants.get(side.id) if isinstance(side, ast.Name) else value
                if isinstance(value, int | float) and not isinstance(value, bool):
                    yield value


def test_there_are_at_most_25_rules_and_each_is_used() -> None:
    source = "".join(p.read_text() for p in TOOL.rglob("*.py") if p.name != "rules.py")
    assert len(fields(Rules)) <= 25
    assert not [f.name for f in fields(Rules) if f"rules.{f.name}" not in source]


def test_deciding_files_compare_with_rules_alone() -> None:
    allowed = {"names.py": {0.02}, "witnesses.py": {0.5}}  # what is too rare to matter; what is recorded
    found = {
        name: set(compared_numbers(TOOL / name)) - ALLOWED - allowed.get(name, set()) for name in DECIDING
    }
    assert not {name: numbers for name, numbers in found.items() if numbers}


def test_only_one_file_names_a_verdict() -> None:
    naming = [
        p.name
        for p in TOOL.rglob("*.py")
        if any(f"Conclusion.{word}" in p.read_text() for word in ("NOTHING", "UNDETERMINED", "PHYSICS"))
    ]
    assert set(naming) == {"decide.py", "lines.py"}  # the second words it


def test_the_page_has_the_rules() -> None:
    page = (ROOT / "docs" / "mismatch_rules.md").read_text(encoding="utf-8")
    assert rules.table() in page


def compared_names(source: str, names: set[str]) -> set[str]:
    """Names of mechanisms that something is compared with, or looked for in a written-out collection."""
    sides = [
        side
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Compare)
        for side in (node.left, *node.comparators)
    ]
    found = (inner.value for side in sides for inner in ast.walk(side) if isinstance(inner, ast.Constant))
    return {value for value in found if isinstance(value, str) and value in names}


# The place that still asks by name: a list that may become shorter, and no longer.
BY_NAME = {"output.py": {"road_grade"}}


def test_generic_code_asks_for_no_mechanism_by_its_name() -> None:
    names = set(LIBRARY)
    assert compared_names("if x.name in ('other', 'brake_lag'): pass", {"brake_lag"}) == {"brake_lag"}
    generic = [p for p in TOOL.rglob("*.py") if p.parent.name != "mechanisms"]
    found = {p.relative_to(TOOL).as_posix(): compared_names(p.read_text(), names) for p in generic}
    assert {file: names for file, names in found.items() if names} == BY_NAME
