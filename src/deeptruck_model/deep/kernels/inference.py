"""The running truck, compiled: one step, or a whole free or forced run, of an ensemble.

The weights of a gate lie in one matrix with rows [u, w, y, code, h, 1], so that a step is one product.
Responses are float64: v(k+1) = v(k) + a(k+1) dt holds to rounding after hours.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from deeptruck_model.deep.data import FloatArray
from deeptruck_model.deep.kernels.layers import (
    add_gains,
    cell,
    code_width,
    compiled,
    constrain,
    decode,
    encode,
    fill_factors,
    forced,
    multiply,
)
from deeptruck_model.deep.network import TruckNetwork

_ROWS = 64  # of the batch run together: their gates stay in the cache


def pack(network: TruckNetwork) -> tuple[FloatArray, ...]:
    """A network's weights laid out for `step` and `run`.

    In this order: gates (members, inputs + hidden + 1, 4 hidden); decoder, its bias, output, its bias as
    in the network without the auxiliary outputs; mean, scale (n_u + n_w + n_y,); the width of the speed
    code (1,). A plain tuple, which compiled code takes over fastest.
    """
    n = {name: p.detach().numpy() for name, p in network.named_parameters()}
    gates = np.concatenate([n["input"], n["recurrent"], n["bias"][:, None]], axis=1)
    signals = network.shape.signals
    kept = np.r_[: network.shape.responses - 1, network.shape.named : network.shape.outputs]
    output, output_bias = n["output"][..., kept], n["output_bias"][..., kept]
    arrays = (gates, n["decoder"], n["decoder_bias"], output, output_bias)
    scales = (
        network.mean.numpy()[:signals],
        network.scale.numpy()[:signals],
        np.array([code_width(network)]),
    )
    return tuple(np.ascontiguousarray(a, dtype=np.float32) for a in (*arrays, *scales))


@compiled
def _normalise(packed: Any, u: Any, w: Any, y: Any, inputs: Any, z: Any) -> None:
    """Fill the first columns of z (batch, inputs + hidden + 1): the scaled [u, w, y] and the speed code."""
    n_u, n_w, n_y = u.shape[1], w.shape[1], y.shape[1]
    mean, scale = packed[5], packed[6]
    for b in range(z.shape[0]):
        for j in range(n_u):
            z[b, j] = (np.float32(u[b, j]) - mean[j]) / scale[j]
        for j in range(n_w):
            z[b, n_u + j] = (np.float32(w[b, j]) - mean[n_u + j]) / scale[n_u + j]
        for j in range(n_y):
            i = n_u + n_w + j
            z[b, i] = (np.float32(y[b, j]) - mean[i]) / scale[i]
        encode(np.float32(y[b, 1]), packed[7][0], z[b, n_u + n_w + n_y : inputs])


@compiled
def _advance(packed: Any, m: Any, dt: Any, z: Any, c: Any, h: Any, y: Any, work: Any) -> None:
    """One step of member m from z and c (batch, hidden): c, h and y (batch, n_y) become the next ones."""
    gates, tanh_c, decoded, raw, bounded, factor = work
    free, first = y.shape[1] - 1, packed[5].shape[0] - y.shape[1]
    multiply(z, packed[0][m], gates)
    cell(gates, c, c, tanh_c, h)
    decode(h, packed[1][m], packed[2][m], packed[3][m], packed[4][m], decoded, raw)
    for b in range(z.shape[0]):
        if len(factor):
            fill_factors(z[b], np.float32(y[b, 1]), packed[5], packed[6], factor)
            add_gains(raw[b], factor, free, free)
        for o in range(free):
            column = first + (o + 1 if o else 0)  # the speed, behind the acceleration, is C's
            raw[b, o] = raw[b, o] * packed[6][column] + packed[5][column]
    constrain(raw, y, dt, y, bounded)


@compiled
def _workspace(packed: Any, batch: Any, free: Any) -> Any:
    return (
        np.empty((batch, packed[0].shape[2]), np.float32),
        np.empty((batch, packed[1].shape[1]), np.float32),
        np.empty((batch, packed[1].shape[2]), np.float32),
        np.empty((batch, packed[3].shape[2]), np.float32),
        np.empty(batch, np.bool_),
        np.empty(packed[3].shape[2] // free - 1, np.float32),
    )


@compiled
def step(packed: Any, dt: Any, h: Any, c: Any, y: Any, u: Any, w: Any) -> Any:
    """Next (h, c, y) of every member and the mean response; h, c (members, batch, hidden), y (members,
    batch, n_y)."""
    members, batch, hidden = h.shape
    inputs = packed[0].shape[1] - hidden - 1
    work = _workspace(packed, batch, y.shape[2] - 1)
    z = np.ones((batch, inputs + hidden + 1), np.float32)
    h, c, y = h.copy(), c.copy(), y.copy()
    mean = np.zeros((batch, y.shape[2]))
    for m in range(members):
        _normalise(packed, u, w, y[m], inputs, z)
        z[:, inputs:-1] = h[m]
        _advance(packed, m, dt, z, c[m], h[m], y[m], work)
        mean += y[m]
    return h, c, y, mean / members


@compiled
def force(y: Any, recorded: Any) -> Any:
    """The response that every member feeds back, (members, batch, n_y): `recorded` (batch, n_y) where it is
    finite, its own y elsewhere."""
    fed = np.empty_like(y)
    for m in range(y.shape[0]):
        for b in range(y.shape[1]):
            forced(y[m, b], recorded[b], fed[m, b])
    return fed


@compiled
def run(packed: Any, dt: Any, u: Any, w: Any, y0: Any, recorded: Any, along: Any) -> Any:
    """Mean response and its standard deviation over members, both (batch, T, n_y), for u (batch, T, n_u).

    y0 starts every run; with `along`, finite samples of recorded (batch, T, n_y) are fed instead of the
    response.
    """
    batch, steps, responses = u.shape[0], u.shape[1], y0.shape[1]
    members, hidden = packed[0].shape[0], packed[1].shape[1]
    inputs = packed[0].shape[1] - hidden - 1
    mean, square = np.zeros((batch, steps, responses)), np.zeros((batch, steps, responses))
    for first in range(0, batch, _ROWS):
        rows = slice(first, min(first + _ROWS, batch))
        size = rows.stop - rows.start
        work = _workspace(packed, size, responses - 1)
        h = np.empty((size, hidden), np.float32)
        z = np.ones((size, inputs + hidden + 1), np.float32)
        u_now, w_now = np.empty((size, u.shape[2])), np.empty((size, w.shape[2]))
        for m in range(members):
            c = np.zeros((size, hidden), np.float32)
            h[:] = np.float32(0.0)
            y = y0[rows].copy()
            for k in range(steps):
                for b in range(size):
                    for j in range(responses):
                        delta = y[b, j] - y0[rows.start + b, j]
                        mean[rows.start + b, k, j] += delta / members
                        square[rows.start + b, k, j] += delta * delta / members
                    if along:
                        forced(y[b], recorded[rows.start + b, k], y[b])
                if k + 1 == steps:
                    break
                u_now[:], w_now[:] = u[rows, k], w[rows, k]
                _normalise(packed, u_now, w_now, y, inputs, z)
                z[:, inputs:-1] = h
                _advance(packed, m, dt, z, c, h, y, work)
    for b in range(batch):
        for k in range(steps):
            for j in range(responses):
                square[b, k, j] = np.sqrt(max(square[b, k, j] - mean[b, k, j] ** 2, 0.0))
                mean[b, k, j] += y0[b, j]
    return mean, square
