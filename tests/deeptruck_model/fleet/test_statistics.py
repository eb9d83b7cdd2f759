"""False discoveries stay below the stated rate over many simulated fleets, and true ones are made."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deeptruck_model.fleet.statistics import (
    REFERENCE,
    TESTED,
    TOO_FEW,
    TOO_LITTLE,
    Seen,
    discovered,
    least_references,
    p_value,
    pooled,
    share,
    siblings,
)

FAMILY = {"drag_area": "air", "headwind": "air", "brake_gain": "brakes", "brake_lag": "brakes"}
NAMES = tuple(FAMILY)


def simulated(rng, count: int, affected: int, sizes=(4.0, 40.0), spread: float = 0.0) -> dict[str, Seen]:
    """Evidence as of sound trucks, chi-squared less its cost; 'drag_area' of `affected` has more.
    `spread` is the sd of what each truck has of its own on all its drives, in nats."""
    out = {}
    for k in range(count):
        own = rng.normal(0.0, spread)
        parts = []
        more = rng.uniform(*sizes) if k < affected else 0.0
        for _ in range(2):
            nats = {n: 0.5 * rng.chisquare(1) - 2.0 + own for n in NAMES}
            nats["drag_area"] += more * rng.uniform(0.7, 1.3)
            nats["headwind"] += 0.8 * more
            parts.append(nats)
        out[f"{k:03d}"] = Seen(parts[0], parts[1], 1.0)
    return out


def rates(rng, fleets: int, level: float, **how) -> tuple[float, float]:
    """Mean share of false among discoveries, and of the affected that are discovered."""
    false, power = [], []
    for _ in range(fleets):
        affected = how["affected"]
        found = [int(n) for n, t in siblings(simulated(rng, **how), FAMILY, level).items() if t.differs]
        wrong = sum(n >= affected for n in found)
        false.append(wrong / max(len(found), 1))
        power.append((len(found) - wrong) / max(affected, 1))
    return float(np.mean(false)), float(np.mean(power))


@pytest.mark.parametrize("affected", [0, 5, 30])
@pytest.mark.parametrize("level", [0.05, 0.2])
def test_false_discoveries_stay_below_the_level(affected, level):
    """Over 60 fleets of 100; three standard errors are allowed for."""
    fleets = 60
    false, power = rates(np.random.default_rng(affected), fleets, level, count=100, affected=affected)
    assert false <= level + 3.0 * np.sqrt(level * (1 - level) / fleets)
    if affected == 30:
        assert power > 0.9


def test_a_fleet_of_300_with_a_tenth_affected():
    """The power that is stated in docs/fleet.md."""
    false, power = rates(np.random.default_rng(3), 20, 0.05, count=300, affected=30, sizes=(6.0, 40.0))
    assert false <= 0.05 and power >= 0.9


def test_what_trucks_have_of_their_own_is_seen_by_no_reference():
    """Sound trucks that differ for good are no exchangeable siblings: the rate rises (docs/fleet.md)."""
    false, _ = rates(np.random.default_rng(5), 60, 0.05, count=100, affected=0, spread=2.0)
    assert false > 0.05


def test_trucks_known_to_be_sound_are_the_references():
    rng = np.random.default_rng(0)
    trucks = simulated(rng, 60, 6)
    trucks = {n: Seen(t.fitted, t.held_out, t.hours, sound=int(n) >= 40 or None) for n, t in trucks.items()}
    tested = siblings(trucks, FAMILY, 0.5)
    assert [n for n, t in tested.items() if t.role == REFERENCE] == [f"{k:03d}" for k in range(40, 60)]
    assert all(t.p is not None for t in tested.values() if t.role == TESTED)


@settings(max_examples=50)
@given(st.lists(st.floats(-5, 5), min_size=1, max_size=40), st.floats(-6, 6))
def test_p_values_are_ranks(references, value):
    p = p_value(value, references)
    n = len(references)
    assert 1 / (n + 1) <= p <= 1
    assert p == (1 + sum(r >= value for r in references)) / (n + 1)


def test_p_values_of_the_exchangeable_are_no_smaller_than_uniform():
    rng = np.random.default_rng(1)
    p = [p_value(x[0], x[1:]) for x in rng.normal(size=(2000, 20))]
    for level in (0.05, 0.1, 0.3):
        assert np.mean(np.array(p) <= level) <= level + 0.02


def test_how_many_references_a_rate_needs():
    assert least_references(300, 27, 0.05) == 222
    for n, yes in ((222, True), (221, False)):
        p = [1 / (n + 1)] * 27 + [1.0] * 273
        assert discovered(p, 0.05)[:27].all() == yes


def test_too_few_siblings_and_too_little_driving_are_said():
    trucks = simulated(np.random.default_rng(0), 4, 1)
    assert {t.role for t in siblings(trucks, FAMILY).values()} == {TOO_FEW}
    trucks = simulated(np.random.default_rng(0), 40, 0)
    trucks["short"] = Seen(trucks["000"].fitted, trucks["000"].held_out, 0.1)
    trucks["empty"] = Seen({}, {}, 1.0)
    tested = siblings(trucks, FAMILY)
    assert tested["short"].role == tested["empty"].role == TOO_LITTLE


def test_families_and_names_are_found_within_trucks():
    tested = siblings(simulated(np.random.default_rng(2), 400, 20, sizes=(30.0, 40.0)), FAMILY)
    for k in range(20):
        t = tested[f"{k:03d}"]
        assert t.differs and set(t.families or ()) == {"air"} and "drag_area" in (t.names or ())


def test_pooled_sizes_recover_what_they_were_drawn_from():
    rng = np.random.default_rng(0)
    sds = rng.uniform(0.05, 0.3, 300)
    true = rng.normal(1.2, 0.2, 300)
    of = pooled(true + rng.normal(0.0, sds), sds)
    assert abs(of.mean - 1.2) < 3 * of.error and of.between == pytest.approx(0.2, rel=0.2)
    raw, shrunk = np.array(of.raw), np.array(of.shrunk)
    assert np.mean((shrunk - true) ** 2) < 0.9 * np.mean((raw - true) ** 2)


def test_a_share_has_an_interval():
    value, low, high = share(3, 30)
    assert value == 0.1 and 0.0 < low < 0.1 < high < 0.3
