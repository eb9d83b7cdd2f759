"""The environment's equations in torch, differentiable through the truck."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from deeptruck_cacc.controllers.approach import approach
from deeptruck_cacc.environments.reward import Reward, shaped_square
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.training.network import SeedBatch
from deeptruck_core.signals import SPEED
from deeptruck_model.simulators import Simulator


class Traffic(NamedTuple):
    """State of a batch between windows; `truck` is the simulator's state, `sent` the commands that have not
    yet arrived."""

    k: int
    truck: Any
    speed: Tensor
    gap: Tensor
    memory: Tensor
    action: Tensor
    sent: tuple[Tensor, ...]


class Window(NamedTuple):
    """Cost of a window for each row, and its trajectories, each (rows,) or (steps, rows)."""

    cost: Tensor
    time_gap_error: Tensor
    speed_error: Tensor
    crashed: Tensor
    wasted: (
        Tensor  # mean of engine times brake as asked, and a little of the jerk: what nobody wants to sit in
    )


@dataclass
class Road:
    """A batch of scenes, driven by a SeedBatch over simulator.torch_module()."""

    simulator: Simulator
    reward: Reward
    speed_share: float = 1.0  # of the reward's alpha_v, paid for the distance from the ideal follower's speed
    alpha_time_gap: float = 0.2  # on the time-gap error in 0.1 s, as it is judged, linear beyond 0.3 s
    alpha_sharp: float = 0.2  # on the same, linear from 0.03 s on, so that the last bit goes as well
    alpha_rate: float = 0.3  # on the change of action a step, squared: keeps the pedals quiet
    alpha_both: float = 1.0  # on engine times brake: neither pedal is worth anything against the other
    alpha_asked: float = 200.0  # on the same as asked of exclusive pedals: where both are, the engine's
    # demand is taken from the brake, which is ten times stronger; that was a limit cycle of 1.3 Hz
    margin_m: float = 4.0  # the crash penalty cannot be differentiated; a hinge this far above d_safety can

    def __post_init__(self) -> None:
        self.module = self.simulator.torch_module()  # type: ignore[attr-defined]
        self.dt = self.simulator.dt
        self.paid = replace(self.reward, alpha_v=self.speed_share * self.reward.alpha_v)
        interface = self.simulator.interface
        self.has_grade, self.n_u, self.n_y = bool(interface.w), len(interface.u), len(interface.y)

    def start(self, scene: Scene, policy: SeedBatch) -> Traffic:
        """The first state of a path."""
        speed, gap = _tensor(scene.speed), _tensor(scene.gap)
        y0 = torch.zeros(scene.batch, self.n_y)
        y0[:, SPEED] = speed
        idle = torch.zeros(scene.batch, 2)
        return Traffic(0, self.module.reset(y0), speed, gap, policy.start(scene.batch), idle, ())

    def drive(self, scene: Scene, policy: SeedBatch, state: Traffic, steps: int) -> tuple[Traffic, Window]:
        """Drive `steps` steps from `state`; gradients reach the policy through all of them."""
        leader, ideal, seen, felt, time_gap, gain = self._given(scene)
        gap_noise, speed_noise = self._radar(scene)
        low, high = (torch.tensor(x) for x in policy.scale.limits)
        first, truck, speed, gap, memory, action, sent = state
        delay = None if scene.command_delay is None else torch.from_numpy(scene.command_delay)
        gaps, speeds, actions = [], [], [action]
        for k in range(first, first + steps):
            radar = leader[k] + speed_noise[k], speed, gap + gap_noise[k]
            signals = torch.stack([*radar, speed * time_gap, seen[k]], dim=1)
            action, memory = policy(signals, memory)
            commands = (policy.commands(action) * gain).clamp(low, high)
            if delay is not None:
                commands, sent = _arrived(commands, sent, delay)
            truck, y = self.module(truck, commands[:, : self.n_u], felt[k])
            gap, speed = gap + (leader[k] - speed) * self.dt, y[:, SPEED]
            gaps.append(gap)
            speeds.append(speed)
            actions.append(action)
        after = Traffic(first + steps, truck, speed, gap, memory, action, sent)
        ahead, wanted = (x[first + 1 : first + steps + 1] for x in (leader, ideal))
        driven = torch.stack(gaps), torch.stack(speeds), torch.stack(actions)
        return after, self._judge(policy, *driven, ahead, wanted, time_gap)

    def _given(self, scene: Scene) -> tuple[Tensor, ...]:
        """Speeds of the leader and of the ideal follower (T + 1, rows), the grade that the policy observes
        (T, rows), the w that acts on the truck (T, rows, n_w), time gap, and command gain.

        The target is the speed of the ideal follower (see FeatureMap), because keeping a time gap behind an
        accelerating leader needs a speed other than the leader's.
        """
        speeds, ideal = [scene.leader_speed], [scene.leader_speed]
        for pull in scene.leader_acceleration.T:
            ideal.append(ideal[-1] + (speeds[-1] - ideal[-1]) * self.dt / scene.time_gap)
            speeds.append(np.maximum(speeds[-1] + pull * self.dt, 0.0))
        grade = scene.grade.T
        felt = grade if scene.hidden_grade is None else grade + scene.hidden_grade.T
        seen = grade if self.has_grade else np.zeros_like(grade)
        w = felt[..., None] if self.has_grade else np.zeros((*grade.shape, 0))
        gain = np.ones((scene.batch, 2)) if scene.command_gain is None else scene.command_gain
        return tuple(_tensor(x) for x in (np.array(speeds), np.array(ideal), seen, w, scene.time_gap, gain))

    def _radar(self, scene: Scene) -> tuple[Tensor, Tensor]:
        """The radar's errors of gap and leader speed, each (T, rows)."""
        nothing = np.zeros((scene.steps, scene.batch))
        offsets = scene.seen_gap_offset, scene.seen_speed_offset
        gap, speed = (_tensor(nothing if x is None else x.T) for x in offsets)
        return gap, speed

    def _judge(
        self,
        policy: SeedBatch,
        gap: Tensor,
        speed: Tensor,
        action: Tensor,
        leader: Tensor,
        ideal: Tensor,
        time_gap: Tensor,
    ) -> Window:
        """Cost and errors of a window; gap, speed, leader, ideal (steps, rows), action (steps + 1,
        rows, 2)."""
        gap_error, speed_error = gap - speed * time_gap, leader - speed
        taken = action[1:].flatten(0, 1)
        commands, scale = policy.commands(taken).view(*gap.shape, 2), policy.scale
        asked = [pedal.view(gap.shape) for pedal in policy.asked(taken)]
        engine, brake = commands[..., 0] / scale.engine_high, commands[..., 1] / max(scale.brake_high, 1e-12)
        if rate := policy.features.approach:
            ideal = leader + approach(gap - time_gap * leader, time_gap, rate)[0]
        error = time_gap * (ideal - speed) if rate else gap_error  # near the right gap both are one
        cost = self._tracking(error, speed, ideal) + self.paid.effort(engine, brake)
        hinge = (self.reward.d_safety + self.margin_m - gap).clamp(min=0.0, max=10.0)
        change = (action[1:] - action[:-1])[1:].square().sum(dim=2)
        both, weight = engine * brake, self.alpha_both
        if scale.exclusive:
            both, weight = asked[0] * asked[1], self.alpha_asked
        total = (cost + hinge + weight * both).mean(dim=0)
        jerk = speed.diff(n=2, dim=0) / self.dt**2
        total = total + self.alpha_rate * change.mean(dim=0)
        time_gap_error = (gap_error / speed.clamp(min=1.0)).detach()
        crashed = (gap.detach() <= self.reward.d_safety).any(dim=0)
        wasted = both.mean(dim=0) + 0.02 * jerk.square().mean(dim=0).sqrt()
        return Window(total, time_gap_error, speed_error.detach(), crashed, wasted.detach())

    def _tracking(self, gap_error: Tensor, speed: Tensor, ideal: Tensor) -> Tensor:
        """The reward's tracking terms with the ideal follower's speed, and the time-gap error,
        (steps, rows)."""
        late = gap_error / speed.clamp(min=3.0) / 0.1
        cost: Tensor = self.paid.tracking(gap_error, ideal - speed)
        cost = cost + self.alpha_time_gap * shaped_square(late, 3.0)
        return cost + self.alpha_sharp * shaped_square(late, 0.3)


def _arrived(commands: Tensor, sent: tuple[Tensor, ...], delay: Tensor) -> tuple[Tensor, tuple[Tensor, ...]]:
    """CaccEnv._arrived in torch: commands that reach each truck now, and commands that have not yet
    arrived."""
    sent = (*sent, commands)[-1 - int(delay.max()) :]
    oldest = (len(sent) - 1 - delay).clamp(min=0)
    return torch.stack(sent)[oldest, torch.arange(len(delay))], sent


def detach(state: Any) -> Any:
    """The same state without gradient history; any nesting of tuples and tensors."""
    if isinstance(state, Tensor):
        return state.detach()
    if isinstance(state, tuple):
        parts = [detach(part) for part in state]
        return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)
    return state


def _tensor(x: NDArray[Any]) -> Tensor:
    return torch.tensor(x, dtype=torch.float32)
