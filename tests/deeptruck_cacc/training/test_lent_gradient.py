from __future__ import annotations

import numpy as np
import pytest
import torch

from deeptruck_cacc.environments import scenes
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.training import AnalyticConfig, train
from deeptruck_cacc.training.lent_gradient import LentGradient, with_gradient
from deeptruck_core.signals import SPEED
from deeptruck_model import simulators

torch.set_num_threads(1)


@pytest.fixture(scope="module")
def trucksim():
    return simulators.load("truck:trucksim")


def drive(module, u, w, speed=15.0):
    """Speeds (T,) with gradients, from commands u (T, rows, 2)."""
    y0 = torch.zeros(u.shape[1], 3)
    y0[:, SPEED] = speed
    state, speeds = module.reset(y0), []
    for k in range(len(u)):
        state, y = module(state, u[k], w[k])
        speeds.append(y[:, SPEED])
    return torch.stack(speeds)


def test_numbers_are_the_simulators(trucksim):
    rng = np.random.default_rng(0)
    u = np.stack([rng.uniform(0, 1500, (60, 4)), rng.uniform(0, 40, (60, 4))], axis=2)
    w = rng.uniform(-0.03, 0.03, (60, 4, 1))
    got = drive(with_gradient(trucksim).torch_module(), torch.tensor(u).float(), torch.tensor(w).float())
    y0 = np.tile([0.0, 15.0, 0.0], (4, 1))
    last = np.concatenate([u, u[-1:]]), np.concatenate([w, w[-1:]])
    true = simulators.free_run(trucksim, *(x.astype(np.float32).swapaxes(0, 1) for x in last), y0)
    np.testing.assert_allclose(got.numpy().T, true.y[:, 1:, SPEED], atol=1e-4)


def test_the_gradient_is_near_that_of_a_truck_that_has_one(toy):
    """The toy's own lag is 0.3 s, the lent one 0.4 s: after two seconds both have nearly arrived."""
    gradients = []
    for module in (toy.torch_module(), LentGradient(toy).torch_module()):
        u = torch.tensor([400.0, 0.0]).repeat(20, 3, 1).requires_grad_()
        drive(module, u, torch.zeros(20, 3, 1))[-1].sum().backward()
        gradients.append(u.grad.sum(dim=0)[0])
    own, lent = gradients
    np.testing.assert_allclose(lent[0], own[0], rtol=0.1)


def test_engine_drives_brake_holds_back_and_hills_do_too(trucksim):
    module = with_gradient(trucksim).torch_module()
    u = torch.tensor([700.0, 10.0]).repeat(10, 2, 1).requires_grad_()
    w = torch.zeros(10, 2, 1, requires_grad=True)
    drive(module, u, w)[-1].sum().backward()
    assert (u.grad[:, :, 0] > 0).all() and (u.grad[:, :, 1] < 0).all() and (w.grad < 0).all()


@pytest.mark.long
def test_training_on_a_physics_truck_gets_better_and_holds_the_gap(trucksim, tmp_path):
    scores = []
    for iterations in (1, 40):
        config = AnalyticConfig(seeds=1, rollouts=12, iterations=iterations, window=80)
        policy = train(trucksim, tmp_path / str(iterations), config)
        scores.append(policy.card["validation"]["score"])
    assert scores[1] < 0.85 * scores[0]
    trace = roll_out(trucksim, policy, scenes.paper(np.random.default_rng(1), 30, 400, trucksim.dt))
    assert np.abs(trace["time_gap_error"][250:]).max() < 0.2
    assert not trace["crash"].any()
