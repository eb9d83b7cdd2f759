"""Verdict and advice follow from numbers; a verdict says one probability for one name."""

from __future__ import annotations

from dataclasses import replace

import pytest

from deeptruck_model.mismatch import Mismatch
from deeptruck_model.mismatch.folders import AS_GIVEN, CORRECTION, REFIT
from deeptruck_model.mismatch.mechanisms.families import UNKNOWN
from deeptruck_model.mismatch.report import lines
from deeptruck_model.mismatch.rules import Rules
from deeptruck_model.mismatch.verdict import decide, wording
from deeptruck_model.mismatch.verdict.decide import Numbers
from deeptruck_model.mismatch.verdict.result import Answer, Conclusion, Kind, Verdict
from deeptruck_model.mismatch.verdict.wording import spoken

RULES = Rules()
NAN = float("nan")
RIGHT = Numbers(given=0.1, parameters_only=0.1, corrected=0.1, added_up=0.1)
OFF = replace(RIGHT, given=0.5, parameters_only=0.5, corrected=0.5, added_up=0.5, is_corrected=True)
PHYSICS = replace(OFF, kinds=[Kind.PHYSICS], sure=[True])
BETTER = replace(PHYSICS, better=frozenset({CORRECTION}), corrected=0.2)
REFITTED = replace(OFF, better=frozenset({REFIT}), parameters_only=0.2)
FAULTY = {"kinds": [Kind.SENSOR], "sure": [True]}


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        (RIGHT, Conclusion.NOTHING),
        (replace(RIGHT, given=RULES.visible), Conclusion.NOTHING),
        (replace(RIGHT, given=RULES.visible + 1e-6), Conclusion.UNDETERMINED),
        (replace(RIGHT, added_up=RULES.visible + 1e-6), Conclusion.UNDETERMINED),
        (replace(RIGHT, given=NAN), Conclusion.NOTHING),
        (replace(RIGHT, given=NAN, added_up=NAN), Conclusion.UNDETERMINED),
        (OFF, Conclusion.UNDETERMINED),
        (replace(OFF, reference_error=0.4), Conclusion.NOTHING),  # no more than on its own recordings
        (replace(OFF, reference_error=0.37), Conclusion.UNDETERMINED),
        (
            replace(OFF, given=0.25, added_up=0.25, reference_error=0.01),
            Conclusion.NOTHING,
        ),  # a floor of what is visible
        (replace(OFF, given=1.1, reference_error=2.0), Conclusion.UNDETERMINED),
        (PHYSICS, Conclusion.PHYSICS),
        # there, if it matters or not
        (replace(RIGHT, kinds=[Kind.PHYSICS], sure=[True]), Conclusion.PHYSICS),
        (replace(RIGHT, kinds=[Kind.PHYSICS], sure=[False]), Conclusion.NOTHING),
        (replace(PHYSICS, sure=[False]), Conclusion.PHYSICS),
        (replace(OFF, kinds=[Kind.PARAMETER]), Conclusion.PARAMETER),
        (replace(OFF, **FAULTY), Conclusion.SENSOR),
        (replace(OFF, kinds=[Kind.PARAMETER, Kind.PHYSICS]), Conclusion.PARAMETER),
        (replace(OFF, kinds=[Kind.PHYSICS, Kind.PARAMETER]), Conclusion.PHYSICS),
    ],
)
def test_the_verdict_follows_from_findings_and_errors(numbers: Numbers, expected: Conclusion) -> None:
    assert decide.conclusion(numbers, RULES) is expected


@pytest.mark.parametrize(
    ("reference_error", "expected"),
    [(None, 0.3), (0.01, 0.3), (0.5, 0.665), (0.75, 0.9975), (0.76, 1.0), (3.0, 1.0)],
)
def test_a_learned_simulator_may_be_off_by_a_little_more_than_on_its_own_recordings(
    reference_error: float | None, expected: float
) -> None:
    assert decide.tolerance(reference_error, RULES) == pytest.approx(expected)


def test_refitted_parameters_are_offered_only_where_the_correction_has_no_name() -> None:
    """What is offered is what is stated, although all parameters refitted alone are nearer."""
    both = replace(OFF, better=frozenset({REFIT, CORRECTION}), parameters_only=0.05, corrected=0.1)
    for named, expected in ((False, REFIT), (True, CORRECTION)):
        assert decide.offered(replace(both, named=named), Conclusion.PARAMETER, RULES) == expected
    alone = replace(both, named=True, better=frozenset({REFIT}))
    assert decide.offered(alone, Conclusion.PARAMETER, RULES) == AS_GIVEN


def lights(numbers: Numbers) -> dict[str, tuple[Answer, str]]:
    found = decide.advice(numbers, decide.conclusion(numbers, RULES), RULES)
    return {name: (a.answer, a.reason) for name, a in found.items()}


