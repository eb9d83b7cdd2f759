"""Thresholds of verdicts are rules: documented, handed on, and nowhere else but for those listed here."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_model.mismatch import rules
from deeptruck_model.mismatch.posterior.penalties import large_enough
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules

ROOT = Path(__file__).parents[3]
MISMATCH = ROOT / "src" / "deeptruck_model" / "mismatch"
DECIDING = ("data", "residual", "posterior", "correction")
ROOMS = tuple(f"deeptruck_model.mismatch.{room}." for room in DECIDING)
# What may be compared with though it is no rule: how many are fitted, which samples enter a fit, how much
# driving it takes to tell something, what cannot be at all, and how something is computed.
NUMERICS = {
    "correction/improvement.py": {"ENOUGH"},
    "correction/own_error.py": {"BEYOND", "ENOUGH", "KNOWN", "SELDOM"},
    "correction/recipes.py": {"FOLDS"},
    "correction/recovered_road.py": {"LEAST"},
    "correction/road_of_another.py": {"ROAD_SHARED"},
    "correction/worth.py": {"NOTICED", "NOTICED_M_S2"},
    "data/one_road.py": {"BELIEVED", "LAP_M", "STEP_M"},
    "data/prepared.py": {"LEAST_DRIVING_S", "LEAST_SPEED_SD"},
    "data/speed_unit.py": {"FEWEST", "GEARS_AT_MOST", "MOSTLY", "NEAR", "SAME"},
    "data/units.py": {"NEAR"},
    "posterior/by_place.py": {"MOSTLY"},
    "posterior/candidates.py": {"FEW_COLUMNS", "FITTED", "MOST_COLUMNS", "SECOND_TERMS"},
    "posterior/kernel_evidence.py": {"ACTING", "FEW_ROWS"},
    "posterior/formula.py": {"BEYOND", "CELLS", "LEAST_IN_CELL", "LEAST_R2"},
    "posterior/free_law.py": {"LEAST_R2"},
    "posterior/kernels.py": {"TINY"},
    "posterior/left_out.py": {"ACTS", "FEWEST"},
    "posterior/next_pass.py": {"AHEAD", "LEAST"},
    "posterior/nuisances.py": {"LEAST_DRIVING_S"},
    "posterior/penalties.py": {"LEARNABLE", "MOST_PRIOR_SD"},
    "posterior/naming.py": {"ALIKE", "MOST_TERMS", "NOTHING", "UNKNOWN"},
    "posterior/recorded_torque.py": {"AFTER_SHIFT_S", "LEAST_BRAKING", "LEAST_ROWS"},
    "posterior/rivals.py": {"Z95"},
    "posterior/road_lock.py": {"LENGTH_M", "ROAD_SHARE", "ROAD_WINDOWS"},
    "posterior/slow_force.py": {"BRAKE_S", "BRAKING", "LINE_R2", "LINE_S", "SLOWEST"},
    "posterior/stepwise.py": {"MOST_TERMS"},
    "posterior/windows.py": {"AROUND_S", "FITTED", "LINE_S", "WINDOWS_MOST"},
    "residual/components.py": {"ALIKE"},
    "residual/effective_mass.py": {"ASKED_MORE", "BRAKED", "RELEASED_S"},
    "residual/evidence.py": {"SELDOM", "WIDTH"},
    "residual/forced.py": {"ALIKE"},
    "residual/sensitivity.py": {"LEAST_EFFECTIVE_MASS_GAIN"},
    "residual/shift_moment.py": {"FEWEST", "TELLS"},
    "residual/noise.py": {"LEAST_DRIVES"},
}


def deciding() -> Iterator[tuple[str, ast.Module]]:
    for room in DECIDING:
        for path in sorted((MISMATCH / room).glob("*.py")):
            yield f"{room}/{path.name}", ast.parse(path.read_text(encoding="utf-8"))


def numbers(tree: ast.Module) -> set[str]:
    """Upper-case names that a module gives to numbers, or imports from one that may."""
    found: set[str] = set()
    for node in tree.body:
        if isinstance(node, ast.Assign) and any(
            isinstance(part, ast.Constant) and isinstance(part.value, int | float)
            for part in ast.walk(node.value)
        ):
            names = [part.id for target in node.targets for part in ast.walk(target) if hasattr(part, "id")]
            found |= {name for name in names if name.isupper()}
        elif isinstance(node, ast.ImportFrom) and str(node.module).startswith(ROOMS):
            found |= {alias.name for alias in node.names if alias.name.isupper()}
    return found


def compared(tree: ast.Module) -> set[str]:
    """Names in comparisons of sizes, in functions."""
    sizes = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)
    nodes = (n for n in ast.walk(tree) if isinstance(n, ast.Compare) and isinstance(n.ops[0], sizes))
    return {part.id for n in nodes for part in ast.walk(n) if isinstance(part, ast.Name)}


def test_no_module_compares_with_a_number_of_its_own() -> None:
    found = {name: numbers(tree) & compared(tree) for name, tree in deciding()}
    assert {name: own for name, own in found.items() if own} == NUMERICS


def takes_rules(node: ast.AST) -> bool:
    """Whether a function has such an argument, or a class such a field."""
    if isinstance(node, ast.FunctionDef):
        return any(a.arg == "rules" for a in [*node.args.args, *node.args.kwonlyargs])
    return isinstance(node, ast.ClassDef) and any(
        isinstance(n, ast.AnnAssign) and ast.unparse(n.target) == "rules" for n in node.body
    )


def test_rules_are_handed_on() -> None:
    """Nothing falls back on the usual rules where others were given. Names with two meanings are not seen."""
    trees = dict(deciding()) | {"find.py": ast.parse((MISMATCH / "find.py").read_text(encoding="utf-8"))}
    defined = [
        n for t in trees.values() for n in ast.walk(t) if isinstance(n, ast.FunctionDef | ast.ClassDef)
    ]
    takes = {n.name for n in defined if takes_rules(n)} - {n.name for n in defined if not takes_rules(n)}
    assert {"gather", "claimed", "sensor_faults", "Cause", "Evidence", "Series"} <= takes
    for name, tree in trees.items():
        for call in (n for n in ast.walk(tree) if isinstance(n, ast.Call)):
            called = getattr(call.func, "attr", getattr(call.func, "id", ""))
            given = " ".join(ast.unparse(a) for a in [*call.args, *(k.value for k in call.keywords)])
            assert called not in takes or "rules" in given, f"{name}:{call.lineno}"


def test_the_page_is_the_rules() -> None:
    page = (ROOT / "docs" / "mismatch_rules.md").read_text(encoding="utf-8")
    inside = page.partition(rules.BEGIN)[2].partition(rules.END)[0]
    assert inside.strip() == rules.table(), "run: python -m deeptruck_model.mismatch.rules"


def test_the_table_is_put_between_the_marks(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{rules.BEGIN}\nstale row\n{rules.END}\nafter\n")
    rules.put_into(page)
    text = page.read_text()
    assert text.startswith("before\n") and text.endswith("\nafter\n") and "stale row" not in text
    assert text.count("\n| `") == len(fields(Rules))


def test_every_rule_says_what_it_is() -> None:
    sources = {rules.SENSORS, rules.TRUCKS, rules.STATISTICS, rules.CHOSEN, rules.FITTED}
    for f in fields(Rules):
        assert f.metadata["unit"] and f.metadata["means"] and f.metadata["source"] in sources, f.name


def test_rules_cannot_be_changed_but_replaced() -> None:
    usual = Rules()
    with pytest.raises(FrozenInstanceError):
        usual.least_gain = 1.0  # type: ignore[misc]
    assert replace(usual, least_gain=1.0) != usual == Rules()


def test_evidence_is_judged_by_its_own_rules(nothing_missing: Evidence) -> None:
    force = np.full(len(nothing_missing), 0.03)
    strict = Rules(least_force=0.05, least_force_acting=0.05)
    assert large_enough(nothing_missing, force)
    assert not large_enough(replace(nothing_missing, rules=strict), force)
