"""Delays, lags and rate limits in the command path, step by step; `rerun` of the evidence uses the
same code.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from deeptruck_model.trucks.compiled import entry

if TYPE_CHECKING:
    from deeptruck_model.mismatch.prepare.prepared import Prepared


Array = NDArray[np.float64]


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
