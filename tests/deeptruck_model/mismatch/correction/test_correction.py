"""What goes into a corrected simulator: what is of use on drives that were not fitted, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeptruck_model import simulators, trucks
from deeptruck_model.mismatch.correction import correction, recipes
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck, Term
from deeptruck_model.mismatch.fit_result import Chosen, Errors
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, held_steady, is_time_varying, laws
from deeptruck_model.mismatch.mechanisms.laws import Follower, Law
from deeptruck_model.mismatch.mechanisms.variants import Constants, Static
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.kernels import UNKNOWN
from deeptruck_model.mismatch.posterior.search import Model, Search
from deeptruck_model.mismatch.residual.evidence import Evidence, Stretch

TRUCK = trucks.load("trucksim")
ONE: Any = [None]  # the recording that is not held out; its errors are made up


def law_and_gusts(e: Evidence) -> tuple[CandidateTerm, CandidateTerm]:
    search = Search(e)
    law = search.candidate_terms(LIBRARY["driveline_loss"])[0]
    gusts = next(s for s in search.candidate_terms(LIBRARY["headwind"]) if is_time_varying(s))
    return law, gusts


def explanation(causes: tuple[Cause, ...], model: Model, lawful: Model | None = None) -> Any:
    return SimpleNamespace(causes=causes, model=model, lawful=lawful)


def run(size: float) -> Errors:
    """A free run of one step with this error."""
    one = np.full((1, 1), size)
    return Errors(one, one, np.zeros(1, dtype=np.intp), np.zeros(1, dtype=np.intp))


@pytest.fixture
def options(nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch) -> list[tuple[set[str], set[str]]]:
    """(terms, parameters) of every correction that is driven; the one with the fewest terms drives best, and
    with one parameter moved."""
    driven: list[tuple[set[str], set[str]]] = []

    def windows(truck: CorrectedTruck) -> Errors:
        driven.append(({t.effect for t in truck.terms}, set(truck.moved)))
        return run(len(truck.terms) + abs(len(truck.moved) - 1.0) if truck.terms else 9.0)

    monkeypatch.setattr(recipes, "free_runs", lambda jobs, _: [windows(truck) for truck, _ in jobs])
    return driven


def test_of_all_that_was_found_the_part_goes_in_that_drives_best(
    nothing_missing: Evidence, options: list[tuple[set[str], set[str]]]
) -> None:
    e = nothing_missing
    law, gusts = law_and_gusts(e)
    model = Search(e).model((law, gusts), frozenset({"torque_gain", "brake_gain"}))
    causes = tuple(
        Cause(kind, effect, 90.0, 0.3, np.zeros(len(e)), term)
        for kind, effect, term in (
            ("missing_physics", "driveline_loss", law),
            ("missing_physics", "headwind", gusts),
            ("parameter_error", "brake_gain", None),
        )
    )
    made = correction.correct(TRUCK, e, explanation(causes, model), ONE, 20.0)
    tuned, after = made.tuned, made.named
    assert made.unnamed is None
    assert set(tuned.moved) == {"torque_gain", "brake_gain"} and not tuned.terms
    laws, everything = {"driveline_loss"}, {"driveline_loss", "headwind"}
    moved, stated = {"torque_gain", "brake_gain"}, {"brake_gain"}
    nothing: set[str] = set()
    each = [(nothing, nothing)]
    for free in (moved, stated, nothing):  # at last of each three with gusts held steady
        each += [(everything, free), (laws, free), (everything, free)]
    assert options == [*each, (nothing, moved)]
    assert ({t.effect for t in after.terms}, set(after.moved)) == (laws, stated)


def test_nothing_goes_in_where_the_truck_as_given_drives_best(
    nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    e = nothing_missing
    law, _ = law_and_gusts(e)
    monkeypatch.setattr(correction, "horizon", lambda *_: 20.0)
    monkeypatch.setattr(
        recipes,
        "free_runs",
        lambda jobs, _: [run(float(len(made.terms) + len(made.moved))) for made, _ in jobs],
    )
    cause = Cause("missing_physics", "driveline_loss", 50.0, 1.0, np.zeros(len(e)), law)
    made = correction.correct(
        TRUCK, e, explanation((cause,), Search(e).model((law,), frozenset({"torque_gain"}))), ONE, 20.0
    )
    assert not made.named.terms and not made.named.moved and made.tuned.moved
    assert made.chosen is Chosen.NOTHING


def test_what_was_not_stated_never_goes_in(
    nothing_missing: Evidence, options: list[tuple[set[str], set[str]]]
) -> None:
    law, gusts = law_and_gusts(nothing_missing)
    model = Search(nothing_missing).model((law, gusts), frozenset())
    cause = Cause("missing_physics", "driveline_loss", 90.0, 1.0, np.zeros(len(nothing_missing)), law)
    after = correction.correct(TRUCK, nothing_missing, explanation((cause,), model), ONE, 20.0).named
    assert [t.effect for t in after.terms] == ["driveline_loss"] and not after.moved
    nothing: set[str] = set()
    assert options == [
        (nothing, nothing),
        ({"driveline_loss"}, nothing),
        (nothing, {"torque_gain", "brake_gain"}),
    ]


def test_what_comes_and_goes_can_be_held_steady(nothing_missing: Evidence) -> None:
    law, gusts = law_and_gusts(nothing_missing)
    held = held_steady(gusts, nothing_missing)
    assert held_steady(law, nothing_missing) is law
    assert held.columns.shape[1] < gusts.columns.shape[1] and not is_time_varying(held)
    assert held.mechanism is gusts.mechanism


def test_the_interval_is_over_all_recordings_each_unseen(
    nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two held-out recordings that show little, and six others that show much: together they are sure."""

    def runs(count: int, size: float) -> Errors:
        of = np.repeat(np.arange(count), 4)
        speed = size * (1.0 + 0.5 * np.sin(np.arange(4 * count)))[:, None] * np.ones(10)
        return Errors(speed, speed, of, np.arange(4 * count))

    sizes = iter([1.0, 1.0, 0.9])  # before, parameters only and after
    monkeypatch.setattr(correction, "free_runs", lambda jobs, _: [runs(2, next(sizes)) for _ in jobs])
    monkeypatch.setattr(correction, "horizon", lambda *_: 20.0)
    after = CorrectedTruck(TRUCK, [], {"torque_gain": 0.1}, None, False)
    crossed = {
        name: runs(6, size) for name, size in (("before", 1.0), ("parameters_only", 1.0), ("after", 0.4))
    }
    made = correction.Corrections(after, after, None, crossed)
    held_out: Any = [SimpleNamespace(recording=SimpleNamespace(name=n)) for n in "ab"]
    _, marked, fit = correction.shown(TRUCK, made, held_out, with_unnamed=False)
    assert fit.improvement is not None and fit.improvement.recordings == 8 and fit.windows == 8
    assert fit.improvement.ci95[0] > 0.2 and fit.validated and marked.validated
    assert (fit.chosen, fit.corrected, fit.horizon_s) == (Chosen.FINDINGS, ("torque_gain",), 20.0)


