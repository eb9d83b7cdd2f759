"""Formulas for unnamed forces: found where there is one, simple, repeatable, silent on noise."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from deeptruck_model.mismatch.posterior import formula

ROWS, NOISE = 1500, 250.0


@pytest.fixture(scope="module")
def drive():
    rng = np.random.default_rng(4)
    speed, heat = rng.uniform(3.0, 27.0, ROWS), rng.uniform(0.0, 1.0, ROWS)
    return {"speed": speed, "engine over 3 s": heat}, np.arange(ROWS) > 1000, rng.normal(0.0, NOISE, ROWS)


def ceiling(force, noise, out):
    """The r2 that the true force itself would score on the held-out rows."""
    y = (force + noise)[out]
    return 1.0 - np.sum(noise[out] ** 2) / np.sum((y - y.mean()) ** 2)


def test_a_parabola_is_found_and_not_passed_off_as_a_line(drive):
    columns, out, noise = drive
    force = -4.0 * columns["speed"] ** 2
    found = formula.fit(columns, force + noise, out)
    assert found is not None
    assert found.drivers == ("speed",)
    assert "speed^2" in found.text
    assert found.held_out_r2 > ceiling(force, noise, out) - 0.02


def test_signals_of_several_words_are_bracketed_and_both_are_found(drive):
    columns, out, noise = drive
    force = 150.0 * columns["speed"] * columns["engine over 3 s"]
    found = formula.fit(columns, force + noise, out)
    assert found is not None
    assert set(found.drivers) == set(columns)
    assert "[engine over 3 s]" in found.text
    assert found.held_out_r2 > ceiling(force, noise, out) - 0.03


def test_constants_have_three_digits_at_most(drive):
    columns, out, noise = drive
    found = formula.fit({"speed": columns["speed"]}, 1234.567 - 56.789 * columns["speed"] + noise, out)
    assert found is not None
    digits = [
        token.strip("-()").replace(".", "").strip("0") for token in found.text.split() if token[-1].isdigit()
    ]
    assert digits
    assert all(len(d) <= formula.DIGITS for d in digits)


def test_the_same_data_and_seed_give_the_same_formula(drive):
    columns, out, noise = drive
    one = {"speed": columns["speed"]}
    y = 900.0 * np.sin(0.5 * columns["speed"]) + noise
    assert formula.fit(one, y, out, seed=3) == formula.fit(one, y, out, seed=3)


def test_noise_has_no_formula_worth_telling(drive):
    columns, out, noise = drive
    assert formula.fit({"speed": columns["speed"]}, noise, out) is None


def test_a_formula_that_predicts_next_to_nothing_is_not_told(drive):
    """`exp(sin(t) - sin(2 t))` stood in a verdict for 3 % of what is left."""
    columns, out, noise = drive
    weak = noise + 0.2 * noise.std() * np.sign(columns["speed"] - columns["speed"].mean())
    assert formula.fit({"speed": columns["speed"]}, weak, out) is None


def test_cells_hold_equally_many_rows_and_keep_the_mean():
    rng = np.random.default_rng(0)
    X, y = rng.normal(size=(4096, 2)), rng.normal(size=4096)
    means, values = formula.cells(X, y)
    assert len(means) == len(values) == formula.CELLS
    np.testing.assert_allclose(values.mean(), y.mean(), atol=1e-12)
    np.testing.assert_allclose(means.mean(axis=0), X.mean(axis=0), atol=1e-12)
    assert np.ptp(means, axis=0).min() > 2.0  # cells spread over the data, they are not random groups


def test_a_formula_has_no_pole_where_the_truck_drives(drive):
    columns, _, noise = drive
    symbols = [sympy.Symbol(name, real=True) for name in columns]
    X = np.stack(list(columns.values()), axis=1)
    speed = symbols[0]
    assert formula._bounded(speed * 10.0, symbols, X, 270.0 + noise)
    assert not formula._bounded(100.0 / (speed - 15.0), symbols, X, 270.0 + noise)
    assert not formula._bounded(sympy.exp(speed), symbols, X, 270.0 + noise)
