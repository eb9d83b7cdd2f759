import numpy as np
import torch

from deeptruck_model.deep import Shape, TruckNetwork
from deeptruck_model.deep.data import Scales
from deeptruck_model.deep.network import WEIGHTS
from deeptruck_model.deep.optimizer import MATRICES, RMS, default_optimizers, orthogonal


def network(*seeds: int) -> TruckNetwork:
    scales = Scales(np.zeros(6, np.float32), np.ones(6, np.float32))
    return TruckNetwork(Shape(2, 1, 3, 16, 8, members=len(seeds)), scales, 0.1, seeds)


def moved(net: TruckNetwork, gradients: list[torch.Tensor]) -> dict[str, torch.Tensor]:
    """Two updates with the same gradients."""
    before = {name: getattr(net, name).detach().clone() for name in WEIGHTS}
    optimizers = default_optimizers(net, 0.01, 0.0)
    for _ in range(2):
        for name, gradient in zip(WEIGHTS, gradients, strict=True):
            getattr(net, name).grad = gradient.clone()
        for optimizer in optimizers:
            optimizer.step()
    return {name: getattr(net, name).detach() - before[name] for name in WEIGHTS}


def test_a_step_moves_all_directions_of_a_matrix_alike():
    generator = torch.Generator().manual_seed(0)
    for rows, columns in ((6, 40), (40, 6)):
        even = torch.linalg.qr(torch.randn(3, 40, 6, generator=generator))[0]
        uneven = even * torch.logspace(-0.7, 0.7, 6)  # singular values from 0.2 to 5
        uneven = uneven.mT if rows < columns else uneven
        singular = torch.linalg.svdvals(orthogonal(uneven)) / (RMS * 40**0.5)
        assert float(singular.min()) > 0.6 and float(singular.max()) < 1.3


def test_every_weight_moves_against_its_gradient_and_each_member_alone():
    both, alone = network(3, 4), network(4)
    gradients = [torch.randn_like(getattr(both, name)) for name in WEIGHTS]
    together = moved(both, gradients)
    single = moved(alone, [g[1:] for g in gradients])
    for name, gradient in zip(WEIGHTS, gradients, strict=True):
        assert float((together[name] * gradient).sum()) < 0, name
        torch.testing.assert_close(together[name][1:], single[name], atol=1e-6, rtol=1e-4)
    assert set(MATRICES) < set(WEIGHTS)
