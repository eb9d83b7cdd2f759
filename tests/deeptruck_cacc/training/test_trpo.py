from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from deeptruck_cacc import load_policy
from deeptruck_cacc.training import TrpoConfig, train, trpo
from deeptruck_cacc.training.trpo import Gaussian, StackedMlp, improve

torch.set_num_threads(1)
QUICK = TrpoConfig(seeds=2, iterations=3, environments=5, path=60, validate_every=2)


@pytest.fixture
def net():
    net = StackedMlp((3, 7, 5, 2))
    generators = [torch.Generator().manual_seed(k) for k in range(4)]
    parameters = net.fresh(generators, 1.0) + 0.1 * torch.randn(4, net.size, generator=generators[0])
    return net, parameters.double(), torch.randn(4, 11, 3, generator=generators[1]).double()


def test_derivatives_by_hand_are_those_of_small_steps(net):
    net, parameters, x = net
    outputs, inputs = net.forward(parameters, x)
    change, back = torch.randn_like(parameters), torch.randn_like(outputs)
    ahead, behind = (net.forward(parameters + step * change, x)[0] for step in (1e-5, -1e-5))
    pushed = (ahead - behind) / 2e-5
    torch.testing.assert_close(net.push(parameters, inputs, change), pushed, rtol=1e-6, atol=1e-7)
    pulled = net.pull(parameters, inputs, back)
    torch.testing.assert_close((pulled * change).sum(), (back * pushed).sum(), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("most_kl", [0.01, 0.3])
def test_a_step_is_better_and_within_the_trust_region(net, most_kl):
    net, parameters, x = net
    policy = Gaussian(net, parameters, torch.full((4, 2), -0.7).double())
    mean = net.forward(parameters, x)[0]
    noise = torch.randn(mean.shape, generator=torch.Generator().manual_seed(0)).double()
    actions = mean + 0.5 * noise
    advantages = -(actions - 1.0).square().sum(dim=2)  # towards (1, 1)
    advantages = advantages - advantages.mean(dim=1, keepdim=True)
    advantages[3] = 0.0  # a seed with nothing to gain
    better = improve(policy, x, actions, advantages, torch.arange(11).expand(4, 11), most_kl)
    moved = net.forward(better.mean, x)[0]
    sd, new = policy.log_std.exp()[:, None], better.log_std.exp()[:, None]
    kl = (new.log() - sd.log() + (sd**2 + (moved - mean) ** 2) / (2 * new**2) - 0.5).mean(dim=(1, 2))
    assert (kl <= most_kl).all() and (kl[:3] > 0.1 * most_kl).all()

    def log_likelihood(mean, sd):
        return (-((actions - mean) ** 2) / (2 * sd**2) - sd.log()).sum(dim=2)

    ratio = (log_likelihood(moved, new) - log_likelihood(mean, sd)).exp()
    assert ((ratio * advantages).mean(dim=1) > advantages.mean(dim=1))[:3].all()
    torch.testing.assert_close(better.mean[3], policy.mean[3])


def test_the_advantage_of_a_whole_path_is_its_discounted_return():
    rewards, values = torch.tensor([[1.0, 2.0, 4.0]]), torch.tensor([[0.5, 0.25, 0.125, 8.0]])
    whole = trpo.advantage(rewards, values, 0.5, 1.0)
    torch.testing.assert_close(whole, torch.tensor([[1 + 1 + 1 + 1 - 0.5, 2 + 2 + 2 - 0.25, 4 + 4 - 0.125]]))
    near = trpo.advantage(rewards, values, 0.5, 0.0)
    torch.testing.assert_close(near[0, 0], torch.tensor(1 + 0.125 - 0.5))


@pytest.mark.usefixtures("quick_exam")
def test_a_seed_does_not_know_the_seeds_beside_it(toy, tmp_path):
    train(toy, tmp_path / "both", replace(QUICK, seed=3))
    train(toy, tmp_path / "one", replace(QUICK, seed=4, seeds=1))
    curves = [
        [
            json.loads(line)["return_mean"]
            for line in (tmp_path / name / "seeds/4/learning_curve.jsonl").open()
        ]
        for name in ("both", "one")
    ]
    np.testing.assert_allclose(*curves, rtol=1e-3)
    assert len(curves[0]) == 3


def test_it_learns_the_identity_case(toy, tmp_path):
    config = TrpoConfig(seeds=2, iterations=8, path=150, validate_every=4)
    policy = train(toy, tmp_path / "p", config)
    assert policy.card["validation"]["score"] == min(
        load_policy(tmp_path / "p" / "seeds" / k).card["validation"]["score"] for k in "01"
    )
    for k in "01":
        lines = (tmp_path / "p" / "seeds" / k / "learning_curve.jsonl").read_text().splitlines()
        first, last = json.loads(lines[0]), json.loads(lines[-1])
        assert last["return_mean"] > 0.15 * first["return_mean"]


@pytest.mark.usefixtures("quick_exam")
def test_the_printed_reward_is_what_is_paid_and_goes_on_the_card(toy, tmp_path):
    one = replace(QUICK, seeds=1, iterations=1)
    printed = train(toy, tmp_path / "a", replace(one, printed_reward=True))
    shaped = train(toy, tmp_path / "b", one)
    assert printed.card["reward"]["knee_gap_m"] is None and shaped.card["reward"]["knee_gap_m"] == 0.5
    returns = [
        json.loads((tmp_path / name / "seeds/0/learning_curve.jsonl").read_text())["return_mean"]
        for name in "ab"
    ]
    assert returns[0] < 1.5 * returns[1]  # the same paths, whose large errors cost their squares
