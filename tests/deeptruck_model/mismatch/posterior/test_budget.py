"""The budget: shares that add up, and the part that acts."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter
from small_drives import DT, N, evidence, posterior_of, regression

from deeptruck_model.mismatch.mechanisms.families import EACH_DRIVE, LEFT_OVER, SLOW
from deeptruck_model.mismatch.posterior.budget import Budget, Part, _shares, budget
from deeptruck_model.mismatch.posterior.posterior import posterior
from deeptruck_model.mismatch.residual.evidence import Evidence


def split(e: Evidence, given: Evidence) -> Budget:
    return budget(posterior(regression(e), sweeps=80), given)


@cache
def of(name: str) -> Budget:
    p = posterior_of(name)
    return budget(p, p.regression.e)


@pytest.mark.parametrize("name", ["none", EACH_DRIVE, SLOW])
def test_shares_add_up_to_one_and_lie_in_their_intervals(name: str) -> None:
    found = of(name)
    assert sum(p.share for p in found.parts) == pytest.approx(1.0)
    assert all(p.low <= p.share <= p.high for p in found.parts)
    assert found.parts[-1].part == LEFT_OVER


def test_of_noise_most_is_left_over() -> None:
    assert of("none").share(LEFT_OVER) > 0.5


def test_what_differs_by_drive_is_each_drives_own() -> None:
    found = of(EACH_DRIVE)
    assert found.parts[0].part == EACH_DRIVE
    assert found.share(EACH_DRIVE) > 0.6
    assert found.share(LEFT_OVER) < 0.2


def test_what_swells_slowly_is_slow() -> None:
    found = of(SLOW)
    assert found.parts[0].part == SLOW
    assert found.share(SLOW) > 0.5


def test_a_force_of_the_brakes_is_a_part_of_the_brakes() -> None:
    e = evidence(-0.4 * evidence()["brake"])
    found = split(e, e)
    assert found.parts[0].part == "brakes"


def test_what_refitting_took_away_is_a_part_of_its_family() -> None:
    """Brakes 20 % weaker than the simulator's, about which the search was linearised."""
    given = evidence()
    given = replace(given, residual=given.residual + 0.2 * given["brake"])
    e = replace(evidence(), moved={"brake_gain": -0.2})
    found = split(e, given)
    assert found.share("brakes") > 0.95
    assert found.speed_rmse > 5.0 * of("none").speed_rmse
    assert sum(p.share for p in found.parts) == pytest.approx(1.0)


def test_what_all_drives_have_is_not_of_each() -> None:
    assert of("steady").share(EACH_DRIVE) < 0.01


@pytest.mark.long
def test_intervals_hold_what_is_known() -> None:
    """Shares of four known forces beside coloured noise, which make the figures of mismatch_method.md."""
    names = ("brakes", EACH_DRIVE, "air_tyres_road", SLOW, LEFT_OVER)
    inside, errors = [], []
    for seed in range(100, 108):
        true, found = _known(seed)
        parts = {n: Part(n, 0.0, 0.0, 0.0, 0.0) for n in names}  # of what is in no draw
        parts |= {p.part: p for p in found.parts}
        inside.append([parts[n].low - 0.005 <= true[n] <= parts[n].high + 0.005 for n in names])
        errors.append([parts[n].share - true[n] for n in names])
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    held = np.mean(inside, axis=0)
    print(*(f"{n}: {100.0 * h:.0f} % held, error {e:.3f}" for n, h, e in zip(names, held, rms, strict=True)))
    assert held.min() > 0.6
    assert np.max(np.abs(errors), axis=0)[-1] < 0.04


def _known(seed: int) -> tuple[dict[str, float], Budget]:
    """True shares of the squared speed error over the budget's windows, and the budget."""
    rng = np.random.default_rng(seed)
    e = evidence()
    at = np.arange(N)
    own = rng.normal(0.0, 0.03, 3)
    slow = np.interp(at * DT, np.arange(0.0, 1300.0, 60.0), rng.normal(0.0, 1.0, 22))
    forces = {
        "brakes": rng.normal(0.0, 0.25) * e["brake"] * (1.0 + rng.normal(0.0, 0.3) * np.sin(at / 900.0)),
        EACH_DRIVE: np.repeat(own - own.mean(), N // 3),
        "air_tyres_road": rng.normal(0.0, 1e-4) * e["speed"] ** 2,
        SLOW: rng.normal(0.0, 0.03) * slow,
    }
    noise = lfilter([1.0], [1.0, -0.5], rng.normal(0.0, 0.03, N))
    residual = sum(forces.values()) + noise
    e = replace(e, residual=residual)
    found = split(e, e)
    steps = round(found.horizon_s / DT)
    columns = np.column_stack([*forces.values(), residual])
    added = np.concatenate(
        [
            np.cumsum(columns[k : k + steps], axis=0) * DT
            for s in e.drives
            for k in range(s.start, s.stop - steps, steps // 2)
        ]
    )
    ends = np.insert(added, 4, 0.0, axis=1)  # no rows of an unrecorded brake
    groups = [np.array([k]) for k in range(5)]
    (shares,) = _shares(np.ones((1, 4)), groups, ends.T @ ends)
    return {**dict(zip(forces, shares, strict=False)), LEFT_OVER: float(shares[-1])}, found


def test_what_persists_is_more_than_white_noise_adds_up_to() -> None:
    """Noise of a learned simulator: white it adds up to no more than itself, as an autoregression of 0.9 to
    nearly ten times as much."""
    noise = np.random.default_rng(3).normal(0.0, 0.03, N)
    white = replace(evidence(), residual=noise, learned_slow_noise=0.3)
    coloured = replace(white, residual=lfilter([1.0], [1.0, -0.9], noise))
    assert split(white, white).persistent < 0.3
    found = split(coloured, coloured)
    assert 0.6 < found.persistent + found.share(SLOW) < 1.0
    assert found.persistent < found.share(LEFT_OVER)


def test_the_speed_error_is_what_a_free_run_adds_up() -> None:
    """A steady 0.05 m/s^2 makes 2 m/s in 40 s, and an rms of 2 / sqrt(3)."""
    assert of("steady").speed_rmse == pytest.approx(2.0 / np.sqrt(3.0), rel=0.1)


def test_what_two_parts_cancel_counts_in_neither() -> None:
    """Two parts of one shape, 1.3 and -0.3 of what is seen: all of it is the first one's."""
    x = np.sin(np.arange(100.0))
    columns = np.column_stack([x, x, np.zeros(100), x])
    (shares,) = _shares(np.array([[1.3, -0.3]]), [np.array([0]), np.array([1])], columns.T @ columns)
    assert shares == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
