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
from hypothesis import given
from hypothesis import strategies as st

from deeptruck_core import errors, signals
from deeptruck_core.account import Account, moment
from deeptruck_core.json_data import from_json, stored, to_json
from deeptruck_core.reading import typed
from deeptruck_model import errors as earlier_errors
from deeptruck_model import signals as earlier_signals


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


# The account of an input


@given(st.lists(st.sampled_from(["used", "remote frames", "11-bit frames"]), max_size=50))
def test_what_is_used_and_set_aside_adds_up(items: list[str]) -> None:
    account = Account("drive.log", "frames")
    for line, item in enumerate(items, 1):
        account.total.read += 1
        if item == "used":
            account.total.used += 1
        else:
            account.total.set_aside(item, f"in line {line}")
    assert account.balanced
    account.total.read += 1
    assert not account.balanced


def test_an_account_keeps_counts_reasons_and_the_first_place() -> None:
    account = Account("drive.log", "frames", sources={"can0": 3, "can1": 2}, spans=[(0.0, 1.0), (9.0, 12.0)])
    account.total.read, account.total.used = 5, 3
    account.total.set_aside("remote frames", "in line 4")
    account.total.set_aside("remote frames", "in line 7")
    speed = account.channel("speed")
    speed.read, speed.used = 10, 9
    speed.set_aside("below 0 m/s: reversing", "at 3.2 s")
    assert len(list(account.lines())) == 5
    assert account.balanced
    assert to_json(account)["set_aside"] == {"remote frames": {"count": 2, "first": "in line 4"}}


def test_a_time_since_1970_is_shown_as_a_date() -> None:
    assert moment(299.9) == "299.9 s" and moment(float("nan")) == "nan s"
    assert moment(1.7e9 + 0.25) == "2023-11-14 22:13:20.2 UTC"


# Names of the core that were in deeptruck_model work for one more release


def test_earlier_names_are_the_same_objects() -> None:
    assert earlier_errors.InputError is errors.InputError
    assert earlier_signals.CHANNELS is signals.CHANNELS
    assert earlier_signals.TruckInterface is signals.TruckInterface


def test_a_path_is_shown_as_it_is_typed() -> None:
    assert typed("found/a") == "found/a" and typed("my logs/a") == '"my logs/a"'
    assert typed("a $b") == "'a $b'"
