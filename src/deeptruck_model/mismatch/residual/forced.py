"""Block averages of samples, stacked over the recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from deeptruck_core.errors import InputError
from deeptruck_core.signals import ACCELERATION
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.prepare.runs import forced
from deeptruck_model.mismatch.residual.evidence import DriveRows
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]


def accelerations(
    simulator: Simulator, prepared: Sequence[Prepared], grid: Grid, us: Sequence[Array]
) -> Array:
    """Simulated accelerations (n,) with the commands `us`, in blocks."""
    return grid.stack([run.y[0, :, ACCELERATION] for run in forced(simulator, prepared, us)])


Mask = NDArray[np.bool_]


class Grid:
    """Block averages of native samples, stacked over the recordings."""

    def __init__(self, prepared: Sequence[Prepared], held_out: Sequence[bool], block: int) -> None:
        self.block, self.prepared = block, prepared
        drives, start = [], 0
        for p, out in zip(prepared, held_out, strict=True):
            rows = len(p.recording) // block
            drives.append(DriveRows(p.recording.name, start, start + rows, p.recording.start_s, out))
            start += rows
        if start == 0:
            raise InputError("the recordings are shorter than one block; record at least a few minutes")
        self.drives = tuple(drives)

    def __len__(self) -> int:
        return self.drives[-1].stop

    def stack(self, parts: Sequence[Array]) -> Array:
        """Block means; NaN in a block with a NaN."""
        return np.concatenate([self._blocks(p).mean(axis=1) for p in parts])

    def last(self, parts: Sequence[Array]) -> Array:
        """Last native sample of each block, for gears and other labels."""
        return np.concatenate([self._blocks(p)[:, -1] for p in parts])

    def any(self, parts: Sequence[Mask]) -> Mask:
        """Blocks that contain a marked sample."""
        return np.concatenate([self._blocks(p).any(axis=1) for p in parts])

    def valid(self) -> Mask:
        return np.concatenate([self._blocks(p.valid).all(axis=1) for p in self.prepared])

    def _blocks(self, x: NDArray[np.generic]) -> NDArray[np.generic]:
        n = len(x) // self.block
        return x[: n * self.block].reshape(n, self.block)
