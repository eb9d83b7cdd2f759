"""The numbers that decide are rules: few, used, documented, and nowhere else."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

from deeptruck_model.mismatch import rules
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.others import PARAMETER_ERRORS
from deeptruck_model.mismatch.rules import Limits, Rules

ROOT = Path(__file__).parents[3]
TOOL = ROOT / "src" / "deeptruck_model" / "mismatch"
DECIDING = ("verdict/decide.py", "names.py", "verdict/findings.py", "tree.py", "verdict/witnesses.py")
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
STEERING: dict[str, dict[str, str]] = {
    "grids, windows and counts of a computation": {
        "posterior/events.py": "LENGTHS_S MOST STEP_S",
        "live/monitor.py": "PATIENCE",
        "mechanisms/courses.py": "BIN_M MOST_KNOTS SLOW_KNOT_S",
        "mechanisms/terms.py": "ACTING LEAST_ROWS NEAREST",
        "correction/model.py": "FOLDS LOWEST",
        "posterior/kernels.py": "TINY",
        "posterior/posterior.py": "LASTING MOST_KNOTS MOST_PLACES PLACE_M STEADY",
        "posterior/relinearise.py": "SETTLED",
        "posterior/fitted.py": "FORMS IN_PLACE LEAST_GAIN REACH",
        "posterior/sampler.py": "BURN_IN LEAST_POWER LEAST_STEP MOST_KNOWN",
        "residual/components.py": "ALIKE ASK_EVERY_S KNOTS LOOK_BACK_S",
        "residual/evidence.py": "BLOCK_LEARNED_S BLOCK_S SLOW_NOISE_S",
        "residual/forced.py": "ALIKE",
        "residual/command_response.py": "SMOOTH_S",
        "residual/sensor_filter.py": "SMOOTH_S",
        "roads/one_road.py": "LAP_M STEP_M",
        "roads/shared_roads.py": "GAP_M",
        "roads/road_lock.py": "LENGTH_M",
        "strength.py": "SMOOTH_S",
        "unrecorded.py": "BLOCK_S",
    },
    "priors and the tails of noise": {
        "posterior/events.py": "CLIP INFORMS",
        "correction/forms.py": "SIZE_SD",
        "posterior/regression.py": "FREE LARGEST_SLOPE",
        "roads/slow_force.py": "DRAGS",
        "residual/noise.py": "ORDER ORDINARY TAIL Z95",
    },
    "what a recorded signal means": {
        "data/speed_unit.py": "FEWEST GEARS_AT_MOST MOSTLY NEAR SAME",
        "identifiable.py": "APART APART_M_S2 SLOW_S",
        "roads/slow_force.py": "BRAKE_S BRAKING SLOWEST",
        "residual/effective_mass.py": "BRAKED RELEASED_S",
        "residual/evidence.py": "MOST_TURNS SELDOM WIDTH",
        "residual/shift_moment.py": "FEWEST LEAST_CHANGE",
        "unrecorded.py": "IDLE LEAST_S",
    },
    "constants of a mechanism": {
        "mechanisms/air_and_tyres.py": "FAR_M LEAST_GRIP",
        "mechanisms/driveline.py": "LOCKED_M_S",
        "mechanisms/engine_drag.py": "LINGERS LITTLE RELEASED",
        "mechanisms/symbols.py": "ACTS CRAWL_SPEED OMEGA",
    },
    "what a page shows": {
        "report/lines.py": "LARGE MOST_DRIVES WIDE WORTH_SAYING",
        "report/over_speed.py": "LEAST_S MEAN_S MOST_TICKS PRESSED",
        "residual/gather.py": "SLOW_S",
        "report/explorer_data.py": "AROUND_S",
        "report/page.py": "LEAST_SHARE",
        "verdict/where.py": "SMALL",
    },
    "marks": {
        "correction/corrected_truck.py": "SCHEMA",
        "posterior/sampler.py": "OUT",
        "roads/one_road.py": "NOWHERE",
    },
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
        names = weighed(tree)
        found |= {(file, name) for name in names & given.get(file, set())}
        for node in tree.body:
            if isinstance(node, ast.ImportFrom) and node.module:
                place = node.module.removeprefix("deeptruck_model.mismatch.").replace(".", "/") + ".py"
                found |= {(place, a.name) for a in node.names if a.name in names & given.get(place, set())}
    listed = {
        (file, name) for of in STEERING.values() for file, names in of.items() for name in names.split()
    }
    assert found == listed


def test_a_constant_is_seen_in_products_bounds_and_dictionaries() -> None:
    tree = ast.parse("A, B = 1.0, {'x': -2}\nif y < A * z: pass\nmax(B['x'], 0)")
    assert constants(tree) & weighed(tree) == {"A", "B"}


def test_deciding_files_compare_with_rules_alone() -> None:
    allowed = {
        "names.py": {0.02},
        "verdict/witnesses.py": {0.5},
    }  # what is too rare to matter; what is recorded
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


ABOUT_ONE_EFFECT = ("mechanisms/", "roads/", "live/adaptation.py", "data/checks.py", "folders.py")


def test_only_files_about_one_effect_know_its_name() -> None:
    """Whatever else depends on a mechanism asks its record."""
    effects = sorted(LIBRARY.keys() - PARAMETER_ERRORS.keys())
    words = re.compile("|".join(rf"[\"']{name}[\"']|\b{name.upper()}\b" for name in effects))
    knows = {p.relative_to(TOOL).as_posix() for p in TOOL.rglob("*.py") if words.search(p.read_text())}
    assert not {file for file in knows if not file.startswith(ABOUT_ONE_EFFECT)}
    assert any(file.startswith("mechanisms/") for file in knows)
