"""Road slope that no sensor recorded as such: from the accelerometer, from elevation, or from both.

An accelerometer along the vehicle feels gravity: what it reads beyond dv/dt is g sin(slope), beside its bias
and the pitch of the body, which follows the acceleration. Both sources are measurements of one road, with the
errors that each shows, and a Kalman smoother over distance fuses them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from deeptruck_core.arrays import Array
from deeptruck_core.constants import GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELEROMETER, ELEVATION, SLOPE_FROM
from deeptruck_model.recordings.consistency.accelerometer import accelerometer
from deeptruck_model.recordings.consistency.windows import CORRELATED, SCALE
from deeptruck_model.recordings.recording import Recording

GRADE_WINDOW_M = 100.0
_CELL_M = 5.0
DERIVED_NOTE = "grade derived from "  # begins the note of a recording whose grade no sensor measured

STEP_M = 10.0  # of the smoother
ROAD_M, FAR_M, NEAR_M = 300.0, 300.0, 30.0  # over which a slope is forgotten; of the variogram's two points
BIAS, WALK = 0.1, 0.01  # m/s^2: prior sd of the sensor's bias; its change over DRIFT_M
DRIFT_M = 10_000.0
START = 0.05  # prior sd of the slope where a piece begins
FAST_S, SMOOTH_S = 4.0, 0.4  # the body pitches within so long, and no road changes; noise of dv/dt
LEAST_SPEED = 1.0  # m/s: below, the suspension is wound up by the brakes
LEAST_M = 50.0  # of averaging: no road bends within less, and what is faster has the drive's own dv/dt in it
LEAST_KM = 1.0  # of road, to estimate errors from
HEIGHT_APART_M = 200.0  # errors of heights nearer to one another are alike
HEIGHT_ERRORS = (0.5, 1.5, 5.0, 15.0, 50.0)  # m, of which the most probable is taken


@dataclass(frozen=True)
class Slope:
    """Slope rise/run of a recording, and its standard deviation, (n,) each."""

    grade: Array
    sd: Array


@dataclass(frozen=True)
class FeltSlope:
    """Slopes of the pieces of one log by its accelerometer, and how they were found: `pitch` is the share of
    dv/dt that the sensor reads beyond it, when the truck pulls and when it slows; `bias` in m/s^2;
    `resolved_m` the length over which the smoother averages; `height_m` the error of elevation, if fused."""

    of: tuple[Slope, ...]
    pitch: tuple[float, float]
    bias: float
    resolved_m: float
    height_m: float | None

    @property
    def note(self) -> str:
        """What the bag says of its grade."""
        fused = "" if self.height_m is None else f", fused with elevation (errors of {self.height_m:g} m)"
        known = float(np.sqrt(np.mean(np.concatenate([s.sd for s in self.of]) ** 2)))
        return (
            f"{DERIVED_NOTE}the accelerometer less dv/dt{fused}: averages over {self.resolved_m:.0f} m, sd "
            f"{100 * known:.1f} %; bias {self.bias:+.3f} m/s^2, pitch and scale {self.pitch[0]:+.3f} "
            f"pulling, {self.pitch[1]:+.3f} slowing"
        )


def with_slope(
    recordings: Sequence[Recording], source: str | None = None, window_m: float | None = None
) -> list[Recording]:
    """The pieces of one log with a grade derived from a source of SOURCES; unchanged if they have none. By
    default an accelerometer is taken, fused with elevation, or else elevation alone, where no grade was
    recorded.

    Raises InputError for a source that was not recorded.
    """
    there = {c for r in recordings for c, x in r.channels.items() if np.isfinite(x).any()}
    channel = {ACCELEROMETER: "specific_force", ELEVATION: "elevation"}
    if source is not None and channel[source] not in there:
        raise InputError(f"{SLOPE_FROM}: {source} needs {channel[source]}, which was not recorded")
    if source is None and "grade" in there:
        return list(recordings)
    found = felt_slope(recordings) if source != ELEVATION and "specific_force" in there else None
    if found is not None:
        return [_sloped(r, one.grade, found.note) for r, one in zip(recordings, found.of, strict=True)]
    if source == ACCELEROMETER:
        raise InputError(
            f"{SLOPE_FROM}: {source} needs {LEAST_KM:g} km of driving whose specific_force follows the speed"
        )
    window = window_m or GRADE_WINDOW_M
    note = f"{DERIVED_NOTE}elevation over distance, smoothed over {window:g} m"
    return [
        _sloped(r, grade_from_elevation(r.channels["speed"], r.channels["elevation"], r.dt, window), note)
        if "elevation" in r.channels
        else r
        for r in recordings
    ]


def _sloped(r: Recording, grade: Array, note: str) -> Recording:
    channels, interface = {**r.channels, "grade": grade}, replace(r.interface, grade=True)
    return replace(r, channels=channels, interface=interface, notes=(*r.notes, note))


def felt_slope(recordings: Sequence[Recording]) -> FeltSlope | None:
    """The slope that the accelerometer of one log felt, fused with its elevation if there is one. None if
    less than LEAST_KM was driven with it, or if it does not follow the speed."""
    seen = accelerometer(recordings, "specific_force")
    low, high = SCALE
    if seen is not None and (seen.correlation < CORRELATED or not low < seen.slope < high):
        return None
    pieces = [_Piece.of(r) for r in recordings]
    pitch = _pitch(pieces)
    if pitch is None:
        return None
    # what is turned reads less of everything; of a body that pitches the accelerometer reads more of dv/dt
    scale = 1.0 + min(0.5 * (pitch[0] + pitch[1]), 0.0)
    felt = [p.in_cells((p.beyond - pitch[0] * p.pulling - pitch[1] * p.slowing) / scale) for p in pieces]
    known = sum(int(np.isfinite(x).sum()) for x in felt)
    if known * STEP_M < 1000.0 * LEAST_KM:
        return None
    near, far = (_variogram(felt, round(m / STEP_M)) for m in (NEAR_M, FAR_M))
    rise = np.exp(-NEAR_M / ROAD_M) - np.exp(-FAR_M / ROAD_M)
    road = max((far - near) / rise, 1e-4) / GRAVITY**2  # variance of the slope
    noise = max(near - GRAVITY**2 * road * (1.0 - np.exp(-NEAR_M / ROAD_M)), 0.1 * near, 1e-6)
    heights = [p.heights() for p in pieces]
    has = any(np.isfinite(h).any() for h in heights)
    tried = {sd: _filtered(felt, heights, road, noise, sd) for sd in (HEIGHT_ERRORS if has else (np.inf,))}
    error, best = max(tried.items(), key=lambda one: one[1].evidence)
    slopes, bias = _smoothed(best)
    return FeltSlope(
        tuple(p.at_samples(s, sd) for p, (s, sd) in zip(pieces, slopes, strict=True)),
        pitch,
        bias,
        max(2.0 * STEP_M * float(np.sqrt(noise / (GRAVITY**2 * best.grows))), LEAST_M),
        error if has else None,
    )


@dataclass(frozen=True)
class _Piece:
    """One recording: distance (n,), what the accelerometer reads beyond dv/dt, and dv/dt where it is positive
    and where negative, all smoothed over SMOOTH_S and (n,)."""

    recording: Recording
    distance: Array
    beyond: Array
    pulling: Array
    slowing: Array

    @classmethod
    def of(cls, r: Recording) -> _Piece:
        speed = r.channels["speed"]
        filled = _filled(speed)
        distance = np.cumsum(np.maximum(filled, 0.0)) * r.dt
        width = SMOOTH_S / r.dt
        rate = gaussian_filter1d(np.diff(filled, prepend=filled[:1]) / r.dt, width)
        reading = r.channels.get("specific_force", np.full(len(r), np.nan))
        beyond = gaussian_filter1d(_filled(reading), width) - rate
        unknown = ~np.isfinite(reading + speed) | (filled < LEAST_SPEED)
        beyond = np.where(unknown, np.nan, beyond)
        return cls(r, distance, beyond, np.maximum(rate, 0.0), np.minimum(rate, 0.0))

    def fast(self, x: Array) -> Array:
        """The changes of x (n,) within FAST_S, in which no road changes."""
        return x - gaussian_filter1d(x, FAST_S / self.recording.dt)

    def in_cells(self, x: Array) -> Array:
        """Means of x (n,) over cells of STEP_M; NaN where none is known."""
        cell = (self.distance / STEP_M).astype(np.intp)
        known = np.isfinite(x)
        count = np.bincount(cell[known], minlength=cell[-1] + 1)
        total = np.bincount(cell[known], x[known], cell[-1] + 1)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    def heights(self) -> Array:
        """Elevation in cells, one every HEIGHT_APART_M."""
        height = self.recording.channels.get("elevation", np.full(len(self.recording), np.nan))
        cells = self.in_cells(height)
        apart = np.arange(len(cells)) % round(HEIGHT_APART_M / STEP_M) == 0
        return np.where(apart, cells, np.nan)

    def at_samples(self, slope: Array, sd: Array) -> Slope:
        """Slopes at the middles of cells as slopes at samples, averaged over LEAST_M."""
        slope = gaussian_filter1d(slope, LEAST_M / 2.0 / STEP_M, mode="nearest")
        middle = (np.arange(len(slope)) + 0.5) * STEP_M
        return Slope(np.interp(self.distance, middle, slope), np.interp(self.distance, middle, sd))


def _filled(x: Array) -> Array:
    known = np.isfinite(x)
    at = np.arange(len(x))
    return np.interp(at, at[known], x[known]) if known.any() else np.zeros_like(x)


def _pitch(pieces: Sequence[_Piece]) -> tuple[float, float] | None:
    """Shares of dv/dt that the accelerometer reads beyond it when pulling and slowing, by fast changes: pitch
    of the body and the sensor's scale, which act alike. None without data."""
    rows, y = [], []
    for p in pieces:
        use = np.isfinite(p.beyond)
        if not use.any():
            continue
        later = np.gradient(p.pulling + p.slowing)  # what a lag between the two sensors would add
        columns = [p.fast(x)[use] for x in (p.pulling, p.slowing, later)]
        rows.append(np.stack(columns, axis=1))
        y.append(p.fast(_filled(p.beyond))[use])
    if not y:
        return None
    X, target = np.concatenate(rows), np.concatenate(y)
    weight = np.ones(len(target))
    b = np.zeros(3)
    for _ in range(5):
        H = (X * weight[:, None]).T @ X + np.eye(3) * 1e-9
        b = np.linalg.solve(H, X.T @ (weight * target))
        off = target - X @ b
        weight = 1.0 / (1.0 + (off / (2.0 * 1.4826 * np.median(np.abs(off)) + 1e-9)) ** 2)
    return float(b[0]), float(b[1])


