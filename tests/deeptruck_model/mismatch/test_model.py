"""The correction: few forms that stand for a mean force, and what drives best."""

from __future__ import annotations

import numpy as np
from small_drives import evidence

from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.model import _forms, _terms
from deeptruck_model.mismatch.posterior.posterior import posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.rules import Limits, Rules


def test_few_forms_stand_for_a_force_that_is_a_sum_of_many() -> None:
    search = Regression(evidence())
    options = search.candidate_terms(LIBRARY["dragging_brake"])
    force = sum(np.nan_to_num(t.columns).sum(axis=1) for t in options)
    taken = _forms(search, options, force)
    assert 1 <= len(taken) <= Limits.most_forms
    X = np.concatenate([np.nan_to_num(t.columns) for t in taken], axis=1)[search.rows]
    left = force[search.rows] - X @ np.linalg.lstsq(X, force[search.rows], rcond=None)[0]
    assert np.sum(left**2) < 0.1 * np.sum(force[search.rows] ** 2)


def test_whatever_may_be_in_has_a_term_and_noise_has_none() -> None:
    e = evidence()
    quiet = posterior(Regression(e), Rules(), sweeps=40)
    lost = evidence(-0.3 * np.maximum(e["engine"], 0.0) * (e["speed"] > 18.0))
    loud = posterior(Regression(lost), Rules(), sweeps=40)
    assert len(_terms(quiet)) <= 1
    assert _terms(loud)
