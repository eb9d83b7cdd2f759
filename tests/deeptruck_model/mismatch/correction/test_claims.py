"""What little evidence speaks for must surely help on drives it was not fitted to, or it is not told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_model.mismatch.correction.claims import OwnCorrection, claimed
from deeptruck_model.mismatch.fit_result import Errors
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.variants import Static, Variant, Windowed
from deeptruck_model.mismatch.posterior.causes import Cause
from deeptruck_model.mismatch.posterior.left_out import LeftOut
from deeptruck_model.mismatch.rules import Rules

WINDOWED = Windowed(Static(), ((0, 1.0, 9.0),))


def runs(recordings: int, size: float, spread: float = 0.0) -> Errors:
    """Four free runs of ten steps along each recording, `size` m/s off; `spread` by the recording."""
    of = np.repeat(np.arange(recordings), 4)
    speed = (size + spread * (-1.0) ** of)[:, None] * np.ones(10)
    return Errors(speed, speed, of, np.arange(4 * recordings))


def own(after: float, spread: float = 0.0) -> Callable[[], OwnCorrection]:
    """Of a simulator that is 0.1 m/s off along two recordings that are held out and six others; `after` the
    correction that holds what was found, and by how much recordings differ in that."""
    crossed = runs(6, 0.1), runs(6, after, spread)
    return lambda: OwnCorrection(runs(2, 0.1), runs(2, after), crossed)


def test_one_run_that_is_off_whatever_is_corrected_does_not_hide_what_the_others_show() -> None:
    def off(size: float) -> Errors:
        made = runs(2, size)
        made.speed[3] = 1.0
        return made

    for after, helps in ((0.05, True), (0.099, False)):
        assert OwnCorrection(off(0.1), off(after), chosen=True).helps(Rules()) == helps


def not_asked() -> OwnCorrection:
    raise AssertionError("what is strong is told without driving it")


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
    ("after", "spread", "told"), [(0.06, 0.0, True), (0.099, 0.0, False), (0.09, 0.07, False)]
)
def test_what_is_weak_is_told_where_its_own_correction_surely_helps(
    after: float, spread: float, told: bool
) -> None:
    """Whatever drives best: a law had been withdrawn because refitted parameters drove a little better, and a
    truck that was 0.2 m/s off was said to lack nothing."""
    assert claimed(found(Rules.clear - 1.0), own(after, spread)) == told


def test_what_free_runs_chose_needs_no_certainty() -> None:
    """Half of the recordings were driven before the drag area changed, and gain nothing."""
    unsure = own(0.09, 0.07)()
    assert claimed(found(50.0), lambda: replace(unsure, chosen=True))
    worse = OwnCorrection(runs(2, 0.1), runs(2, 0.12), chosen=True)
    assert not claimed(found(50.0), lambda: worse)


def test_what_is_strong_needs_no_drive() -> None:
    assert claimed(found(Rules.clear + 1.0), not_asked)
    assert claimed(found(30.0, Rules.clear + 1.0), not_asked)


def test_few_recordings_are_judged_by_what_was_held_out() -> None:
    for after, told in ((0.05, True), (0.12, False)):
        alone = OwnCorrection(runs(1, 0.1), runs(1, after))
        assert claimed(found(50.0), lambda alone=alone: alone) == told  # type: ignore[misc]


def test_laws_that_overlap_are_strong_together() -> None:
    assert claimed(found(50.0, 60.0, together=Rules.clear + 1.0), not_asked)
    assert not claimed(found(50.0, 60.0, together=Rules.clear - 1.0), own(0.2))


def test_what_no_other_drive_can_show_is_not_asked_of_it() -> None:
    assert claimed(found(80.0, variant=WINDOWED, left_out=blocks(0.1)), not_asked)
    assert claimed(found(0.0, needed={"road_grade": 0.01}), not_asked)
    assert claimed(found(30.0), lambda: OwnCorrection(runs(0, 0.1), runs(0, 0.1)))  # too short to tell
    assert claimed(found(), not_asked)


@pytest.mark.parametrize("left_out", [None, blocks(-0.1)])
def test_what_blocks_of_its_own_drives_do_not_show_is_not_told(left_out: LeftOut | None) -> None:
    weak, strong = (found(gain, variant=WINDOWED, left_out=left_out) for gain in (80.0, Rules.clear + 1.0))
    assert not claimed(weak, own(0.2)) and claimed(strong, not_asked)


def test_blocks_claim_nothing_that_acts_throughout() -> None:
    """Knots follow slow noise into blocks that were left out: four of forty trucks with nothing missing."""
    assert not claimed(found(80.0, left_out=blocks(0.1)), own(0.2))


def test_other_rules_ask_for_more() -> None:
    assert not claimed(found(200.0), own(0.2), Rules(clear=300.0))
