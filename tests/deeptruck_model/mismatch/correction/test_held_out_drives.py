"""What is weak must help on drives it was not fitted to, or it is not told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_model.mismatch.correction.correction import in_vain
from deeptruck_model.mismatch.fit_result import Chosen, Compared, Rmse
from deeptruck_model.mismatch.mechanisms.variants import Gate, Gated, Spline, Static, Variant, Windowed
from deeptruck_model.mismatch.posterior.causes import Cause

SPLINE = Spline("elapsed", (4,), ("a",), 20.0, 0.25, 0.1)
WINDOWED = Windowed(Static(), ((0, 1.0, 9.0),))


def errors(*, after: float, tuned: float, laws: float | None = None) -> Compared:
    """Of a simulator whose model discrepancy is 0.1 m/s."""
    free_model = None if laws is None else Rmse(laws, 0.1)
    return Compared(Rmse(0.1, 0.1), Rmse(tuned, 0.1), Rmse(after, 0.1), free_model)


FOUND = Chosen.FINDINGS


@pytest.mark.parametrize(
    ("gains", "after", "vain"),
    [((50.0, 30.0), 0.2, True), ((50.0,), 0.05, False), ((50.0, 90.0), 0.2, False), ((), 0.2, False)],
)
def test_what_is_weak_and_drives_worse_is_not_told(
    gains: tuple[float, ...], after: float, vain: bool
) -> None:
    causes = tuple(Cause("missing_physics", "headwind", g, 0.5, np.zeros(1)) for g in gains)
    fit = errors(after=after, tuned=0.05)
    explanation: Any = SimpleNamespace(causes=causes)
    assert in_vain(explanation, fit, FOUND) == vain
    assert not in_vain(explanation, None, FOUND)  # no held-out drive was long enough to tell


@pytest.mark.parametrize(
    ("variant", "after", "vain"),
    [
        (Static(), 0.05, True),
        (Static(), 0.04, False),
        (SPLINE, 0.06, False),
        (WINDOWED, 0.05, False),
    ],
)
def test_a_weak_law_must_drive_better_than_other_parameters(
    variant: Variant, after: float, vain: bool
) -> None:
    """What is time-varying helps no other drive anyway."""
    term: Any = SimpleNamespace(variant=variant)
    causes = (Cause("missing_physics", "load_slosh", 33.0, 0.5, np.zeros(1), term),)
    fit = errors(after=after, tuned=0.05)
    explanation: Any = SimpleNamespace(causes=causes)
    assert in_vain(explanation, fit, FOUND) == vain


@pytest.mark.parametrize(
    ("effect", "gain", "recorded", "vain"),
    [
        ("road_grade", 72.0, True, True),
        ("road_grade", 72.0, False, False),
        ("headwind", 72.0, False, True),
        ("road_grade", 55.0, False, True),
    ],
)
def test_a_road_without_recorded_slopes_need_not_help_on_another_road(
    effect: str, gain: float, recorded: bool, vain: bool
) -> None:
    """A hilly drive of a real car had been called nothing missing."""
    term: Any = SimpleNamespace(variant=SPLINE)
    causes = (Cause("missing_physics", effect, gain, 1.0, np.zeros(1), term),)
    explanation: Any = SimpleNamespace(causes=causes)
    fit = errors(after=0.1, tuned=0.1)
    assert in_vain(explanation, fit, Chosen.NOTHING, slopes_recorded=recorded) == vain


@pytest.mark.parametrize(
    ("gain", "after", "vain"), [(84.0, 0.099, True), (84.0, 0.09, False), (130.0, 0.099, False)]
)
@pytest.mark.parametrize("beside", [Static(), WINDOWED])
def test_a_law_that_helps_no_other_drive_must_be_clear(
    beside: Variant, gain: float, after: float, vain: bool
) -> None:
    """Beside what acts now and then, which no other drive need show, it is not asked."""
    terms: Any = [
        SimpleNamespace(variant=Gated(Static(), Gate("lever", "above", 7.0))),
        SimpleNamespace(variant=beside),
    ]
    causes = tuple(
        Cause("missing_physics", name, g, 0.5, np.zeros(1), s)
        for name, g, s in zip(("driveline_backlash", "engine_friction"), (gain, 52.0), terms, strict=True)
    )
    explanation: Any = SimpleNamespace(causes=causes)
    fit = errors(after=after, tuned=0.1)
    assert in_vain(explanation, fit, FOUND) == (vain and not beside.acts_in_windows)


@pytest.mark.parametrize(
    ("gain", "after", "chosen", "vain"),
    [
        (84.0, 0.099, FOUND, True),
        (84.0, 0.09, FOUND, False),
        (55.0, 0.08, Chosen.PARAMETERS, True),
        (55.0, 0.08, FOUND, False),
        (84.0, 0.08, Chosen.PARAMETERS, False),
    ],
)
def test_what_comes_and_goes_must_help_other_drives_a_little(
    gain: float, after: float, chosen: Chosen, vain: bool
) -> None:
    """And not by the parameters that were moved instead of it."""
    term: Any = SimpleNamespace(variant=SPLINE)
    causes = (Cause("missing_physics", "dragging_brake", gain, 1.0, np.zeros(1), term),)
    fit = errors(after=after, tuned=0.08)
    explanation: Any = SimpleNamespace(causes=causes)
    assert in_vain(explanation, fit, chosen) == vain


def test_a_slow_force_is_told_by_its_size_and_not_by_a_drive() -> None:
    slow = Cause("missing_physics", "road_grade", 0.0, 0.5, np.zeros(1), needed={"road_grade": 0.01})
    fit = errors(after=0.2, tuned=0.1)
    explanation: Any = SimpleNamespace(causes=(slow,))
    assert not in_vain(explanation, fit, FOUND)


@pytest.mark.parametrize(("after", "vain"), [(0.05, False), (0.08, True)])
def test_a_parameter_of_few_nats_needs_drives_that_show_it(after: float, vain: bool) -> None:
    causes = (Cause("parameter_error", "mass", 10.0, 0.5, np.zeros(1)),)
    fit = errors(after=after, tuned=0.05)
    explanation: Any = SimpleNamespace(causes=causes)
    assert in_vain(explanation, fit, FOUND) == vain


@pytest.mark.parametrize(
    ("gain", "after", "vain"),
    [(100.0, 0.11, True), (100.0, 0.06, False), (50.0, 0.06, True), (200.0, 0.11, False)],
)
def test_beside_a_learned_simulator_more_must_be_shown(gain: float, after: float, vain: bool) -> None:
    term: Any = SimpleNamespace(variant=SPLINE)
    causes = (Cause("missing_physics", "road_surface", gain, 0.5, np.zeros(1), term),)
    fit = errors(after=after, tuned=0.05)
    explanation: Any = SimpleNamespace(causes=causes)
    assert in_vain(explanation, fit, FOUND, learned=True) == vain
    assert not in_vain(explanation, errors(after=0.09, tuned=0.05), FOUND)


@pytest.mark.parametrize(("beside", "vain"), [(SPLINE, True), (WINDOWED, False)])
def test_a_law_beside_what_comes_and_goes_must_help_other_drives(beside: Variant, vain: bool) -> None:
    terms: Any = [SimpleNamespace(variant=Static()), SimpleNamespace(variant=beside)]
    causes = tuple(
        Cause("missing_physics", name, 96.0, 0.5, np.zeros(1), s)
        for name, s in zip(("load_slosh", "engine_friction"), terms, strict=True)
    )
    explanation: Any = SimpleNamespace(causes=causes)
    assert in_vain(explanation, errors(after=0.12, tuned=0.13), FOUND) == vain


def test_a_law_is_not_told_where_all_parameters_went_in_instead() -> None:
    term: Any = SimpleNamespace(variant=Static())
    causes = (Cause("missing_physics", "load_slosh", 84.0, 1.0, np.zeros(1), term),)
    explanation: Any = SimpleNamespace(causes=causes)
    instead = errors(after=0.08, tuned=0.08)
    assert in_vain(explanation, instead, Chosen.PARAMETERS)
    assert not in_vain(explanation, instead, FOUND)  # no better by chance alone


@pytest.mark.parametrize(
    ("gain", "laws", "vain"),
    [(79.0, 0.18, True), (79.0, 0.04, False), (79.0, None, False), (130.0, 0.18, False)],
)
def test_laws_without_a_name_must_help_other_drives(gain: float, laws: float | None, vain: bool) -> None:
    """An unknown force that varied with the slope had been told of a truck in which nothing was missing."""
    causes = (Cause("missing_physics", "unknown", gain, 0.8, np.zeros(1)),)
    explanation: Any = SimpleNamespace(causes=causes)
    fit = errors(after=0.06, tuned=0.05, laws=laws)
    assert in_vain(explanation, fit, FOUND) == vain
