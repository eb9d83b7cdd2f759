"""Turns recordings into K-step sequences: common interface, cuts at invalid inputs, split by time,
batches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.arrays import Array
from deeptruck_core.constants import ROUNDED_GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION, SPEED, TruckInterface
from deeptruck_model.recordings import Recording

FloatArray = NDArray[np.float32]
SHORTEST_S = 3.0  # a piece below this teaches nothing
HELD_OUT = 0.15  # share of the data, always the later part, that selects the checkpoint
SPLIT_FROM_S = 120.0  # pieces from this length on are split inside; shorter ones go whole to one side
CONSISTENCY_S = 20.0
LACKING = 0.1  # share of the driving that may be left out for the sake of an input that the rest has
BRAKED = -0.6  # m/s^2; a laden truck coasts down at less
AUXILIARY = ("gear", "engine_speed", "engine_torque")  # targets of the training besides the response
EFFECTS = {
    "engine_command": "how the truck answers the engine",
    "brake_command": "how it brakes",
    "grade": "how it takes hills",
}


@dataclass(frozen=True)
class Scales:
    """Normalisation inside the network: (x - mean) / scale for the columns [u, w, y, auxiliary targets], each
    (columns,).

    `top_speed` m/s is the upper end of the speed code.
    """

    mean: FloatArray
    scale: FloatArray
    top_speed: float = 30.0


def common_interface(recordings: Sequence[Recording]) -> TruckInterface:
    """The channels present in (nearly) all of the driving; fuel if any recording has it. Raises InputError if
    units or dt differ."""
    if not recordings:
        raise InputError("no recording to train on: give at least one bag with a drive in it")
    first = recordings[0]
    for other in recordings[1:]:
        if abs(other.dt - first.dt) > 1e-6:
            raise InputError(
                f"'{first.name}' is sampled every {first.dt:g} s and '{other.name}' every {other.dt:g} s; "
                "train on bags of one rate"
            )
        if other.interface.engine_unit != first.interface.engine_unit:
            raise InputError(
                f"engine command is in {first.interface.engine_unit} in '{first.name}' and in "
                f"{other.interface.engine_unit} in '{other.name}'; train on bags of one truck"
            )
    brakes = {r.interface.brake_unit for r in recordings if has(r, "brake_command")}
    if len(brakes) > 1:
        raise InputError(
            f"the bags give the brake command in {', '.join(sorted(map(str, brakes)))}; convert them"
        )
    if not any(has(r, "engine_command") for r in recordings):
        raise InputError("no recording has an engine_command: map the engine's command or fuel rate to it")
    return replace(
        first.interface,
        brake_unit=brakes.pop() if brakes and _nearly_all(recordings, "brake_command") else None,
        grade=_nearly_all(recordings, "grade"),
        fuel=any(has(r, "fuel_rate") for r in recordings),
    )


def _nearly_all(recordings: Sequence[Recording], channel: str) -> bool:
    """Whether so few recordings lack a channel that these recordings are omitted and not the channel."""
    lacking = sum(len(r) for r in recordings if not has(r, channel))
    return lacking <= LACKING * sum(map(len, recordings))


def has(recording: Recording, channel: str) -> bool:
    """Whether a recording has a channel with valid samples."""
    return channel in recording.channels and bool(np.isfinite(recording.channels[channel]).any())


def unexplained(recording: Recording, interface: TruckInterface) -> NDArray[np.bool_]:
    """Rows, (n,), in which the truck must have braked by means that `interface` does not show.

    Only if no brake is recorded and the engine command is a fuel flow, which cannot retard: then a
    deceleration beyond BRAKED, minus the effect of grade, has no cause in the inputs.
    """
    if interface.brake_unit is not None or interface.engine_unit not in ("g/s", "cm^3/s"):
        return np.zeros(len(recording), bool)
    grade = recording.channels.get("grade", 0.0) if interface.grade else 0.0
    return np.asarray(recording.channels["acceleration"] + ROUNDED_GRAVITY * grade < BRAKED)


def cut(recording: Recording, interface: TruckInterface) -> list[Recording]:
    """Segments in which every input of `interface` is valid and no row is unexplained, beginning at a valid
    speed."""
    missing = {name: np.full(len(recording), np.nan) for name in (*interface.u, *interface.w, *interface.y)}
    channels = {**missing, **recording.channels}
    whole = replace(recording, interface=interface, channels=channels)
    speed = whole.channels["speed"]
    valid = np.isfinite(np.concatenate([whole.u, whole.w], axis=1)).all(axis=1)
    valid &= ~unexplained(whole, interface)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], valid.astype(np.int8), [0]])))
    pieces = []
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        known = np.flatnonzero(np.isfinite(speed[start:stop]))
        if len(known) and (known[-1] - known[0]) * whole.dt >= SHORTEST_S:
            pieces.append(whole.piece(int(start + known[0]), int(start + known[-1] + 1)))
    return pieces


def consistent(recording: Recording) -> Recording:
    """The recording with the slow part of its acceleration replaced by that of its speed.

    An accelerometer that measures grade, or is biased, would conflict with the constraint v(k+1) = v(k) + a
    dt; its changes within CONSISTENCY_S are kept. Data that already satisfy the constraint are unchanged.
    """
    acceleration, speed = recording.channels["acceleration"], recording.channels["speed"]
    gained = np.full(len(recording), np.nan)
    gained[1:] = np.diff(speed) / recording.dt
    excess = acceleration - gained
    window = np.ones(max(1, min(len(excess), round(CONSISTENCY_S / recording.dt))))
    known = np.isfinite(excess)
    weight = np.convolve(known.astype(float), window, mode="same")[: len(excess)]
    slow = np.convolve(np.where(known, excess, 0.0), window, mode="same")[: len(excess)] / np.maximum(
        weight, 1.0
    )
    corrected = np.where(np.isnan(acceleration), gained, acceleration - slow)
    return replace(recording, channels={**recording.channels, "acceleration": corrected})


def time_split(pieces: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """Training and validation pieces. Of a long piece the share HELD_OUT at its end is held out; of short
    pieces, one in 1/HELD_OUT.

    A single short piece is split in the same way; one too short for that is used for both.
    """
    training: list[Recording] = []
    validation: list[Recording] = []
    every, short = round(1 / HELD_OUT), 0
    for piece in pieces:
        edge = round(len(piece) * (1 - HELD_OUT))
        if len(piece) * piece.dt >= SPLIT_FROM_S or (len(pieces) < every and len(piece) - edge >= 5):
            training.append(piece.piece(0, edge))
            validation.append(piece.piece(edge, len(piece)))
        else:
            short += 1
            (validation if short % every == 0 else training).append(piece)
    return training, validation or list(training)


@dataclass(frozen=True)
class Sequences:
    """All samples concatenated; `bounds` (pieces, 2) are the start and stop of each piece.

    x (n, n_u + n_w) is normalised, y (n, n_y) in physical units; negative speeds (sensor noise at rest) are
    0.
    """

    x: FloatArray
    y: FloatArray
    bounds: NDArray[np.int64]

    @classmethod
    def of(cls, pieces: Sequence[Recording], scales: Scales, auxiliary: tuple[str, ...] = ()) -> Sequences:
        """Stack the pieces; auxiliary targets follow y, NaN where a piece lacks them."""
        inputs = pieces[0].u.shape[1] + pieces[0].w.shape[1]
        x = np.concatenate([np.concatenate([p.u, p.w], axis=1) for p in pieces])
        y = np.concatenate([np.concatenate([p.y, _columns(p, auxiliary)], axis=1) for p in pieces])
        y[:, SPEED] = np.maximum(y[:, SPEED], 0.0)
        stops = np.cumsum([len(p) for p in pieces])
        bounds = np.stack([stops - [len(p) for p in pieces], stops], axis=1)
        scaled = (x - scales.mean[:inputs]) / scales.scale[:inputs]
        return cls(scaled.astype(np.float32), y.astype(np.float32), bounds)

    def starts(self, steps: int, rng: np.random.Generator) -> NDArray[np.int64]:
        """Starts that tile every piece once from a random phase, in random order, with at least steps/4
        samples after each."""
        found = []
        for start, stop in self.bounds:
            phase = rng.integers(0, max(1, min(steps, (stop - start) // 4)))
            found.append(np.arange(start + phase, stop - 1 - min(steps // 4, (stop - start) // 2), steps))
        starts = np.concatenate(found)
        return rng.permutation(starts[np.isfinite(self.y[starts, SPEED])])

    def draw(self, count: int, steps: int, rng: np.random.Generator) -> NDArray[np.int64]:
        """`count` starts, from as many random tilings of all pieces as necessary."""
        drawn: list[NDArray[np.int64]] = []
        while sum(map(len, drawn)) < count:
            drawn.append(self.starts(steps, rng))
            if not len(drawn[-1]):
                raise InputError(
                    "the recordings are too short or too broken to cut a single sequence from them"
                )
        return np.concatenate(drawn)[:count]

    def gather(self, starts: NDArray[np.int64], steps: int) -> tuple[FloatArray, FloatArray]:
        """x (..., K, batch, n_x) and target (..., K+1, batch, n_y) for starts (..., batch); NaN beyond the
        end of a piece."""
        stop = self.bounds[np.searchsorted(self.bounds[:, 1], starts, side="right"), 1]
        index = starts[..., None, :] + np.arange(steps + 1)[:, None]
        beyond = index >= stop[..., None, :]
        index = np.where(beyond, 0, index)
        target = self.y[index]
        target[beyond] = np.nan
        return self.x[index[..., :-1, :]], target


def auxiliary_targets(pieces: Sequence[Recording]) -> tuple[str, ...]:
    """Internal signals of the truck that are recorded in most of the data: a network trained to output them
    also learns the states that determine them."""
    total = sum(len(p) for p in pieces)
    known = {
        c: sum(int(np.isfinite(p.channels[c]).sum()) for p in pieces if c in p.channels) for c in AUXILIARY
    }
    return tuple(c for c in AUXILIARY if known[c] > 0.5 * total)


def _columns(piece: Recording, channels: tuple[str, ...]) -> Array:
    missing = np.full(len(piece), np.nan)
    return np.array([piece.channels.get(c, missing) for c in channels]).reshape(len(channels), len(piece)).T


def measure_scales(pieces: Sequence[Recording], auxiliary: tuple[str, ...] = ()) -> Scales:
    """Mean and standard deviation of [u, w, y, auxiliary targets]; the scale of a nearly constant channel is
    bounded below."""
    data = np.concatenate([np.concatenate([p.u, p.w, p.y, _columns(p, auxiliary)], axis=1) for p in pieces])
    known = np.ma.masked_invalid(data)  # type: ignore[no-untyped-call]
    mean, deviation = (np.ma.filled(x, 0.0) for x in (known.mean(axis=0), known.std(axis=0)))
    names = (*pieces[0].interface.u, *pieces[0].interface.w, *pieces[0].interface.y, *auxiliary)
    floors = {"grade": 0.005, "speed": 1.0, "acceleration": 0.05, "fuel_rate": 0.05}
    floor = [
        floors.get(n, max(1e-3 * float(np.ma.filled(abs(known[:, i]).max(), 1.0)), 1e-6))
        for i, n in enumerate(names)
    ]
    top = max(5.0, float(np.nanmax(data[:, names.index("speed")])))
    return Scales(mean.astype(np.float32), np.maximum(deviation, floor).astype(np.float32), top)


def loss_weights(
    scales: Scales, n_y: int, auxiliary: int, speed_s: float, fuel: float, inside: float
) -> FloatArray:
    """Weights (n_y + auxiliary,) of squared errors: acceleration by its variance, speed as acceleration held
    for `speed_s`, fuel and auxiliary targets by their variances times a factor."""
    variance = scales.scale[-n_y - auxiliary :].astype(np.float64) ** 2
    return np.array(
        [
            1 / variance[ACCELERATION],
            1 / (variance[ACCELERATION] * speed_s**2),
            *(fuel / variance[2:n_y]),
            *(inside / variance[n_y:]),
        ],
        np.float32,
    )


def unexcited(pieces: Sequence[Recording], interface: TruckInterface) -> tuple[str, ...]:
    """One line for each input that never varies, so that its effect cannot be learned; empty if all vary."""
    constant = [name for name in (*interface.u, *interface.w) if not _varies(pieces, name)]
    unused = "brake_command" in constant and not pieces[0].channels["brake_command"].any()
    says = {name: f"{name.replace('_', ' ')} never varies" for name in constant}
    says |= {"brake_command": "the brake is never used"} if unused else {}
    lines = [f"{says[name]}: {EFFECTS[name]} is not learned from it" for name in constant]
    if interface.brake_unit is None:
        lines.append(f"braking is not recorded: {EFFECTS['brake_command']} is not learned from it")
    return tuple(lines)


def _varies(pieces: Sequence[Recording], name: str) -> bool:
    values = {float(edge(p.channels[name])) for p in pieces for edge in (np.nanmin, np.nanmax)}
    return len(values) > 1
