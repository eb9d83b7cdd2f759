"""Arguments that no training run can have."""

from __future__ import annotations

from typing import Any

import pytest

from deeptruck_core.errors import InputError
from deeptruck_model.deep.arguments import Arguments


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"learning_rate": -1.0}, "learning_rate is -1; it must be at least 0"),
        ({"updates": -5}, r"budget \(updates in Python\) is -5; it must be at least 0"),
        ({"learning_rate": 1e31}, r"learning_rate is 1e\+31; it must be at most 1e\+30"),
        ({"members": 0}, "members is 0; it must be at least 1"),
        ({"clip": float("nan")}, "clip is nan"),
    ],
)
def test_a_value_that_no_run_can_have_is_refused(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Arguments(**wrong)
