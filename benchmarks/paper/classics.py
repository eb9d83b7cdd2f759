"""Models with which a deep truck is compared: ARX, NARX and gradient boosting, a fitted physics truck, and
the reference truck itself started from states that resemble the start.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial import KDTree
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from deeptruck_model import trucks
from deeptruck_model.deep.data import common_interface, cut
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import ACCELERATION, SPEED, TruckInterface
from deeptruck_model.simulators import Array, Run, Simulator
from deeptruck_model.trucks import PhysicsTruck, TruckState
from deeptruck_model.trucks.specification import Specification

LAGS = 5
LARGEST = 100.0  # m/s^2, cm^3/s: a polynomial that runs away stays a number
STARTS_FROM = "volvo"
FITTED = (
    "mass",
    "drag_area",
    "rolling_resistance",
    "full_load_gain",
    "engine_friction",
    "engine_brake_torque",
    "boost_lag",
    "brake_gain",
    "fuel_gain",
    "shift_time",
    "upshift_low",
    "upshift_high",
    "downshift_low",
    "downshift_high",
)
RUNS, SECONDS = 150, 20.0
EVALUATIONS = 2000
SPAN = 1.1  # of the logarithm: each scalar between a third and three times its start
SPEED_S = 5.0  # a speed error counts as the acceleration that brings it about in this time
NEAREST = 50
FINENESS = 0.1  # of each signal's standard deviation: what counts as the same


class History(NamedTuple):
    """The last LAGS rows of [u, w, y], newest last, (batch, LAGS, n); u and w of the newest row are not known
    yet."""

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
        """The channels u, w and y of the truck."""
        return self._interface

    @property
    def dt(self) -> float:
        """Step in s."""
        return self._dt

    def reset(self, y0: Array) -> History:
        """Start without a past: the first input and response are repeated."""
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
        """Replace the predicted response by the recorded one."""
        return state._replace(y=np.where(np.isnan(y), state.y, y))

    def inside(self, state: History) -> dict[str, Array]:
        """No inner state."""
        return {}

    def parameters(self) -> dict[str, float]:
        """No parameters."""
        return {}

    def with_parameters(self, values: Mapping[str, float]) -> Regression:
        """Raises InputError for any name."""
        if values:
            raise InputError(f"a regression has no parameter '{next(iter(values))}'")
        return self

    def save(self, path: Path) -> None:
        """Not supported: comparison models are refitted."""
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
    """Rows of the last LAGS samples, and the acceleration and fuel rate that follow each."""
    data = np.concatenate([piece.u, piece.w, piece.y], axis=1)
    windows = np.lib.stride_tricks.sliding_window_view(data, LAGS, axis=0)[:-1]
    x = np.moveaxis(windows, 2, 1).reshape(len(windows), -1)
    return x, np.delete(piece.y[LAGS:], SPEED, axis=1)


def physics(recordings: Sequence[Recording], evaluations: int = EVALUATIONS) -> PhysicsTruck:
    """A physics truck fitted to recordings: its structure is right, its parameters start from another
    truck's.

    Gear ratios are taken from the recorded gear, engine speed and speed; FITTED are fitted to free runs.
    Raises InputError for interfaces that a physics truck does not have.
    """
    interface = common_interface(recordings)
    pieces = [piece for r in recordings for piece in cut(r, interface)]
    truck = PhysicsTruck(_dressed(trucks.load(STARTS_FROM).specification, pieces), dt=recordings[0].dt)
    u, w, y = _windows(pieces)
    scale = np.nanstd(y, axis=(0, 1))
    scale[SPEED] = scale[ACCELERATION] * SPEED_S
    initial = truck.parameters()

    def at(logarithms: Array) -> PhysicsTruck:
        factors = np.exp(logarithms)
        return truck.with_parameters({n: initial[n] * float(f) for n, f in zip(FITTED, factors, strict=True)})

    def cost(logarithms: Array) -> float:
        try:
            run = at(logarithms).rollout(u, w, y[:, 0], inside=False).y
        except InputError:  # a scalar out of its range
            return 1e3
        return float(np.nanmean(((run - y) / scale) ** 2))

    bounds = [(-SPAN, SPAN)] * len(FITTED)
    found = minimize(
        cost, np.zeros(len(FITTED)), method="Powell", bounds=bounds, options={"maxfev": evaluations}
    )
    return at(found.x)


def _dressed(known: Specification, pieces: Sequence[Recording]) -> Specification:
    """The other truck with the recordings' interface and gear ratios."""
    interface = pieces[0].interface
    ratios = _ratios(pieces, known.values["final_drive"] / known.values["wheel_radius"])
    return replace(known, interface=interface, ratios=ratios or known.ratios)


