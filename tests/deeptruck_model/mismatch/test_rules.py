"""The numbers that decide are rules: few, used, documented, and nowhere else."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.families import PARAMETER_ERRORS
from deeptruck_model.mismatch.rules import Limits, Rules

ROOT = Path(__file__).parents[3]
TOOL = ROOT / "src" / "deeptruck_model" / "mismatch"
DECIDING = ("verdict/decide.py", "posterior/names.py", "verdict/findings.py", "verdict/where.py")
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


# Constants that are compared with, or bound a value, and decide nothing: by what they steer.
STEERING = {
    "grids, windows and counts of a computation": (
        "ACTING ALIKE ASK_EVERY_S AT_A_SHIFT BEHIND BIN_M BLOCK_LEARNED_S BLOCK_S BURN_IN FAR FOLDS FORMS "
        "IN_PLACE KNOTS LAP_M LASTING LEAST_GAIN LEAST_POWER LEAST_ROWS LEAST_STEP LENGTHS_S "
        "LOOK_BACK_S LOWEST MOST MOST_KNOTS MOST_KNOWN MOST_PLACES MOST_STEPS NEAREST "
        "PLACE_M REACH SETTLED SLOW_KNOT_S SLOW_NOISE_S SMOOTH_S STEADY STEP_M STEP_S TINY"
    ),
    "priors and the tails of noise": "CLIP FREE INFORMS LARGEST_SLOPE ORDER ORDINARY TAIL Z95",
    "what a recorded signal means": (
        "BRAKED BRAKE_S BRAKING FEWEST GEARS_AT_MOST IDLE LEAST_CHANGE LEAST_S "
        "MOSTLY MOST_TURNS NEAR NEAR_M RELEASED_S SAME SELDOM SLOWEST SLOW_S WIDTH"
    ),
    "constants of a mechanism": "ACTS CRAWL_SPEED FAR_M LEAST_GRIP LINGERS LITTLE LOCKED_M_S OMEGA RELEASED",
    "what a page shows": (
        "AROUND_S BINS LARGE LEAST_S LEAST_SHARE MOST_DRIVES NOTHING_KNOWN PRESSED SLOW_S SMALL WORTH_SAYING"
    ),
    "marks": "NOWHERE OUT SCHEMA",
}
BOUNDING = {"max", "min", "maximum", "minimum", "clip"}


def is_numeric(node: ast.expr | None) -> bool:
    """Whether an expression is a number, or a tuple or dictionary of such."""
    if isinstance(node, ast.UnaryOp):
        return is_numeric(node.operand)
    if isinstance(node, ast.Tuple | ast.Dict):
        values = node.elts if isinstance(node, ast.Tuple) else node.values
        return bool(values) and all(map(is_numeric, values))
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def constants(tree: ast.Module) -> set[str]:
    """Names that a file gives to numbers."""
    found = set()
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            pairs = [(target, node.value)]
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = list(zip(target.elts, node.value.elts, strict=True))
            found |= {t.id for t, value in pairs if isinstance(t, ast.Name) and is_numeric(value)}
    return found


def weighed(tree: ast.Module) -> set[str]:
    """Names in a comparison or in the arguments of a bound, in products and subscripts too."""
    sides: list[ast.expr] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            sides += [node.left, *node.comparators]
        elif isinstance(node, ast.Call):
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            sides += node.args if name in BOUNDING else []
    return {n.id for side in sides for n in ast.walk(side) if isinstance(n, ast.Name)}


def test_each_rule_is_used() -> None:
    source = "".join(p.read_text() for p in TOOL.rglob("*.py") if p.name != "rules.py")
    assert not [f.name for f in fields(Rules) if not re.search(rf"[Rr]ules\.{f.name}\b", source)]
    assert not [f.name for f in fields(Limits) if not re.search(rf"\bLimits\.{f.name}\b", source)]


def test_what_is_compared_with_is_a_rule_or_steers_a_computation() -> None:
    """In every file of the tool; a constant that is imported belongs to the file that has it."""
    trees = {p.relative_to(TOOL).as_posix(): ast.parse(p.read_text()) for p in TOOL.rglob("*.py")}
    given = {file: constants(tree) for file, tree in trees.items() if file != "rules.py"}
    found = set()
    for file, tree in trees.items():
        own = set(given.get(file, ()))
        for node in tree.body:
            if isinstance(node, ast.ImportFrom) and node.module:
                place = node.module.removeprefix("deeptruck_model.mismatch.").replace(".", "/") + ".py"
                own |= {a.name for a in node.names} & given.get(place, set())
        found |= weighed(tree) & own
    assert found == {name for names in STEERING.values() for name in names.split()}


def test_a_constant_is_seen_in_products_bounds_and_dictionaries() -> None:
    tree = ast.parse("A, B = 1.0, {'x': -2}\nif y < A * z: pass\nmax(B['x'], 0)")
    assert constants(tree) & weighed(tree) == {"A", "B"}


def test_deciding_files_compare_with_rules_alone() -> None:
    allowed = {
        "posterior/names.py": {0.02},
        "verdict/where.py": {0.1, 0.5, 2.0, 200},
    }  # what is too rare to matter; which segments and regimes are shown
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


ABOUT_ONE_EFFECT = (
    "mechanisms/",
    "verdict/road.py",
    "live/adaptation.py",
    "prepare/sensors.py",
    "folders.py",
)


def test_only_files_about_one_effect_know_its_name() -> None:
    """Whatever else depends on a mechanism asks its record."""
    effects = sorted(LIBRARY.keys() - PARAMETER_ERRORS.keys())
    words = re.compile("|".join(rf"[\"']{name}[\"']|\b{name.upper()}\b" for name in effects))
    knows = {p.relative_to(TOOL).as_posix() for p in TOOL.rglob("*.py") if words.search(p.read_text())}
    assert not {file for file in knows if not file.startswith(ABOUT_ONE_EFFECT)}
    assert any(file.startswith("mechanisms/") for file in knows)
