"""The recogniser learns what laws of a name have in common, and is judged by families it has not seen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from deeptruck_exam.teaching import learning
from deeptruck_exam.teaching.samples import UNKNOWN, Samples
from deeptruck_model.mismatch import NOTHING, Fingerprint, Given, Recogniser, Seen

KEYS = ("brake_lag, law", "headwind, law", "unknown, law")
NAMES = ("brake_lag", "headwind", UNKNOWN)
FAMILIES = ("first", "second", "third")


def taught(family: str, seed: int, count: int = 120) -> Samples:
    """Laws of brake_lag are, to the evidence, like headwind; only their signs tell them."""
    rng = np.random.default_rng(seed)
    which = rng.integers(0, 3, count)
    nats = rng.uniform(60.0, 80.0, (3, count))
    nats[1, which == 0] += 40.0  # the evidence alone is wrong
    nats[1, which == 1] += 40.0
    nats[2, which == 2] += 40.0
    sign = np.where(np.arange(3)[:, None] == 1, np.where(which == 0, -12.0, 2.0), 0.0)
    size, told, noise = np.full((3, count), 2), np.full((3, count), 3.0), np.ones(count)
    seen = Seen(nats, sign, size, told, noise)
    names = np.array(NAMES)[which]
    laws = np.array([f"{family} {name} {k % 2}" for k, name in enumerate(names)])
    alone = Given(np.zeros(count, dtype=bool), np.zeros(count), np.zeros(count))
    made = Fingerprint(KEYS, np.ones(3), seen, seen, alone)
    return Samples(made, names, laws, np.full(count, family), family)


def left_over(family: str, seed: int) -> Samples:
    """The same beside names, half of which leave nothing but the error of their form, where they act."""
    part = taught(family, seed)
    nothing = np.arange(len(part.names)) % 2 == 0
    given = Given(np.full(len(nothing), True), np.full(len(nothing), 900.0), np.where(nothing, 0.9, 0.2))
    beside = replace(part.fingerprint, given=given)
    return replace(part, fingerprint=beside, names=np.where(nothing, NOTHING, part.names))


@pytest.fixture(scope="module")
def whole() -> learning.Lesson:
    return learning.lesson([taught(f, k) for k, f in enumerate(FAMILIES)], KEYS, NAMES)


def test_what_laws_have_in_common_is_learned(whole: learning.Lesson) -> None:
    taught_by = {f: learning.learned(learning.without([f], whole), KEYS, NAMES, members=1) for f in FAMILIES}
    by, alone, rows = learning.unseen(whole, taught_by)
    assert rows.all()
    weight = learning.weights(whole, NAMES)
    network, evidence = (learning.score(p, whole.answer, weight) for p in (by, alone))
    assert network.first > 0.9 > evidence.first
    assert network.log_score > evidence.log_score


def test_a_law_without_its_names_kernels_is_unknown() -> None:
    whole = learning.lesson([taught("first", 1)], KEYS, NAMES)
    hidden = ~whole.possible[:, 0]
    assert hidden.any() and (whole.answer[hidden] == NAMES.index(UNKNOWN)).all()


def test_what_tells_nothing_teaches_nothing() -> None:
    part = taught("first", 2)
    weak = Seen(
        np.full((3, 120), 5.0),
        *(getattr(part.fingerprint.held, n) for n in ("sign", "size", "told", "noise")),
    )
    silent = Samples(
        replace(part.fingerprint, held=weak, free=weak), part.names, part.laws, part.families, part.world
    )
    assert len(learning.lesson([part, silent], KEYS, NAMES).answer) == len(
        learning.lesson([part], KEYS, NAMES).answer
    )


def test_every_name_counts_alike_and_every_law_of_it(whole: learning.Lesson) -> None:
    weight = learning.weights(whole, NAMES)
    brakes, wind = (weight[whole.answer == k].sum() for k in (0, 1))
    assert brakes == pytest.approx(wind)
    laws = whole.laws[whole.answer == 0]
    each = {law: weight[whole.answer == 0][laws == law].sum() for law in set(laws.tolist())}
    assert max(each.values()) == pytest.approx(min(each.values()))


def test_beside_names_nothing_more_can_be_missing() -> None:
    names = (*NAMES, NOTHING)
    parts = [
        *(taught(f, k) for k, f in enumerate(FAMILIES)),
        *(left_over(f, k) for k, f in enumerate(FAMILIES)),
    ]
    whole = learning.lesson(parts, KEYS, names)
    nothing, beside = whole.answer == names.index(NOTHING), whole.possible[:, names.index(NOTHING)]
    assert nothing.any() and beside[nothing].all() and not beside.all()
    weight = learning.weights(whole, names)
    assert weight[nothing].sum() == pytest.approx(weight[beside & ~nothing].sum())
    by = learning.learned(whole, KEYS, names, members=1)
    alone = by.probabilities(taught("first", 7).fingerprint)[:, names.index(NOTHING)]
    given, said = left_over("first", 7), by.probabilities(left_over("first", 7).fingerprint)
    right = (said[:, names.index(NOTHING)] > 0.5) == (given.names == NOTHING)
    assert alone.max() < 1e-6 and right.mean() > 0.9


def test_what_is_packed_is_what_was_learned(whole: learning.Lesson, tmp_path: Path) -> None:
    by = learning.learned(whole, KEYS, NAMES, members=2)
    (tmp_path / "weights.npz").write_bytes(learning.packed(by))
    again = Recogniser.load(tmp_path / "weights.npz")
    assert (again.keys, again.names) == (KEYS, NAMES)
    f = taught("first", 3, 20).fingerprint
    np.testing.assert_allclose(again.probabilities(f), by.probabilities(f), atol=0.02)


def test_a_kept_base_is_the_same_again(tmp_path: Path) -> None:
    part = taught("second", 4, 10)
    part.save(tmp_path / "base.npz")
    again = Samples.load(tmp_path / "base.npz")
    np.testing.assert_allclose(again.fingerprint.held.nats, part.fingerprint.held.nats, rtol=1e-6)
    np.testing.assert_array_equal(again.names, part.names)
    assert (again.world, again.fingerprint.keys) == (part.world, part.fingerprint.keys)


def test_scores_are_of_probabilities() -> None:
    p = np.array([[0.7, 0.2, 0.1], [0.5, 0.4, 0.1]])
    found = learning.score(p, np.array([0, 1]), np.ones(2))
    assert (found.first, found.in_set, found.size) == (0.5, 1.0, 2.0)
    assert found.log_score == pytest.approx(np.log(0.7 * 0.4) / 2)
    assert found.calibration == pytest.approx((0.3 + 0.5) / 2)
