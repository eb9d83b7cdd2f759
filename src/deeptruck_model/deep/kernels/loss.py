"""The numbers of `network`, compiled: the loss of K-step sequences, and its gradient.

K steps of one member run forward from zero state, and back through time for the gradient. Matrix products go
to BLAS, everything else is one pass over memory, in float32. `inference` is the running truck.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from deeptruck_model.deep.data import FloatArray
from deeptruck_model.deep.kernels.layers import (
    OFFSET,
    ONE,
    ZERO,
    add_gains,
    cell,
    cell_back,
    code_width,
    compiled,
    constrain,
    decode,
    encode,
    fill_factors,
    forced,
)
from deeptruck_model.deep.network import WEIGHTS, TruckNetwork


class Weights(NamedTuple):
    """Of one member, in the order of WEIGHTS; their gradients likewise."""

    input: Any
    recurrent: Any
    bias: Any
    decoder: Any
    decoder_bias: Any
    output: Any
    output_bias: Any


class Units(NamedTuple):
    """mean and scale of [u, w, y, auxiliary], the step dt, the width of the speed code."""

    mean: Any
    scale: Any
    dt: Any
    width: Any


class Run(NamedTuple):
    """What the forward run leaves for the way back; all (K, batch, ...), hy and c with one step more."""

    gates: Any  # activated, (.., 4 hidden)
    hy: Any  # [h, fed-back y, its speed code]
    c: Any
    tanh_c: Any
    decoded: Any
    y: Any  # responses and auxiliary outputs, in units
    own: Any  # is the y fed at this step the model's own? (.., n_y)
    bounded: Any  # did C hold the truck? (..,)
    factor: Any  # (.., factors)
    gear_gain: Any  # gain of the last factor, (.., n_y - 1)


@compiled
def buffers(w: Any, fed_back: Any, steps: Any, batch: Any, responses: Any, auxiliary: Any) -> Any:
    """An empty Run."""
    hidden, free = w.recurrent.shape[0], responses - 1
    factors = (w.output.shape[1] - free - auxiliary) // free
    return Run(
        np.empty((steps, batch, 4 * hidden), np.float32),
        np.empty((steps + 1, batch, fed_back), np.float32),
        np.empty((steps + 1, batch, hidden), np.float32),
        np.empty((steps, batch, hidden), np.float32),
        np.empty((steps, batch, w.decoder.shape[1]), np.float32),
        np.empty((steps, batch, responses + auxiliary), np.float32),
        np.empty((steps, batch, responses), np.bool_),
        np.empty((steps, batch), np.bool_),
        np.empty((steps, batch, factors), np.float32),
        np.empty((steps, batch, free), np.float32),
    )


@compiled
def _feed(k: Any, target: Any, units: Any, recorded: Any, first: Any, run: Any, fed: Any) -> None:
    """Choose the y that step k is fed, fed (batch, n_y), and write it and its speed code into hy. A value
    unequal to itself is NaN: unknown."""
    responses = fed.shape[1]
    hidden = run.c.shape[2]
    for b in range(fed.shape[0]):
        overruled = k > 0 and recorded and forced(run.y[k - 1, b], target[k, b, :responses], fed[b])
        for j in range(responses):
            value = target[k, b, j]
            run.own[k, b, j] = k > 0 and not (recorded and value == value) and not (overruled and j == 0)
            if k == 0:  # an unknown initial response is other than speed
                fed[b, j] = value if value == value else units.mean[first + j]
            elif not recorded:
                fed[b, j] = run.y[k - 1, b, j]
            run.hy[k, b, hidden + j] = (fed[b, j] - units.mean[first + j]) / units.scale[first + j]
        encode(fed[b, 1], units.width, run.hy[k, b, hidden + responses :])


@compiled
def _respond(k: Any, x: Any, units: Any, run: Any, fed: Any, raw: Any) -> None:
    """y(k) from the raw outputs (batch, outputs) of D: with gains and units, and the constraint C."""
    first, responses, factors = x.shape[2], fed.shape[1], run.factor.shape[2]
    named = run.y.shape[2] - 1
    for b in range(fed.shape[0]):
        if factors:
            fill_factors(x[k, b], fed[b, 1], units.mean, units.scale, run.factor[k, b])
            add_gains(raw[b], run.factor[k, b], responses - 1, named)
            for o in range(responses - 1):
                run.gear_gain[k, b, o] = raw[b, named + (o + 1) * factors - 1]
        for o in range(named):
            column = first + (o + 1 if o else 0)  # the speed, behind the acceleration, is C's
            raw[b, o] = raw[b, o] * units.scale[column] + units.mean[column]
            if o >= responses - 1:
                run.y[k, b, o + 1] = raw[b, o]
    constrain(raw, fed, units.dt, run.y[k], run.bounded[k])


@compiled
def forward(w: Any, feedback: Any, x: Any, target: Any, units: Any, recorded: Any, run: Any) -> None:
    """Fill `run` with K steps from zero state; feedback has the rows [h, y, code] of the gates' weights."""
    steps, batch, first = x.shape
    hidden = w.recurrent.shape[0]
    from_x = run.gates.reshape(steps * batch, 4 * hidden)
    np.dot(x.reshape(steps * batch, first), np.ascontiguousarray(w.input[:first]), from_x)
    product = np.empty((batch, 4 * hidden), np.float32)
    h = np.empty((batch, hidden), np.float32)
    raw = np.empty((batch, w.output.shape[1]), np.float32)
    fed = np.empty((batch, run.own.shape[2]), np.float32)
    run.hy[0], run.c[0] = ZERO, ZERO
    for k in range(steps):
        _feed(k, target, units, recorded, first, run, fed)
        np.dot(run.hy[k], feedback, product)
        for b in range(batch):
            for j in range(4 * hidden):
                run.gates[k, b, j] += product[b, j] + w.bias[j]
        cell(run.gates[k], run.c[k], run.c[k + 1], run.tanh_c[k], h)
        run.hy[k + 1, :, :hidden] = h
        decode(h, w.decoder, w.decoder_bias, w.output, w.output_bias, run.decoded[k], raw)
        _respond(k, x, units, run, fed, raw)


