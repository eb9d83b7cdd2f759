"""Curves, memories and gates: what a grammar law makes of its carrier. All arrays are (batch, n)."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from scipy.signal import lfilter

from deeptruck_exam.grammar.signals import Signals
from deeptruck_exam.laws.law import Array
from deeptruck_exam.laws.series import CELL_M, lagged, ou_series, smooth_spans, some_drives

Rng = np.random.Generator

# Curves of a driver 0 to about 1, to 0 to 1.


def spline(x: Array, rng: Rng) -> Array:
    """Monotone: increments at random between knots, smoothed."""
    knots = np.linspace(0.0, 1.0, 9)
    rise = np.cumsum(np.append(0.0, rng.gamma(0.6, 1.0, 8)))
    return np.interp(np.clip(x, 0.0, 1.0), knots, rise / max(rise[-1], 1e-9))


def threshold(x: Array, rng: Rng) -> Array:
    """Nothing below a value, then a soft or a steep rise."""
    at, wide = rng.uniform(0.15, 0.7), np.exp(rng.uniform(np.log(0.02), np.log(0.3)))
    return 1.0 / (1.0 + np.exp(-np.clip((x - at) / wide, -40.0, 40.0)))


def saturation(x: Array, rng: Rng) -> Array:
    half, power = rng.uniform(0.1, 0.6), rng.uniform(1.0, 3.0)
    x = np.maximum(x, 0.0) ** power
    return x / (x + half**power)


def power(x: Array, rng: Rng) -> Array:
    return np.clip(x, 0.0, 1.5) ** np.exp(rng.uniform(np.log(0.5), np.log(2.5)))


def bell(x: Array, rng: Rng) -> Array:
    """A band of the driver."""
    return np.exp(-(((x - rng.uniform(0.2, 0.8)) / rng.uniform(0.05, 0.25)) ** 2))


def falling(x: Array, rng: Rng) -> Array:
    return 1.0 - CURVES[str(rng.choice(["spline", "threshold", "saturation", "power"]))](x, rng)


CURVES: Mapping[str, Callable[[Array, Rng], Array]] = {
    "spline": spline,
    "threshold": threshold,
    "saturation": saturation,
    "power": power,
    "bell": bell,
    "falling": falling,
}


# Memories of a driver or of a carrier; `seconds` is their time, `dt` the period.


def lag(x: Array, seconds: float, dt: float, rng: Rng) -> Array:
    return lagged(x, seconds, dt)


def heat(x: Array, seconds: float, dt: float, rng: Rng) -> Array:
    """A slow store, warm to some degree when a drive begins, behind a fast one."""
    fast, share = lagged(x, rng.uniform(0.05, 0.2) * seconds, dt), rng.uniform(0.0, 0.6)
    keep = np.exp(-dt / seconds)
    first = rng.uniform(0.0, 1.0, (len(x), 1)) * x.mean() * keep
    slow = lfilter([1.0 - keep], [1.0, -keep], x, axis=1, zi=first)[0]
    out: Array = share * fast + (1.0 - share) * slow
    return out


def delay(x: Array, seconds: float, dt: float, rng: Rng) -> Array:
    """A dead time, constant or wandering a little."""
    n = x.shape[1]
    wander = 1.0 + rng.uniform(0.0, 0.3) * ou_series(rng, (1, n), dt, 15.0)[0]
    at = np.arange(n) - np.clip(seconds * wander, 0.0, 3.0 * seconds) / dt
    return np.stack([np.interp(at, np.arange(n), row) for row in x])


def hold(x: Array, seconds: float, dt: float, rng: Rng) -> Array:
    """Sampled once a period of two such times, some of it lost."""
    steps = max(2, round(2.0 * seconds / dt))
    at = np.arange(x.shape[1]) // steps * steps
    return x[:, at]


def rate(x: Array, seconds: float, dt: float, rng: Rng) -> Array:
    """At most the 95 % quantile of its size in such a time, up; faster down."""
    up = float(np.quantile(np.abs(x), 0.95)) / max(seconds, dt) * dt + 1e-9
    down = up * rng.uniform(1.0, 4.0)
    out = x.copy()
    for k in range(1, x.shape[1]):
        out[:, k] = np.clip(x[:, k], out[:, k - 1] - down, out[:, k - 1] + up)
    return out


def rise(x: Array, seconds: float, dt: float, rng: Rng) -> Array:
    """Follows a rise slowly beyond a share of the most, a fall at once."""
    free = rng.uniform(0.1, 0.4) * float(np.quantile(np.abs(x), 0.98))
    falls = rng.uniform(0.05, 0.5) * seconds
    up, down = 1.0 - np.exp(-dt / seconds), 1.0 - np.exp(-dt / falls)
    state, out = np.zeros(len(x)), x.copy()
    for k in range(x.shape[1]):
        away = np.maximum(x[:, k] - free, 0.0) - state
        state = state + np.where(away > 0.0, up, down) * away
        out[:, k] = np.minimum(x[:, k], free + state)
    return out


def hysteresis(x: Array, seconds: float, dt: float, rng: Rng) -> Array:
    """On above a value of the lagged signal, off well below it."""
    x = lagged(x, seconds, dt)
    high = np.quantile(x, rng.uniform(0.5, 0.85))
    low = high * rng.uniform(0.3, 0.8)
    on, out = np.zeros(len(x), bool), np.zeros(x.shape)
    for k in range(x.shape[1]):
        on = (on | (x[:, k] > high)) & (x[:, k] > low)
        out[:, k] = on
    return lagged(out, rng.uniform(0.1, 1.0), dt)


def play(x: Array, seconds: float, dt: float, rng: Rng) -> Array:
    """Zero for such a time after each change of sign, then winding up, with or without a swing."""
    side = np.sign(np.where(np.abs(x) > 0.02 * np.abs(x).max(), x, 0.0))
    for k in range(1, x.shape[1]):
        side[:, k] = np.where(side[:, k] == 0.0, side[:, k - 1], side[:, k])
    crossed = np.zeros(x.shape, bool)
    crossed[:, 1:] = side[:, 1:] != side[:, :-1]
    at = np.where(crossed, np.arange(x.shape[1]), -(10**6))
    since = (np.arange(x.shape[1]) - np.maximum.accumulate(at, axis=1)) * dt - seconds
    wound = 1.0 - np.exp(-np.maximum(since, 0.0) / rng.uniform(0.1, 0.4))
    omega, swing = 2.0 * np.pi * rng.uniform(1.2, 3.0), rng.uniform(0.0, 0.8)
    ring = swing * np.exp(-0.15 * omega * np.maximum(since, 0.0)) * np.cos(omega * since)
    return x * np.where(since < 0.0, 0.0, np.where(since < 5.0, wound + ring, 1.0))


def swings(x: Array, seconds: float, dt: float, rng: Rng) -> Array:
    """A lightly damped second-order system of such a period, driven by the signal: Tustin's rule."""
    omega, damping = 2.0 * np.pi / seconds, rng.uniform(0.02, 0.2)
    k = 2.0 / dt
    a = np.array([k**2 + 2 * damping * omega * k + omega**2, 2 * (omega**2 - k**2),
                  k**2 - 2 * damping * omega * k + omega**2])  # fmt: skip
    b = omega**2 * np.array([1.0, 2.0, 1.0])
    return np.asarray(lfilter(b / a[0], a / a[0], x, axis=1))


