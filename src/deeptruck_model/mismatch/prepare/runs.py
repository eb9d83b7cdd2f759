"""Runs a simulator forced along recordings: every step starts from the recorded response."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.signals import ACCELERATION, SPEED
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.simulators import Run, Simulator, forced_run, free_run

Array = NDArray[np.float64]

FREE_S = 200.0  # of a free run that shows whether a simulator without `force` forgets
ALIKE = 0.8  # of the longest drive's length, for drives that are run at once


def forced(simulator: Simulator, prepared: Sequence[Prepared], us: Sequence[Array]) -> list[Run]:
    """Runs (1, T) along every drive with the commands `us`, one array (T, n_u) for each drive.

    Drives of similar length are run in one batch, because simulators stepped in Python, such as a corrected
    truck, take as long for many rows as for one. Shorter drives are extended by their last sample; the
    extension is cut off.
    """
    runs: dict[int, Run] = {}
    lengths = [len(u) for u in us]
    for together in _alike(lengths):
        longest = lengths[together[0]]
        drives = [(us[i], prepared[i].w, fed(simulator, prepared[i].y)) for i in together]
        u, w, y = (np.stack([padded(x, longest) for x in each]) for each in zip(*drives, strict=True))
        run = forced_run(simulator, u, w, y)
        for row, i in enumerate(together):
            own = (slice(row, row + 1), slice(lengths[i]))
            runs[i] = Run(run.y[own], {name: x[own] for name, x in run.inside.items()})
    return [runs[i] for i in range(len(us))]


def forgotten(simulator: Simulator, prepared: Sequence[Prepared]) -> float:
    """Relative change (rms) of a simulator's acceleration if it is reset at each response of its own free
    run; shows how much a simulator without `force` loses by it. 0 for one with `force`."""
    if not getattr(simulator, "starts_anew", False):
        return 0.0
    p = max(prepared, key=lambda p: int(p.valid.sum()))
    n = round(FREE_S / p.dt)
    u, w, y = (np.nan_to_num(x[:n])[None] for x in (p.u, p.w, p.y))
    free = free_run(simulator, u, w, y[:, 0]).y
    anew = forced_run(simulator, u, w, free).y
    own, again = free[0, 2:, ACCELERATION], anew[0, 2:, ACCELERATION]
    return float(np.linalg.norm(again - own)) / max(float(np.linalg.norm(own)), 1e-6)


def _alike(lengths: Sequence[int]) -> list[list[int]]:
    """Indices in groups of similar length, the longest of each first."""
    groups: list[list[int]] = []
    for i in sorted(range(len(lengths)), key=lambda i: -lengths[i]):
        if groups and lengths[i] > ALIKE * lengths[groups[-1][0]]:
            groups[-1].append(i)
        else:
            groups.append([i])
    return groups


def fed(simulator: Simulator, y: Array) -> Array:
    """The channels of a recorded drive y (..., T, n_y) that the simulator gets as feedback; it starts from
    all of them."""
    out = fed_back(simulator, y).copy()
    out[..., 0, :] = y[..., 0, :]
    return out


def fed_back(simulator: Simulator, y: Array) -> Array:
    """The channels of another truck's responses y (..., n_y) that the simulator gets as feedback.

    A learned simulator that gets the acceleration it is to predict would reproduce it together with the
    mismatch; it therefore gets only the speed.
    """
    if simulator.parameters():
        return y
    out = np.full_like(y, np.nan)
    out[..., SPEED] = y[..., SPEED]
    return out


def padded(x: Array, length: int) -> Array:
    """x (T, ...), extended to `length` with its last value."""
    more = length - len(x)
    return np.concatenate([x, np.repeat(x[-1:], more, axis=0)]) if more else x
