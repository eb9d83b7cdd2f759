"""What little evidence speaks for must surely help on drives it was not fitted to, or it is not told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_model.mismatch.correction.correction import claimed
from deeptruck_model.mismatch.fit_result import Chosen, Compared, FitResult, Rmse
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.variants import Static, Variant, Windowed
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.left_out import LeftOut
from deeptruck_model.mismatch.rules import Rules

WINDOWED = Windowed(Static(), ((0, 1.0, 9.0),))


def fit(after: float | None, chosen: Chosen = Chosen.FINDINGS) -> FitResult:
    """Of a simulator that is 0.1 m/s off; `after` its correction, m/s, None where no drive is long enough."""
    errors = None if after is None else Compared(Rmse(0.1, 0.1), Rmse(0.05, 0.1), Rmse(after, 0.1))
    return FitResult(
        held_out=("drive",),
        horizon_s=20.0,
        windows=9,
        chosen=chosen,
        corrected=(),
        validated=False,
        errors=errors,
        improvement=None,
    )


def blocks(low: float) -> LeftOut:
    """What blocks that were left out show, by the lower end of their interval."""
    return LeftOut(5.0, 9, 0.1, 0.08, (low, 0.3))


def found(
    *gains: float,
    together: float = 0.0,
    variant: Variant | None = None,
    needed: dict[str, float] | None = None,
    left_out: LeftOut | None = None,
) -> Any:
    """An explanation; `needed` as of a slow force."""
    term: Any = SimpleNamespace(variant=variant or Static(), mechanism=LIBRARY["headwind"])
    causes = tuple(
        Cause("missing_physics", "headwind", gain, 0.5, np.zeros(1), term, needed=needed, left_out=left_out)
        for gain in gains
    )
    return SimpleNamespace(causes=causes, gained=together)


@pytest.mark.parametrize(
    ("gains", "after", "told"),
    [
        ((Rules.clear - 1.0,), 0.06, True),
        ((Rules.clear - 1.0,), 0.099, False),
        ((Rules.clear + 1.0,), 0.2, True),
        ((30.0, Rules.clear + 1.0), 0.2, True),
    ],
)
def test_what_is_weak_is_told_where_its_own_correction_helps(
    gains: tuple[float, ...], after: float, told: bool
) -> None:
    """A law that other parameters replace as well is told if its own correction helps: it had been withdrawn,
    and a truck that was 0.3 m/s off was said to lack nothing."""
    assert claimed(found(*gains), fit(after)) == told


@pytest.mark.parametrize(
    ("chosen", "told"),
    [(Chosen.FINDINGS, True), (Chosen.LAWS, True), (Chosen.PARAMETERS, False), (Chosen.NOTHING, False)],
)
def test_another_correction_speaks_for_no_finding(chosen: Chosen, told: bool) -> None:
    assert claimed(found(50.0), fit(0.06, chosen)) == told


def test_laws_that_overlap_are_strong_together() -> None:
    assert claimed(found(50.0, 60.0, together=Rules.clear + 1.0), fit(0.2))
    assert not claimed(found(50.0, 60.0, together=Rules.clear - 1.0), fit(0.2))


def test_what_no_other_drive_can_show_is_not_asked_of_it() -> None:
    refused = fit(0.2)
    assert claimed(found(80.0, variant=WINDOWED, left_out=blocks(0.1)), refused)
    assert claimed(found(0.0, needed={"road_grade": 0.01}), refused)
    assert claimed(found(30.0), fit(None))  # no drive was long enough to tell
    assert claimed(found(), refused)


@pytest.mark.parametrize("left_out", [None, blocks(-0.1)])
def test_what_blocks_of_its_own_drives_do_not_show_is_not_told(left_out: LeftOut | None) -> None:
    weak, strong = (found(gain, variant=WINDOWED, left_out=left_out) for gain in (80.0, Rules.clear + 1.0))
    assert not claimed(weak, fit(0.2)) and claimed(strong, fit(0.2))


def test_blocks_claim_nothing_that_acts_throughout() -> None:
    """Knots follow slow noise into blocks that were left out: four of forty trucks with nothing missing."""
    assert not claimed(found(80.0, left_out=blocks(0.1)), fit(0.2))


def test_other_rules_ask_for_more() -> None:
    assert not claimed(found(200.0), fit(0.2), Rules(clear=300.0))