def _ratios(pieces: Sequence[Recording], final: float) -> tuple[float, ...]:
    """Gearbox ratio of each gear from engine speed, speed and the `final` drive, rad/m; of an unrecorded gear
    from a straight line through the logarithms. Empty if these channels were not recorded."""
    if not all({"gear", "engine_speed"} <= p.channels.keys() for p in pieces):
        return ()
    gear, engine, speed = (
        np.concatenate([p.channels[n] for p in pieces]) for n in ("gear", "engine_speed", "speed")
    )
    gears = np.arange(1, int(np.nanmax(gear)) + 1)
    turning = speed > 2.0
    ratio = np.log(np.where(turning, engine, 1.0) / np.where(turning, speed, 1.0))
    seen = [np.median(ratio[m]) if (m := turning & (gear == g)).any() else np.nan for g in gears]
    known = np.isfinite(seen)
    line = np.polyfit(gears[known], np.array(seen)[known], 1)
    filled = np.where(known, seen, np.polyval(line, gears))
    return tuple(float(r) for r in np.minimum.accumulate(np.exp(filled) / final))


def _windows(pieces: Sequence[Recording]) -> tuple[Array, Array, Array]:
    """RUNS segments of SECONDS, evenly spaced over all pieces: u, w, y (runs, T, n)."""
    steps = min(round(SECONDS / pieces[0].dt), max(len(p) for p in pieces) - 1)
    starts = [(p, k) for p in pieces for k in range(0, len(p) - steps, steps // 4)]
    chosen = [starts[i] for i in np.linspace(0, len(starts) - 1, RUNS).astype(int)]

    def stack(name: str) -> Array:
        return np.stack([getattr(p, name)[k : k + steps + 1] for p, k in chosen])

    return stack("u"), stack("w"), stack("y")


class LookAlikes(PhysicsTruck):
    """The mean of the truck's runs from all states in `drive` that resemble the start.

    Gear, boost and brake temperature are hidden in the sample of u, w and y from which a run starts: no model
    can do better than to average over all states that have this sample.
    """

    def __init__(self, truck: PhysicsTruck, drive: Recording) -> None:
        super().__init__(truck.specification, dt=truck.dt)
        self._states = states(truck, drive)
        seen = np.concatenate([drive.u, drive.w, drive.y], axis=1)
        self._unit = np.maximum(FINENESS * seen.std(axis=0), 1e-9)
        self._tree = KDTree(seen / self._unit)

    def rollout(
        self, u: Array, w: Array, y0: Array, recorded: Array | None = None, *, inside: bool = False
    ) -> Run:
        """Free run from y0 (batch, n_y) under u (batch, T, n_u) and w (batch, T, n_w)."""
        start = np.concatenate([u[:, 0], w[:, 0], y0], axis=1) / self._unit
        distance, index = self._tree.query(start, range(1, NEAREST + 1))
        weight = np.exp(-0.5 * (distance**2 - distance[:, :1] ** 2))
        records = self._states[index.ravel()].copy()
        records["speed"] = np.repeat(y0[:, SPEED], NEAREST)
        state, y = TruckState(records), [y0]
        share = (weight / weight.sum(axis=1, keepdims=True))[..., None]
        for k in range(u.shape[1] - 1):
            u_k, w_k = (np.repeat(x[:, k], NEAREST, axis=0) for x in (u, w))
            response = self._respond(state, u_k, w_k)
            y.append((response.reshape(len(y0), NEAREST, -1) * share).sum(axis=1))
        return Run(np.stack(y, axis=1), {})

    def _respond(self, state: TruckState, u: Array, w: Array) -> Array:
        y = np.empty((len(u), len(self.interface.y)))
        self.advance(state, u, np.ascontiguousarray(w[:, 0]), y)
        return y


def states(truck: PhysicsTruck, drive: Recording) -> NDArray[np.void]:
    """The truck's whole state at every sample of a drive from its reset, (n,) records of
    trucks.state.STATE."""
    state = truck.reset(np.array([[0.0, drive.channels["speed"][0]]]))
    kept = np.empty(len(drive), state.records.dtype)
    u, grade = drive.u, np.ascontiguousarray(drive.w[:, 0])
    y = np.empty((1, len(truck.interface.y)))
    for k in range(len(drive)):
        kept[k] = state.records[0]
        truck.advance(state, u[k : k + 1], grade[k : k + 1], y)
    return kept
