"""Classical models behind the Simulator protocol, to be beaten: ARX, NARX and gradient boosting.

Each predicts the next acceleration and fuel rate from the last LAGS inputs, conditions and responses; the
speed follows from the same kinematic constraint as in the deep truck.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from deeptruck_model.deep.data.windows import common_interface, cut
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import SPEED, TruckInterface
from deeptruck_model.simulators import Array, Simulator

LAGS = 5
LARGEST = 100.0  # m/s^2, cm^3/s: a polynomial that runs away stays a number


class History(NamedTuple):
    """The last LAGS rows of [u, w, y], newest last, (batch, LAGS, n); the newest row has no u and w yet."""

    rows: Array
    y: Array


class Regression:
    """A fitted one-step regression as a truck: `predict` maps (n, LAGS * columns) to (n, n_y - 1).

    It gives the next acceleration and fuel rate from the last LAGS inputs, conditions and responses; the
    speed follows from the same kinematic constraint as in the deep truck.
    """

    def __init__(self, interface: TruckInterface, dt: float, predict: Callable[[Array], Array]) -> None:
        self._interface, self._dt, self._predict = interface, dt, predict

    @property
    def interface(self) -> TruckInterface:
        """Which u, w and y the truck has."""
        return self._interface

    @property
    def dt(self) -> float:
        """Step in s."""
        return self._dt

    def reset(self, y0: Array) -> History:
        """No past: the first input and response are repeated."""
        return History(np.zeros((len(y0), 0, 0)), np.array(y0, dtype=np.float64))

    def step(self, state: History, u: Array, w: Array) -> tuple[History, Array]:
        """One step; u (batch, n_u), w (batch, n_w)."""
        newest = np.concatenate([u, w, state.y], axis=1)[:, None]
        rows = np.concatenate([state.rows[:, 1:], newest], axis=1) if state.rows.shape[1] else newest
        rows = np.repeat(rows, LAGS, axis=1) if rows.shape[1] == 1 else rows
        free = np.clip(self._predict(rows.reshape(len(rows), -1)), -LARGEST, LARGEST)
        speed = np.maximum(state.y[:, SPEED] + free[:, 0] * self.dt, 0.0)
        y = np.column_stack([(speed - state.y[:, SPEED]) / self.dt, speed, np.maximum(free[:, 1:], 0.0)])
        return History(rows, y), y

    def force(self, state: History, y: Array) -> History:
        """Feed the recorded response instead."""
        return state._replace(y=np.where(np.isnan(y), state.y, y))

    def inside(self, state: History) -> dict[str, Array]:
        """Nothing inside."""
        return {}

    def parameters(self) -> dict[str, float]:
        """Nothing to tune."""
        return {}

    def with_parameters(self, values: Mapping[str, float]) -> Regression:
        """Raises InputError for any name."""
        if values:
            raise InputError(f"a regression has no parameter '{next(iter(values))}'")
        return self

    def save(self, path: Path) -> None:
        """Comparison models are refitted, never saved."""
        raise InputError("a comparison model is not saved; fit it again")


def arx(recordings: Sequence[Recording]) -> Simulator:
    """Linear, by ridge regression."""
    return _fit(recordings, lambda: make_pipeline(StandardScaler(), Ridge(1e-3)))


def narx(recordings: Sequence[Recording]) -> Simulator:
    """Quadratic polynomial of the lagged signals, by ridge regression."""
    return _fit(
        recordings,
        lambda: make_pipeline(StandardScaler(), PolynomialFeatures(2), StandardScaler(), Ridge(1.0)),
    )


def boosting(recordings: Sequence[Recording]) -> Simulator:
    """Histogram gradient boosting."""
    return _fit(recordings, lambda: HistGradientBoostingRegressor(max_iter=300, random_state=0))


MODELS: dict[str, Callable[[Sequence[Recording]], Simulator]] = {
    "ARX": arx,
    "NARX": narx,
    "gradient boosting": boosting,
}


def _fit(recordings: Sequence[Recording], regressor: Callable[[], Any]) -> Regression:
    interface = common_interface(recordings)
    pairs = [_lagged(piece) for r in recordings for piece in cut(r, interface)]
    x, y = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    known = np.isfinite(x).all(axis=1) & np.isfinite(y).all(axis=1)
    models = [regressor().fit(x[known], y[known, column]) for column in range(y.shape[1])]

    def predict(rows: Array) -> Array:
        return np.column_stack([model.predict(rows) for model in models])

    return Regression(interface, recordings[0].dt, predict)


def _lagged(piece: Recording) -> tuple[Array, Array]:
    """Rows of the last LAGS samples, and the acceleration and fuel rate that follow."""
    data = np.concatenate([piece.u, piece.w, piece.y], axis=1)
    windows = np.lib.stride_tricks.sliding_window_view(data, LAGS, axis=0)[:-1]
    x = np.moveaxis(windows, 2, 1).reshape(len(windows), -1)
    return x, np.delete(piece.y[LAGS:], SPEED, axis=1)