@compiled
def _back_through_feedback(k: Any, first: Any, units: Any, run: Any, dy: Any, d_hy: Any, d_raw: Any) -> None:
    """Add to dy(k) what y(k) does to the rest of the run, where it was fed to step k + 1."""
    responses, hidden, factors = run.own.shape[2], run.c.shape[2], run.factor.shape[2]
    for b in range(d_hy.shape[0]):
        for j in range(responses):
            if run.own[k + 1, b, j]:
                dy[k, b, j] += d_hy[b, hidden + j] / units.scale[first + j]
        if not run.own[k + 1, b, 1]:
            continue
        for j in range(hidden + responses, d_hy.shape[1]):
            slope = (ONE - run.hy[k + 1, b, j] ** 2) / (units.width * (ONE + run.y[k, b, 1]))
            dy[k, b, 1] += d_hy[b, j] * slope
        if not run.bounded[k + 1, b]:
            dy[k, b, 1] += dy[k + 1, b, 1]
        if factors:
            slope = run.factor[k + 1, b, factors - 1] / (OFFSET + run.y[k, b, 1])
            for o in range(responses - 1):
                dy[k, b, 1] -= d_raw[k + 1, b, o] * run.gear_gain[k + 1, b, o] * slope


@compiled
def _back_through_response(k: Any, first: Any, units: Any, run: Any, dy: Any, d_raw: Any) -> None:
    """d_raw(k) of D's raw outputs from dy(k)."""
    free, named, factors = run.own.shape[2] - 1, run.y.shape[2] - 1, run.factor.shape[2]
    for b in range(d_raw.shape[1]):
        # also where C held the truck, as in `network`: one that wrongly stands could never learn to start
        d_raw[k, b, 0] = (dy[k, b, 0] + units.dt * dy[k, b, 1]) * units.scale[first]
        for o in range(1, named):
            d_raw[k, b, o] = dy[k, b, o + 1] * units.scale[first + o + 1]
        for o in range(free):
            for j in range(factors):
                d_raw[k, b, named + o * factors + j] = d_raw[k, b, o] * run.factor[k, b, j]


@compiled
def _back_through_output(w: Any, decoded: Any, d_raw: Any, d_output: Any) -> None:
    """Turn decoded (batch, decoder) into the gradient before its tanh; add to d_output."""
    for b in range(decoded.shape[0]):
        for j in range(decoded.shape[1]):
            e = decoded[b, j]
            total = ZERO
            for o in range(d_raw.shape[1]):
                total += d_raw[b, o] * w.output[j, o]
                d_output[j, o] += d_raw[b, o] * e
            decoded[b, j] = total * (ONE - e * e)


@compiled
def _add_rows(matrix: Any, total: Any) -> None:
    for r in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            total[j] += matrix[r, j]


