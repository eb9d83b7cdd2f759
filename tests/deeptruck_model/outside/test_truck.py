"""Somebody else's simulator drives as one of ours, and what it answers wrongly is one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import simulators
from deeptruck_model.simulators import Simulator

BARE = """

class Bare:
    '''No more than what is needed.'''
    def __init__(self):
        self.truck = make()
        self.interface, self.dt = self.truck.interface, self.truck.dt
        self.reset, self.force = self.truck.reset, self.truck.force
        self.command_range = {"engine_command": (0.0, 500.0)}
    def step(self, state, u, w):
        return self.truck.step(state, u, w)

class Flat(Bare):
    def step(self, state, u, w): return state, state

class Diverges(Bare):
    def step(self, state, u, w): return state, np.full((len(u), 2), np.inf)

class Lone(Bare):
    def step(self, state, u, w): return None

class Raises(Bare):
    def step(self, state, u, w): raise ZeroDivisionError("by zero")

class Rolls(Bare):
    def rollout(self, u, w, y0, recorded): return simulators.Run(np.full((len(u), u.shape[1], 2), np.nan), {})
"""


def load(shuttle: Path, factory: str) -> Any:
    with shuttle.open("a") as file:
        file.write(BARE + "\nfrom deeptruck_model import simulators\n")
    return simulators.load(f"python:{shuttle.stem}:{factory}")


U, W, Y0 = np.full((2, 30, 2), [500.0, 0.0]), np.zeros((2, 30, 1)), np.array([[0.0, 10.0], [0.0, 20.0]])


def test_it_drives_as_the_object_itself_does(shuttle: Path) -> None:
    truck = load(shuttle, "make")
    assert isinstance(truck, Simulator)
    speed = simulators.free_run(truck, U, W, Y0).y[:, :, 1]
    a = 4.0 * 500.0 / 20000.0 - 0.5 * 1.2 * 6.0 / 20000.0 * Y0[:, 1] ** 2 - 9.81 * 0.006
    np.testing.assert_allclose(speed[:, 1], Y0[:, 1] + 0.1 * a)
    heavy = truck.with_parameters({"mass": 40000.0})
    assert heavy.parameters()["mass"] == 40000.0 and truck.parameters()["mass"] == 20000.0
    with pytest.raises(InputError, match="has no parameter wings"):
        truck.with_parameters({"wings": 2.0})


def test_what_it_leaves_out_is_filled_in_and_what_it_has_beyond_is_passed_on(shuttle: Path) -> None:
    truck = load(shuttle, "Bare")
    assert isinstance(truck, Simulator)
    assert truck.parameters() == {} and truck.inside(truck.reset(Y0)) == {}
    assert truck.command_range == {"engine_command": (0.0, 500.0)} and not hasattr(truck, "rollout")
    assert simulators.free_run(truck, U, W, Y0).y.shape == (2, 30, 2)


@pytest.mark.parametrize(
    ("factory", "says"),
    [
        ("Flat", r"its y has shape \(2,\), expected \(2, 2\)"),
        ("Diverges", "its y is not finite"),
        ("Lone", "step raised TypeError"),
        ("Raises", r"step raised ZeroDivisionError at \w+.py:\d+ \(by zero\)"),
    ],
)
def test_a_wrong_answer_is_one_line_that_names_it(shuttle: Path, factory: str, says: str) -> None:
    with pytest.raises(InputError, match=rf"^python:{shuttle.stem}:{factory}: .*{says}") as caught:
        simulators.free_run(load(shuttle, factory), U, W, Y0)
    assert "\n" not in str(caught.value)