@pytest.mark.parametrize(
    ("numbers", "answer", "reason"),
    [
        (RIGHT, Answer.YES, wording.ENOUGH),
        (replace(RIGHT, missing=["gear"]), Answer.UNSURE, wording.not_recorded(["gear"])),
        (replace(RIGHT, added_up=NAN, missing=["gear"]), Answer.NO, wording.TOO_SHORT),
        (replace(RIGHT, **FAULTY, missing=["gear"]), Answer.UNSURE, wording.FAULTY),
        (
            replace(PHYSICS, kinds=[Kind.PHYSICS, Kind.SENSOR], sure=[True, True]),
            Answer.UNSURE,
            wording.FAULTY,
        ),
        (replace(PHYSICS, kinds=[Kind.SENSOR], sure=[False]), Answer.UNSURE, wording.MAYBE_FAULTY),
        (replace(RIGHT, doubts=["pedals are swapped"]), Answer.UNSURE, "pedals are swapped"),
    ],
)
def test_data_are_enough_where_every_input_is_known(numbers: Numbers, answer: Answer, reason: str) -> None:
    assert lights(numbers)["data"] == (answer, reason)


@pytest.mark.parametrize(
    ("numbers", "answer", "reason"),
    [
        (RIGHT, Answer.YES, wording.good(0.1, 40.0)),
        (replace(RIGHT, given=NAN), Answer.UNSURE, wording.NOT_DRIVEN),
        (OFF, Answer.NO, wording.too_far(0.5, 0.5, 40.0, 0.3)),
        (PHYSICS, Answer.NO, wording.too_far(0.5, 0.5, 40.0, 0.3)),
        (replace(PHYSICS, reference_error=0.2), Answer.NO, wording.too_far(0.5, 0.5, 40.0, 0.3, 0.2)),
        (
            replace(PHYSICS, given=0.1),
            Answer.NO,
            "free runs of 40 s on held-out drives are off by 0.1 m/s, but along the fitted drives by 0.5 "
            "m/s; good enough is 0.3 m/s on both",
        ),
        (replace(PHYSICS, given=0.1, added_up=0.1), Answer.YES, wording.good_enough(0.1, 40.0)),
        (replace(PHYSICS, given=0.3, added_up=0.3), Answer.YES, wording.good_enough(0.3, 40.0)),
        (replace(RIGHT, **FAULTY), Answer.YES, wording.without_faults(0.1, 40.0)),
    ],
)
def test_whether_it_matters_is_the_light_of_the_simulator(
    numbers: Numbers, answer: Answer, reason: str
) -> None:
    assert lights(numbers)["simulator"] == (answer, reason)


@pytest.mark.parametrize(
    ("numbers", "answer", "reason"),
    [
        (BETTER, Answer.YES, wording.better(0.5, 0.2, refit=False)),
        (REFITTED, Answer.YES, wording.better(0.5, 0.2, refit=True)),
        (
            replace(BETTER, **FAULTY),
            Answer.UNSURE,
            wording.after_repair(wording.better(0.5, 0.2, refit=False), sure=True),
        ),
        (
            replace(BETTER, doubts=["pedals are swapped"]),
            Answer.UNSURE,
            wording.after_settling(wording.better(0.5, 0.2, refit=False)),
        ),
        (replace(PHYSICS, corrected=0.4, parameters_only=0.6), Answer.UNSURE, wording.NOT_SIGNIFICANT),
        (replace(PHYSICS, corrected=0.6, parameters_only=0.4), Answer.UNSURE, wording.NOT_SIGNIFICANT),
        (replace(BETTER, bare=0.6), Answer.UNSURE, wording.worse_bare(0.5, 0.2, 0.6)),
        (replace(BETTER, bare=0.505), Answer.YES, wording.better(0.5, 0.2, refit=False)),
        (replace(PHYSICS, corrected=0.5, parameters_only=0.5), Answer.NO, wording.NOT_BETTER),
        (replace(PHYSICS, is_corrected=False), Answer.NO, wording.NOTHING_CORRECTED),
        (Numbers([Kind.PHYSICS], [True], 0.5, 0.4, 0.5), Answer.NO, wording.NOTHING_CORRECTED),
        (
            replace(RIGHT, better=frozenset({CORRECTION}), is_corrected=True),
            Answer.NO,
            wording.AS_IT_IS,
        ),
        (replace(PHYSICS, given=NAN), Answer.NO, wording.NOT_DRIVEN),
    ],
)
def test_what_is_best_on_drives_left_out_is_advised(numbers: Numbers, answer: Answer, reason: str) -> None:
    assert lights(numbers)["apply"] == (answer, reason)


NEARLY = replace(RIGHT, given=0.2, parameters_only=0.02, corrected=0.02)  # a torque 5 % too small, unnamed
JUST = replace(RIGHT, given=0.25, parameters_only=0.25 - RULES.drift, corrected=0.25 - RULES.drift)


