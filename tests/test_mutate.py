"""The draw of mutants: by seed, each a change that compiles, and tests that exist."""

from __future__ import annotations

import ast
import importlib.util
from pathlib import Path

SPEC = importlib.util.spec_from_file_location("mutate", Path(__file__).with_name("mutate.py"))
assert SPEC is not None and SPEC.loader is not None
mutate = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(mutate)
ROOMS = ("deeptruck_cacc/safety/shield.py", "truck_bridge/j1939")


def test_a_draw_is_the_same_by_its_seed_and_each_mutant_differs_and_compiles() -> None:
    chosen = mutate.drawn(ROOMS, 20, seed=3)
    assert chosen == mutate.drawn(ROOMS, 20, seed=3) != mutate.drawn(ROOMS, 20, seed=4)
    for one in chosen:
        original = ast.unparse(ast.parse((mutate.SOURCE / one.module).read_text()))
        mutated = ast.unparse(one.tree())
        assert mutated != original
        compile(mutated, one.module, "exec")


def test_the_tests_of_a_file_mirror_it() -> None:
    for file, tests in (
        ("deeptruck_cacc/safety/shield.py", "deeptruck_cacc/safety/test_shield.py"),
        ("deeptruck_cacc/safety/proof.py", "deeptruck_cacc/safety"),
        ("truck_bridge/safety/motion.py", "safety/test_motion.py"),
        ("truck_bridge/units.py", "truck_bridge"),
    ):
        assert mutate.tests_of(file) == mutate.TESTS / tests
