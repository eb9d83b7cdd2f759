"""What acts in one regime alone is found there, by its own name; and sums over bins are the real gains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_model.mismatch.expression import Stream
from deeptruck_model.mismatch.mechanisms import LIBRARY, CandidateTerm, build
from deeptruck_model.mismatch.mechanisms.base import GATES
from deeptruck_model.mismatch.mechanisms.variants import Gate
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.evidence import Evidence


def test_the_sums_over_bins_are_those_of_the_confined_columns(nothing_missing: Evidence) -> None:
    use = np.arange(len(nothing_missing)) % 3 > 0
    regimes = Regression(nothing_missing).regimes.of(nothing_missing, use)
    C, y, X = (np.random.default_rng(k).normal(size=(use.sum(), n)) for k, n in ((0, 2), (1, 1), (2, 3)))
    gates, p = regimes.products(C, y[:, 0], X)
    for i, gate in enumerate(gates):
        signal, side, at = gate.signal, gate.side, gate.at
        x = GATES[signal][0].rows(nothing_missing)[use]
        inside = (x > at if side == "above" else x <= at)[:, None]
        assert pytest.approx((C * inside).T @ C) == p.CtC[i]
        assert pytest.approx((C * inside).T @ y[:, 0]) == p.Cty[i]
        assert pytest.approx(X.T @ (C * inside)) == p.XtC[i]
    assert len(gates) == regimes.count == 2 * 9 * 2  # nine borders of speed and of engine, two sides


def confined(e: Evidence, gate: Gate) -> CandidateTerm:
    search = Regression(e)
    return search.regimes.gated(search.candidate_terms(LIBRARY["driveline_loss"])[0], gate, e)


def test_what_brakes_make_up_for_begins_anew_at_the_border(nothing_missing: Evidence) -> None:
    """As the same expression over the recording has it."""
    holds = (nothing_missing["brake"] > 0.1).astype(float)
    e = replace(nothing_missing, signals=nothing_missing.signals | {"holds": holds, "made up": -0.4 * holds})
    term = confined(e, Gate("speed", "above", 19.0))
    rows = np.stack([part.expression.rows(e) for part in term.parts], axis=1)
    np.testing.assert_allclose(term.columns, rows, atol=1e-12)


@pytest.mark.parametrize("side", ["above", "below"])
@pytest.mark.parametrize(("signal", "at"), [("speed", 19.0), ("engine torque", 0.01)])
def test_a_confined_shape_acts_alike_in_a_simulation(
    nothing_missing: Evidence, side: str, signal: str, at: float
) -> None:
    e = nothing_missing
    e = replace(e, signals=e.signals | {"lever": np.where(e["speed"] > 15.0, 6.0, 12.0)})
    term = confined(e, Gate(signal, side, at))
    stream = Stream([c.expression for c in build(term.mechanism, term.variant)])
    memory, out = stream.begin(1), []
    for k in range(600):
        now = {name: x[k : k + 1] for name, x in e.signals.items()}
        values, memory = stream.step(memory, now, e.dt)
        out.append(np.broadcast_to(values[0], 1)[0])
    assert np.array(out) == pytest.approx(term.columns[:600, 0])
    assert 0 < np.count_nonzero(out) < 600


@pytest.mark.parametrize(("gears", "expected"), [([24.0], []), ([6.0, 24.0], [12.0])])
def test_no_border_runs_through_a_gear(
    nothing_missing: Evidence, gears: list[float], expected: list[float]
) -> None:
    e, rng = nothing_missing, np.random.default_rng(0)
    driven = np.array(gears)[np.arange(len(e)) // 40 % len(gears)]
    ratio = driven * (1.0 + 1e-4 * rng.normal(size=len(e)))
    e = replace(e, signals=e.signals | {"ratio": ratio, "lever": ratio})
    assert Regression(e).regimes.borders["lever"] == pytest.approx(expected, rel=1e-3)
