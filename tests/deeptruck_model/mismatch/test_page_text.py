"""What the page says of a group: what decided against each of its names."""

from __future__ import annotations

from typing import Any

import pytest

from deeptruck_model.mismatch import page_text


@pytest.mark.parametrize(
    ("rivals", "said"),
    [
        ({}, "its signals, by which headwind acts too; its form is another"),
        ({"unknown": 12.0}, "a force without a name that comes and goes likewise the data, by 12.0 nats"),
    ],
)
def test_unknown_is_in_a_group_by_its_signals_or_as_a_force_that_comes_and_goes(
    rivals: dict[str, float], said: str
) -> None:
    finding: dict[str, Any] = {
        "effect": "headwind",
        "cannot_be_told_from": ["unknown"],
        "rivals": [{"effect": name, "worse_by_nats": worse} for name, worse in rivals.items()],
    }
    assert said in page_text._apart(finding)
