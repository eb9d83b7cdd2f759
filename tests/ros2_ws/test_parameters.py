"""Parameters: one schema, one line for whatever does not fit it."""

from __future__ import annotations

from pathlib import Path

import pytest

from deeptruck_core.errors import InputError
from deeptruck_nodes import parameters

NODES = [name for name in parameters.schema() if name != "common"]


@pytest.mark.parametrize("node", NODES)
def test_defaults_fit_their_own_schema(node: str) -> None:
    values = parameters.checked(node, {})
    assert set(values) == set(parameters.described(node))
    assert all(entry["says"] for entry in parameters.described(node).values())


@pytest.mark.parametrize(
    ("given", "names"),
    [
        ({"rate": 10}, "truck_sim has no parameter 'rate'"),
        ({"rate_hz": 0.5}, "rate_hz = 0.5 is outside 1..1000"),
        ({"rate_hz": float("nan")}, "is outside 1..1000"),
        ({"rate_hz": "fast"}, "rate_hz = 'fast' is not a number"),
        ({"rate_hz": True}, "is not a number"),
        ({"simulator": 3}, "is not a text"),
        ({"lockstep": 1}, "is not a switch"),
        ({"peers": "leader"}, "is not a texts"),
    ],
)
def test_bad_values_are_refused_in_one_line(given: dict[str, object], names: str) -> None:
    with pytest.raises(InputError) as caught:
        parameters.checked("truck_sim", given)
    assert names in str(caught.value) and "\n" not in str(caught.value)


def test_a_file_comes_back_as_it_was_written(tmp_path: Path) -> None:
    given = {"leader": {"seed": 3, "profile": "sine"}, "truck_sim": {"rate_hz": 50.0}}
    parameters.write_file(tmp_path / "p.yaml", given)
    back = parameters.read_file(tmp_path / "p.yaml")
    assert {k: back["leader"][k] for k in ("seed", "profile")} == given["leader"]
    assert parameters.checked("truck_sim", back["truck_sim"]) == parameters.checked(
        "truck_sim", given["truck_sim"]
    )


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("a: [", "is not YAML"),
        ("", "expected 'NODE: {ros__parameters: {name: value}}'"),
        ("pilot: {ros__parameters: {x: 1}}", "not 'pilot'; nodes are truck_sim"),
        ("leader: {seed: 1}", "expected 'NODE: {ros__parameters:"),
        ("leader: {ros__parameters: {speeed: 1}}", "has no parameter 'speeed'"),
        ("/leader: {ros__parameters: {seed: -1}}", "outside 0..2147483647"),
    ],
)
def test_bad_files_are_refused_in_one_line(text: str, names: str, tmp_path: Path) -> None:
    (tmp_path / "p.yaml").write_text(text)
    with pytest.raises(InputError) as caught:
        parameters.read_file(tmp_path / "p.yaml")
    assert names in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot read parameters"):
        parameters.read_file(tmp_path / "none.yaml")
