"""The classifier learns what laws of a name have in common, and is judged on others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from deeptruck_exam.laws.catalogue import UNKNOWN
from deeptruck_exam.teach import acceptance, learning
from deeptruck_exam.teach.samples import Samples
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch import NOTHING, EffectClassifier, Given, KernelFeatures, Seen

KEYS = ("brake_lag, law", "headwind, law", "unknown, law")
NAMES = ("brake_lag", "headwind", UNKNOWN)
SETS = ("a", "b", "c")


def made(letter: str, seed: int, count: int = 120) -> Samples:
    """Laws of brake_lag are, to the evidence, like headwind; only their signs distinguish them."""
    rng = np.random.default_rng(seed)
    which = rng.integers(0, 3, count)
    nats = rng.uniform(60.0, 80.0, (3, count))
    nats[1, which == 0] += 40.0  # the evidence alone is wrong
    nats[1, which == 1] += 40.0
    nats[2, which == 2] += 40.0
    sign = np.where(np.arange(3)[:, None] == 1, np.where(which == 0, -12.0, 2.0), 0.0)
    size, directions, noise = np.full((3, count), 2), np.full((3, count), 3.0), np.ones(count)
    seen = Seen(nats, sign, size, directions, noise)
    names = np.array(NAMES)[which]
    laws = np.array([f"{letter}{name}-{k % 2}" for k, name in enumerate(names)])
    alone = Given(np.zeros(count, dtype=bool), np.zeros(count), np.zeros(count))
    found = KernelFeatures(KEYS, np.ones(3), seen, seen, alone)
    return Samples(found, names, laws)


def left_over(letter: str, seed: int) -> Samples:
    """The same beside names, half of which leave nothing but the error of their form, where they act."""
    part = made(letter, seed)
    nothing = np.arange(len(part.names)) % 2 == 0
    given = Given(np.full(len(nothing), True), np.full(len(nothing), 900.0), np.where(nothing, 0.9, 0.2))
    beside = replace(part.kernels, given=given)
    return replace(part, kernels=beside, names=np.where(nothing, NOTHING, part.names))


@pytest.fixture(scope="module")
def whole() -> learning.TrainingSet:
    return learning.training_set([made(f, k) for k, f in enumerate(SETS)], KEYS, NAMES)


def test_what_laws_have_in_common_is_learned() -> None:
    new = learning.trained(
        learning.training_set([made("a", 0), made("b", 1)], KEYS, NAMES), KEYS, NAMES, members=1
    )
    ways = {"new": acceptance.of_classifier(new), "evidence": acceptance.of_evidence(NAMES)}
    found = acceptance.judged([made("c", 2)], ways)
    assert set(found) == {"all", "with a name", "unknown"}
    assert found["all"]["new"].first > 0.9 > found["all"]["evidence"].first
    assert found["all"]["new"].log_score > found["all"]["evidence"].log_score


def test_a_worse_classifier_is_not_accepted_and_it_is_said_why() -> None:
    shipped = acceptance.Score(100, 0.60, 0.80, 2.0, -1.0, 0.05)
    assert acceptance.failures(replace(shipped, first=0.57, log_score=-1.1, calibration=0.06), shipped) == []
    worse = replace(shipped, in_set=0.76, log_score=-1.2, calibration=0.07)
    assert [line.split(" ")[0] for line in acceptance.failures(worse, shipped)] == [
        "in_set",
        "log_score",
        "calibration",
    ]


def test_a_law_without_its_names_kernels_is_unknown() -> None:
    whole = learning.training_set([made("a", 1)], KEYS, NAMES)
    hidden = ~whole.possible[:, 0]
    assert hidden.any() and (whole.answer[hidden] == NAMES.index(UNKNOWN)).all()


def test_what_leaves_no_evidence_is_not_learned() -> None:
    part = made("a", 2)
    weak = Seen(
        np.full((3, 120), 5.0),
        *(getattr(part.kernels.held, n) for n in ("sign", "size", "directions", "noise")),
    )
    silent = Samples(replace(part.kernels, held=weak, free=weak), part.names, part.laws)
    assert len(learning.training_set([part, silent], KEYS, NAMES).answer) == len(
        learning.training_set([part], KEYS, NAMES).answer
    )


def test_every_name_counts_alike_and_every_law_of_it(whole: learning.TrainingSet) -> None:
    weight = learning.weights(whole.answer, whole.laws, whole.possible, NAMES)
    brakes, wind = (weight[whole.answer == k].sum() for k in (0, 1))
    assert brakes == pytest.approx(wind)
    laws = whole.laws[whole.answer == 0]
    each = {law: weight[whole.answer == 0][laws == law].sum() for law in set(laws.tolist())}
    assert max(each.values()) == pytest.approx(min(each.values()))


def test_beside_names_nothing_more_can_be_missing() -> None:
    names = (*NAMES, NOTHING)
    parts = [
        *(made(f, k) for k, f in enumerate(SETS)),
        *(left_over(f, k) for k, f in enumerate(SETS)),
    ]
    whole = learning.training_set(parts, KEYS, names)
    nothing, beside = whole.answer == names.index(NOTHING), whole.possible[:, names.index(NOTHING)]
    assert nothing.any() and beside[nothing].all() and not beside.all()
    weight = learning.weights(whole.answer, whole.laws, whole.possible, names)
    assert weight[nothing].sum() == pytest.approx(weight[beside & ~nothing].sum())
    by = learning.trained(whole, KEYS, names, members=1)
    alone = by.probabilities(made("a", 7).kernels)[:, names.index(NOTHING)]
    given, said = left_over("a", 7), by.probabilities(left_over("a", 7).kernels)
    right = (said[:, names.index(NOTHING)] > 0.5) == (given.names == NOTHING)
    assert alone.max() < 1e-6 and right.mean() > 0.9


def test_what_is_packed_is_what_was_learned(whole: learning.TrainingSet, tmp_path: Path) -> None:
    by = learning.trained(whole, KEYS, NAMES, members=2)
    (tmp_path / "weights.npz").write_bytes(learning.packed(by))
    again = EffectClassifier.load(tmp_path / "weights.npz")
    assert (again.keys, again.names) == (KEYS, NAMES)
    f = made("a", 3, 20).kernels
    np.testing.assert_allclose(again.probabilities(f), by.probabilities(f), atol=0.02)


def test_a_kept_base_is_the_same_again(tmp_path: Path) -> None:
    part = made("b", 4, 10)
    part.save(tmp_path / "base.npz")
    again = Samples.load(tmp_path / "base.npz")
    np.testing.assert_allclose(again.kernels.held.nats, part.kernels.held.nats, rtol=1e-6)
    np.testing.assert_array_equal(again.names, part.names)
    assert again.kernels.keys == part.kernels.keys


def test_a_base_of_another_version_is_refused(tmp_path: Path) -> None:
    made("b", 4, 10).save(tmp_path / "base.npz")
    with np.load(tmp_path / "base.npz") as kept:
        np.savez(tmp_path / "old.npz", **{n: kept[n] for n in kept if not n.endswith("_directions")})
    with pytest.raises(InputError, match=r"old\.npz was made by another version; delete it"):
        Samples.load(tmp_path / "old.npz")


def test_scores_are_of_probabilities() -> None:
    p = np.array([[0.7, 0.2, 0.1], [0.5, 0.4, 0.1]])
    found = acceptance.score(p, np.array([0, 1]), np.ones(2))
    assert (found.first, found.in_set, found.size) == (0.5, 1.0, 2.0)
    assert found.log_score == pytest.approx(np.log(0.7 * 0.4) / 2)
    assert found.calibration == pytest.approx((0.3 + 0.5) / 2)
