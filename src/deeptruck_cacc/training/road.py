"""The environment's equations in torch, differentiable through the truck."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from torch import Tensor

from deeptruck_cacc.reward import Reward
from deeptruck_cacc.scenes import Scene
from deeptruck_cacc.training.network import SeedBatch
from deeptruck_model.signals import SPEED
from deeptruck_model.simulators import Simulator


class Traffic(NamedTuple):
    """State of a batch between windows; `truck` is the simulator's own."""

    k: int
    truck: Any
    leader_speed: Tensor
    speed: Tensor
    gap: Tensor
    memory: Tensor
    action: Tensor


class Window(NamedTuple):
    """What a window cost each row and how it went, each (rows,) or (steps, rows)."""

    cost: Tensor
    time_gap_error: Tensor
    speed_error: Tensor
    crashed: Tensor


@dataclass
class Road:
    """One batch of scenes, driven by a SeedBatch over simulator.torch_module()."""

    simulator: Simulator
    reward: Reward
    alpha_rate: float = 0.02  # on the change of action a step, squared: keeps the pedals quiet
    alpha_both: float = 0.5  # on engine times brake: neither pedal is worth anything against the other
    margin_m: float = 4.0  # the crash penalty cannot be differentiated; a hinge this far above d_safety can

    def __post_init__(self) -> None:
        self.module = self.simulator.torch_module()  # type: ignore[attr-defined]
        self.dt = self.simulator.dt
        self.has_grade = bool(self.simulator.interface.w)
        self.n_u, self.n_y = len(self.simulator.interface.u), len(self.simulator.interface.y)

    def start(self, scene: Scene, policy: SeedBatch) -> Traffic:
        """The first state of a path."""
        leader, speed, gap = (
            torch.tensor(x, dtype=torch.float32) for x in (scene.leader_speed, scene.speed, scene.gap)
        )
        y0 = torch.zeros(scene.batch, self.n_y)
        y0[:, SPEED] = speed
        memory = policy.start(scene.batch)
        return Traffic(0, self.module.reset(y0), leader, speed, gap, memory, torch.zeros(scene.batch, 2))

    def drive(self, scene: Scene, policy: SeedBatch, state: Traffic, steps: int) -> tuple[Traffic, Window]:
        """`steps` steps from `state`; gradients reach the policy through every one of them."""
        seen, felt, pull, time_gap = _tensors(scene, self.has_grade)
        k, truck, leader, speed, gap, memory, action = state
        gain = 1.0 if scene.command_gain is None else torch.tensor(scene.command_gain, dtype=torch.float32)
        low, high = (torch.tensor(x, dtype=torch.float32) for x in policy.scale.limits)
        cost, errors, speed_errors = torch.zeros(scene.batch), [], []
        crashed = torch.zeros(scene.batch, dtype=torch.bool)
        for k in range(state.k, state.k + steps):
            signals = torch.stack([leader, speed, gap, speed * time_gap, seen[:, k]], dim=1)
            before, (action, memory) = action, policy(signals, memory)
            commands = policy.commands(action)
            w = felt[:, k : k + 1] if self.has_grade else torch.zeros(scene.batch, 0)
            felt_commands = (commands * gain).clamp(low, high)
            truck, y = self.module(truck, felt_commands[:, : self.n_u], w)
            gap = gap + (leader - speed) * self.dt
            leader, speed = (leader + pull[:, k] * self.dt).clamp(min=0.0), y[:, SPEED]
            gap_error, speed_error = gap - speed * time_gap, leader - speed
            cost = cost + self._cost(policy, gap, gap_error, speed_error, commands, action - before, k)
            errors.append((gap_error / speed.clamp(min=1.0)).detach())
            speed_errors.append(speed_error.detach())
            crashed |= gap.detach() <= self.reward.d_safety
        after = Traffic(k + 1, truck, leader, speed, gap, memory, action)
        return after, Window(cost / steps, torch.stack(errors), torch.stack(speed_errors), crashed)

    def _cost(
        self,
        policy: SeedBatch,
        gap: Tensor,
        gap_error: Tensor,
        speed_error: Tensor,
        commands: Tensor,
        change: Tensor,
        k: int,
    ) -> Tensor:
        scale = policy.scale
        engine, brake = commands[:, 0] / scale.engine_high, commands[:, 1] / max(scale.brake_high, 1e-12)
        cost = self.reward.tracking(gap_error, speed_error)
        cost = cost + self.reward.effort(engine, brake) + self.alpha_both * engine * brake
        hinge = (self.reward.d_safety + self.margin_m - gap).clamp(min=0.0)
        quiet = self.alpha_rate * (change**2).sum(dim=1) if k else 0.0
        return cost + quiet + hinge.clamp(max=10.0)


def detach(state: Any) -> Any:
    """The same state without its history, whatever tuples and tensors it is made of."""
    if isinstance(state, Tensor):
        return state.detach()
    if isinstance(state, tuple):
        parts = [detach(part) for part in state]
        return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)
    return state


def _tensors(scene: Scene, has_grade: bool) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Seen grade, felt grade, leader acceleration (rows, T) and time gap (rows,)."""
    grade = torch.tensor(scene.grade, dtype=torch.float32)
    hidden = 0.0 if scene.hidden_grade is None else torch.tensor(scene.hidden_grade, dtype=torch.float32)
    pull = torch.tensor(scene.leader_acceleration, dtype=torch.float32)
    time_gap = torch.tensor(scene.time_gap, dtype=torch.float32)
    return (grade if has_grade else torch.zeros_like(grade)), grade + hidden, pull, time_gap
