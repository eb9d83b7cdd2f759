"""The numbers of `network`, compiled: loss with its gradient through K steps, and the free-running truck.

Matrix products go to BLAS, everything else is one pass over memory. Float32 as in training; the response of a
running truck is kept in float64, so that v(k+1) = v(k) + a(k+1) dt holds to rounding after hours.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import torch
from numpy.typing import NDArray

from deeptruck_model.deep.network import REST_ACCELERATION, REST_SPEED, WEIGHTS, TruckNetwork

FloatArray = NDArray[np.float32]

# No nnan/ninf: a NaN input must come out as NaN.
compiled = numba.njit(cache=True, fastmath={"reassoc", "contract", "arcp", "nsz"}, error_model="numpy")

_HALF, _ONE, _ZERO = np.float32(0.5), np.float32(1.0), np.float32(0.0)
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


@compiled
def _tanh(x: Any) -> Any:
    x = min(max(x, -_BOUND), _BOUND) if x == x else x
    s = x * x
    p = x * (_A1 + s * (_A3 + s * (_A5 + s * (_A7 + s * (_A9 + s * (_A11 + s * _A13))))))
    return p / (_B0 + s * (_B2 + s * (_B4 + s * _B6)))


@compiled
def _sigmoid(x: Any) -> Any:
    return _HALF + _HALF * _tanh(_HALF * x)


@compiled
def _cell(gates: Any, c: Any, c_next: Any, tanh_c: Any, h_next: Any) -> None:
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
            g[j] = _tanh(g[j])
        for j in range(n):
            o[j] = _sigmoid(o[j])
        for j in range(n):
            after[j] = f[j] * now[j] + i[j] * g[j]
        for j in range(n):
            t[j] = _tanh(after[j])
        for j in range(n):
            h[j] = o[j] * t[j]


@compiled
def _cell_back(gates: Any, c: Any, tanh_c: Any, dh: Any, dc: Any) -> None:
    """Turn activated gates into their gradient in place, and dc of c(k+1) into dc of c(k)."""
    n = c.shape[1]
    for b in range(c.shape[0]):
        i, f, g, o = gates[b, :n], gates[b, n : 2 * n], gates[b, 2 * n : 3 * n], gates[b, 3 * n :]
        now, t, dhb, dcb = c[b], tanh_c[b], dh[b], dc[b]
        for j in range(n):
            dcb[j] += dhb[j] * o[j] * (_ONE - t[j] * t[j])
        for j in range(n):
            o[j] = dhb[j] * t[j] * o[j] * (_ONE - o[j])
        for j in range(n):
            kept, entering, candidate = f[j], i[j], g[j]
            i[j] = dcb[j] * candidate * entering * (_ONE - entering)
            f[j] = dcb[j] * now[j] * kept * (_ONE - kept)
            g[j] = dcb[j] * entering * (_ONE - candidate * candidate)
            dcb[j] = dcb[j] * kept


@compiled
def encode(speed: Any, width: Any, code: Any) -> None:
    """Fill code (code,) with soft steps on the logarithm of the speed, as TruckNetwork does."""
    logarithm = np.log(_ONE + speed)
    for j in range(len(code)):
        code[j] = _tanh(np.float32(logarithm / width) - np.float32(j) - _HALF)


def code_width(network: TruckNetwork) -> float:
    """Distance of the steps of the speed code; 1 where there is none."""
    return math.log1p(network.top_speed) / network.shape.code if network.shape.code else 1.0


@compiled
def _constrain(raw: Any, y: Any, dt: Any, y_next: Any, bounded: Any) -> None:
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
            y_next[b, 2] = max(raw[b, 1], _ZERO) if raw[b, 1] == raw[b, 1] else raw[b, 1]


@compiled
def _decode(
    h: Any, decoder: Any, decoder_bias: Any, output: Any, output_bias: Any, decoded: Any, raw: Any
) -> None:
    """D, still normalised: decoded (batch, decoder) = tanh(...), raw (batch, outputs)."""
    if h.shape[0] <= 2:  # a plain loop beats the overhead of BLAS
        decoded[:] = _ZERO
        for b in range(h.shape[0]):
            for i in range(h.shape[1]):
                for j in range(decoded.shape[1]):
                    decoded[b, j] += h[b, i] * decoder[i, j]
    else:
        np.dot(h, decoder, decoded)
    for b in range(h.shape[0]):
        for j in range(decoded.shape[1]):
            decoded[b, j] = _tanh(decoded[b, j] + decoder_bias[j])
        for o in range(raw.shape[1]):
            total = output_bias[o]
            for j in range(decoded.shape[1]):
                total += decoded[b, j] * output[j, o]
            raw[b, o] = total


@compiled
def _loss(y: Any, target: Any, weight: Any, dy: Any) -> Any:
    """Weighted mean square over the valid samples of each channel; dy (K, batch, n_y) is its gradient."""
    total = 0.0
    for j in range(y.shape[2]):
        valid, squares = 0, 0.0
        for k in range(y.shape[0]):
            for b in range(y.shape[1]):
                error = y[k, b, j] - target[k, b, j]
                if error == error:
                    valid += 1
                    squares += error * error
        factor = weight[j] / np.float32(max(valid, 1))
        total += factor * squares
        for k in range(y.shape[0]):
            for b in range(y.shape[1]):
                error = y[k, b, j] - target[k, b, j]
                dy[k, b, j] = np.float32(2.0) * factor * error if error == error else _ZERO
    return total


@compiled
def _forward(
    w: Any,
    feedback: Any,
    x: Any,
    target: Any,
    mean: Any,
    scale: Any,
    dt: Any,
    width: Any,
    recorded: Any,
    run: Any,
) -> None:
    """K steps from zero state. Fills `run`: gates (activated), hy = [h, fed-back y, its speed code], c,
    tanh_c, decoded, y with the taught signals, own (is y its own?), bounded.
    """
    w_in, w_rec, bias, w_dec, b_dec, w_out, b_out = w
    gates, hy, c, tanh_c, decoded, y, own, bounded = run
    steps, batch, conditions = x.shape
    hidden, outputs = w_rec.shape[0], w_out.shape[1]
    responses = own.shape[2]
    flat_gates = gates.reshape(steps * batch, 4 * hidden)
    np.dot(x.reshape(steps * batch, conditions), np.ascontiguousarray(w_in[:conditions]), flat_gates)
    product = np.empty((batch, 4 * hidden), np.float32)
    h = np.empty((batch, hidden), np.float32)
    raw = np.empty((batch, outputs), np.float32)
    fed = np.empty((batch, responses), np.float32)
    hy[0], c[0] = _ZERO, _ZERO
    for k in range(steps):
        for b in range(batch):
            for j in range(responses):
                value = target[k, b, j]
                own[k, b, j] = k > 0 and not (recorded and value == value)
                if own[k, b, j]:
                    value = y[k - 1, b, j]
                elif value != value:  # an unknown initial response other than speed
                    value = mean[conditions + j]
                fed[b, j] = value
                hy[k, b, hidden + j] = (value - mean[conditions + j]) / scale[conditions + j]
            encode(fed[b, 1], width, hy[k, b, hidden + responses :])
        np.dot(hy[k], feedback, product)
        for b in range(batch):
            for j in range(4 * hidden):
                gates[k, b, j] += product[b, j] + bias[j]
        _cell(gates[k], c[k], c[k + 1], tanh_c[k], h)
        hy[k + 1, :, :hidden] = h
        _decode(h, w_dec, b_dec, w_out, b_out, decoded[k], raw)
        for b in range(batch):
            for o in range(outputs):
                column = conditions + (o + 1 if o else 0)
                raw[b, o] = raw[b, o] * scale[column] + mean[column]
                if o >= responses - 1:
                    y[k, b, o + 1] = raw[b, o]
        _constrain(raw, fed, dt, y[k], bounded[k])


@compiled
def _backward(
    w: Any, feedback: Any, x: Any, scale: Any, dt: Any, width: Any, run: Any, dy: Any, d: Any
) -> None:
    """Gradient `d` of the weights from dy = dL/dy (K, batch, n_y), which is used up; gates become their
    gradient."""
    _, w_rec, _, w_dec, _, w_out, _ = w
    gates, hy, c, tanh_c, decoded, y, own, bounded = run
    steps, batch, conditions = x.shape
    hidden, responses, outputs = w_rec.shape[0], own.shape[2], w_out.shape[1]
    fed_back = feedback.shape[0]
    feedback_t, w_dec_t = np.ascontiguousarray(feedback.T), np.ascontiguousarray(w_dec.T)
    d_raw = np.empty((steps, batch, outputs), np.float32)
    d_hy = np.zeros((batch, fed_back), np.float32)
    dh = np.empty((batch, hidden), np.float32)
    dc = np.zeros((batch, hidden), np.float32)
    for k in range(steps - 1, -1, -1):
        for b in range(batch):
            if k + 1 < steps:  # what y(k+1) does to the rest of the run, where it was fed back
                for j in range(responses):
                    if own[k + 1, b, j]:
                        dy[k, b, j] += d_hy[b, hidden + j] / scale[conditions + j]
                if own[k + 1, b, 1]:
                    for j in range(hidden + responses, fed_back):
                        slope = (_ONE - hy[k + 1, b, j] ** 2) / (width * (_ONE + y[k, b, 1]))
                        dy[k, b, 1] += d_hy[b, j] * slope
                if own[k + 1, b, 1] and not bounded[k + 1, b]:
                    dy[k, b, 1] += dy[k + 1, b, 1]
            d_raw[k, b, 0] = (dy[k, b, 0] + dt * dy[k, b, 1]) * scale[conditions]
            for o in range(1, outputs):
                d_raw[k, b, o] = dy[k, b, o + 1] * scale[conditions + o + 1]
            for j in range(decoded.shape[2]):
                e = decoded[k, b, j]
                total = _ZERO
                for o in range(outputs):
                    total += d_raw[k, b, o] * w_out[j, o]
                    d[5][j, o] += d_raw[k, b, o] * e
                decoded[k, b, j] = total * (_ONE - e * e)
        np.dot(decoded[k], w_dec_t, dh)
        for b in range(batch):
            for j in range(hidden):
                dh[b, j] += d_hy[b, j]
        _cell_back(gates[k], c[k], tanh_c[k], dh, dc)
        np.dot(gates[k], feedback_t, d_hy)

    rows = steps * batch
    flat_gates, flat_decoded = gates.reshape(rows, 4 * hidden), decoded.reshape(rows, w_dec.shape[1])
    d[0][:conditions] = np.dot(x.reshape(rows, conditions).T, flat_gates)
    d_feedback = np.dot(hy[:steps].reshape(rows, fed_back).T, flat_gates)
    d[1][:], d[0][conditions:] = d_feedback[:hidden], d_feedback[hidden:]
    h = np.ascontiguousarray(hy[1:, :, :hidden]).reshape(rows, hidden)
    d[3][:] = np.dot(h.T, flat_decoded)
    for r in range(rows):
        for j in range(4 * hidden):
            d[2][j] += flat_gates[r, j]
        for j in range(w_dec.shape[1]):
            d[4][j] += flat_decoded[r, j]
    for k in range(steps):
        for b in range(batch):
            for o in range(outputs):
                d[6][o] += d_raw[k, b, o]


@compiled
def _buffers(w: Any, fed_back: Any, steps: Any, batch: Any, responses: Any, taught: Any) -> Any:
    hidden = w[1].shape[0]
    return (
        np.empty((steps, batch, 4 * hidden), np.float32),
        np.empty((steps + 1, batch, fed_back), np.float32),
        np.empty((steps + 1, batch, hidden), np.float32),
        np.empty((steps, batch, hidden), np.float32),
        np.empty((steps, batch, w[3].shape[1]), np.float32),
        np.empty((steps, batch, responses + taught), np.float32),
        np.empty((steps, batch, responses), np.bool_),
        np.empty((steps, batch), np.bool_),
    )


@compiled
def _members(
    w: Any,
    x: Any,
    target: Any,
    mean: Any,
    scale: Any,
    dt: Any,
    width: Any,
    weight: Any,
    taught: Any,
    recorded: Any,
    learns: Any,
    d: Any,
) -> Any:
    """Losses (members,); with `learns` also the gradient, in `d`. `w` and `d` are tuples in the order of
    WEIGHTS."""
    members, steps, batch, conditions = x.shape
    losses = np.empty(members)
    for m in range(members):
        w_m = (w[0][m], w[1][m], w[2][m], w[3][m], w[4][m], w[5][m], w[6][m])
        feedback = np.concatenate((w_m[1], w_m[0][conditions:]))  # of [h, y, code]: one product a step
        run = _buffers(w_m, feedback.shape[0], steps, batch, target.shape[3] - taught, taught)
        _forward(w_m, feedback, x[m], target[m], mean, scale, dt, width, recorded, run)
        dy = np.empty((steps, batch, target.shape[3]), np.float32)
        losses[m] = _loss(run[5], target[m, 1:], weight, dy)
        if learns:
            d_m = (d[0][m], d[1][m], d[2][m], d[3][m], d[4][m], d[5][m], d[6][m])
            _backward(w_m, feedback, x[m], scale, dt, width, run, dy, d_m)
    return losses


def gradient(
    network: TruckNetwork, x: FloatArray, target: FloatArray, weight: FloatArray, form: str
) -> NDArray[np.float64]:
    """Losses (members,) of K-step sequences; their gradients land in the parameters' `.grad`.

    x (members, K, batch, n_u + n_w) is normalised; target (members, K + 1, batch, n_y + taught) in units
    with NaN where a sample is invalid (target[:, 0] starts the run); weight (n_y,) multiplies the squared
    errors.
    """
    for name in WEIGHTS:
        parameter = getattr(network, name)
        parameter.grad = torch.zeros_like(parameter)
    return _call(network, x, target, weight, form == "training", True)


def loss(
    network: TruckNetwork, x: FloatArray, target: FloatArray, weight: FloatArray, form: str = "deployment"
) -> NDArray[np.float64]:
    """Losses (members,) without a gradient; shapes as in `gradient`."""
    return _call(network, x, target, weight, form == "training", False)


def _call(
    network: TruckNetwork, x: FloatArray, target: FloatArray, weight: FloatArray, recorded: bool, learns: bool
) -> NDArray[np.float64]:
    weights = [getattr(network, name) for name in WEIGHTS]
    losses: NDArray[np.float64] = _members(
        tuple(p.detach().numpy() for p in weights),
        x,
        target,
        network.mean.numpy(),
        network.scale.numpy(),
        np.float32(network.dt),
        np.float32(code_width(network)),
        weight,
        network.shape.taught,
        recorded,
        learns,
        tuple((p.grad if learns else p.detach()).numpy() for p in weights),
    )
    return losses