def test_a_correction_is_judged_as_it_is_handed_over_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """One by the gap helps where the gap is told, and no simulator is told it."""

    def windows(jobs: Sequence[tuple[object, object]], _: float, alone: bool = False) -> list[Errors]:
        each = [np.full((6, 10), 1.0 if truck is TRUCK else 1.6 if alone else 0.3) for truck, _ in jobs]
        return [Errors(speed, speed, np.arange(6), np.zeros(6, dtype=np.intp)) for speed in each]

    monkeypatch.setattr(correction, "free_runs", windows)
    monkeypatch.setattr(correction, "horizon", lambda *_: 40.0)
    held_out: Any = [SimpleNamespace(recording=SimpleNamespace(name="a"))]
    constants = {"speed": True, "gap": False}
    for of, kept in constants.items():
        term = Term(UNKNOWN, Static(constants=Law("force", of, (5.0, 25.0))), (0.1, 0.2))
        after = CorrectedTruck(TRUCK, [term], {}, None, False)
        _, marked, fit = correction.shown(
            TRUCK, correction.Corrections(after, after, None), held_out, with_unnamed=False
        )
        assert marked.validated == fit.validated == kept
        assert (fit.handed_over is None) == kept


@pytest.mark.parametrize(("of", "by_mean"), [("headwind", ("headwind",)), ("driveline_loss", ())])
def test_what_a_correction_holds_by_its_mean_alone_is_told(
    nothing_missing: Evidence,
    options: list[tuple[set[str], set[str]]],
    monkeypatch: pytest.MonkeyPatch,
    of: str,
    by_mean: tuple[str, ...],
) -> None:
    """Gusts are those of their drives; a law is another drive's too."""
    monkeypatch.setattr(correction, "horizon", lambda *_: 20.0)
    monkeypatch.setattr(correction, "free_runs", lambda jobs, *_: [run(1.0) for _ in jobs])
    found = next(term for term in law_and_gusts(nothing_missing) if term.mechanism.effect == of)
    search = Search(nothing_missing)
    model, none = search.model((found,), frozenset()), search.model((), frozenset())
    cause = Cause("missing_physics", of, 500.0, 1.0, np.zeros(len(nothing_missing)), found)
    x = Explanation((cause,), model, none, none, SimpleNamespace(), 0.0, None, ())  # type: ignore[arg-type]
    made = correction.corrected_and_driven(TRUCK, nothing_missing, x, ONE, [], with_unnamed=False)
    assert made.fit.corrected == (of,) and made.fit.by_mean == by_mean


