"""What acts now and then alone: planted in noise of the same kind as everything else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.posterior import windows
from deeptruck_model.mismatch.posterior.explain import explain
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.posterior.slow_force import LINE_S
from deeptruck_model.mismatch.report.findings import from_cause
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.rules import Rules

TIME = np.arange(6000) * 0.2
STUCK = ((TIME > 300) & (TIME < 306)) | ((TIME > 801) & (TIME < 809))


@pytest.fixture(scope="module")
def stuck(nothing_missing: Evidence) -> Evidence:
    return replace(nothing_missing, residual=nothing_missing.residual - 0.25 * STUCK)


def test_noise_alone_has_no_windows(nothing_missing: Evidence) -> None:
    search = Search(nothing_missing)
    assert windows.windows(nothing_missing, search.background(())) == []


def test_the_windows_are_where_the_brake_sticks(stuck: Evidence) -> None:
    spans = windows.windows(stuck, Search(stuck).background(()))
    marked = windows.within(spans, stuck)
    assert marked[STUCK].mean() > 0.9 and marked[~STUCK].mean() < 0.02


def test_what_sticks_now_and_then_is_named_and_acts_nowhere_else(stuck: Evidence) -> None:
    found = explain(Search(stuck))
    assert found.causes and found.causes[0].term is not None and found.causes[0].term.variant.acts_in_windows
    names = {found.causes[0].effect, *found.causes[0].not_told_from}
    assert "dragging_brake" in names
    assert "seen now and then alone" in from_cause(found.causes[0], stuck, found, {}).says.parts[0]
    near = np.convolve(STUCK, np.ones(61), mode="same") > 0
    assert np.abs(found.causes[0].force[~near]).max() < 1e-9


def test_windows_are_narrowed_to_where_the_force_itself_acts(stuck: Evidence) -> None:
    search = Search(stuck)
    model = search.background(())
    spans = windows.narrowed(search, model, windows.windows(stuck, model))
    assert [round(x) for _, first, last in spans for x in (first, last)] == [
        300,
        306,
        201,
        209,
    ]  # of the second drive, which begins at 600 s


def test_what_lasts_is_not_narrowed_and_hundreds_of_windows_have_a_penalty(stuck: Evidence) -> None:
    search = Search(stuck)
    model = search.background(())
    whole = [(0, 10.0, 10.0 + LINE_S + 1.0)]
    ((record, first, last),) = windows.narrowed(search, model, whole)
    assert record == 0 and (round(first), round(last)) == (10, 311)
    many = [(0, float(t), t + 0.5) for t in range(500)]
    assert np.isfinite(windows.unnamed(search, many).trials)


def test_pauses_are_left_out_and_steps_of_other_sizes_are_kept() -> None:
    force = np.zeros(200)
    force[40:80], force[80:90], force[100:120] = 2.0, 6.0, 2.0
    noise = np.random.default_rng(0).normal(0.0, 0.5, 200)
    pieces = windows.steps(force + noise, Rules.stands_out)
    inside = np.zeros(200, dtype=bool)
    for begin, end in pieces:
        inside[begin:end] = True
    assert (inside == (force > 0)).mean() > 0.97
    assert windows.steps(noise, Rules.stands_out) == [] and windows.steps(noise[:1], Rules.stands_out) == []


def test_bursts_that_follow_nothing_are_unknown(nothing_missing: Evidence) -> None:
    """Each of another size and sign, a sixteenth of the time: more than rare, and no name's."""
    rng, force = np.random.default_rng(1), np.zeros(len(nothing_missing))
    for start in range(60, len(force) - 60, 250):
        begin = start + int(rng.integers(0, 60))
        force[begin : begin + int(rng.integers(8, 22))] = rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 0.9)
    e = replace(nothing_missing, residual=nothing_missing.residual + force)
    found = explain(Search(e))
    (cause,) = found.causes
    assert cause.effect == "unknown" and cause.time_varying
    said = from_cause(cause, e, found, {})
    assert "when it acts most (the `segments`)" in str(said.would_be_told_by) and said.nearest is None
    assert np.corrcoef(cause.force, force)[0, 1] > 0.9


def test_what_is_off_for_much_of_the_time_is_no_noise_and_no_exception(nothing_missing: Evidence) -> None:
    """Humps every few seconds, by the place: no name for them, and 'nothing missing' had been told."""
    humps = ((TIME * 20.0) % 160.0 < 40.0) * 0.4 * np.sin(TIME * 0.9)
    often = replace(nothing_missing, residual=nothing_missing.residual - humps)
    rare = replace(nothing_missing, residual=nothing_missing.residual - 0.25 * STUCK)
    off = [windows.often_off(e, Search(e).background(())) for e in (often, rare, nothing_missing)]
    assert off[0] > 0.2 and off[1:] == [0.0, 0.0]
    assert windows.windows(often, Search(often).background(())) == []
    learned = replace(often, model_discrepancy=0.02)
    assert windows.often_off(learned, Search(learned).background(())) == 0.0
