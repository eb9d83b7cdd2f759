"""Recordings made fit to be compared with a simulator, and what of them it is fed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from deeptruck_model.mismatch.data.kinematics import noise_of, observed_acceleration
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import SPEED
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MOVING = 1.5  # m/s; below it standstill logic and wheel sensors rule, not longitudinal dynamics
UNRECORDED_BRAKING = -0.5  # m/s^2; where braking is not recorded, slowing harder than this tells nothing
SETTLE_S = 6.0  # the simulator's unknown inner state at the start needs this long to be forgotten
STRANGE_S = 1.0  # in which a learned simulator gets over driving that it never learned from


@dataclass(frozen=True)
class Prepared:
    """A recording made fit for a simulator: no NaN, speed smoothed as little as its noise demands."""

    recording: Recording
    u: Array
    w: Array
    y: Array
    observed: Array  # acceleration, (n,)
    valid: Mask
    speed_noise: float
    measured_acceleration: bool

    @property
    def dt(self) -> float:
        return self.recording.dt


def prepare(
    recording: Recording, measured_acceleration: bool, response: Sequence[str] | None = None
) -> Prepared:
    """Fill what is missing, mark it invalid for as long as it can disturb, and estimate acceleration.

    `response` are the columns of y that the simulator has, else those that were recorded; what it has and the
    recording lacks, such as fuel, is NaN.
    """
    dt = recording.dt
    needed = (*recording.interface.u, *recording.interface.w, "speed")
    bad = ~np.isfinite(recording.columns(needed).sum(axis=1))
    told = {n for n in recording.interface.y if np.isfinite(recording.channels.get(n, np.nan)).any()}
    filled = {name: fill(recording.channels[name]) for name in {*needed, *told}}
    speed = filled["speed"]
    noise = noise_of(recording.channels["speed"])
    width = float(np.clip(noise / 0.02, 0.0, 3.0)) * 0.15 / dt if dt < 0.5 else 0.0
    smooth = gaussian_filter1d(speed, width, mode="reflect") if width > 0.3 else speed
    accelerometer = recording.channels["acceleration"] if measured_acceleration else None
    observed = observed_acceleration(speed, accelerometer, dt)
    filled |= {"speed": smooth, "acceleration": observed}
    dead = widen(bad, round(0.3 / dt), round(2.0 / dt)) | (smooth < MOVING)
    if recording.interface.brake_unit is None:
        slowing = gaussian_filter1d(observed, max(1.0, 1.0 / dt)) < UNRECORDED_BRAKING
        dead |= widen(slowing, round(2.0 / dt), round(3.0 / dt))
    dead[: round(SETTLE_S / dt)] = True
    dead[len(dead) - round(1.0 / dt) :] = True
    whole = replace(recording, channels=filled)
    unknown = np.full(len(recording), np.nan)
    y = np.stack([filled.get(n, unknown) for n in response or recording.interface.y], axis=1)
    return Prepared(recording, whole.u, whole.w, y, observed, ~dead, noise, measured_acceleration)


def learned(simulator: Simulator, p: Prepared) -> Prepared:
    """The recording, invalid too where a learned simulator has learned from nothing like it."""
    driven = getattr(simulator, "driven", None)
    if driven is None:
        return p
    strange = ~driven.covers(p.y[:, SPEED], p.u, p.w)
    return replace(p, valid=p.valid & ~widen(strange, 0, round(STRANGE_S / p.dt)))


def fed(simulator: Simulator, y: Array) -> Array:
    """What of a recorded drive y (..., T, n_y) the simulator is fed; it starts from all of it."""
    out = heard(simulator, y).copy()
    out[..., 0, :] = y[..., 0, :]
    return out


def heard(simulator: Simulator, y: Array) -> Array:
    """What of responses y (..., n_y) that are not its own the simulator is fed.

    A learned simulator that sees the acceleration it is to predict passes it on, and the mismatch with it; so
    it is fed speed alone.
    """
    if simulator.parameters():
        return y
    out = np.full_like(y, np.nan)
    out[..., SPEED] = y[..., SPEED]
    return out


def padded(x: Array, length: int) -> Array:
    """x (T, ...) that goes on to `length` as it ends."""
    more = length - len(x)
    return np.concatenate([x, np.repeat(x[-1:], more, axis=0)]) if more else x


def quantum(x: Array) -> float:
    """The step a channel is quantised to: its smallest common difference, at most 2 % of its range."""
    steps = np.abs(np.diff(x))
    steps = steps[steps > 1e-12]
    if len(steps) < 20:
        return 0.0
    return float(min(np.quantile(steps, 0.02), 0.02 * np.ptp(x)))


def fill(x: Array) -> Array:
    ok = np.isfinite(x)
    if ok.all():
        return x
    if not ok.any():
        return np.zeros_like(x)
    index = np.arange(len(x))
    return np.interp(index, index[ok], x[ok])


def widen(bad: Mask, before: int, after: int) -> Mask:
    if not bad.any():
        return bad
    kernel = np.ones(before + after + 1)
    full = np.convolve(bad.astype(float), kernel)
    return full[before : before + len(bad)] > 0.5
