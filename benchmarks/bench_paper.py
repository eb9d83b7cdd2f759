"""How long the page that compares with the paper takes: CPU time of a gradient step, of a measurement and of
an iteration of each trainer, times the number that the page needs.

python benchmarks/bench_paper.py [--updates 10] [--iterations 3]
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import harness
import numpy as np
import torch
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(harness.ROOT))  # where `benchmarks` is a package
from benchmarks.paper import control, learning, modelling
from benchmarks.paper.page import BATCH, FIELD_SEEDS, SEEDS
from deeptruck_cacc import training as policies
from deeptruck_model.deep import DeepTruck, training
from deeptruck_model.deep.arguments import Arguments
from deeptruck_model.deep.optimizer import validate
from deeptruck_model.deep.preparation import prepare
from deeptruck_model.deep.resume import identity_of

POLICIES = 10


def batch(truck: str, recipe: Arguments, seeds: int, updates: int) -> tuple[int, float, float, DeepTruck]:
    """For a batch of `seeds`: gradient steps of a training; CPU time of one step, ms, and of the whole, s,
    for each seed, including its measurement; and a truck of the batch after few steps."""
    drive, test = learning.drives(truck)
    arguments = replace(recipe, members=seeds)
    data = prepare([drive], arguments)
    identity = identity_of(data, arguments)
    run = training._begin(data, arguments, identity)
    horizon = round(arguments.horizon_s / data.dt)
    step = harness.cpu_s(lambda: training._round(run, 0, updates, updates, lambda _: None)).min() / updates
    look = harness.cpu_s(lambda: validate(run.network, data.held_out, run.weight, horizon)).min()
    deep = DeepTruck(run.network.member(0), data.interface, details=training._details(run, 0.0))
    long = truck == "trucksim"
    measured = harness.cpu_s(lambda: learning._measured(deep, drive, test, long=long), 1).min()
    total = identity["updates"] * step + arguments.rounds * look
    return identity["updates"], 1e3 * step / seeds, total / seeds + measured, deep


def iteration(deep: DeepTruck, chain: control.Chain, iterations: int) -> tuple[int, float]:
    """Number of iterations of a training of POLICIES seeds in one batch, and median CPU s of one."""
    stamps: list[float] = []
    with tempfile.TemporaryDirectory() as out:
        config = chain.config(seeds=POLICIES, iterations=iterations)
        policies.train(
            deep,
            Path(out) / "policy",
            trainer=chain.trainer,
            config=config,
            progress=lambda *_: stamps.append(time.process_time()),
        )
    return chain.config().iterations, float(np.median(np.diff(stamps)))


@threadpool_limits.wrap(limits=1)
def main() -> None:
    """Print the table and write its section of docs/results/speed.md."""
    args = harness.options(__doc__, {"--updates": 10, "--iterations": 3})
    torch.set_num_threads(1)
    wanted = {("trucksim", name): seeds for name, seeds in SEEDS.items()}
    wanted |= {(truck, name): FIELD_SEEDS for truck in modelling.FIELD_ROWS for name in learning.RECIPES}
    wanted |= {("trucksim", name): 1 for name in learning.VARIANTS}
    rows, total, trucks = [], 0.0, {}
    for (truck, name), seeds in wanted.items():
        recipe = (learning.RECIPES | learning.VARIANTS)[name]
        updates, ms, each, trucks[truck, name] = batch(truck, recipe, min(seeds, BATCH), args.updates)
        total += seeds * each
        rows.append(f"`{truck}`, {name} | {seeds} | {updates} | {ms:.2f} ms | {seeds * each / 60:.1f}")
    for name, chain in control.CHAINS.items():
        count, each = iteration(trucks["trucksim", chain.truck], chain, args.iterations)
        total += count * each
        rows.append(
            f"policies, {name} | {POLICIES} | {count} | {each:.2f} s for all | {count * each / 60:.1f}"
        )
    lines = harness.heading("Time of the page beside the paper", ", CPU time of one thread.")
    heads = "trained | seeds | steps of each | a step of one seed | CPU min of all seeds"
    lines += [*harness.table(heads, rows), ""]
    lines += [
        f"Together {total / 3600:.1f} CPU h, figures and probes aside; `modelling --workers 2` shares it out."
    ]
    harness.store("speed", lines)


if __name__ == "__main__":
    main()
