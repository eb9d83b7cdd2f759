"""What corrects an outside simulator names it, with hashes, and loads it again or says what has changed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_model import simulator_facts as facts
from deeptruck_model import simulators
from deeptruck_model.manifest import MANIFEST
from deeptruck_model.mismatch import CorrectedTruck
from deeptruck_model.mismatch.correction.corrected_truck import Term
from deeptruck_model.mismatch.mechanisms import variant
from deeptruck_model.outside import saved

U, W, Y0 = np.full((1, 40, 2), [500.0, 0.0]), np.zeros((1, 40, 1)), np.array([[0.0, 15.0]])


@pytest.fixture
def corrected(shuttle: Path) -> Path:
    """A corrected shuttle as a folder; its arguments are read from heavy.yaml."""
    Path("heavy.yaml").write_text("mass: 30000\n")
    base = simulators.load(f"python:{shuttle.stem}:make:heavy.yaml")
    CorrectedTruck(
        base, [Term("dragging_brake", (variant("constant"),), (0.1,))], {"mass": 0.1}, None, True
    ).save(Path("better"))
    return Path("better").absolute()


def test_it_loads_again_and_drives_the_same(corrected: Path, shuttle: Path) -> None:
    base = simulators.load(f"python:{shuttle.stem}:make:heavy.yaml")
    first = CorrectedTruck(
        base, [Term("dragging_brake", (variant("constant"),), (0.1,))], {"mass": 0.1}, None, True
    )
    again = simulators.load(corrected)
    assert again.parameters()["mass"] == pytest.approx(33000.0)
    runs = [simulators.free_run(truck, U, W, Y0).y for truck in (first, again)]
    np.testing.assert_array_equal(*runs)
    said = facts.simulator(str(corrected))
    assert (said.kind, said.interface.name) == ("corrected", "shuttle")


def test_parameters_that_it_was_given_are_kept(shuttle: Path) -> None:
    truck = simulators.load(f"python:{shuttle.stem}:make").with_parameters({"mass": 25000.0})
    truck.save(Path("kept"))
    assert simulators.load("kept").parameters()["mass"] == 25000.0


def test_from_elsewhere_the_arguments_are_where_they_were(
    corrected: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")  # the module is on the path still
    assert simulators.load(corrected).parameters()["mass"] == pytest.approx(33000.0)


@pytest.mark.parametrize("changed", ["module", "arguments"])
def test_what_has_changed_since_is_not_loaded_until_it_is_accepted(
    corrected: Path, shuttle: Path, changed: str
) -> None:
    file = shuttle if changed == "module" else Path("heavy.yaml")
    file.write_text(file.read_text() + "\n# a remark\n")
    for look in (facts.simulator, simulators.load):
        with pytest.raises(InputError, match=rf"{file.name} of SHA-256 .* --accept'") as caught:
            look(str(corrected))
        assert "\n" not in str(caught.value)
    place = saved.stands_for(corrected)
    assert place == corrected / "base"
    saved.accept(place)
    assert simulators.load(corrected).parameters()["mass"] == pytest.approx(33000.0)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"simulator": "python:gone_for_good:make"}, r"there is no module gone_for_good.*its module was /"),
        ({"simulator": 5}, "is damaged"),
        ({"schema": 0}, "another version"),
        ({"dt": "x"}, "is damaged"),
        ({"parameters": {"wings": 2.0}}, "has no parameter wings"),
        ({"dt": 0.05}, "has another interface or dt now"),
    ],
)
def test_a_folder_that_tells_nothing_usable_is_one_line(
    corrected: Path, change: dict[str, object], says: str
) -> None:
    file = corrected / "base" / MANIFEST
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(InputError, match=says) as caught:
        simulators.load(corrected)
    assert "\n" not in str(caught.value)


def test_an_object_that_nobody_can_make_again_is_named(shuttle: Path) -> None:
    inner = simulators.load(f"python:{shuttle.stem}:make")._inner  # type: ignore[attr-defined]
    CorrectedTruck(inner, [], {}, None, False).save(Path("lone"))
    with pytest.raises(InputError, match=r"an object of shuttle_\w+\.Shuttle, .* write a factory for it"):
        simulators.load("lone")
    assert [file.name for file in Path("lone/base").iterdir()] == [MANIFEST]
