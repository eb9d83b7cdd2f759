"""The numbers of `network`, compiled: the loss of K-step sequences, and its gradient.

Matrix products go to BLAS, everything else is one pass over memory, in float32. `unfolding` has the steps,
`inference` the running truck.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from deeptruck_model.deep.data.scales import FloatArray
from deeptruck_model.deep.kernels.compiled import ZERO, compiled
from deeptruck_model.deep.kernels.heads import code_width
from deeptruck_model.deep.kernels.unfolding import Units, Weights, backward, buffers, forward
from deeptruck_model.deep.network import WEIGHTS, TruckNetwork


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
    units = Units(
        network.mean.numpy(), network.scale.numpy(), np.float32(network.dt), np.float32(code_width(network))
    )
    losses: NDArray[np.float64] = _members(
        Weights(*(p.detach().numpy() for p in weights)),
        x,
        target,
        units,
        weight,
        network.shape.taught,
        recorded,
        learns,
        Weights(*((p.grad if learns else p.detach()).numpy() for p in weights)),
    )
    return losses


@compiled
def _members(
    w: Any, x: Any, target: Any, units: Any, weight: Any, taught: Any, recorded: Any, learns: Any, d: Any
) -> Any:
    """Losses (members,); with `learns` also the gradient, in `d`. w and d are stacked Weights."""
    members, steps, batch, conditions = x.shape
    losses = np.empty(members)
    for m in range(members):
        alone = _member(w, m)
        feedback = np.concatenate((alone.recurrent, alone.input[conditions:]))  # one product a step
        run = buffers(alone, feedback.shape[0], steps, batch, target.shape[3] - taught, taught)
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
                dy[k, b, j] = np.float32(2.0) * factor * error if error == error else ZERO
    return total
