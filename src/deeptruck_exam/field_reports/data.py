"""Fourth forms of the faults of measurement."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np

from deeptruck_exam.hidden import (
    Array,
    Effect,
    Fault,
    Kind,
    Planted,
    Setting,
    ou_series,
    register,
)

SIGN = {"sign": (-1.0, 1.0)}


def _averaging_telematics(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        values = channels["acceleration"]
        width = max(1, round(p.window_s / dt))
        padded = np.concatenate([np.full(width - 1, values[0]), values])
        mean = np.convolve(padded, np.ones(width) / width, mode="valid")
        time = np.arange(len(values)) * dt
        channels["acceleration"] = np.interp(time - p.sent_s, time, mean)

    return spoil


def _buffers_stamped_on_arrival(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        time = np.arange(len(channels["acceleration"])) * dt
        blocks = rng.uniform(p.least_s, p.most_s, int(time[-1] / p.block_s) + 2)
        late = np.sign(p.sign) * blocks[(time / p.block_s).astype(int)]
        channels["acceleration"] = np.interp(time - late, time, channels["acceleration"])

    return spoil


def _tyres_of_another_size(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        time = np.arange(len(channels["speed"])) * dt
        warms = p.grows * (1.0 - np.exp(-time / 400.0)) * rng.uniform(0.3, 1.0)
        scale = np.sign(p.sign) * p.scale * rng.uniform(0.85, 1.15)
        channels["speed"] = channels["speed"] * (1.0 + scale - warms)

    return spoil


def _phone_in_a_cradle(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        time = np.arange(len(channels["acceleration"])) * dt
        slips = np.sort(rng.uniform(0.0, 1.6 * time[-1], 2))
        turned = 1.0 + p.slips * rng.normal(0.0, 1.0, 3)[np.searchsorted(slips, time)]
        channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias * turned

    return spoil


def _twisted_bracket(p: SimpleNamespace) -> Fault:
    def spoil(channels: dict[str, Array], dt: float, rng: np.random.Generator) -> None:
        n = len(channels["grade"])
        crossfall = 0.025 * np.clip(ou_series(rng, (1, n), dt, 12.0)[0] - 0.8, -2.5, 2.5)
        channels["grade"] = channels["grade"] + np.sign(p.sign) * (p.bias + p.twist * crossfall)

    return spoil


def _add(
    key: str,
    name: str,
    source: str,
    ranges: dict[str, tuple[float, float]],
    fault: Callable[[SimpleNamespace], Fault],
    needs: tuple[str, ...] = ("highway", "suburban", "hills", "descent"),
    accepts: tuple[str, ...] = (),
    conceal: tuple[str, ...] = (),
) -> None:
    def build(setting: Setting, p: SimpleNamespace) -> Planted:
        return Planted(faults=(fault(p),), conceal=conceal)

    kind: Kind = "measurement_fault"
    register(Effect(key, name, kind, source, ranges, build, needs=needs, accepts=accepts, forms="fourth"))


_add(
    "averaging_telematics",
    "clock_offset",
    "A telematics box that sends the mean of its last second or two (running averages delay by half their"
    " width: Oppenheim and Schafer, Discrete-Time Signal Processing), and sends it late; sizes chosen here",
    {"window_s": (0.5, 1.2), "sent_s": (0.2, 0.7)},
    _averaging_telematics,
    needs=("suburban", "hills"),
)
_add(
    "buffers_stamped_on_arrival",
    "clock_offset",
    "Loggers that stamp a buffer when it is written: within a block the delay is one, the next block has"
    " another (notes of CAN logger makers on host time stamps); blocks and sizes chosen here",
    {"least_s": (0.2, 0.45), "most_s": (0.7, 1.3), "block_s": (12.0, 35.0), **SIGN},
    _buffers_stamped_on_arrival,
    needs=("suburban", "hills"),
)
_add(
    "tyres_of_another_size",
    "speed_scale",
    "Revolutions a kilometre of drive tyres that were changed without calibration (ETRTO rolling"
    " circumferences of 315/80 and 315/60 R 22.5 are a tenth apart), which grow as they warm; chosen here",
    {"scale": (0.035, 0.085), "grows": (0.002, 0.010), **SIGN},
    _tyres_of_another_size,
)
_add(
    "phone_in_a_cradle",
    "acceleration_bias",
    "Gravity that leaks into a tilted accelerometer (studies of smartphones as vehicle sensors, such as"
    " Castignani, Derrmann, Frank and Engel, IEEE Intell. Transp. Syst. Mag. 7, 2015): another tilt every"
    " time the cradle slips; sizes chosen here",
    {"bias": (0.16, 0.42), "slips": (0.05, 0.25), **SIGN},
    _phone_in_a_cradle,
)
_add(
    "twisted_bracket",
    "grade_bias",
    "An inclinometer that is out of level and turned about its vertical axis, so that a part of the road's"
    " crossfall (2.5 %, superelevated in bends: RAA and AASHTO design guides) shows as slope; chosen here",
    {"bias": (0.009, 0.024), "twist": (0.05, 0.2), **SIGN},
    _twisted_bracket,
    accepts=("rolling_resistance",),
    conceal=("elevation",),
)
