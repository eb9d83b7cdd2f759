"""Laws whose constants are fitted, on small drives whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_drives import N, evidence, regression

from deeptruck_model.mismatch.mechanisms.record import Column, Form, Mechanism, grid
from deeptruck_model.mismatch.posterior.fitted import narrowed
from deeptruck_model.mismatch.posterior.kernels import Kernel, kernels
from deeptruck_model.mismatch.posterior.posterior import Posterior, first_look, posterior
from deeptruck_model.mismatch.posterior.regression import Regression
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import Lag, Signal

KEEPS_S = 17.0  # no value of the library's grid


def kept_brake(e: Evidence) -> np.ndarray:
    """A brake that lets go late, m/s^2 (N,)."""
    held = np.zeros(N)
    for s in e.drives:
        last = 0.0
        for k in range(s.start, s.stop):
            now = e["brake"][k]
            last = max(now, last + (now - last) * (1.0 - np.exp(-e.dt / KEEPS_S)))
            held[k] = last
    return -0.1 * (held - e["brake"])


def law_of(search: Regression, name: str) -> Kernel:
    return next(k for k in kernels(search) if k.name == name and k.part == "law")


def held(p: Posterior, search: Regression, force: np.ndarray) -> float:
    """The gain of dragging brake over that of the force itself, both alone."""
    r = p.beside([law_of(search, "dragging_brake"), Kernel("true", force[:, None])])
    gains = r.table((-1,) * len(r.at)).max(axis=1)
    return float(gains[-2] / gains[-1])


@pytest.fixture(scope="module")
def looked() -> Posterior:
    e = evidence(kept_brake(evidence()))
    return first_look(regression(e))


def test_a_constant_between_those_of_the_grid_is_found(looked: Posterior) -> None:
    terms = narrowed(looked).fitted["dragging_brake"]
    constants = [dict(v.constants) for t in terms for v in t.variants]
    seconds = [
        c[n] for c in constants for n in ("keeps_s", "decay_s") if n in c
    ]  # the same of one brake force
    assert min(abs(x / KEEPS_S - 1.0) for x in seconds) < 0.15


def test_a_narrowed_kernel_holds_more_of_the_force_and_has_fewer_directions(looked: Posterior) -> None:
    narrow = narrowed(looked)
    force = kept_brake(looked.regression.e)
    before, after = (held(looked, s, force) for s in (looked.regression, narrow))
    assert after > 0.97
    assert after > before
    p = posterior(narrow, sweeps=60, noise=looked.noise)
    assert p.probability("dragging_brake") > 0.9


def test_names_that_may_act_in_its_place_are_fitted_too(looked: Posterior) -> None:
    assert len(narrowed(looked).fitted) > 1


def test_a_learned_simulator_keeps_its_kernels(looked: Posterior) -> None:
    search = looked.regression
    learned = replace(looked, regression=regression(replace(search.e, known_physics=False)))
    assert narrowed(learned) is learned.regression


def test_a_mechanism_of_the_users_may_have_fitted_constants() -> None:
    lag_s = 3.3
    ours = Mechanism(
        "late_air", "air_tyres_road", "air follows late", "F = -k lag(v)", ("speed",), ("speed",),
        "of our own", "change speed", {
            "late": Form(
                lambda lag_s: Column(Lag((Signal("engine"),), lag_s) - Signal("engine"), 0.2, "share"),
                grid(lag_s=(1.0, 10.0)), fitted={"lag_s": (0.3, 30.0)},
            )
        },
    )  # fmt: skip
    e = evidence()
    force = 0.2 * (e.lag(e["engine"], lag_s) - e["engine"])
    search = Regression(evidence(force))
    search.library = [ours]
    terms = narrowed(first_look(search)).fitted["late_air"]
    assert dict(terms[0].variants[0].constants)["lag_s"] == pytest.approx(lag_s, rel=0.1)
