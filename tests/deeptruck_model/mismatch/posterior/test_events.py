"""Events: forces of seconds are found where they act, and in noise as seldom as the rule says."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter
from small_drives import DT, N, evidence, regression

from deeptruck_core.json_data import from_json, to_json
from deeptruck_model.mismatch.mechanisms.families import FAMILY
from deeptruck_model.mismatch.posterior.events import (
    CLIP,
    LARGEST,
    POWER,
    Event,
    Possible,
    _Filters,
    events,
    find_events,
    in_several,
    rows_of,
    with_events,
)
from deeptruck_model.mismatch.posterior.kernels import kernels, without
from deeptruck_model.mismatch.posterior.names import names
from deeptruck_model.mismatch.posterior.posterior import first_look, posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.noise import ORDER, TAIL, Prior, fit
from deeptruck_model.mismatch.rules import Rules

NO_COLUMNS = Prior(np.zeros(0), np.zeros(0), np.zeros(0))
ROWS = slice(2500, 2535)  # 7 s of the second drive, from 100 s on


@cache
def search() -> Regression:
    return regression(evidence())


def found(force: np.ndarray, seed: int = 0, held_out: str = "") -> tuple[Event, ...]:
    """The events in noise of autoregression 0.3 with heavy tails beside a force (N,), m/s^2, where one drive
    may be held out."""
    e = search().e
    innovations = 0.02 * np.random.default_rng(seed).standard_t(TAIL, N)
    y = lfilter([1.0], [1.0, -0.3], innovations) + force
    series = replace(search().series, y=y)
    drives = [replace(s, held_out=s.name == held_out) for s in e.drives]
    return find_events(series, fit(series, np.zeros((N, 0)), NO_COLUMNS), kernels(search()), drives, DT)


def during(rows: slice, force: np.ndarray | float) -> np.ndarray:
    out = np.zeros(N)
    out[rows] = np.broadcast_to(force, N)[rows]
    return out


def overlaps(event: Event, rows: slice) -> float:
    """Share of the rows that the event covers."""
    return (min(event.stop, rows.stop) - max(event.start, rows.start)) / (rows.stop - rows.start)


@pytest.mark.parametrize("size", [-0.12, 0.12])
def test_a_force_of_seconds_is_found_where_it_acts(size: float) -> None:
    (event,) = found(during(ROWS, size))
    assert event.recording == "b"
    assert event.start_s == pytest.approx(100.0, abs=1.5)
    assert event.end_s == pytest.approx(107.0, abs=1.5)
    assert event.speed_change == pytest.approx(7.0 * size, abs=0.15)
    assert event.probability > 0.999


def test_a_force_that_follows_the_engine_for_seconds_is_found() -> None:
    engine = search().e["engine"]
    (event,) = found(during(ROWS, -0.6 * engine))
    assert overlaps(event, ROWS) >= 0.5
    assert event.speed_change == pytest.approx(-0.6 * float(engine[ROWS].sum()) * DT, abs=0.3)


def test_events_are_told_apart() -> None:
    near = (slice(2500, 2535), slice(2570, 2605), slice(4600, 4660))
    several = found(sum(during(rows, -0.15) for rows in near))
    assert len(several) == len(near)
    for rows in near:
        assert max(overlaps(e, rows) for e in several) > 0.8
    assert several[0].stop - several[0].start == pytest.approx(60, abs=12)  # the largest is first


@pytest.mark.parametrize(
    "force",
    [
        pytest.param(0.05 * np.sin(2 * np.pi * np.arange(N) * DT / 50.0), id="all the time"),
        pytest.param(-0.15 * search().e["brake"], id="whenever the truck brakes"),
        pytest.param(1.5 * (np.arange(N) % 997 == 0), id="jolts"),
    ],
)
def test_what_is_off_all_along_is_no_event(force: np.ndarray) -> None:
    assert found(force) == ()


def test_what_is_off_along_a_held_out_drive_is_no_event_there() -> None:
    swell = during(slice(N // 3, 2 * N // 3), 0.05 * np.sin(2 * np.pi * np.arange(N) * DT / 50.0))
    assert len(found(swell, held_out="b")) < len(found(swell))
    assert max(overlaps(x, ROWS) for x in found(during(ROWS, 0.2), held_out="b")) > 0.8


def test_rows_that_do_not_count_hold_no_event() -> None:
    series = replace(search().series, y=during(ROWS, 0.3))
    valid = np.ones(N, dtype=bool)
    valid[ROWS.start - 60 : ROWS.stop + 60] = False
    noise = fit(
        replace(series, y=np.random.default_rng(0).normal(0.0, 0.03, N)), np.zeros((N, 0)), NO_COLUMNS
    )
    drives = search().e.drives
    assert len(find_events(series, noise, kernels(search()), drives, DT)) == 1
    assert find_events(replace(series, valid=valid), noise, kernels(search()), drives, DT) == ()
    short = tuple(replace(s, stop=s.start + 12) for s in drives)
    assert find_events(series, noise, kernels(search()), short, DT) == ()


@pytest.mark.parametrize("dt", [DT, 1.0])
def test_filters_are_the_whitened_directions_of_their_windows(dt: float) -> None:
    e, rng = search().e, np.random.default_rng(3)
    valid = rng.random(N) > 0.01
    series = replace(search().series, y=rng.normal(0.0, 0.05, N), valid=valid, relative=1.0 + rng.random(N))
    noise = fit(series, np.zeros((N, 0)), NO_COLUMNS)
    filters = _Filters(series, noise, [k for k in kernels(search()) if k.part != "parameter"], e.drives, dt)
    psi = np.clip(filters.whitened, -CLIP, CLIP)
    sums = filters.sums(psi)
    assert (filters.edges[filters.last] - filters.edges[filters.first]).min() >= ORDER
    for w in [*range(3), *rng.integers(0, len(filters.first), 10)]:
        rows = slice(filters.edges[filters.first[w]], filters.edges[filters.last[w]])
        confined = np.zeros_like(filters.directions)
        confined[rows] = filters.directions[rows]
        whitened = (
            lfilter(np.concatenate([[1.0], -noise.ar]), [1.0], confined, axis=0) * filters.weight[:, None]
        )
        inner = sums[filters.last[w]] - sums[filters.first[w]]
        np.testing.assert_allclose(inner, whitened.T @ psi, atol=1e-8 * np.abs(sums).max())
        half = 0.5 / (POWER * (np.sum(whitened**2, axis=0) + LARGEST**-2))
        np.testing.assert_allclose(
            filters._half_variance(filters.first[[w]], filters.last[[w]])[0], half, rtol=1e-6
        )


def test_events_are_found_beside_what_acts_always_and_left_out_of_its_fit() -> None:
    """One in a fitted drive and one in a held-out drive with a constant of its own; brakes are wrong too."""
    rows = (ROWS, slice(5000, 5035))
    always = 0.2 * evidence()["brake"] + during(slice(4000, 6000), 0.04)
    e = evidence(always + sum(during(r, -0.2) for r in rows), held_out=1)
    p = posterior(Regression(e.to_fit()), sweeps=30)
    happened = events(p)
    assert len(happened) == len(rows)
    for r in rows:
        assert max(overlaps(x, r) for x in happened) > 0.8
    outside = np.zeros(N, dtype=bool)
    outside[ROWS] = True
    other = without(p.regression, outside)
    assert kernels(other) is kernels(p.regression)
    assert not set(other.rows) & set(range(ROWS.start, ROWS.stop))
    assert set(range(ROWS.start, ROWS.stop)) <= set(p.regression.rows)
    assert posterior(other, sweeps=5).probability("brake_gain") > 0.3


def lost_for_seconds(*starts: int) -> tuple[np.ndarray, list[slice]]:
    """Most of a strong engine's force is lost for 6 s from each start on; and the rows."""
    rows = [slice(k, k + 30) for k in starts]
    return sum((during(r, -0.8 * evidence()["engine"]) for r in rows), np.zeros(N)), rows


