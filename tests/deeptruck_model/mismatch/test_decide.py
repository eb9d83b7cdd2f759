"""What the verdict advises."""

from __future__ import annotations

from typing import cast

import pytest

from deeptruck_model.mismatch import decide
from deeptruck_model.mismatch.budget import Budget
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck
from deeptruck_model.mismatch.fit_result import Compared, FitResult, Rmse
from deeptruck_model.mismatch.report import wording
from deeptruck_model.mismatch.result import Advice, Answer, Conclusion
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.validate import Validated


@pytest.mark.parametrize(
    ("after", "expected"),
    [
        (0.4, Advice(Answer.UNSURE, wording.NOT_SIGNIFICANT)),
        (0.5, Advice(Answer.NO, wording.NOT_BETTER)),
        (0.6, Advice(Answer.NO, wording.NOT_BETTER)),
    ],
)
def test_a_correction_that_is_not_validated_is_open_where_the_error_falls(
    after: float, expected: Advice
) -> None:
    before = Rmse(0.5, 0.1)
    fit = FitResult(("a",), 40.0, 3, ("headwind",), False, Compared(before, before, Rmse(after, 0.1)))
    driven = Validated(cast(CorrectedTruck, None), cast(CorrectedTruck, None), {}, fit, None)
    budget = Budget(40.0, 3, 0.5, ())
    assert decide.advice((), Conclusion.PHYSICS, budget, driven, Rules(), faults=False)["apply"] == expected
