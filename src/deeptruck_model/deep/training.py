"""Training of a deep truck in one file: arguments, data, loop, saving, evaluation from disk."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from threadpoolctl import threadpool_limits

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_core.terminal.progress import bar, board
from deeptruck_model import calls, simulators
from deeptruck_model.deep import card, coverage, remarks, resume
from deeptruck_model.deep.arguments import FUEL, PAPER_FUEL, Arguments
from deeptruck_model.deep.data import FloatArray, Scales, loss_weights
from deeptruck_model.deep.kernels import loss
from deeptruck_model.deep.network import WEIGHTS, Shape, TruckNetwork
from deeptruck_model.deep.optimizer import (
    Best,
    finite,
    guard,
    largest_gradient,
    learning_rate,
    optimizers,
    peak_rate,
    validate,
)
from deeptruck_model.deep.preparation import Prepared, prepare
from deeptruck_model.deep.resume import differences, identity_in, identity_of
from deeptruck_model.deep.truck import DeepTruck, load_directory
from deeptruck_model.recordings import Recording
from deeptruck_model.recordings.several import Drives, drives
from deeptruck_model.results import DEEP_TRUCK
from deeptruck_model.simulators import read_manifest

Observer = Callable[[int, TruckNetwork], None]


class DivergedError(InputError):
    """A training run that left no usable weights."""


@threadpool_limits.wrap(limits=1)  # the matrices are small: a second thread only waits, at full load
def train(
    recordings: Drives,
    out: str | Path,
    arguments: Arguments = Arguments(),
    resumes: bool = False,
    observe: Observer | None = None,
    overwrite: bool = False,
) -> DeepTruck:
    """Train on `recordings`, write the simulator directory `out`, and return the truck as read back from it.

    Recordings may be given as paths of bags. `observe` is called with the number of updates and the network
    after every round. Same data, arguments and machine give the same weights, resumed after a kill or not.
    With `resumes` a killed run is continued; `overwrite` sets it aside and starts again, and replaces an
    older deep truck once the new one is complete. Raises InputError for data that cannot be trained on, an
    `out` that holds something else, or a resume of another run.
    """
    began, out = time.monotonic(), calls.path(out, "out")
    calls.instance(arguments, Arguments, "arguments", "such as Arguments(hidden=32)")
    recordings = drives(recordings)
    DEEP_TRUCK.check(
        out, overwrite=overwrite or resumes
    )  # whether it is this run's own is known with the data
    torch.set_num_threads(1)
    data = prepare(recordings, arguments)
    identity = identity_of(data, arguments)
    if resumes and identity_in(out) == identity:
        return load_directory(out, read_manifest(out))
    if resumes and not overwrite:
        _refuse_another(out, identity)
    with DEEP_TRUCK.replacing(out, overwrite=overwrite, resume=resumes) as working:
        if (working / resume.FILE).exists() or identity_in(working) != identity:  # else killed once complete
            _work(data, arguments, identity, working, out, observe, began)
    loaded = simulators.load(out)
    assert isinstance(loaded, DeepTruck)
    return loaded


def _refuse_another(out: Path, identity: dict[str, Any]) -> None:
    """Raises InputError if the truck at `out` is from another run."""
    there = identity_in(out)
    if there is None:
        return
    if files.unfinished(out).exists():
        DEEP_TRUCK.check(
            out, resume=True
        )  # a run to replace it was killed: it takes --overwrite to go on, too
    raise InputError(
        f"{out} is another run ({differences(there, identity)}); choose another --out, or "
        "add --overwrite instead of --resume"
    )


def _work(
    data: Prepared,
    arguments: Arguments,
    identity: dict[str, Any],
    working: Path,
    out: Path,
    observe: Observer | None,
    began: float,
) -> None:
    """Train from the last resume point in `working`, if there is one, and complete the simulator there."""
    run = _begin(data, arguments, identity)
    done = resume.load(working, identity, run.network, run.optimizers, run.best)
    _loop(run, working, done, observe)
    if not np.isfinite(run.best.scores).all():
        (working / resume.FILE).unlink(missing_ok=True)  # going on with it would only diverge again
        raise DivergedError(
            "training diverged: take a lower learning rate than "
            f"{peak_rate(arguments):g}, or look at the recordings with 'deeptruck-model coverage'"
        )
    run.best.restore(run.network)
    truck = DeepTruck(
        run.network,
        data.interface,
        coverage.measure_coverage(data.training),
        _details(run, time.monotonic() - began),
        driven=coverage.measure_driven(data.training, data.driven),
    )
    card.complete(truck, data.training, data.validation, working)


def finished(recordings: Sequence[Recording], out: Path, arguments: Arguments) -> bool:
    """Whether `out` already holds the truck that `train` would return. Raises InputError as `train` does for
    the recordings."""
    return identity_in(out) == identity_of(prepare(recordings, arguments), arguments)


@dataclass(frozen=True)
class _Run:
    """State of a training run."""

    data: Prepared
    arguments: Arguments
    identity: dict[str, Any]
    network: TruckNetwork
    weight: FloatArray
    optimizers: list[torch.optim.Optimizer]
    best: Best
    seeds: tuple[int, ...]

    @property
    def steps(self) -> int:
        return int(self.identity["steps"])

    @property
    def updates(self) -> int:
        return int(self.identity["updates"])


def _begin(data: Prepared, arguments: Arguments, identity: dict[str, Any]) -> _Run:
    """Network, loss weights and optimisers before the first update."""
    seeds = tuple(arguments.seed + m for m in range(arguments.members))
    network = _fresh(data, arguments, seeds) if data.start is None else _copies(data.start, seeds)
    shape = network.shape
    if arguments.mode == "paper":
        plain = [1.0, 1.0, arguments.fuel or PAPER_FUEL]  # of acceleration, speed and fuel rate
        weight = np.array(plain[: shape.responses] + [0.0] * shape.auxiliary, np.float32)
    else:
        fuel = arguments.fuel or FUEL
        weight = loss_weights(
            data.scales, shape.responses, shape.auxiliary, arguments.speed_s, fuel, arguments.auxiliary
        )
    return _Run(
        data, arguments, identity, network, weight, optimizers(network, arguments), Best(network), seeds
    )


def _copies(start: TruckNetwork, seeds: tuple[int, ...]) -> TruckNetwork:
    """A network whose members start with the weights of those of `start`, in turn; only their data order
    differs."""
    scales = Scales(start.mean.numpy(), start.scale.numpy(), start.top_speed)
    network = TruckNetwork(replace(start.shape, members=len(seeds)), scales, start.dt, seeds)
    turn = [m % start.shape.members for m in range(len(seeds))]
    for name in WEIGHTS:
        getattr(network, name).data.copy_(getattr(start, name).detach()[turn])
    return network


def _fresh(data: Prepared, arguments: Arguments, seeds: tuple[int, ...]) -> TruckNetwork:
    """A network with random initial weights."""
    interface, default = data.interface, arguments.mode == "default"
    shape = Shape(
        len(interface.u),
        len(interface.w),
        len(interface.y),
        arguments.hidden,
        arguments.decoder,
        arguments.members,
        arguments.code if default else 0,
        len(data.auxiliary),
        arguments.kind == "grey" and default,
    )
    return TruckNetwork(shape, data.scales, data.dt, seeds)


def _loop(run: _Run, working: Path, done: int, observe: Observer | None) -> None:
    """Rounds of updates, each followed by validation and a resume point."""
    arguments, per_round = run.arguments, math.ceil(run.updates / run.arguments.rounds)
    judged = np.where(np.arange(len(run.weight)) < run.network.shape.responses, run.weight, np.float32(0.0))
    score = ""
    with board(working / "tensorboard", done) as curves, bar("training") as show:

        def step(now: int) -> None:
            show(now, run.updates, score)

        while done < run.updates:
            count = min(per_round, run.updates - done)
            step(done)
            losses = _round(run, done, count, per_round, step)
            done += count
            horizon = round(arguments.horizon_s / run.data.dt)
            scores = validate(run.network, run.data.held_out, judged, horizon)
            run.best.keep(scores, run.network)
            curves.add_scalar("loss/training", float(np.mean(losses)), done)
            curves.add_scalar("loss/validation", float(np.mean(scores)), done)
            curves.add_scalar("learning_rate", learning_rate(arguments, done - 1, run.updates), done)
            score = f"validation {scores.mean():.4f}, best {run.best.scores.mean():.4f}"
            step(done)
            if observe is not None:
                observe(done, run.network)
            resume.save(working, run.identity, run.network, run.optimizers, run.best, done)
            if not finite(run.network).any():
                break  # such weights never come back


def _round(
    run: _Run, done: int, count: int, per_round: int, show: Callable[[int], None]
) -> np.ndarray[Any, Any]:
    """`count` updates; returns the losses (members,) of the last."""
    arguments, sequences, batch = run.arguments, run.data.sequences, run.arguments.sequences
    # starts of the round, (members, count), depend on seed and round, so that a resumed run draws the same
    rngs = [np.random.default_rng([seed, done // per_round]) for seed in run.seeds]
    starts = np.stack([sequences.draw(per_round * batch, run.steps, rng) for rng in rngs])
    losses = np.full(len(run.seeds), np.nan)
    for i in range(count):
        x, target = sequences.gather(starts[:, i * batch : (i + 1) * batch], run.steps)
        losses = loss.gradient(run.network, x, target, run.weight, arguments.feedback)
        guard(run.network, losses, largest_gradient(arguments))
        for optimizer in run.optimizers:
            optimizer.param_groups[0]["lr"] = learning_rate(arguments, done + i, run.updates)
            optimizer.step()
        show(done + i + 1)
    return losses


def _details(run: _Run, seconds: float) -> dict[str, Any]:
    """Manifest entries on the training."""
    data = run.data
    return {
        "config": asdict(run.arguments),
        "seeds": list(run.seeds),
        "data_hash": data.data_hash,
        "git_hash": card.git_hash(),
        "auxiliary": list(data.auxiliary),
        remarks.KEY: list(data.trained_on),
        "training": {
            "updates": run.updates,
            "unexplained": data.unexplained,
            "unexcited": list(data.unexcited),
            "learning_rate": peak_rate(run.arguments),
            "steps": run.steps,
            "hours": data.samples * data.dt / 3600,
            "seconds": seconds,
            "validation_loss": run.best.scores.tolist(),
        },
    }
