from itertools import product

import numpy as np
import pytest
import torch

from deeptruck_model.deep import Shape, TruckNetwork
from deeptruck_model.deep.data import Scales
from deeptruck_model.deep.kernels import loss
from deeptruck_model.deep.network import WEIGHTS

rng = np.random.default_rng(0)


def network(
    controls: int,
    conditions: int,
    responses: int,
    dt: float = 0.1,
    code: int = 0,
    auxiliary: int = 0,
    gains: bool = False,
) -> TruckNetwork:
    means, widths = np.array([500, 10, 0.0, 0.1, 8, 3]), np.array([700, 15, 0.02, 0.8, 6, 2])
    columns = [*range(controls), *range(2, 2 + conditions), *range(3, 3 + responses), *range(auxiliary)]
    scales = Scales(means[columns].astype(np.float32), widths[columns].astype(np.float32))
    return TruckNetwork(
        Shape(controls, conditions, responses, 16, 8, members=2, code=code, auxiliary=auxiliary, gains=gains),
        scales,
        dt,
        seeds=(3, 4),
    )


def sequences(net: TruckNetwork, steps: int, batch: int) -> tuple[np.ndarray, np.ndarray]:
    """Inputs (members, K, batch, n); targets with invalid samples, standstill and unknown starts."""
    shape = net.shape
    conditions = shape.controls + shape.conditions
    x = rng.standard_normal((2, steps, batch, conditions)).astype(np.float32)
    target = rng.standard_normal((2, steps + 1, batch, shape.responses + shape.auxiliary)).astype(np.float32)
    target = target * net.scale[conditions:].numpy() + net.mean[conditions:].numpy()
    target[..., 1] = np.maximum(target[..., 1], 0)
    start = target[:, 0, :, 1].copy()
    target[rng.random(target.shape) < 0.15] = np.nan
    target[:, 0, :, 1] = start
    target[:, 0, ::2, 1] = 0.0
    return x, target


@pytest.mark.parametrize(
    ("interface", "form", "dt"),
    [
        *product(
            [(2, 1, 3), (1, 0, 2), (2, 1, 3, 0.1, 5, 2), (2, 1, 3, 0.1, 5, 2, True)],
            ["training", "deployment"],
            [0.1],
        ),
        ((2, 1, 3), "deployment", 1.0),
        ((1, 0, 2, 1.0, 5, 1), "deployment", 1.0),
        ((1, 0, 2, 1.0, 5, 1, True), "deployment", 1.0),
        ((2, 1, 3), "training", 1.0),
        ((1, 0, 2, 1.0, 5, 1, True), "training", 1.0),
    ],
)
def test_compiled_gradient_equals_autograd(interface, form, dt):
    net = network(*interface[:3], dt, *interface[4:])
    x, target = sequences(net, 30, 5)
    weight = np.array([1.6, 0.05, 0.2, 0.3, 0.1], np.float32)[: target.shape[3]]

    conditions = net.shape.controls + net.shape.conditions
    raw = (torch.as_tensor(x) * net.scale[:conditions] + net.mean[:conditions]).transpose(1, 2)
    y = torch.as_tensor(target).transpose(1, 2).clone()
    y[:, :, 0] = torch.where(torch.isnan(y[:, :, 0]), net.mean[conditions:], y[:, :, 0])
    y = y[..., : net.shape.responses]
    run = net.unfold(raw[..., : net.shape.controls], raw[..., net.shape.controls :], y, form)
    truth = torch.as_tensor(target).transpose(1, 2)[:, :, 1:]
    valid = ~torch.isnan(truth)
    error = torch.where(valid, run - torch.nan_to_num(truth), torch.zeros(()))
    losses = (error.square().sum((1, 2)) / valid.sum((1, 2)) * torch.as_tensor(weight)).sum(-1)
    losses.sum().backward()
    expected = {name: getattr(net, name).grad.clone() for name in WEIGHTS}

    compiled = loss.gradient(net, x, target, weight, form)
    assert compiled == pytest.approx(losses.detach().numpy(), rel=1e-5)
    for name in WEIGHTS:
        largest = float(expected[name].abs().max())
        assert largest > 0
        assert float((getattr(net, name).grad - expected[name]).abs().max()) < 1e-5 * largest, name


def test_matches_torch_lstm():
    """H is the LSTM of the text books, not merely something recurrent."""
    net = network(2, 1, 3)
    reference = torch.nn.LSTM(6, 16)
    with torch.no_grad():
        reference.weight_ih_l0.copy_(net.input[0].T)
        reference.weight_hh_l0.copy_(net.recurrent[0].T)
        reference.bias_ih_l0.copy_(net.bias[0])
        reference.bias_hh_l0.zero_()
    u, w = torch.randn(7, 2), torch.randn(7, 1)
    state = net.initial(torch.zeros(7, 3))
    after = net.step(state, u, w)
    x = (torch.cat([u, w, torch.zeros(7, 3)], dim=1) - net.mean) / net.scale
    output, _ = reference(x[None])
    torch.testing.assert_close(after.h[0], output[0])


def test_a_member_does_not_depend_on_its_neighbours():
    both = network(2, 1, 3)
    alone = TruckNetwork(
        Shape(2, 1, 3, 16, 8, members=1), Scales(both.mean.numpy(), both.scale.numpy()), 0.1, (4,)
    )
    x, target = sequences(both, 20, 4)
    weight = np.ones(3, np.float32)
    loss.gradient(both, x, target, weight, "deployment")
    loss.gradient(alone, x[1:], target[1:], weight, "deployment")
    for name in WEIGHTS:
        assert torch.equal(getattr(both, name)[1:], getattr(alone, name))
        assert torch.equal(getattr(both, name).grad[1:], getattr(alone, name).grad)


def test_a_wrongly_standing_model_still_learns_to_start():
    net = network(2, 1, 3)
    net.output.data.zero_()
    net.output_bias.data[:, 0] = -1.0  # it brakes for ever
    target = np.zeros((2, 21, 4, 3), np.float32)
    target[..., 1] = np.linspace(0, 2, 21)[None, :, None]
    x = np.zeros((2, 20, 4, 3), np.float32)
    loss.gradient(net, x, target, np.array([0, 1, 0], np.float32), "deployment")
    assert float(net.output_bias.grad[:, 0].max()) < 0  # a step downhill raises the acceleration