def _variogram(felt: Sequence[Array], cells: int) -> float:
    """Half the mean square of what cells so far apart differ by; robust, as brakes and bumps are rare."""
    apart = np.concatenate([x[cells:] - x[:-cells] for x in felt if len(x) > cells] or [np.zeros(1)])
    apart = apart[np.isfinite(apart)]
    return float(0.5 * (1.4826 * np.median(np.abs(apart))) ** 2) if len(apart) else 0.0


@dataclass(frozen=True)
class _Filtered:
    """States (height, slope, bias) of all cells one after the other, predicted and filtered, with
    covariances; `first` are the first cells of pieces, `grows` the variance that a slope gains in a cell."""

    before: Array
    before_var: Array
    after: Array
    after_var: Array
    first: tuple[int, ...]
    step: Array
    grows: float
    evidence: float


def _filtered(
    felt: Sequence[Array], heights: Sequence[Array], road: float, noise: float, height_sd: float
) -> _Filtered:
    """Kalman filter over the cells of all pieces. Height and slope begin anew with a piece, the bias does
    not."""
    keep = np.exp(-STEP_M / ROAD_M)
    step = np.array([[1.0, STEP_M, 0.0], [0.0, keep, 0.0], [0.0, 0.0, 1.0]])
    grows = road * (1.0 - keep**2)
    q = np.diag([1e-4, grows, WALK**2 * STEP_M / DRIFT_M])
    x, P = np.zeros(3), np.diag([0.0, 0.0, BIAS**2])
    rows = [(row, var) for row, var in (([0.0, GRAVITY, 1.0], noise), ([1.0, 0.0, 0.0], height_sd**2))]
    before, before_var, after, after_var = (list[Array]() for _ in range(4))
    first, evidence = list[int](), 0.0
    for y, z in zip(felt, heights, strict=True):
        first.append(len(before))
        about = float(z[np.isfinite(z)][0]) if np.isfinite(z).any() else 0.0
        x = np.array([about, 0.0, x[2]])
        P = np.diag([1e4, START**2, P[2, 2]])
        for k in range(len(y)):
            if k:
                x, P = step @ x, step @ P @ step.T + q
            before.append(x)
            before_var.append(P)
            for (row, var), seen in zip(rows, (y[k], z[k]), strict=True):
                if np.isfinite(seen) and np.isfinite(var):
                    h = np.array(row)
                    gain = P @ h
                    s = float(h @ gain) + var
                    off = float(seen - h @ x)
                    x, P = x + gain * (off / s), P - np.outer(gain, gain) / s
                    evidence -= 0.5 * (off**2 / s + np.log(s))
            after.append(x)
            after_var.append(P)
    return _Filtered(
        np.array(before), np.array(before_var), np.array(after), np.array(after_var), tuple(first), step,
        grows, evidence,
    )  # fmt: skip