MEMORIES: Mapping[str, Callable[[Array, float, float, Rng], Array]] = {
    "lag": lag,
    "heat": heat,
    "delay": delay,
    "hold": hold,
    "rate": rate,
    "rise": rise,
    "hysteresis": hysteresis,
    "play": play,
    "swings": swings,
}


# Gates (batch, n), 0 to 1: when a law acts.


def regime(s: Signals, rng: Rng) -> Array:
    """One condition of driving."""
    conditions: tuple[Callable[[], Array], ...] = (
        lambda: s.grade / 0.005 - 0.5,
        lambda: (s.speed - rng.uniform(12.0, 18.0)) / 1.0,
        lambda: (rng.uniform(9.0, 14.0) - s.speed) / 1.0,
        lambda: (s.power_share - rng.uniform(0.15, 0.4)) / 0.05,
        lambda: (s.engine_speed - rng.uniform(115.0, 150.0)) / 8.0,
    )
    return np.clip(conditions[rng.integers(len(conditions))](), 0.0, 1.0)


def intervals(s: Signals, rng: Rng) -> Array:
    """On for a while and off for a while, whatever the truck does."""
    noise = ou_series(rng, s.speed.shape, s.dt, np.exp(rng.uniform(np.log(5.0), np.log(60.0))))
    return np.clip((noise - np.quantile(noise, rng.uniform(0.4, 0.8))) / 0.1, 0.0, 1.0)


def places(s: Signals, rng: Rng) -> Array:
    """Spans of road, the same for all drives and both directions."""
    gap, length = rng.uniform(200.0, 900.0), rng.uniform(120.0, 600.0)
    rows = int(s.setting.route.max()) + 1
    road = smooth_spans(rng, rows, (0.5 * gap, 1.5 * gap), (0.6 * length, 1.6 * length))
    road = (road > 0.05).astype(float) if rng.random() < 0.5 else road
    cell = (s.place / CELL_M).astype(int) % road.shape[1]
    return np.asarray(road[s.setting.route[:, None], cell])


def drives(s: Signals, rng: Rng) -> Array:
    """Some of the drives, from their beginning or from a moment on."""
    chosen = some_drives(rng, len(s.speed), rng.uniform(0.3, 0.7))
    begins = np.where(rng.random(len(chosen)) < 0.5, -1.0, rng.uniform(0.2, 0.6, len(chosen)))
    return np.asarray(chosen[:, None] * (s.time / s.setting.duration_s >= begins[:, None]), float)


GATES: Mapping[str, Callable[[Signals, Rng], Array]] = {
    "always": lambda s, rng: np.ones(s.speed.shape),
    "regime": regime,
    "intervals": intervals,
    "places": places,
    "drives": drives,
    "closed": lambda s, rng: lagged(s.closed * (s.speed > rng.uniform(3.0, 12.0)), 0.3, s.dt),
}
