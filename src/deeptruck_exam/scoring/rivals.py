"""Other methods on the same recordings: parameter refit, pysindy, gradient boosting; and an oracle.

pysindy and boosting predict from the recorded speed of the held-out drives, also within open-loop windows,
where the tool has only its own; this favours them.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor

from deeptruck_exam.cases.absorption import retune
from deeptruck_exam.cases.build import DT
from deeptruck_exam.laws.law import Array
from deeptruck_exam.scoring.evaluation import arrays, open_loop, residual
from deeptruck_exam.worlds.trucks import TUNABLE
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Simulator
from deeptruck_model.trucks import PhysicsTruck

SECOND = round(1.0 / DT)  # samples, over which the target is averaged
LAGS_S = (2.0, 10.0)  # s
EVERY = 3  # samples, of which one is learned from: the averaged target hardly changes between
MOST = 4.0  # m/s^2


def features(recordings: Sequence[Recording]) -> Array:
    """Regressors of the residual, (batch, n, columns): speed, commands, grade, commands LAGS_S ago, and the
    time since the start of the drive."""
    u, w, y = arrays(recordings)
    lags = [round(seconds / DT) for seconds in LAGS_S]
    past = [np.concatenate([u[:, :1].repeat(lag, axis=1), u[:, :-lag]], axis=1) for lag in lags]
    time = np.broadcast_to(np.arange(u.shape[1])[None, :, None] * DT, (*u.shape[:2], 1))
    return np.concatenate([y[:, :, 1:2], u, w, *past, time], axis=2)


def _smooth(values: Array) -> Array:
    kernel = np.ones(SECOND) / SECOND
    return np.stack([np.convolve(row, kernel, mode="same") for row in values])


def boosted(simulator: Simulator, fit: Sequence[Recording], held_out: Sequence[Recording]) -> Array:
    """Residual acceleration (batch, n) on the held-out recordings by gradient boosting."""
    target = _smooth(residual(simulator, *arrays(fit)))
    x = features(fit)
    model = HistGradientBoostingRegressor(
        max_iter=150, learning_rate=0.08, min_samples_leaf=40, random_state=0
    )
    model.fit(x[:, ::EVERY].reshape(-1, x.shape[2]), target[:, ::EVERY].ravel())
    new = features(held_out)
    return np.asarray(model.predict(new.reshape(-1, new.shape[2]))).reshape(new.shape[:2])


def sindy(simulator: Simulator, fit: Sequence[Recording], held_out: Sequence[Recording]) -> Array:
    """Residual acceleration (batch, n) on the held-out recordings by pysindy's sparse regression on
    polynomials of degree 2 in speed, commands and grade."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import pysindy

        def state(recordings: Sequence[Recording]) -> Array:
            u, w, y = arrays(recordings)
            return np.concatenate([y[:, :, 1:2], u, w], axis=2)

        x, new = state(fit), state(held_out)
        centre, spread = x.mean(axis=(0, 1)), x.std(axis=(0, 1)) + 1e-9
        library = pysindy.PolynomialLibrary(degree=2)
        target = _smooth(residual(simulator, *arrays(fit)))
        flat = ((x - centre) / spread)[:, ::EVERY].reshape(-1, x.shape[2])
        terms = np.asarray(library.fit_transform(flat))
        solver = pysindy.STLSQ(threshold=0.005, alpha=1e-3)
        solver.fit(terms, target[:, ::EVERY].reshape(-1, 1))
        fresh = np.asarray(library.transform(((new - centre) / spread).reshape(-1, x.shape[2])))
        return np.asarray(fresh @ np.asarray(solver.coef_).T).reshape(new.shape[:2])


def compare(
    simulator: Simulator,
    fit: Sequence[Recording],
    held_out: Sequence[Recording],
    *,
    oracle: Simulator,
    extra: Array,
    grade: Array | None = None,
) -> dict[str, Mapping[str, float]]:
    """Errors of all rivals in open-loop windows of the held-out drives. `oracle` has the true parameters and
    `extra` (batch, n) is the true acceleration of the effects; `grade` (batch, n) the true slope if it was
    not recorded."""
    u, w, y = arrays(held_out)
    errors: dict[str, Mapping[str, float]] = {"before": open_loop(simulator, u, w, y).rmse()}
    if isinstance(simulator, PhysicsTruck):
        start = {name: simulator.parameters()[name] for name in TUNABLE}
        tuned = simulator.with_parameters(retune(simulator, start, fit))
        errors["parameters_only"] = open_loop(tuned, u, w, y).rmse()
    errors["pysindy"] = open_loop(simulator, u, w, y, bounded(sindy(simulator, fit, held_out), y)).rmse()
    errors["boosting"] = open_loop(simulator, u, w, y, bounded(boosted(simulator, fit, held_out), y)).rmse()
    road = w if grade is None else grade[:, :, None]
    errors["oracle"] = open_loop(oracle, u, road, y, extra[:, : y.shape[1]]).rmse()
    return errors


def bounded(values: Array, y: Array) -> Array:
    """Accelerations (batch, n) limited to the range of the samples of y, so that extreme extrapolations do
    not decide a case."""
    return np.clip(values[:, : y.shape[1]], -MOST, MOST)
