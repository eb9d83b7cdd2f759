"""Around the LSTM, compiled: the speed code that enters it, the decoder D, its gains, the constraint C."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from deeptruck_model.deep.kernels.compiled import HALF, ONE, ZERO, compiled, tanh
from deeptruck_model.deep.network import (
    LEVER_OFFSET,
    LEVER_SPEED,
    REST_ACCELERATION,
    REST_SPEED,
    TruckNetwork,
)

OFFSET, _SPEED = np.float32(LEVER_OFFSET), np.float32(LEVER_SPEED)
BY_HAND = 2  # up to this batch a plain loop beats the overhead of BLAS


def code_width(network: TruckNetwork) -> float:
    """Distance of the steps of the speed code; 1 where there is none."""
    return math.log1p(network.top_speed) / network.shape.code if network.shape.code else 1.0


@compiled
def encode(speed: Any, width: Any, code: Any) -> None:
    """Fill code (code,) with soft steps on the logarithm of the speed, as TruckNetwork does."""
    logarithm = np.log(ONE + speed)
    for j in range(len(code)):
        code[j] = tanh(np.float32(logarithm / width) - np.float32(j) - HALF)


@compiled
def multiply(rows: Any, matrix: Any, product: Any) -> None:
    """product = rows @ matrix."""
    if rows.shape[0] > BY_HAND:
        np.dot(rows, matrix, product)
        return
    product[:] = ZERO
    for b in range(rows.shape[0]):
        for i in range(rows.shape[1]):
            for j in range(product.shape[1]):
                product[b, j] += rows[b, i] * matrix[i, j]


@compiled
def decode(
    h: Any, decoder: Any, decoder_bias: Any, output: Any, output_bias: Any, decoded: Any, raw: Any
) -> None:
    """D, still normalised: decoded (batch, decoder) = tanh(...), raw (batch, outputs)."""
    multiply(h, decoder, decoded)
    for b in range(h.shape[0]):
        for j in range(decoded.shape[1]):
            decoded[b, j] = tanh(decoded[b, j] + decoder_bias[j])
        for o in range(raw.shape[1]):
            total = output_bias[o]
            for j in range(decoded.shape[1]):
                total += decoded[b, j] * output[j, o]
            raw[b, o] = total


@compiled
def fill_factors(x: Any, speed: Any, mean: Any, scale: Any, factor: Any) -> None:
    """What gains multiply, factor (factors,): u and w over their scales, and the engine command over the
    speed."""
    n = len(factor) - 1
    for j in range(n):
        factor[j] = x[j] + mean[j] / scale[j]
    factor[n] = factor[0] * _SPEED / (OFFSET + speed)


@compiled
def add_gains(raw: Any, factor: Any, free: Any, named: Any) -> None:
    """Add gains times factors to the `free` responses in raw (outputs,), still normalised."""
    n = len(factor)
    for o in range(free):
        for j in range(n):
            raw[o] += raw[named + o * n + j] * factor[j]


@compiled
def constrain(raw: Any, y: Any, dt: Any, y_next: Any, bounded: Any) -> None:
    """C on raw (batch, outputs) in units: fills y_next (batch, n_y) and bounded (batch,), as TruckNetwork
    does."""
    for b in range(raw.shape[0]):
        a, v = raw[b, 0], y[b, 1]  # y and y_next may be one array
        moved = v + a * dt
        stands = (moved < 0) or (moved < REST_SPEED and a < REST_ACCELERATION)
        y_next[b, 0] = -v / dt if stands else a
        y_next[b, 1] = 0.0 if stands else moved
        bounded[b] = stands
        if y.shape[1] > 2:
            y_next[b, 2] = max(raw[b, 1], ZERO) if raw[b, 1] == raw[b, 1] else raw[b, 1]
