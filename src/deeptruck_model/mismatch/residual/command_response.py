"""Response of the simulated acceleration to other command paths, from four runs for each command.

Delays, lags and rate limits change a command by little or for a short time. At every sample the acceleration
is taken as a function of the lagged command, piecewise linear through runs in which that command alone came
early, late or lagged; so gear, clutch and torque limits of that sample are in it. Responses to two commands
add up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from deeptruck_core.signals import ACCELERATION
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.prepare.runs import forced
from deeptruck_model.mismatch.residual.command_path import changed, lagged
from deeptruck_model.simulators import Run, Simulator

Array = NDArray[np.float64]
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
    """Runs with one command changed: `commands` and changes of the `accelerations` (run, T) of each drive,
    the recorded command with no change first."""

    commands: list[Array]
    accelerations: list[Array]
    dt: float
    lag_s: float = 0.0

    def to(self, asked: Sequence[Array], runs: Iterable[int] | None = None) -> list[Array]:
        """The change of the acceleration (T,) of each drive under the commands `asked` (T,), from the first
        run and `runs`, all by default."""
        rows = [0, *(range(1, len(self.commands[0])) if runs is None else runs)]
        x = [_arrived(u[rows], self.dt, self.lag_s) for u in self.commands]
        a = [each[rows] for each in self.accelerations]
        slopes = self._slopes(x, a)
        wanted = (_arrived(u[None], self.dt, self.lag_s)[0] for u in asked)
        return [_interpolated(*each) for each in zip(x, a, wanted, slopes, strict=True)]

    def _slopes(self, x: Sequence[Array], a: Sequence[Array]) -> list[Array]:
        """Change of the acceleration per change of the command near each sample, (T,) of each drive."""
        over = max(1, round(SMOOTH_S / self.dt))
        both = [
            ((each - each[:1]) * change, (each - each[:1]) ** 2) for each, change in zip(x, a, strict=True)
        ]
        product, square = (sum(float(part[i].sum()) for part in both) for i in (0, 1))
        least = (LEAST * max(float(np.ptp(u)) for u in self.commands)) ** 2
        mean = product / square if square > 0.0 else 0.0
        return [
            (uniform_filter1d(p.sum(axis=0), over) + least * mean)
            / np.maximum(uniform_filter1d(s.sum(axis=0), over) + least, 1e-12)
            for p, s in both
        ]

    def error(self, valid: Sequence[NDArray[np.bool_]]) -> float:
        """Sum of squared errors by which the other runs predict each run, in `valid` samples."""
        runs = range(1, len(self.commands[0]))
        total = 0.0
        for k in runs:
            predicted = self.to([u[k] for u in self.commands], [r for r in runs if r != k])
            off = zip(predicted, self.accelerations, valid, strict=True)
            total += sum(float(np.sum((p - a[k])[v] ** 2)) for p, a, v in off)
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
    candidates = [_OfOneCommand(x, a, prepared[0].dt, lag_s) for lag_s in LAGS_S]
    valid = [p.valid for p in prepared]
    return min(candidates, key=lambda candidate: candidate.error(valid))


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
    """In each sample the function through the points x, a (run, T), at the value `at` (T,); beyond them it
    goes on with `slope` (T,)."""
    order = np.argsort(x, axis=0)
    x, a = np.take_along_axis(x, order, axis=0), np.take_along_axis(a, order, axis=0)
    within = np.clip(at, x[0], x[-1])
    above = np.clip((x < within).sum(axis=0), 1, len(x) - 1)[None]
    x0, x1, a0, a1 = (np.take_along_axis(z, j, axis=0)[0] for z in (x, a) for j in (above - 1, above))
    share = np.where(x1 > x0, (within - x0) / np.where(x1 > x0, x1 - x0, 1.0), 0.0)
    out: Array = a0 + share * (a1 - a0) + slope * (at - within)
    return out