def _smoothed(f: _Filtered) -> tuple[list[tuple[Array, Array]], float]:
    """Smoothed slopes with their sds, for each piece, and the mean bias (Rauch, Tung and Striebel, AIAA
    Journal 3, 1965)."""
    x, P = f.after.copy(), f.after_var.copy()
    starts = set(f.first)
    for k in range(len(x) - 2, -1, -1):
        if k + 1 in starts:  # only the bias goes on into the next piece
            gain = np.zeros((3, 3))
            gain[:, 2] = f.after_var[k][:, 2] / f.before_var[k + 1][2, 2]
        else:
            gain = f.after_var[k] @ f.step.T @ np.linalg.inv(f.before_var[k + 1])
        x[k] += gain @ (x[k + 1] - f.before[k + 1])
        P[k] += gain @ (P[k + 1] - f.before_var[k + 1]) @ gain.T
    ends = (*f.first, len(x))
    return [(x[a:b, 1], np.sqrt(np.maximum(P[a:b, 1, 1], 0.0))) for a, b in pairwise(ends)], float(
        x[:, 2].mean()
    )


def grade_from_elevation(
    speed: Array, elevation: Array, dt: float, window_m: float = GRADE_WINDOW_M
) -> Array:
    """Slope rise/run at each sample, (n,): the local slope of elevation over distance driven.

    speed (n,) in m/s and elevation (n,) in m, `dt` in s. Elevation is averaged in cells of 5 m of road, so
    that standing still adds no noise, and a line is fitted around each cell with Gaussian weights of standard
    deviation window_m / 2. NaN where elevation covers too little of the road nearby to fit a line.
    """
    distance = np.concatenate([[0.0], np.cumsum(np.nan_to_num(np.maximum(speed[1:], 0.0)) * dt)])
    cell = np.floor(distance / _CELL_M).astype(np.int64)
    known = ~np.isnan(elevation)
    count = np.bincount(cell[known], minlength=cell[-1] + 1)
    has = (count > 0).astype(np.float64)
    mean = [
        np.bincount(cell[known], x[known], cell[-1] + 1) / np.maximum(count, 1) for x in (distance, elevation)
    ]
    offset = np.where(count > 0, mean[0] - _middle(mean[0], count), 0.0)
    rise = np.where(count > 0, mean[1] - _middle(mean[1], count), 0.0)
    moments = (has, has * offset, has * rise, has * offset**2, has * offset * rise)
    width = window_m / 2 / _CELL_M
    n, x, h, xx, xh = (gaussian_filter1d(m, width, mode="constant", truncate=3.0) for m in moments)
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = xx / n - (x / n) ** 2
        slope = (xh / n - (x / n) * (h / n)) / spread
    slope[~(spread > (window_m / 8) ** 2)] = np.nan
    return np.interp(distance, (np.arange(cell[-1] + 1) + 0.5) * _CELL_M, slope)


def _middle(values: Array, count: NDArray[np.int64]) -> float:
    """A central value that is subtracted to keep the moments precise."""
    return float(values[count > 0].mean()) if (count > 0).any() else 0.0
