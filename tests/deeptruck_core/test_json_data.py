"""A dataclass is read as it was written, and what its fields say of their form in JSON holds."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
import pytest

from deeptruck_core.json_data import from_json, stored, to_json


class Colour(StrEnum):
    RED = "red"


@dataclass(frozen=True)
class Inner:
    x: float = field(metadata=stored(key="inner_x"))
    n: int = 0


@dataclass(frozen=True)
class Outer:
    name: str
    colour: Colour
    share: float = field(metadata=stored(digits=2))
    ends: tuple[float, float] = field(metadata=stored(figures=3))
    rivals: tuple[str, ...] = field(default=(), metadata=stored(earlier="others"))
    inner: Inner | None = field(default=None, metadata=stored(flat=True))
    force: Any = field(default=None, compare=False, metadata=stored(hidden=True))
    gain: float | None = field(default=None, metadata=stored(sparse=True))
    parts: Mapping[str, Inner] = field(default_factory=dict, metadata=stored(sparse=True))
    compared: int = field(default=7, metadata=stored(later=True))


WHOLE = Outer(
    "a", Colour.RED, 0.25, (1.0, 2.0), ("b",), Inner(3.5, 2), np.zeros(3), 4.0, {"p": Inner(1.0)}, 5
)
LEAST = Outer("a", Colour.RED, 0.25, (1.0, 2.0))


@pytest.mark.parametrize("x", [WHOLE, LEAST])
def test_what_was_written_is_read_again(x: Outer) -> None:
    assert from_json(Outer, json.loads(json.dumps(to_json(x)))) == x


def test_fields_stand_in_their_order_as_their_metadata_say() -> None:
    x = Outer("a", Colour.RED, 0.12345, (1.23456, 1234.56), inner=Inner(1.0), force=np.zeros(3))
    assert json.dumps(to_json(x)) == json.dumps(
        {
            "name": "a", "colour": "red", "share": 0.12, "ends": [1.23, 1230.0], "rivals": [], "others": [],
            "inner_x": 1.0, "n": 0, "compared": 7,
        }
    )  # fmt: skip


def test_types_of_numpy_become_those_of_python_and_what_json_lacks_null() -> None:
    x = Inner(np.float64(np.nan), np.int64(3))  # type: ignore[arg-type]
    data = to_json([x, {"infinite": math.inf, "array": np.array([1.0, np.nan])}])
    assert data == [{"inner_x": None, "n": 3}, {"infinite": None, "array": [1.0, None]}]
    assert type(data[0]["n"]) is int
    assert math.isnan(from_json(Inner, data[0]).x)


def test_keys_of_earlier_schemas_are_read_and_unknown_ones_ignored() -> None:
    data = to_json(WHOLE) | {"new": 1}
    del data["rivals"], data["compared"]
    assert from_json(Outer, data) == Outer(
        "a", Colour.RED, 0.25, (1.0, 2.0), ("b",), Inner(3.5, 2), None, 4.0, {"p": Inner(1.0)}
    )


@pytest.mark.parametrize("key", ["name", "colour", "share", "ends"])
def test_a_key_that_is_always_written_is_required(key: str) -> None:
    data = to_json(LEAST)
    del data[key]
    with pytest.raises(KeyError, match=key):
        from_json(Outer, data)


@pytest.mark.parametrize(
    "wrong",
    [{"name": 1}, {"colour": "blue"}, {"share": "0.25"}, {"share": True}, {"ends": [1.0]}, {"n": 2.5}],
)
def test_values_of_another_type_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises((TypeError, ValueError)):
        from_json(Outer, to_json(WHOLE) | wrong)
    with pytest.raises(TypeError):
        from_json(Outer, [])
