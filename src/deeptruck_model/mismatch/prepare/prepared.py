"""A recording prepared for a simulator, and the simulator run forced along it: each step starts from the
recorded response.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.constants import GRAVITY
from deeptruck_core.signals import ACCELERATION, FELT, SPEED, TruckInterface
from deeptruck_core.vehicle_kinds import LEAST_SPEED, NO_COASTING
from deeptruck_model.mismatch.rules import Limits
from deeptruck_model.recordings import Recording
from deeptruck_model.simulators import Run, Simulator, forced_run, free_run

BRAKE = "brake_command"


def has_valid(r: Recording, channel: str) -> bool:
    return channel in r.channels and bool(np.isfinite(r.channels[channel]).any())


STANDING = "the truck stands or rolls too slowly to be compared"
BRAKING = "the truck slows as by brakes, which were not recorded"
RECOVERY_S = 1.0  # in which a learned simulator recovers from driving outside its training domain


@dataclass(frozen=True)
class Prepared:
    """A recording prepared for a simulator: without NaN, with speed smoothed as little as its noise
    permits."""

    recording: Recording
    u: Array
    w: Array
    y: Array
    observed: Array  # acceleration, (n,)
    valid: Mask
    speed_noise: float
    measured_acceleration: bool
    road: Array | None = None  # metres along the roads that all drives share (n,), by positions
    left_out: Mapping[str, int] = field(default_factory=dict)  # samples by reason, but for invalid ones

    @property
    def dt(self) -> float:
        return self.recording.dt

    def distance(self) -> Array:
        """Distance since its start, m, (n,)."""
        return np.cumsum(self.y[:, SPEED]) * self.dt

    def place(self) -> Array:
        """Position along the road (n,), m; drives without recorded positions all start at one place."""
        return self.distance() if self.road is None else self.road


def prepare(
    recording: Recording,
    measured_acceleration: bool,
    interface: TruckInterface | None = None,
) -> Prepared:
    """Fill missing samples, mark them invalid for as long as they can disturb, and estimate acceleration.

    `interface` is the simulator's, else the recording's; a response in it that the recording lacks, such as
    fuel, is NaN, and an unrecorded brake is zero.
    """
    if recording.interface.brake_unit is not None and not has_valid(recording, BRAKE):
        recording = replace(recording, interface=replace(recording.interface, brake_unit=None))
    interface = interface or recording.interface
    dt = recording.dt
    needed = (*recording.interface.u, *recording.interface.w, "speed")
    bad = ~np.isfinite(recording.columns(needed).sum(axis=1))
    recorded = {n for n in recording.interface.y if np.isfinite(recording.channels.get(n, np.nan)).any()}
    filled = {name: fill(recording.channels[name]) for name in {*needed, *recorded}}
    speed = filled["speed"]
    noise = noise_of(recording.channels["speed"])
    width = float(np.clip(noise / 0.02, 0.0, 3.0)) * 0.15 / dt if dt < 0.5 else 0.0
    smooth = gaussian_filter1d(speed, width, mode="reflect") if width > 0.3 else speed
    accelerometer = recording.channels["acceleration"] if measured_acceleration else None
    observed = observed_acceleration(speed, accelerometer, dt)
    filled |= {"speed": smooth, "acceleration": observed}
    dead = widen(bad, round(0.3 / dt), round(2.0 / dt)) | (smooth < LEAST_SPEED)
    braking = np.zeros_like(dead)
    if recording.interface.brake_unit is None:
        slows = gaussian_filter1d(observed + _along_gravity(recording), max(1.0, 1.0 / dt)) < NO_COASTING
        unasked = filled["engine_command"] >= 0.0  # below, the motor is asked to slow the truck
        braking = widen(slows & unasked, round(2.0 / dt), round(3.0 / dt)) & ~dead
        dead |= braking
    dead[: round(Limits.settle_s / dt)] = True
    dead[len(dead) - round(1.0 / dt) :] = True
    whole = replace(recording, channels=filled)
    unknown = np.full(len(recording), np.nan)
    y = np.stack([filled.get(n, unknown) for n in interface.y], axis=1)
    u = whole.u
    if BRAKE in interface.u and recording.interface.brake_unit is None:
        u = np.column_stack([u, np.zeros(len(recording))])
    standing = smooth < LEAST_SPEED
    return Prepared(
        recording, u, whole.w, y, observed, ~dead, noise, measured_acceleration,
        left_out={STANDING: int(standing.sum()), BRAKING: int(braking.sum())},
    )  # fmt: skip


def _along_gravity(r: Recording) -> Array:
    """Deceleration by the slope of the road (n,), m/s^2, as recorded or felt; 0 where unknown."""
    unknown = np.full(len(r), np.nan)
    slope = r.channels.get("grade", unknown)
    return GRAVITY * np.nan_to_num(np.where(np.isfinite(slope), slope, r.channels.get(FELT, unknown)))


def learned(simulator: Simulator, p: Prepared) -> Prepared:
    """The recording with samples outside a learned simulator's training domain marked invalid."""
    driven = getattr(simulator, "driven", None)
    if driven is None:
        return p
    outside = ~driven.covers(p.y[:, SPEED], p.u, p.w)
    return replace(p, valid=p.valid & ~widen(outside, 0, round(RECOVERY_S / p.dt)))