def test_no_parameter_goes_where_no_truck_is(nothing_missing: Evidence) -> None:
    stronger = 2.6 * nothing_missing.sensitivity["brake_gain"]  # brakes 3.6 times as strong
    e = replace(nothing_missing, residual=nothing_missing.residual + stronger)
    model = Search(e).model((), frozenset())
    made = correction.correct(TRUCK, e, explanation((), model), [], 20.0)
    assert abs(made.tuned.moved["brake_gain"]) < 0.2 and not made.named.moved


def test_where_nothing_is_missing_nothing_is_corrected(nothing_missing: Evidence) -> None:
    model = Search(nothing_missing).model((), frozenset({"brake_gain"}))
    made = correction.correct(TRUCK, nothing_missing, explanation((), model), ONE, 20.0)
    assert not made.named.terms and not made.named.moved
    assert made.tuned.moved


def is_law(constants: Constants, carrier: str, of: str) -> bool:
    return isinstance(constants, Law) and (constants.carrier, constants.of) == (carrier, of)


def test_laws_without_a_name_go_in_beside_the_names_and_only_when_asked(nothing_missing: Evidence) -> None:
    e = nothing_missing
    law = next(s for s in laws(e) if is_law(s.variant.constants, "engine", "speed"))
    search = Search(e)
    lawful = search.model((law,), frozenset())
    made = correction.correct(TRUCK, e, explanation((), search.model((), frozenset()), lawful), [], 20.0)
    assert made.unnamed is not None and not made.named.terms
    assert [t.effect for t in made.unnamed.terms] == ["unknown"]
    _, unasked, fit = correction.shown(TRUCK, made, [], with_unnamed=False)
    _, asked, told = correction.shown(TRUCK, made, [], with_unnamed=True)
    assert (told.chosen, told.corrected) == (Chosen.LAWS, ("unknown",))
    assert not unasked.terms and [t.effect for t in asked.terms] == ["unknown"]
    assert fit.windows == 0 and fit.errors is None and fit.improvement is None


