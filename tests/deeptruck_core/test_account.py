"""The account of an input: it balances where nothing is lost, and is seen not to where something is."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from deeptruck_core import errors, signals
from deeptruck_core.account import Account, moment
from deeptruck_core.json_data import to_json
from deeptruck_core.reading import typed
from deeptruck_model import errors as earlier_errors
from deeptruck_model import signals as earlier_signals


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
