"""Delays, lags and rate limits in the command path, and the response of the simulated acceleration to them.

`CommandPath` steps one in a simulation. Along recordings they change a command by little or for a short time:
at every sample the acceleration is taken as a function of the lagged command, piecewise linear through four
runs in which that command alone came early, late or lagged; so gear, clutch and torque limits of that sample
are in it. Responses to two commands add up.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from deeptruck_core.arrays import Array, Mask
from deeptruck_core.signals import ACCELERATION
from deeptruck_model.mismatch.prepare.prepared import Prepared, forced
from deeptruck_model.simulators import Run, Simulator
from deeptruck_model.trucks.compiled import entry

SOFT_S = 0.4  # a shaped command comes to its target with this time constant
FASTER_DOWN = 2.0  # and takes torque away so much faster than it adds it
LIMITED = ("rate", "soft", "shaped", "climb", "drop")


def changed(p: Prepared, name: str, amount: float) -> Array:
    """The commands as another path would deliver them; `name` is WHAT_WHICH, e.g. delay_all, rate_brake."""
    what, which = name.split("_")
    out = p.u.copy()
    for i, channel in enumerate(p.recording.interface.u):
        if which != "all" and not channel.startswith(which):
            continue
        x = p.u[:, i]
        if what == "delay":
            t = np.arange(len(out))
            out[:, i] = np.interp(t - amount / p.dt, t, x)
        elif what in LIMITED:
            out[:, i] = _limit_rate(x, *limits(what, amount, p.dt))
        elif what == "lag":
            out[:, i] = _lag(x, *lagged(p.dt, amount))
        else:
            out[:, i] = _one_sided_lag(x, *lagged(p.dt, amount), what == "rise")
    return out


def limits(what: str, rate: float, dt: float) -> tuple[float, float, float]:
    """The largest steps up and down of a rate limit, and the share of the distance to its target by which a
    command moves in a step without it."""
    step, eased = rate * dt, float(1.0 - np.exp(-dt / SOFT_S))
    up = np.inf if what == "drop" else step
    down = {"climb": np.inf, "shaped": FASTER_DOWN * step}.get(what, step)
    return up, down, eased if what in ("soft", "shaped") else 1.0


def lagged(dt: float, tau_s: float) -> tuple[float, float]:
    """Fraction of the initial distance to the command that a first-order lag leaves at the end of a step, and
    the average of that fraction over the step."""
    end = float(np.exp(-dt / tau_s))
    return end, tau_s / dt * (1.0 - end)


@entry
def _one_sided_lag(x: Array, end: float, mean: float, rising: bool) -> Array:
    """A lag in one direction only: brakes that apply late, or release late."""
    out, held = x.copy(), x[0]
    for k in range(len(x)):
        mean_of_step, at_end = x[k] + mean * (held - x[k]), x[k] + end * (held - x[k])
        out[k] = min(x[k], mean_of_step) if rising else max(x[k], mean_of_step)
        held = min(x[k], at_end) if rising else max(x[k], at_end)
    return out


def _lag(x: Array, end: float, mean: float) -> Array:
    """The mean over each step of a first-order lag applied to commands held over the steps."""
    after = lfilter([1 - end], [1, -end], x, zi=end * x[:1])[0]
    before = np.concatenate([x[:1], after[:-1]])
    out: Array = x + mean * (before - x)
    return out


@entry
def _limit_rate(x: Array, up: float, down: float, share: float) -> Array:
    """Follows x by `share` of the distance in each step, at most by `up` and `down`."""
    out = x.copy()
    for k in range(1, len(out)):
        out[k] = out[k - 1] + min(max(share * (x[k] - out[k - 1]), -down), up)
    return out


class CommandPath:
    """A chain of (path name, amount, share): each moves the command by `share` of the full path's change; a
    share is common to all rows of a batch, or one per row (batch,)."""

    def __init__(
        self, paths: Sequence[tuple[str, float, float | Array]], channels: tuple[str, ...], dt: float
    ) -> None:
        self._paths = [(name, amount, np.reshape(share, (-1, 1))) for name, amount, share in paths]
        self._channels, self._dt = channels, dt

    def begin(self) -> Any:
        """Empty memory; each path fills its part at the first step."""
        return [None] * len(self._paths)

    def step(self, memory: Any, u: Array) -> tuple[Array, Any]:
        """Commands (batch, n_u) as they arrive, and the new memory."""
        after = []
        for (name, amount, share), m in zip(self._paths, memory, strict=True):
            what, which = name.split("_")
            moved, m = self._moved(what, u, amount, m)
            on = np.array([which == "all" or c.startswith(which) for c in self._channels])
            u = np.where(on, u + share * (moved - u), u)
            after.append(m)
        return u, after

    def _moved(self, what: str, u: Array, amount: float, memory: Any) -> tuple[Array, Any]:
        """Applies one path to all commands; returns the new memory: a queue, or the state of each command."""
        if what == "delay":
            return self._delayed(u, amount, memory)
        held = u if memory is None else memory
        if what in LIMITED:
            up, down, share = limits(what, amount, self._dt)
            out = held + np.clip(share * (u - held), -down, up)
            return out, out
        end, mean = lagged(self._dt, amount)
        both = u + mean * (held - u), u + end * (held - u)
        if what == "lag":
            return both
        one_way = np.minimum if what == "rise" else np.maximum
        return one_way(u, both[0]), one_way(u, both[1])

    def _delayed(self, u: Array, amount: float, memory: Any) -> tuple[Array, Any]:
        steps = max(amount, 0.0) / self._dt
        whole = int(np.ceil(steps))
        queue = [u] * (whole + 1) if memory is None else [u, *memory[:whole]]
        part = whole - steps
        return (1 - part) * queue[whole] + part * queue[max(whole - 1, 0)], queue


Response = Callable[[str, float], list[Array]]
RUNS = (("delay", -0.8), ("delay", 0.15), ("delay", 0.6), ("lag", 1.5))  # of each command: its path, s
LAGS_S = (0.0, 0.1, 0.2, 0.35, 0.6)  # of the simulator's own response; the one that predicts the runs best
SMOOTH_S = 0.5  # over which the slope beyond the runs is averaged
LEAST = 0.03  # of a command's range: below such a change the slope is that of the whole drive


def command_response(
    simulator: Simulator,
    prepared: Sequence[Prepared],
    runs: Sequence[Run],
    ran: Callable[[], None] = lambda: None,
) -> Response:
    """A function of a path name and an amount, as of `changed`: the change of the simulated acceleration (T,)
    along every drive, m/s^2. `runs` are those with the recorded commands.

    The simulator is run when a command is first changed; `ran` is called after each run.
    """
    own = [run.y[0, :, ACCELERATION] for run in runs]
    channels = prepared[0].recording.interface.u if prepared else ()
    made: dict[int, _OfOneCommand] = {}

    def response(name: str, amount: float) -> list[Array]:
        which = name.split("_")[1]
        total = [np.zeros(len(p.u)) for p in prepared]
        for i, channel in enumerate(channels):
            if which == "all" or channel.startswith(which):
                if i not in made:
                    made[i] = _of_one_command(simulator, prepared, own, i, channel.split("_")[0], ran)
                asked = [changed(p, name, amount)[:, i] for p in prepared]
                total = [x + y for x, y in zip(total, made[i].to(asked), strict=True)]
        return total

    return response


@dataclass(frozen=True)
class _OfOneCommand:
    """In every sample of each drive points of a function from the command that has arrived to the change of
    the acceleration, `arrived` (run, T) ascending and `changes` (run, T), and its slope (T,) beyond them."""

    arrived: list[Array]
    changes: list[Array]
    slopes: list[Array]
    dt: float
    lag_s: float

    @staticmethod
    def through(
        commands: Sequence[Array], changes: Sequence[Array], dt: float, lag_s: float
    ) -> _OfOneCommand:
        """Through runs with these commands (run, T) of each drive; the first one has the recorded command."""
        x = [_arrived(u, dt, lag_s) for u in commands]
        slopes = _slopes(x, changes, max(float(np.ptp(u)) for u in commands), dt)
        order = [np.argsort(each, axis=0) for each in x]
        arrived, ascending = (
            [np.take_along_axis(*each, axis=0) for each in zip(z, order, strict=True)] for z in (x, changes)
        )
        return _OfOneCommand(arrived, ascending, slopes, dt, lag_s)

    def to(self, asked: Sequence[Array]) -> list[Array]:
        """The change of the acceleration (T,) of each drive under the commands `asked` (T,)."""
        wanted = (_arrived(u[None], self.dt, self.lag_s)[0] for u in asked)
        return [
            _interpolated(*each) for each in zip(self.arrived, self.changes, wanted, self.slopes, strict=True)
        ]


def _slopes(x: Sequence[Array], a: Sequence[Array], span: float, dt: float) -> list[Array]:
    """Change of the acceleration per change of the command near each sample, (T,) of each drive, where the
    command has the range `span`."""
    over = max(1, round(SMOOTH_S / dt))
    both = [((each - each[:1]) * change, (each - each[:1]) ** 2) for each, change in zip(x, a, strict=True)]
    product, square = (sum(float(part[i].sum()) for part in both) for i in (0, 1))
    least = (LEAST * span) ** 2
    mean = product / square if square > 0.0 else 0.0
    return [
        (uniform_filter1d(p.sum(axis=0), over) + least * mean)
        / np.maximum(uniform_filter1d(s.sum(axis=0), over) + least, 1e-12)
        for p, s in both
    ]


def _error(x: Sequence[Array], a: Sequence[Array], dt: float, lag_s: float, valid: Sequence[Mask]) -> float:
    """Sum of squared errors by which the other runs predict each run, in `valid` samples."""
    total = 0.0
    for k in range(1, len(x[0])):
        commands, changes = ([np.delete(each, k, axis=0) for each in z] for z in (x, a))
        predicted = _OfOneCommand.through(commands, changes, dt, lag_s).to([u[k] for u in x])
        total += sum(float(np.sum((p - c[k])[v] ** 2)) for p, c, v in zip(predicted, a, valid, strict=True))
    return total


def _of_one_command(
    simulator: Simulator,
    prepared: Sequence[Prepared],
    own: Sequence[Array],
    i: int,
    which: str,
    ran: Callable[[], None],
) -> _OfOneCommand:
    commands = [[p.u[:, i]] for p in prepared]
    accelerations = [[np.zeros(len(a))] for a in own]
    for what, amount in RUNS:
        us = [changed(p, f"{what}_{which}", amount) for p in prepared]
        for k, run in enumerate(forced(simulator, prepared, us)):
            commands[k].append(us[k][:, i])
            accelerations[k].append(run.y[0, :, ACCELERATION] - own[k])
        ran()
    x, a = [np.stack(u) for u in commands], [np.stack(each) for each in accelerations]
    dt, valid = prepared[0].dt, [p.valid for p in prepared]
    errors = {lag_s: _error(x, a, dt, lag_s, valid) for lag_s in LAGS_S}
    return _OfOneCommand.through(x, a, dt, min(errors, key=lambda lag_s: errors[lag_s]))


def _arrived(u: Array, dt: float, lag_s: float) -> Array:
    """Commands (run, T) as they act on the acceleration of each sample, which the command of the sample
    before it causes."""
    before = np.concatenate([u[:, :1], u[:, :-1]], axis=1)
    if not lag_s:
        return before
    keep, _ = lagged(dt, lag_s)
    out: Array = lfilter([1.0 - keep], [1.0, -keep], before, zi=keep * before[:, :1])[0]
    return out


def _interpolated(x: Array, a: Array, at: Array, slope: Array) -> Array:
    """In each sample the function through the points x, a (run, T), of which x ascend, at the value `at`
    (T,); beyond them it goes on with `slope` (T,)."""
    within = np.clip(at, x[0], x[-1])
    above = np.clip((x < within).sum(axis=0), 1, len(x) - 1)[None]
    x0, x1, a0, a1 = (np.take_along_axis(z, j, axis=0)[0] for z in (x, a) for j in (above - 1, above))
    share = np.where(x1 > x0, (within - x0) / np.where(x1 > x0, x1 - x0, 1.0), 0.0)
    out: Array = a0 + share * (a1 - a0) + slope * (at - within)
    return out