def strong_pulls() -> list[int]:
    """Starts of 6 s, far apart, in which the engine pulls most."""
    engine = np.convolve(evidence()["engine"], np.ones(30), "valid")
    order, out = np.argsort(-engine), []
    for k in order:
        if all(abs(k - x) > 200 for x in out) and (k % 2000) + 60 < 2000 and k % 2000 > 60:
            out.append(int(k))
    return out[:4]


def test_a_single_event_has_possible_names_and_is_evidence_for_none() -> None:
    lost, (rows,) = lost_for_seconds(strong_pulls()[0])
    p, happened = with_events(first_look(regression(evidence(lost))), 0)
    assert not rows_of(happened, N)[p.regression.rows].any()
    assert all(abs(x.speed_change) >= p.regression.rules.drift for x in happened)
    (one,) = (x for x in happened if overlaps(x, rows) > 0.5)
    assert one.name is None and not one.other_shift
    assert {FAMILY[x.name] for x in one.possible} & {"engine_driveline"}
    assert not [f for f in names(p).found if not f.lasts]


def test_names_that_act_in_several_events_are_found_beside_what_acts_throughout() -> None:
    lost, rows = lost_for_seconds(*strong_pulls())
    p, happened = with_events(first_look(regression(evidence(lost))), 0)
    cause = names(p).found[0]
    assert FAMILY[cause.name] == "engine_driveline" and not cause.lasts
    within = rows_of(happened, N)
    assert np.abs(cause.force[~within]).max() < 0.05 * np.abs(lost).max()
    made = [r for r in rows if max(overlaps(x, r) for x in happened) > 0.5]
    assert len(made) >= 3
    for r in made:
        assert 0.5 < cause.force[r].sum() / lost[r].sum() < 1.5