@compiled
def _collect(x: Any, run: Any, d_raw: Any, d: Any) -> None:
    """Gradients of the weights from those of gates, decoder and outputs at all steps at once."""
    steps, batch, first = x.shape
    hidden, rows = run.c.shape[2], steps * batch
    gates, decoded = run.gates.reshape(rows, 4 * hidden), run.decoded.reshape(rows, run.decoded.shape[2])
    d.input[:first] = np.dot(x.reshape(rows, first).T, gates)
    d_feedback = np.dot(run.hy[:steps].reshape(rows, run.hy.shape[2]).T, gates)
    d.recurrent[:], d.input[first:] = d_feedback[:hidden], d_feedback[hidden:]
    h = np.ascontiguousarray(run.hy[1:, :, :hidden]).reshape(rows, hidden)
    d.decoder[:] = np.dot(h.T, decoded)
    _add_rows(gates, d.bias)
    _add_rows(decoded, d.decoder_bias)
    _add_rows(d_raw.reshape(rows, d_raw.shape[2]), d.output_bias)


@compiled
def backward(w: Any, feedback: Any, x: Any, units: Any, run: Any, dy: Any, d: Any) -> None:
    """Write the gradient into `d`, which must be zero, from dy = dL/dy (K, batch, n_y); dy, gates and decoded
    are used up."""
    steps, batch, first = x.shape
    hidden = w.recurrent.shape[0]
    feedback_t, decoder_t = np.ascontiguousarray(feedback.T), np.ascontiguousarray(w.decoder.T)
    d_raw = np.empty((steps, batch, w.output.shape[1]), np.float32)
    d_hy = np.zeros((batch, feedback.shape[0]), np.float32)
    dh = np.empty((batch, hidden), np.float32)
    dc = np.zeros((batch, hidden), np.float32)
    for k in range(steps - 1, -1, -1):
        if k + 1 < steps:
            _back_through_feedback(k, first, units, run, dy, d_hy, d_raw)
        _back_through_response(k, first, units, run, dy, d_raw)
        _back_through_output(w, run.decoded[k], d_raw[k], d.output)
        np.dot(run.decoded[k], decoder_t, dh)
        for b in range(batch):
            for j in range(hidden):
                dh[b, j] += d_hy[b, j]
        cell_back(run.gates[k], run.c[k], run.tanh_c[k], dh, dc)
        np.dot(run.gates[k], feedback_t, d_hy)
    _collect(x, run, d_raw, d)


def gradient(
    network: TruckNetwork, x: FloatArray, target: FloatArray, weight: FloatArray, form: str
) -> NDArray[np.float64]:
    """Losses (members,) of K-step sequences; their gradients land in the parameters' `.grad`.

    x (members, K, batch, n_u + n_w) is normalised; target (members, K + 1, batch, n_y + auxiliary) in units
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
    units = Units(
        network.mean.numpy(), network.scale.numpy(), np.float32(network.dt), np.float32(code_width(network))
    )
    losses: NDArray[np.float64] = _members(
        Weights(*(p.detach().numpy() for p in weights)),
        x,
        target,
        units,
        weight,
        network.shape.auxiliary,
        recorded,
        learns,
        Weights(*((p.grad if learns else p.detach()).numpy() for p in weights)),
    )
    return losses


@compiled
def _members(
    w: Any, x: Any, target: Any, units: Any, weight: Any, auxiliary: Any, recorded: Any, learns: Any, d: Any
) -> Any:
    """Losses (members,); with `learns` also the gradient, in `d`. w and d are stacked Weights."""
    members, steps, batch, conditions = x.shape
    losses = np.empty(members)
    for m in range(members):
        alone = _member(w, m)
        feedback = np.concatenate((alone.recurrent, alone.input[conditions:]))  # one product a step
        run = buffers(alone, feedback.shape[0], steps, batch, target.shape[3] - auxiliary, auxiliary)
        forward(alone, feedback, x[m], target[m], units, recorded, run)
        dy = np.empty((steps, batch, target.shape[3]), np.float32)
        losses[m] = _loss(run.y, target[m, 1:], weight, dy)
        if learns:
            backward(alone, feedback, x[m], units, run, dy, _member(d, m))
    return losses


@compiled
def _member(w: Any, m: Any) -> Any:
    return Weights(
        w.input[m], w.recurrent[m], w.bias[m], w.decoder[m], w.decoder_bias[m], w.output[m], w.output_bias[m]
    )


@compiled
def _loss(y: Any, target: Any, weight: Any, dy: Any) -> Any:
    """Weighted mean square over the valid samples of each channel, which are those not NaN: equal to
    themselves. dy (K, batch, n_y) is its gradient."""
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
                dy[k, b, j] = np.float32(2.0) * factor * error if error == error else ZERO
    return total
