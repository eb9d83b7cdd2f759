"""What the compiled code is made of: the decorator, functions that vectorise, the LSTM cell with its
gradient, and around it the speed code, the decoder D, its gains and the constraint C."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from deeptruck_core.imports.compiler import numba
from deeptruck_model.deep.network import (
    GEAR_OFFSET,
    GEAR_SPEED,
    REST_ACCELERATION,
    REST_SPEED,
    TruckNetwork,
)

# No nnan/ninf: a NaN input must come out as NaN.
compiled = numba.njit(cache=True, fastmath={"reassoc", "contract", "arcp", "nsz"}, error_model="numpy")

HALF, ONE, ZERO = np.float32(0.5), np.float32(1.0), np.float32(0.0)
# Rational approximation of tanh, 2 ulp in float32, free of calls so that it vectorises (coefficients:
# Eigen's ptanh).
_BOUND = np.float32(7.90531110763549805)
_A1, _A3, _A5 = (
    np.float32(4.89352455891786e-03),
    np.float32(6.37261928875436e-04),
    np.float32(1.48572235717979e-05),
)
_A7, _A9 = np.float32(5.12229709037114e-08), np.float32(-8.60467152213735e-11)
_A11, _A13 = np.float32(2.00018790482477e-13), np.float32(-2.76076847742355e-16)
_B0, _B2 = np.float32(4.89352518554385e-03), np.float32(2.26843463243900e-03)
_B4, _B6 = np.float32(1.18534705686654e-04), np.float32(1.19825839466702e-06)
OFFSET, _SPEED = np.float32(GEAR_OFFSET), np.float32(GEAR_SPEED)
BY_HAND = 2  # up to this batch a plain loop beats the overhead of BLAS


@compiled
def tanh(x: Any) -> Any:
    """tanh of a float32; NaN stays NaN."""
    x = min(max(x, -_BOUND), _BOUND) if x == x else x
    s = x * x
    p = x * (_A1 + s * (_A3 + s * (_A5 + s * (_A7 + s * (_A9 + s * (_A11 + s * _A13))))))
    return p / (_B0 + s * (_B2 + s * (_B4 + s * _B6)))


@compiled
def _sigmoid(x: Any) -> Any:
    return HALF + HALF * tanh(HALF * x)


@compiled
def cell(gates: Any, c: Any, c_next: Any, tanh_c: Any, h_next: Any) -> None:
    """Activate gates (batch, 4 hidden) in place; write the next cell, its tanh and the hidden state."""
    n = c.shape[1]
    for b in range(c.shape[0]):
        # views that start at 0: an index that might be negative would keep the loops from vectorising
        i, f, g, o = gates[b, :n], gates[b, n : 2 * n], gates[b, 2 * n : 3 * n], gates[b, 3 * n :]
        now, after, t, h = c[b], c_next[b], tanh_c[b], h_next[b]
        for j in range(n):
            i[j] = _sigmoid(i[j])
        for j in range(n):
            f[j] = _sigmoid(f[j])
        for j in range(n):
            g[j] = tanh(g[j])
        for j in range(n):
            o[j] = _sigmoid(o[j])
        for j in range(n):
            after[j] = f[j] * now[j] + i[j] * g[j]
        for j in range(n):
            t[j] = tanh(after[j])
        for j in range(n):
            h[j] = o[j] * t[j]


@compiled
def cell_back(gates: Any, c: Any, tanh_c: Any, dh: Any, dc: Any) -> None:
    """Turn activated gates into their gradient in place, and dc of c(k+1) into dc of c(k)."""
    n = c.shape[1]
    for b in range(c.shape[0]):
        i, f, g, o = gates[b, :n], gates[b, n : 2 * n], gates[b, 2 * n : 3 * n], gates[b, 3 * n :]
        now, t, dhb, dcb = c[b], tanh_c[b], dh[b], dc[b]
        for j in range(n):
            dcb[j] += dhb[j] * o[j] * (ONE - t[j] * t[j])
        for j in range(n):
            o[j] = dhb[j] * t[j] * o[j] * (ONE - o[j])
        for j in range(n):
            kept, entering, candidate = f[j], i[j], g[j]
            i[j] = dcb[j] * candidate * entering * (ONE - entering)
            f[j] = dcb[j] * now[j] * kept * (ONE - kept)
            g[j] = dcb[j] * entering * (ONE - candidate * candidate)
            dcb[j] = dcb[j] * kept


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
    """Compute the decoder D in normalised units: its hidden layer `decoded` (batch, decoder) and its outputs
    `raw` (batch, outputs)."""
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
    """Add sum_j gain[o, j] factor[j] to raw[o] for the first `free` responses o, normalised, in place.

    raw (outputs,) has the gains (free, factors) row by row from index `named` on; factor is (factors,).
    """
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


@compiled
def forced(own: Any, recorded: Any, fed: Any) -> Any:
    """Fill fed (n_y,) with the recorded response (n_y,), and with the model's own where that is NaN, as
    TruckNetwork does. Returns whether a recorded speed overruled C, which held the truck."""
    overruled = own[1] == 0 and recorded[1] == recorded[1] and recorded[0] != recorded[0]
    for j in range(len(fed)):
        fed[j] = recorded[j] if recorded[j] == recorded[j] else own[j]  # fed and own may be one array
    if overruled:
        fed[0] = 0.0
    return overruled