@pytest.mark.parametrize(
    ("numbers", "offer", "expected"),
    [
        (RIGHT, REFIT, AS_GIVEN),
        (RIGHT, CORRECTION, AS_GIVEN),
        (NEARLY, REFIT, REFIT),
        (NEARLY, CORRECTION, CORRECTION),
        (NEARLY, AS_GIVEN, AS_GIVEN),
        (replace(NEARLY, corrected=0.2), CORRECTION, AS_GIVEN),
        (replace(NEARLY, parameters_only=0.2), REFIT, AS_GIVEN),
        (JUST, REFIT, AS_GIVEN),
        (JUST, CORRECTION, AS_GIVEN),
        (replace(JUST, given=NAN), REFIT, AS_GIVEN),
        (replace(OFF, parameters_only=0.49), REFIT, REFIT),  # off by more than it may be, whatever is missing
        (replace(PHYSICS, corrected=0.49), CORRECTION, CORRECTION),
        (
            replace(PHYSICS, given=0.1, parameters_only=0.1, added_up=0.1, corrected=0.09),
            CORRECTION,
            CORRECTION,
        ),
        (PHYSICS, AS_GIVEN, AS_GIVEN),
        (replace(PHYSICS, corrected=0.2, parameters_only=0.19, named=True), CORRECTION, CORRECTION),
        (replace(PHYSICS, corrected=0.2, bare=0.6), CORRECTION, AS_GIVEN),  # worse where a signal lacks
    ],
)
def test_the_best_is_offered_whatever_its_name(numbers: Numbers, offer: str, expected: str) -> None:
    n = replace(numbers, better=frozenset({offer} - {AS_GIVEN}))
    kind = decide.conclusion(n, RULES)
    assert decide.offered(n, kind, RULES) == expected
    assert (decide.advice(n, kind, RULES)["apply"].answer is Answer.YES) is (expected != AS_GIVEN)


@pytest.fixture(params=["lazy_brake", "right_truck", "dragging_brake", "heavier_truck"])
def verdict(request: pytest.FixtureRequest) -> Verdict:
    """The verdicts of the whole runs that the tests share."""
    found: Mismatch = request.getfixturevalue(request.param)
    return found.result


def test_a_name_has_one_probability(verdict: Verdict) -> None:
    """In finding, tree and explanations; a family too."""
    tree = {n.node: n.probability for n in verdict.tree}
    assert tree and max(tree.values()) <= 1.0
    sets = sum(x.probability for x in verdict.explanations)
    for f in verdict.findings:
        if f.effect == UNKNOWN or f.evidence_nats is None:
            continue  # a part of the budget, or a fault between sensors
        assert f.probability == pytest.approx(tree[f.effect], abs=1e-3)
        assert f.family_probability == pytest.approx(tree[f.family], abs=1e-3)
        assert set(f.credible_set) <= tree.keys()
        listed = sum(x.probability for x in verdict.explanations if f.effect in x.names)
        assert listed - 1e-3 <= f.probability <= listed + 1.0 - sets + 1e-3
    none = next((x.probability for x in verdict.explanations if not x.names), 0.0)
    assert tree["nothing"] == pytest.approx(none, abs=1.0 - sets + 1e-3)


def test_what_a_correction_adds_is_stated(verdict: Verdict) -> None:
    """Each force is that of a finding, or of what has no name; each parameter has its interval, and its
    finding states the same change."""
    assert verdict.fit is not None
    found = {f.effect: f for f in verdict.findings}
    for name, strength in verdict.fit.corrected_forces.items():
        assert name == UNKNOWN or replace(found[name].strength, ci95=None) == strength
    assert verdict.fit.corrected_intervals.keys() == verdict.fit.corrected_parameters.keys()
    for name, change in verdict.fit.corrected_parameters.items():
        low, high = verdict.fit.corrected_intervals[name]
        assert low <= change <= high
        if name in found:
            assert found[name].parameters["relative_error"].value == pytest.approx(change, abs=1e-4)
    if verdict.offered == CORRECTION:
        said = " ".join(lines.contains(verdict))
        parts = {
            "without an accepted name" if n == UNKNOWN else spoken(n) for n in verdict.fit.corrected_forces
        }
        assert all(part in said for part in parts)


def test_no_finding_that_is_stated_has_an_interval_that_holds_zero(verdict: Verdict) -> None:
    for f in verdict.findings:
        if f.probability >= Rules().stated:
            sizes = [x for x in f.parameters.values() if not x.drive]
            assert all(x.ci95 is None or x.ci95[0] * x.ci95[1] > 0.0 for x in sizes)


def test_findings_their_forces_and_the_correction_are_one_answer(verdict: Verdict) -> None:
    """What is stated is in the corrected simulator with the size of its finding, and no parameter is changed
    that no finding names."""
    fit = verdict.fit
    assert fit is not None
    stated = {f.effect: f for f in verdict.findings if f.kind is not Kind.SENSOR and f.stated == f.effect}
    if fit.offered == CORRECTION:
        assert stated.keys() <= {*fit.corrected}
    assert verdict.budget is not None
    for f in stated.values():
        assert verdict.budget.share(f.family) > 0.0
    for name, force in fit.corrected_forces.items():
        if name in stated:
            strength = stated[name].strength
            assert strength is not None and force.value == pytest.approx(strength.value)
    for name, change in fit.corrected_parameters.items():
        (finding,) = (f for f in verdict.findings if f.effect == name)
        error = finding.parameters["relative_error"]
        assert error.value == pytest.approx(change, abs=1e-3)
        assert error.ci95 is not None and error.ci95[0] * error.ci95[1] > 0.0
