"""How many instances of an FMU are made, with a counter in the place of each."""

from __future__ import annotations

from typing import cast

import pytest

from deeptruck_model.fmu.drives import FEWEST, SAVE_EVERY, Drive, Instances
from deeptruck_model.fmu.instance import Instance


class Counter:
    """Counts its starts and its steps since, as an instance that cannot save its state."""

    starts = 0

    def start(self, values: object) -> list[float]:
        self.starts += 1
        self.steps = 0.0
        return [0.0]

    def step(self, inputs: object) -> list[float]:
        self.steps += 1.0
        return [self.steps]

    def close(self) -> None:
        """Nothing to end."""


def counted(
    kind: type[Counter], *, can_save: bool = False, only_once: bool = False
) -> tuple[Instances, list[Counter]]:
    """Instances of this kind, and all that were made."""
    made: list[Counter] = []

    def new() -> Instance:
        made.append(kind())
        return cast(Instance, made[-1])

    return Instances(new, can_save=can_save, only_once=only_once), made


@pytest.mark.parametrize(("only_once", "most"), [(True, 1), (False, FEWEST)])
def test_an_fmu_that_allows_one_instance_gets_one(only_once: bool, most: int) -> None:
    instances, made = counted(Counter, only_once=only_once)
    drives = [Drive(()) for _ in range(FEWEST + 2)]
    for drive in drives:
        instances.begin(drive)
    for length in range(3):  # in turns: one instance drives each of them again from its start
        for drive in drives:
            assert instances.step(drive, length, [0.0])[1] == [length + 1.0]
    assert len(made) == most


def test_the_instance_longest_unused_is_taken_from_its_drive() -> None:
    instances, made = counted(Counter)
    drives = [Drive(()) for _ in range(FEWEST + 2)]
    for drive in drives:
        instances.begin(drive)
    for drive in drives[2:]:
        instances.step(drive, 0, [0.0])
    assert sum(one.starts for one in made) == len(drives)  # none had to start again


class Saving(Counter):
    """Can save its steps, and be set back to them."""

    def save_state(self) -> float:
        return self.steps

    def restore(self, state: float) -> None:
        self.steps = state

    def forget(self, state: float) -> None:
        """Nothing to free."""


def test_an_instance_goes_back_to_a_state_from_before_though_it_saved_later_ones() -> None:
    instances, made = counted(Saving, can_save=True)
    drive = Drive(())
    instances.begin(drive)
    for length in range(SAVE_EVERY + 2):
        instances.step(drive, length, [0.0])
    assert instances.step(drive, 10, [0.0])[1] == [11.0]
    assert [one.starts for one in made] == [1]
