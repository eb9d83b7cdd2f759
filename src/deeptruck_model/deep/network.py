"""The paper's model: state model H (LSTM), decoder D, kinematic constraint C.

x(k+1) = H(u(k), w(k) | x(k), y(k)),   y(k) = C(D(x(k))),   v(k+1) = v(k) + a(k+1) dt

`members` independent models are stacked in the leading dimension of every parameter, so that one gradient
trains all seeds and one step runs an ensemble. This file is the readable reference and the differentiable
truck; `kernels` is a faster implementation, and a test compares the two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import torch
from torch import Tensor, nn

from deeptruck_core.signals import ACCELERATION, FUEL, SPEED
from deeptruck_model.deep.data import Scales

# Below both, the truck stands: static friction and the brake hold it, so rounding cannot make it creep.
REST_SPEED = 0.1  # m/s
REST_ACCELERATION = 0.05  # m/s^2

# The engine command acts through the gear, which goes roughly with 1/speed: command * 10 / (3 + speed).
GEAR_SPEED, GEAR_OFFSET = 10.0, 3.0  # m/s

WEIGHTS = ("input", "recurrent", "bias", "decoder", "decoder_bias", "output", "output_bias")


@dataclass(frozen=True)
class Shape:
    """Sizes of a network; `responses` is 2 (acceleration, speed) or 3 (with fuel rate).

    `code` is the number of features that encode the speed on a logarithmic scale, `auxiliary` the number of
    auxiliary targets: signals inside the truck (gear, engine speed ...) that the decoder D outputs besides
    the response. The paper's network has no code and no auxiliary targets.
    """

    controls: int
    conditions: int
    responses: int
    hidden: int = 64
    decoder: int = 32
    members: int = 1
    code: int = 0
    auxiliary: int = 0
    gains: bool = False

    @property
    def signals(self) -> int:
        """Columns of [u, w, y]."""
        return self.controls + self.conditions + self.responses

    @property
    def inputs(self) -> int:
        """Columns that enter the LSTM: [u, w, y, code]."""
        return self.signals + self.code

    @property
    def factors(self) -> int:
        """Number of signals that gains multiply: u, w and the engine command over the speed; 0
        without gains."""
        return self.controls + self.conditions + 1 if self.gains else 0

    @property
    def named(self) -> int:
        """Outputs of D that are signals: acceleration[, fuel rate][, auxiliary targets]."""
        return self.responses - 1 + self.auxiliary

    @property
    def outputs(self) -> int:
        """Columns of D: the named signals, then `factors` gains for acceleration[, and fuel rate]."""
        return self.named + (self.responses - 1) * self.factors


class State(NamedTuple):
    """Hidden h and cell c, (members, batch, hidden), the response to feed back, (members, batch, n_y), and
    the auxiliary outputs of D, (members, batch, auxiliary)."""

    h: Tensor
    c: Tensor
    y: Tensor
    auxiliary: Tensor


class TruckNetwork(nn.Module):
    """`shape.members` stacked copies of C(D(H)). The order of gates is input, forget, cell, output."""

    mean: Tensor
    scale: Tensor
    input: nn.Parameter
    recurrent: nn.Parameter
    bias: nn.Parameter
    decoder: nn.Parameter
    decoder_bias: nn.Parameter
    output: nn.Parameter
    output_bias: nn.Parameter

    def __init__(self, shape: Shape, scales: Scales, dt: float, seeds: tuple[int, ...] = (0,)) -> None:
        super().__init__()
        if len(seeds) != shape.members:
            raise ValueError(f"{shape.members} members need as many seeds, not {len(seeds)}")
        self.shape, self.dt, self.top_speed = shape, dt, scales.top_speed
        self.register_buffer("mean", torch.as_tensor(scales.mean, dtype=torch.float32))
        self.register_buffer("scale", torch.as_tensor(scales.scale, dtype=torch.float32))
        members = [_initial_weights(shape, seed) for seed in seeds]
        for name in WEIGHTS:
            self.register_parameter(name, nn.Parameter(torch.stack([m[name] for m in members])))

    def member(self, index: int) -> TruckNetwork:
        """A copy of one member as a separate network."""
        scales = Scales(self.mean.numpy(), self.scale.numpy(), self.top_speed)
        alone = TruckNetwork(replace(self.shape, members=1), scales, self.dt)
        for name in WEIGHTS:
            getattr(alone, name).data.copy_(getattr(self, name).detach()[index : index + 1])
        return alone

    def initial(self, y0: Tensor) -> State:
        """Zero internal state at the response y0 (batch, n_y)."""
        zeros = self.input.new_zeros(self.shape.members, y0.shape[0], self.shape.hidden)
        auxiliary = self.input.new_zeros(self.shape.members, y0.shape[0], self.shape.auxiliary)
        return State(zeros, zeros, y0.expand(self.shape.members, *y0.shape), auxiliary)

    def step(self, state: State, u: Tensor, w: Tensor) -> State:
        """One step. u (members, batch, n_u) or (batch, n_u), w likewise; the new state's y is the
        response."""
        conditions = torch.cat([u, w], dim=-1).expand(self.shape.members, -1, -1)
        signals = self.shape.signals
        x = (torch.cat([conditions, state.y], dim=-1) - self.mean[:signals]) / self.scale[:signals]
        x = torch.cat([x, self._code(state.y[..., SPEED : SPEED + 1])], dim=-1)
        gates = self.bias[:, None] + torch.bmm(x, self.input) + torch.bmm(state.h, self.recurrent)
        i, f, g, o = gates.chunk(4, dim=-1)
        c = torch.sigmoid(f) * state.c + torch.sigmoid(i) * torch.tanh(g)
        h = torch.sigmoid(o) * torch.tanh(c)
        decoded = torch.tanh(self.decoder_bias[:, None] + torch.bmm(h, self.decoder))
        raw = self.output_bias[:, None] + torch.bmm(decoded, self.output)
        raw = self._with_gains(raw, conditions, state.y)
        raw = raw * self.scale[self._columns] + self.mean[self._columns]
        responses = self.shape.responses - 1
        return State(h, c, self._constrain(raw[..., :responses], state.y), raw[..., responses:])

    def unfold(self, u: Tensor, w: Tensor, y: Tensor, form: str = "deployment") -> Tensor:
        """K steps from zero state: u (.., batch, K, n_u), w likewise, y (.., batch, K+1, n_y) -> (members,
        batch, K, n_y + auxiliary).

        `form` 'deployment' feeds the model its own response and reads only y[..., 0, :]; 'training' feeds
        the recorded one wherever it is finite.
        """
        recorded = y.expand(self.shape.members, *y.shape[-3:])
        state = self.initial(recorded[0, :, 0])._replace(y=recorded[:, :, 0])
        responses = []
        for k in range(u.shape[-2]):
            if k and form == "training":
                state = state._replace(y=self.forced(state.y, recorded[:, :, k]))
            state = self.step(state, u[..., k, :], w[..., k, :])
            responses.append(torch.cat([state.y, state.auxiliary], dim=-1))
        return torch.stack(responses, dim=2)

    def forced(self, own: Tensor, recorded: Tensor) -> Tensor:
        """The fed-back response: the recorded one where it is finite, else `own` (.., n_y).

        Where C keeps the truck at rest, v' = 0 and a = -v / dt. In training, a truck at rest is fed v = 0 and
        therefore a = 0. With a recorded speed, which need not be 0, a is 0 too: -v / dt would feed back a
        stop that did not happen.
        """
        fed = torch.where(torch.isnan(recorded), own, recorded)
        overruled = (own[..., SPEED] == 0) & ~torch.isnan(recorded[..., SPEED])
        overruled &= torch.isnan(recorded[..., ACCELERATION])
        acceleration = torch.where(overruled, 0.0, fed[..., ACCELERATION])
        return torch.cat([acceleration[..., None], fed[..., SPEED:]], dim=-1)

    def _code(self, speed: Tensor) -> Tensor:
        """Speed (.., 1) on a logarithmic scale, on which gears are evenly spaced: (.., code) soft steps."""
        if not self.shape.code:
            return speed[..., :0]
        width = math.log1p(self.top_speed) / self.shape.code
        centres = width * (0.5 + torch.arange(self.shape.code, dtype=speed.dtype))
        return torch.tanh((torch.log1p(speed) - centres) / width)

    def _with_gains(self, raw: Tensor, conditions: Tensor, y: Tensor) -> Tensor:
        """Responses (.., free) and named signals of the raw outputs of D; each response includes the sum of
        its gains times their factors."""
        free, named, factors = self.shape.responses - 1, self.shape.named, self.shape.factors
        if not factors:
            return raw
        share = conditions / self.scale[: conditions.shape[-1]]
        gear_gain = share[..., :1] * (GEAR_SPEED / (GEAR_OFFSET + y[..., SPEED : SPEED + 1]))
        factor = torch.cat([share, gear_gain], dim=-1)[..., None, :]
        gained = (raw[..., named:].reshape(*raw.shape[:-1], free, factors) * factor).sum(-1)
        return torch.cat([raw[..., :free] + gained, raw[..., free:named]], dim=-1)

    @property
    def _columns(self) -> list[int]:
        """Columns of D's outputs in [u, w, y, auxiliary]; speed is not among them, because C computes it."""
        first = self.shape.controls + self.shape.conditions
        return [first + ACCELERATION, *range(first + FUEL, first + 1 + self.shape.named)]

    def _constrain(self, raw: Tensor, y: Tensor) -> Tensor:
        """C: v' = v + a dt, never negative, and zero if it is very small; fuel never negative.

        Where a bound is active, the gradient still reaches the decoder as if it were not (otherwise a model
        that wrongly stands could never learn to start), but not the previous speed.
        """
        acceleration, speed = raw[..., 0], y[..., SPEED]
        moved = speed + acceleration * self.dt
        stands = (moved < 0) | ((moved < REST_SPEED) & (acceleration < REST_ACCELERATION))
        bounded_speed = (acceleration - acceleration.detach()) * self.dt
        bounded_acceleration = acceleration - acceleration.detach() - speed.detach() / self.dt
        parts = [
            torch.where(stands, bounded_acceleration, acceleration),
            torch.where(stands, bounded_speed, moved),
        ]
        if raw.shape[-1] > 1:
            fuel = raw[..., 1]
            parts.append(fuel + (fuel.clamp(min=0) - fuel).detach())
        return torch.stack(parts, dim=-1)


def _initial_weights(shape: Shape, seed: int) -> dict[str, Tensor]:
    """Uniform in +-1/sqrt(fan in), as nn.LSTM and nn.Linear; each member depends only on its own seed."""
    generator = torch.Generator().manual_seed(seed)

    def uniform(bound: float, *size: int) -> Tensor:
        return (torch.rand(*size, generator=generator) * 2 - 1) * bound

    lstm, decoder, outputs = shape.hidden**-0.5, shape.decoder**-0.5, shape.outputs
    return {
        "input": uniform(lstm, shape.inputs, 4 * shape.hidden),
        "recurrent": uniform(lstm, shape.hidden, 4 * shape.hidden),
        "bias": uniform(lstm, 4 * shape.hidden),
        "decoder": uniform(lstm, shape.hidden, shape.decoder),
        "decoder_bias": uniform(lstm, shape.decoder),
        "output": uniform(decoder, shape.decoder, outputs),
        "output_bias": uniform(decoder, outputs),
    }