@pytest.mark.parametrize(
    ("recordings", "with_names", "chosen"),
    [(8, 0.2, Chosen.LAWS), (1, 0.2, Chosen.FINDINGS), (8, 0.35, Chosen.PARAMETERS)],
)
def test_laws_join_names_that_drive_better_where_drives_that_were_not_fitted_ask_for_them(
    nothing_missing: Evidence,
    monkeypatch: pytest.MonkeyPatch,
    recordings: int,
    with_names: float,
    chosen: Chosen,
) -> None:
    ends = np.linspace(0, len(nothing_missing), recordings + 1).astype(int)
    drives = [Stretch(f"d{k}", ends[k], ends[k + 1], 0.0, k > 5) for k in range(recordings)]
    e = replace(nothing_missing, stretches=tuple(drives))
    law = next(s for s in laws(e) if is_law(s.variant.constants, "engine", "speed"))
    search, (name, _) = Search(e), law_and_gusts(e)
    model, lawful = search.model((name,), frozenset()), search.model((name, law), frozenset())
    errors = {Chosen.LAWS: 0.1, Chosen.FINDINGS: with_names, Chosen.PARAMETERS: 0.3, Chosen.NOTHING: 0.4}
    monkeypatch.setattr(recipes.Trials, "errors", lambda self, some: [run(errors[r.what]) for r in some])
    monkeypatch.setattr(correction, "horizon", lambda *_: 20.0)
    cause = Cause("missing_physics", name.mechanism.effect, 200.0, 1.0, np.ones(len(e)), term=name)
    prepared: Any = [None] * min(recordings, 6)
    made = correction.correct(TRUCK, e, explanation((cause,), model, lawful), prepared, 20.0)
    assert made.chosen is chosen and made.after(with_unnamed=False)[1] is chosen
    assert ("unknown" in {t.effect for t in made.named.terms}) == (chosen is Chosen.LAWS)


def test_sizes_that_drive_better_go_in_and_are_told(
    nothing_missing: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends = np.linspace(0, len(nothing_missing), 9).astype(int)
    drives = [Stretch(f"d{k}", ends[k], ends[k + 1], 0.0, k > 5) for k in range(8)]
    e = replace(nothing_missing, stretches=tuple(drives))
    law, _ = law_and_gusts(e)
    monkeypatch.setattr(
        recipes.Trials,
        "errors",
        lambda self, some: [
            run(0.1 if r.for_driving else 0.2 if r.what is Chosen.FINDINGS else 0.4) for r in some
        ],
    )
    monkeypatch.setattr(correction, "horizon", lambda *_: 20.0)
    cause = Cause("missing_physics", law.mechanism.effect, 200.0, 1.0, np.ones(len(e)), term=law)
    model = Search(e).model((law,), frozenset())
    made = correction.correct(TRUCK, e, explanation((cause,), model), [None] * 6, 20.0)  # type: ignore[list-item]
    assert made.chosen is Chosen.FINDINGS and made.for_driving
    _, _, fit = correction.shown(TRUCK, made, [], with_unnamed=False)
    assert fit.for_driving


def test_a_truck_with_laws_can_be_kept(nothing_missing: Evidence, tmp_path: Path) -> None:
    law = next(s for s in laws(nothing_missing) if s.variant.constants == Follower("brake", "late"))
    term = Term("unknown", law.variant, tuple(np.linspace(0.0, 0.1, law.columns.shape[1]).tolist()))
    truck = CorrectedTruck(TRUCK, [term], {}, None, True)
    truck.save(tmp_path / "kept")
    again = simulators.load(tmp_path / "kept")
    assert isinstance(again, CorrectedTruck) and again.terms == truck.terms


def test_a_part_of_the_recordings_in_which_nothing_counts_corrects_nothing(nothing_missing: Evidence) -> None:
    search = Search(nothing_missing, only=np.zeros(len(nothing_missing), dtype=bool))
    law, _ = law_and_gusts(nothing_missing)
    model = search.model((law,), frozenset(search.parameters))
    assert model.change("torque_gain") == 0.0 and np.isfinite(model.fit.b).all()
