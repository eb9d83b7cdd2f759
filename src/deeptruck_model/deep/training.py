"""Train a deep truck, read top to bottom: arguments, data, loop, save, evaluate from disk."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from torch import Tensor
from torch.utils.tensorboard import SummaryWriter

from deeptruck_model.deep import card, checkpoint, coverage, kernels, resume
from deeptruck_model.deep.network import WEIGHTS, Shape, TruckNetwork
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.deep.windows import (
    Sequences,
    common_interface,
    consistent,
    cut,
    loss_weights,
    measure_scales,
    teachable,
    time_split,
    unexplained,
)
from deeptruck_model.errors import InputError
from deeptruck_model.recordings import Recording, data_hash
from deeptruck_model.simulators import MANIFEST, read_manifest

VALIDATION_RUNS = 64


@dataclass(frozen=True)
class Arguments:
    """What a training run depends on, besides the data."""

    seed: int = 0
    """member m starts from seed + m"""
    mode: Literal["default", "paper"] = "default"
    """default: deployment form, AdamW with a cosine; paper: training form, Adagrad"""
    form: Literal["", "training", "deployment"] = ""
    """which y is fed back while training; empty: the mode's own"""
    members: int = 1
    """models trained side by side; the truck is their mean, and their spread widens its intervals"""
    updates: int = 0
    """gradient steps; 0: chosen from the amount of data"""
    steps: int = 100
    """K, samples of one sequence; shortened where the recordings are shorter"""
    sequences: int = 16
    """M, sequences of one gradient"""
    hidden: int = 64
    """LSTM units of H"""
    decoder: int = 32
    """units of D"""
    learning_rate: float = 0.0
    """0: the mode's own"""
    weight_decay: float = 1e-4
    clip: float = 1.0
    """largest norm of one member's gradient"""
    speed_s: float = 5.0
    """a speed error costs as much as the acceleration that brings it about in this time"""
    fuel: float = 0.5
    """cost of a fuel error of one standard deviation"""
    teach: float = 0.3
    """the same for gear, engine speed and torque where recorded; D has to know them, no one else does"""
    code: int = 12
    """features that repeat the speed on a logarithmic scale, where gears are evenly spaced"""
    horizon_s: float = 40.0
    """length of the free runs that select the checkpoint"""
    rounds: int = 40
    """validations, TensorBoard points and resume points of a run"""

    @property
    def feedback(self) -> str:
        """'training' or 'deployment'."""
        return self.form or ("training" if self.mode == "paper" else "deployment")