def test_what_a_shift_at_another_moment_makes_has_no_name() -> None:
    lost, rows = lost_for_seconds(*strong_pulls())
    shifting = np.zeros(N, dtype=bool)
    for r in rows:
        shifting[r] = True
    p, happened = with_events(first_look(regression(replace(evidence(lost), other_shift=shifting))), 0)
    assert happened and all(x.other_shift and x.name is None and not x.possible for x in happened)
    assert not names(p).found


def test_a_force_that_no_name_has_makes_events_without_one() -> None:
    rows = [slice(k, k + 35) for k in (700, 2500, 4300)]
    force = sum((during(r, -0.3 * np.sign(np.sin(np.arange(N) / 3.0)) - 0.1) for r in rows), np.zeros(N))
    search = regression(evidence(force))
    window = [Event("abc"[i], 0.0, 7.0, -0.5, 1.0, None, r.start, r.stop) for i, r in enumerate(rows)]
    p, happened = in_several(posterior(search, sweeps=30), search, window)
    assert all(x.name is None for x in happened)
    shifts = [replace(x, other_shift=True) for x in window]
    assert in_several(p, search, shifts)[0] is p


def false_events(seeds: range) -> tuple[int, float]:
    """Events in noise of the fitted kind, and the hours."""
    count = sum(len(found(np.zeros(N), seed)) for seed in seeds)
    return count, len(seeds) * N * DT / 3600.0


def test_noise_has_hardly_an_event() -> None:
    count, hours = false_events(range(10, 22))
    assert hours == pytest.approx(4.0)
    assert count <= 2


@pytest.mark.long
def test_noise_has_an_event_as_seldom_as_the_rule_says() -> None:
    """The 99.9 % quantile of Poisson's distribution, of as many as the rule allows."""
    count, hours = false_events(range(1000, 1600))
    assert hours == pytest.approx(200.0)
    print(f"{count} events in {hours:.0f} h of noise")
    assert count <= 21 == round(Rules().false_events * hours + 3.6 * np.sqrt(Rules().false_events * hours))


def test_an_event_survives_json() -> None:
    event = Event(
        "a", 12.0, 19.0, -0.42, 0.9876, None, possible=(Possible("headwind", 0.5),), channels=("gap",)
    )
    assert from_json(Event, to_json(event)) == event
    assert "other_shift" not in to_json(event)
