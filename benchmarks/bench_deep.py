"""Speed of the deep truck: gradients of 30 seeds, one inference step, a batched free run. Ratios within
one run.

Times are CPU times of the one thread, so that other work on the machine does not count.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from functools import partial

import harness
import numpy as np
import torch

from deeptruck_core.signals import TruckInterface
from deeptruck_model.deep import DeepTruck, Shape, TruckNetwork
from deeptruck_model.deep.kernels import loss
from deeptruck_model.deep.network import Scales

SEEDS, STEPS, SEQUENCES = 30, 100, 16
MEAN = np.array([500, 10, 0, 0.1, 12, 8], np.float32)
SCALE = np.array([800, 20, 0.02, 0.7, 8, 6], np.float32)


def network(members: int, code: int = 0) -> TruckNetwork:
    shape = Shape(2, 1, 3, members=members, code=code)
    return TruckNetwork(shape, Scales(MEAN, SCALE), 0.1, tuple(range(members)))


seconds = partial(harness.cpu_s, clock=time.thread_time)


def gradients() -> tuple[float, float]:
    """Median seconds of one gradient of 30 seeds: in eager torch one seed after another, and in the compiled
    kernel."""
    rng = np.random.default_rng(0)
    x = rng.standard_normal((SEEDS, STEPS, SEQUENCES, 3)).astype(np.float32)
    y = (rng.standard_normal((SEEDS, STEPS + 1, SEQUENCES, 3)) * SCALE[3:] + MEAN[3:]).astype(np.float32)
    weight = np.array([2, 0.1, 0.02], np.float32)
    singles, stacked = [network(1) for _ in range(SEEDS)], network(SEEDS)
    raw = torch.as_tensor(x * SCALE[:3] + MEAN[:3]).transpose(1, 2)
    target = torch.as_tensor(y).transpose(1, 2)

    def eager() -> None:
        for m, single in enumerate(singles):
            single.zero_grad()
            run = single.unfold(raw[m, ..., :2], raw[m, ..., 2:], target[m])
            ((run[0] - target[m, :, 1:]).square().mean((0, 1)) * torch.as_tensor(weight)).sum().backward()

    compiled = seconds(lambda: loss.gradient(stacked, x, y, weight, "deployment"), 5)
    return float(np.median(seconds(eager, 3))), float(np.median(compiled))


def one_step() -> tuple[np.ndarray, np.ndarray]:
    """Median and 99 % quantile, s, of a step at batch 1: of nn.LSTM with length 1 alone, and of
    DeepTruck.step with its decoder."""
    lstm, x = torch.nn.LSTM(6, 64), torch.randn(1, 1, 6)
    state = (torch.zeros(1, 1, 64), torch.zeros(1, 1, 64))
    truck = DeepTruck(network(1, code=12), TruckInterface("bench"))
    deep, u, w = truck.reset(np.array([[0.0, 10.0, 1.0]])), np.array([[500.0, 0.0]]), np.array([[0.01]])
    with torch.no_grad():
        reference = seconds(lambda: lstm(x, state), 20_000)
    ours = seconds(lambda: truck.step(deep, u, w), 20_000)
    return np.percentile(reference, [50, 99]), np.percentile(ours, [50, 99])


def free_run(batch: int = 1024, steps: int = 400) -> tuple[float, float]:
    """Median seconds of a batched free run, and of the matrix products it contains."""
    truck = DeepTruck(network(1, code=12), TruckInterface("bench"))
    u, w = np.full((batch, steps, 2), 100.0), np.zeros((batch, steps, 1))
    y0 = np.tile([0.0, 10.0, 1.0], (batch, 1))
    gates, decoder, h = truck._packed[0][0], truck._packed[1][0], np.ones((batch, 64), np.float32)
    z, out = np.ones((batch, len(gates)), np.float32), np.empty((batch, 256), np.float32)

    def products() -> None:
        for _ in range(steps - 1):
            np.dot(z, gates, out)
            np.dot(h, decoder)

    return float(np.median(seconds(lambda: truck.rollout(u, w, y0, None), 5))), float(
        np.median(seconds(products, 5))
    )


def main() -> None:
    harness.options(__doc__, {})
    torch.set_num_threads(1)
    eager, compiled = gradients()
    lstm, ours = one_step()
    run, products = free_run()
    rows = [
        f"gradient of {SEEDS} seeds (K {STEPS}, M {SEQUENCES}) | {1e3 * eager:.0f} ms eager, one after "
        f"another | {1e3 * compiled:.0f} ms | {eager / compiled:.1f}x faster | 8x",
        *(
            f"step at batch 1, {name} | {1e6 * theirs:.1f} us nn.LSTM alone | {1e6 * mine:.1f} us | "
            f"{theirs / mine:.1f}x faster | {wanted}"
            for name, theirs, mine, wanted in zip(("p50", "p99"), lstm, ours, ("", "10x"), strict=True)
        ),
        f"free run, batch 1024, 400 steps | {products:.3f} s its matrix products | {run:.3f} s | "
        f"{run / products:.2f}x their time | 2x",
    ]
    title = harness.heading("Speed of the deep truck", ", CPU time of one thread.")
    harness.store("speed", [*title, *harness.table("what | reference | deep truck | ratio | wanted", rows)])


if __name__ == "__main__":
    main()
