"""Cases side by side."""

from __future__ import annotations

import operator
import os

import pytest

from deeptruck_core.errors import InputError
from deeptruck_exam.jobs import in_parallel


def test_each_comes_with_its_result() -> None:
    assert dict(in_parallel(operator.neg, [1, 2, 3], 2, "cases")) == {1: -1, 2: -2, 3: -3}


def test_a_killed_process_is_one_line() -> None:
    with pytest.raises(InputError, match="a process was killed; is there memory for 1 at once"):
        list(in_parallel(os._exit, [1], 1, "cases"))
