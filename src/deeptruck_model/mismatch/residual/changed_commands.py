"""Recorded commands as they had arrived late, lagged or limited; `command_path` does it step by step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from deeptruck_model.mismatch.residual.command_path import FASTER_DOWN, eased, lagged
from deeptruck_model.trucks.compiled import entry

if TYPE_CHECKING:
    from deeptruck_model.mismatch.data.prepared import Prepared

Array = NDArray[np.float64]


def changed(p: Prepared, name: str, amount: float) -> Array:
    """The commands as another path had delivered them; `name` is WHAT_WHICH, e.g. delay_all, rate_brake."""
    what, which = name.split("_")
    out = p.u.copy()
    for i, channel in enumerate(p.recording.interface.u):
        if which != "all" and not channel.startswith(which):
            continue
        if what == "delay":
            t = np.arange(len(out))
            out[:, i] = np.interp(t - amount / p.dt, t, p.u[:, i])
        elif what == "rate":
            out[:, i] = _limit_rate(p.u[:, i], amount * p.dt, amount * p.dt, 1.0)
        elif what in ("soft", "shaped"):
            down = amount * (FASTER_DOWN if what == "shaped" else 1.0)
            out[:, i] = _limit_rate(p.u[:, i], amount * p.dt, down * p.dt, eased(p.dt))
        elif what == "climb":
            out[:, i] = _limit_rate(p.u[:, i], amount * p.dt, np.inf, 1.0)
        elif what == "drop":
            out[:, i] = _limit_rate(p.u[:, i], np.inf, amount * p.dt, 1.0)
        elif what == "lag":
            out[:, i] = _lag(p.u[:, i], *lagged(p.dt, amount))
        elif what in ("rise", "fall"):
            out[:, i] = _one_sided_lag(p.u[:, i], *lagged(p.dt, amount), what == "rise")
    return out


def _one_sided_lag(x: Array, end: float, mean: float, rising: bool) -> Array:
    """A lag in one direction only: shoes that come late, or that let go late."""
    out, held, side = x.tolist(), float(x[0]), min if rising else max
    for k, value in enumerate(out):
        out[k] = side(value, value + mean * (held - value))
        held = side(value, value + end * (held - value))
    return np.array(out)


def _lag(x: Array, end: float, mean: float) -> Array:
    """The mean over each step of a first-order lag behind commands held over the steps."""
    after = lfilter([1 - end], [1, -end], x, zi=end * x[:1])[0]
    before = np.concatenate([x[:1], after[:-1]])
    out: Array = x + mean * (before - x)
    return out


@entry
def _limit_rate(x: Array, up: float, down: float, share: float) -> Array:
    """What follows x by `share` of the distance in each step, and by no more than `up` and `down`."""
    out = x.copy()
    for k in range(1, len(out)):
        out[k] = out[k - 1] + min(max(share * (x[k] - out[k - 1]), -down), up)
    return out
