"""A lateness too small to be told is known beside all else; a larger one is a finding."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms import LIBRARY, candidate_term
from deeptruck_model.mismatch.mechanisms.commands import Delays
from deeptruck_model.mismatch.mechanisms.variants import Static
from deeptruck_model.mismatch.posterior import nuisances
from deeptruck_model.mismatch.posterior.candidates import candidates
from deeptruck_model.mismatch.posterior.penalties import practical
from deeptruck_model.mismatch.posterior.search import Search
from deeptruck_model.mismatch.residual.evidence import Evidence


@pytest.fixture(scope="module")
def truck(nothing_missing: Evidence) -> Evidence:
    """The same truck with a quick driver; each command path can be delayed."""
    e = nothing_missing
    quick = np.random.default_rng(3).normal(size=(3, len(e))).cumsum(axis=1)
    quick = 0.2 * (quick - quick.mean(axis=1, keepdims=True)) / quick.std(axis=1, keepdims=True)
    paths = {"engine": e["engine"] + quick[0], "brake": -e["brake"] + quick[1]}
    simulated = paths["engine"] + paths["brake"] + quick[2]  # a road as quick

    def rerun(name: str, amount: float) -> NDArray[np.float64]:
        which = name.split("_")[1]
        late = [path for part, path in paths.items() if which in (part, "all")]
        return sum((_delayed(path, amount / e.dt) - path for path in late), np.zeros(len(e)))

    return replace(e, simulated=simulated, rerun=rerun)


def _delayed(path: NDArray[np.float64], steps: float) -> NDArray[np.float64]:
    rows = np.arange(len(path), dtype=float)
    return np.interp(rows - steps, rows, path)


@pytest.mark.parametrize(
    ("share", "delay_s", "known"),
    [(0.0, 0.4, False), (0.25, 0.4, True), (1.0, 0.4, False), (1.0, 1.0, False)],
)
def test_only_what_is_too_small_to_be_told_is_known(
    truck: Evidence, share: float, delay_s: float, known: bool
) -> None:
    late = replace(truck, residual=truck.residual + share * truck.rerun("delay_all", delay_s))
    assert (nuisances.beside_it(Search(late)).e.late is not None) == known


def test_nothing_makes_up_for_it(truck: Evidence) -> None:
    """A tail of a tenth of a second is worth much to rate limits and brakes."""
    late = replace(truck, residual=truck.residual + 0.25 * truck.rerun("delay_all", 0.4))
    gains = [_most(search) for search in (Search(late), nuisances.beside_it(Search(late)))]
    assert gains[0] > 15.0 > 5.0 > gains[1]


@pytest.mark.parametrize("lags", [True, False])
def test_what_a_name_explains_is_not_left_to_it(truck: Evidence, lags: bool) -> None:
    """Parameters alone had been fitted beside the lateness that a lagging brake looks like."""
    force = 0.25 * truck.rerun("delay_all", 0.4)
    late = replace(truck, residual=truck.residual + force, late=force[:, None])
    search = Search(late)
    brake = next(
        s
        for s in search.candidate_terms(LIBRARY["command_delay"])
        if s.variant == Static(Delays((("all", 0.1),)))
    )
    column = replace(brake, columns=force[:, None], prior=replace(brake.prior, mean=np.ones(1)))
    model = search.model((column,) if lags else (), frozenset())
    assert (nuisances.left_beside(late, model).late is None) == lags


@pytest.mark.parametrize(
    ("lines", "late_s", "sd_s", "told"),
    [
        (("all",), 0.14, 0.001, False),
        (("all",), 0.18, 0.04, False),  # it may as well be an ordinary one
        (("all",), 0.18, 0.01, True),
        (("engine", "brake"), 0.1, 0.001, False),  # two ordinary ones are no long one
        (("engine", "brake"), 0.18, 0.01, True),
    ],
)
def test_a_delay_is_told_that_is_surely_longer_than_ordinary_ones(
    truck: Evidence, lines: tuple[str, ...], late_s: float, sd_s: float, told: bool
) -> None:
    term = candidate_term(LIBRARY["command_delay"], Static(Delays(tuple((n, 0.2) for n in lines))), truck)
    fitted: Any = SimpleNamespace(
        rules=truck.rules,
        coefficients=lambda name: np.full(len(lines), late_s / 0.2),
        covariance=lambda name: np.eye(len(lines)) * (sd_s / 0.2) ** 2,
    )
    assert practical(Search(truck), fitted, term) == told


def test_a_truck_without_commands_has_none(truck: Evidence) -> None:
    signals = {name: s for name, s in truck.signals.items() if not name.endswith("_command")}
    silent = replace(truck, signals=signals)
    search = Search(silent)
    assert nuisances.beside_it(search) is search


def _most(search: Search) -> float:
    base = search.background(())
    return max(m.score for m in candidates(search, base)) - base.score