def noise_of(x: Array) -> float:
    """White noise of a smooth signal from its third differences, robust against events."""
    d = np.diff(x[np.isfinite(x)], 3)
    return float(1.4826 * np.median(np.abs(d)) / np.sqrt(20.0)) if len(d) > 8 else 0.0


def derivative(speed: Array, dt: float) -> Array:
    """Mean acceleration over the step that ends at each sample, as a Simulator reports it; the first sample
    repeats the second."""
    d = np.diff(speed) / dt
    return np.concatenate([d[:1], d]) if len(d) else np.zeros_like(speed)


def observed_acceleration(speed: Array, accelerometer: Array | None, dt: float) -> Array:
    """Acceleration whose slow part is from speed and whose fast part is from the accelerometer.

    The smoothed difference of the two is added to the accelerometer reading, which removes its offset and
    leaves the true acceleration unchanged. At the ends the difference is mirrored, because holding its last
    sample would extend a single noisy speed difference over seconds.
    """
    slow = derivative(speed, dt)
    if accelerometer is None:
        return slow
    ratio = noise_of(speed) / max(noise_of(accelerometer), 1e-6)
    width = float(np.clip(1.5 * ratio, 0.0, 3.0)) / dt
    if width < 0.5:
        return slow
    bad = ~np.isfinite(accelerometer)
    fast = np.where(bad, slow, accelerometer)
    out: Array = fast + gaussian_filter1d(slow - fast, width, mode="reflect")
    return out


def quantum(x: Array) -> float:
    """The quantisation step of a channel: its smallest common difference, at most 2 % of its range."""
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


FREE_S = 200.0  # of a free run that shows whether a simulator without `force` forgets
ALIKE = 0.8  # of the longest drive's length, for drives that are run at once


def forced(simulator: Simulator, prepared: Sequence[Prepared], us: Sequence[Array]) -> list[Run]:
    """Runs (1, T) along every drive with the commands `us`, one array (T, n_u) for each drive.

    Drives of similar length are run in one batch, because simulators stepped in Python, such as a corrected
    truck, take as long for many rows as for one. Shorter drives are extended by their last sample; the
    extension is cut off.
    """
    runs: dict[int, Run] = {}
    lengths = [len(u) for u in us]
    for together in _alike(lengths):
        longest = lengths[together[0]]
        drives = [(us[i], prepared[i].w, fed(simulator, prepared[i].y)) for i in together]
        u, w, y = (np.stack([padded(x, longest) for x in each]) for each in zip(*drives, strict=True))
        run = forced_run(simulator, u, w, y)
        for row, i in enumerate(together):
            own = (slice(row, row + 1), slice(lengths[i]))
            runs[i] = Run(run.y[own], {name: x[own] for name, x in run.inside.items()})
    return [runs[i] for i in range(len(us))]


def forgotten(simulator: Simulator, prepared: Sequence[Prepared]) -> float:
    """Relative change (rms) of a simulator's acceleration if it is reset at each response of its own free
    run; shows how much a simulator without `force` loses by it. 0 for one with `force`."""
    if not getattr(simulator, "starts_anew", False):
        return 0.0
    p = max(prepared, key=lambda p: int(p.valid.sum()))
    n = round(FREE_S / p.dt)
    u, w, y = (np.nan_to_num(x[:n])[None] for x in (p.u, p.w, p.y))
    free = free_run(simulator, u, w, y[:, 0]).y
    anew = forced_run(simulator, u, w, free).y
    own, again = free[0, 2:, ACCELERATION], anew[0, 2:, ACCELERATION]
    return float(np.linalg.norm(again - own)) / max(float(np.linalg.norm(own)), 1e-6)


def _alike(lengths: Sequence[int]) -> list[list[int]]:
    """Indices in groups of similar length, the longest of each first."""
    groups: list[list[int]] = []
    for i in sorted(range(len(lengths)), key=lambda i: -lengths[i]):
        if groups and lengths[i] > ALIKE * lengths[groups[-1][0]]:
            groups[-1].append(i)
        else:
            groups.append([i])
    return groups


def fed(simulator: Simulator, y: Array) -> Array:
    """The channels of a recorded drive y (..., T, n_y) that the simulator gets as feedback; it starts from
    all of them."""
    out = fed_back(simulator, y).copy()
    out[..., 0, :] = y[..., 0, :]
    return out


def fed_back(simulator: Simulator, y: Array) -> Array:
    """The channels of another truck's responses y (..., n_y) that the simulator gets as feedback.

    A learned simulator that gets the acceleration it is to predict would reproduce it together with the
    mismatch; it therefore gets only the speed.
    """
    if simulator.parameters():
        return y
    out = np.full_like(y, np.nan)
    out[..., SPEED] = y[..., SPEED]
    return out


def padded(x: Array, length: int) -> Array:
    """x (T, ...), extended to `length` with its last value."""
    more = length - len(x)
    return np.concatenate([x, np.repeat(x[-1:], more, axis=0)]) if more else x