def train(
    recordings: Sequence[Recording],
    out: Path,
    arguments: Arguments,
    resumes: bool = False,
    observe: Callable[[int, TruckNetwork], None] | None = None,
) -> DeepTruck:
    """Train on `recordings`, write the simulator directory `out`, return it as read back from there.

    `observe` is called with the updates done and the network after every round. Same data, arguments and
    machine give the same weights, resumed after a kill or not. Raises InputError for data that cannot be
    trained on, an `out` that is something else, or a resume of another run."""
    began = time.monotonic()
    out = out.resolve()
    checkpoint.check_target(out)
    torch.set_num_threads(1)  # the matrices are small: a second thread only waits

    # data
    interface = common_interface(recordings)
    pieces = [piece for recording in recordings for piece in cut(recording, interface)]
    if not pieces:
        raise InputError(
            "no stretch of 3 s with valid inputs and speed in the recordings; see 'deeptruck-model coverage'"
        )
    if arguments.mode == "default":
        pieces = [consistent(piece) for piece in pieces]
    training, validation = time_split(pieces)
    taught = teachable(training) if arguments.teach and arguments.mode == "default" else ()
    scales = measure_scales(training, taught)
    sequences, held_out = (Sequences.of(part, scales, taught) for part in (training, validation))
    dt, samples = pieces[0].dt, sum(len(p) for p in training)
    steps = min(arguments.steps, max(len(p) for p in training) - 1)
    batches = max(1, samples // (steps * arguments.sequences))
    updates = arguments.updates or (600 * batches if arguments.mode == "paper" else default_updates(samples))
    identity = {
        "arguments": asdict(arguments),
        "data_hash": data_hash(pieces),
        "steps": steps,
        "updates": updates,
    }

    if resumes and _finished(out, identity):
        return checkpoint.load_directory(out, read_manifest(out))
    working = out.with_name(f"{out.name}.partial")
    if resumes and (out / MANIFEST).exists() and not working.exists():
        raise InputError(f"{out} was trained on other data or with other arguments; train with --overwrite")

    # model
    seeds = tuple(arguments.seed + m for m in range(arguments.members))
    shape = Shape(
        len(interface.u),
        len(interface.w),
        len(interface.y),
        arguments.hidden,
        arguments.decoder,
        arguments.members,
        arguments.code if arguments.mode == "default" else 0,
        len(taught),
    )
    network = TruckNetwork(shape, scales, dt, seeds)
    weight = loss_weights(
        scales, shape.responses, len(taught), arguments.speed_s, arguments.fuel, arguments.teach
    )
    judged = np.where(np.arange(len(weight)) < shape.responses, weight, np.float32(0.0))
    optimizer = _optimizer(network, arguments)
    best = Best(network)

    # loop
    done = resume.load(working, identity, network, optimizer, best) if resumes else 0
    if not done:
        shutil.rmtree(working, ignore_errors=True)
        resume.make(working)
    per_round = math.ceil(updates / arguments.rounds)
    board = SummaryWriter(str(working / "tensorboard"), purge_step=done)
    with Progress(
        TextColumn("training"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
        TextColumn("{task.fields[score]}"), console=Console(stderr=True),
    ) as progress:  # fmt: skip
        task = progress.add_task("training", total=updates, completed=done, score="")
        while done < updates:
            batch_starts = _draw(sequences, seeds, done // per_round, per_round * arguments.sequences, steps)
            for batch in range(min(per_round, updates - done)):
                starts = batch_starts[:, batch * arguments.sequences : (batch + 1) * arguments.sequences]
                x, target = sequences.gather(starts, steps)
                losses = kernels.gradient(network, x, target, weight, arguments.feedback)
                _guard(network, losses, arguments.clip)
                for group in optimizer.param_groups:
                    group["lr"] = _learning_rate(arguments, done, updates)
                optimizer.step()
                done += 1
                progress.update(task, completed=done)
            scores = validate(network, held_out, judged, round(arguments.horizon_s / dt))
            best.keep(scores, network)
            board.add_scalar("loss/training", float(np.mean(losses)), done)
            board.add_scalar("loss/validation", float(np.mean(scores)), done)
            board.add_scalar("learning_rate", optimizer.param_groups[0]["lr"], done)
            progress.update(task, score=f"validation {np.mean(scores):.4f}, best {best.scores.mean():.4f}")
            if observe is not None:
                observe(done, network)
            resume.save(working, identity, network, optimizer, best, done)
    board.close()

    # save, then evaluate from disk
    if not np.isfinite(best.scores).all():
        raise InputError(
            "training diverged from the first round; look at the recordings with 'deeptruck-model coverage'"
        )
    best.restore(network)
    details = {
        "config": asdict(arguments),
        "seeds": list(seeds),
        "data_hash": identity["data_hash"],
        "git_hash": card.git_hash(),
        "taught": list(taught),
        "training": {
            "updates": updates,
            "unexplained": float(np.mean(np.concatenate([unexplained(r, interface) for r in recordings]))),
            "steps": steps,
            "hours": samples * dt / 3600,
            "seconds": time.monotonic() - began,
            "validation_loss": best.scores.tolist(),
        },
    }
    truck = DeepTruck(network, interface, coverage.measure(training), details)
    return card.publish(truck, training, validation, working, out)


def _finished(out: Path, identity: dict[str, Any]) -> bool:
    """Whether `out` already holds the truck that this run would train."""
    if not (out / MANIFEST).exists():
        return False
    manifest = read_manifest(out)
    run = manifest.get("training", {})
    found = (manifest.get("config"), manifest.get("data_hash"), run.get("steps"), run.get("updates"))
    return found == tuple(identity[key] for key in ("arguments", "data_hash", "steps", "updates"))


def default_updates(samples: int) -> int:
    """Gradient steps for an amount of data: 4 h at 10 Hz get 18,000, about a minute of one core."""
    return int(np.clip(samples // 8, 6000, 18000))


class Best:
    """The weights of every member at its lowest validation loss."""

    def __init__(self, network: TruckNetwork) -> None:
        self.scores = np.full(network.shape.members, np.inf)
        self.weights: dict[str, Tensor] = {n: getattr(network, n).detach().clone() for n in WEIGHTS}

    def keep(self, scores: np.ndarray[Any, Any], network: TruckNetwork) -> None:
        """Take over the members that improved."""
        for m in np.flatnonzero(scores < self.scores):
            self.scores[m] = scores[m]
            for name in WEIGHTS:
                self.weights[name][m] = getattr(network, name).detach()[m]

    def restore(self, network: TruckNetwork) -> None:
        """Put the kept weights back."""
        for name in WEIGHTS:
            getattr(network, name).data.copy_(self.weights[name])


def validate(
    network: TruckNetwork, held_out: Sequences, weight: kernels.FloatArray, steps: int
) -> np.ndarray[Any, Any]:
    """Loss of free runs of `steps` from evenly spaced starts in the held-out data, (members,); inf where
    not finite."""
    steps = min(steps, int(np.max(held_out.bounds[:, 1] - held_out.bounds[:, 0])) - 1)
    candidates = np.sort(held_out.starts(steps, np.random.default_rng(0)))
    if len(candidates) < VALIDATION_RUNS:
        candidates = np.sort(held_out.draw(VALIDATION_RUNS, steps, np.random.default_rng(0)))
    starts = candidates[np.linspace(0, len(candidates) - 1, VALIDATION_RUNS).astype(int)]
    x, target = held_out.gather(np.repeat(starts[None], network.shape.members, axis=0), steps)
    losses = kernels.loss(network, x, target, weight)
    return np.where(np.isfinite(losses), losses, np.inf)


def _draw(
    sequences: Sequences, seeds: tuple[int, ...], round_: int, count: int, steps: int
) -> np.ndarray[Any, Any]:
    """Starts of one round, (members, count). They depend on seed and round alone, so a resumed run draws
    the same."""
    return np.stack([sequences.draw(count, steps, np.random.default_rng([seed, round_])) for seed in seeds])


def _optimizer(network: TruckNetwork, arguments: Arguments) -> torch.optim.Optimizer:
    if arguments.mode == "paper":
        return torch.optim.Adagrad(network.parameters(), lr=arguments.learning_rate or 0.02)
    return torch.optim.AdamW(
        network.parameters(), lr=arguments.learning_rate or 6e-3, weight_decay=arguments.weight_decay
    )


def _learning_rate(arguments: Arguments, done: int, updates: int) -> float:
    """Paper: constant. Default: 200 steps of warm-up, then half a cosine down to a hundredth."""
    if arguments.mode == "paper":
        return arguments.learning_rate or 0.02
    peak, warm = arguments.learning_rate or 6e-3, min(200, updates // 10)
    if done < warm:
        return peak * (done + 1) / warm
    phase = (done - warm) / max(1, updates - warm)
    return peak * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * phase)))


def _guard(network: TruckNetwork, losses: np.ndarray[Any, Any], limit: float) -> None:
    """Clip each member's gradient to `limit`; one that is not finite becomes zero."""
    gradients = [p.grad for p in network.parameters() if p.grad is not None]
    norm = torch.stack([g.flatten(1).square().sum(1) for g in gradients]).sum(0).sqrt()
    finite = torch.isfinite(norm) & torch.as_tensor(np.isfinite(losses))
    factor = torch.where(finite, (limit / norm).clamp(max=1.0), torch.zeros(()))
    for g in gradients:
        shaped = factor.reshape(-1, *([1] * (g.dim() - 1)))
        g.copy_(torch.where(finite.reshape(shaped.shape), g * shaped, torch.zeros(())))
