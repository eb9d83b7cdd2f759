"""Whether a fault that the truck's own controllers told was active while a force acts.

It is told beside a finding and decides nothing: two things at once need not be cause and effect.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.data.prepared import LEAST_DRIVING_S, Prepared
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.strength import acts

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

DERATE = 1569  # SPN by which an engine says that it holds torque back
FAULT_ODDS = 3.0  # times as often as without a fault a force must act with it, for the fault to be named


@dataclass(frozen=True)
class ActiveFault:
    """A code, and its shares of the time in which the force acts and of the other time. `fmi` is None for a
    derate, which engines tell by several.
    """

    spn: int
    fmi: int | None
    while_acting: float
    otherwise: float

    def __str__(self) -> str:
        code = f"SPN {self.spn}" if self.fmi is None else f"SPN {self.spn} FMI {self.fmi}"
        what = f"the engine's derate ({code})" if self.fmi is None else f"a fault ({code})"
        return (
            f"{what} was active in {100.0 * self.while_acting:.0f} % of the time in which it acts, "
            f"and in {100.0 * self.otherwise:.0f} % of the other time"
        )

    def to_json(self) -> dict[str, Any]:
        """`active_fault` of an entry of `findings`."""
        shares = {"while_acting": round(self.while_acting, 3), "otherwise": round(self.otherwise, 3)}
        return vars(self) | shares

    @staticmethod
    def read(entry: Mapping[str, Any] | None) -> ActiveFault | None:
        """From verdict.json; None where a finding has none."""
        return None if entry is None else ActiveFault(**entry)


def active_fault(force: Array, e: Evidence, prepared: Sequence[Prepared]) -> ActiveFault | None:
    """The fault that was active for most of the time in which a force (n,) acts, where it is one of those
    times and not of all: over half of them, and by FAULT_ODDS.
    """
    acting = np.zeros(len(force), dtype=bool)
    acting[e.valid] = acts(force[e.valid])
    told = [
        fault
        for (spn, fmi), on, known in _faults(e, prepared)
        if (fault := _shares(spn, fmi, on, known & e.valid, acting, e.dt))
    ]
    return max(told, key=lambda fault: fault.while_acting, default=None)


def _shares(spn: int, fmi: int | None, on: Mask, known: Mask, acting: Mask, dt: float) -> ActiveFault | None:
    inside, outside = known & acting, known & ~acting
    free = float((known & ~on).sum()) * dt
    if not inside.any() or not outside.any() or free < LEAST_DRIVING_S:
        return None
    share, often = float(on[inside].mean()), float(on[known].mean())
    odds = share * (1 - often) >= FAULT_ODDS * (1 - share) * often
    if share < 0.5 or not odds:
        return None
    return ActiveFault(spn, fmi, share, float(on[outside].mean()))


def _faults(e: Evidence, prepared: Sequence[Prepared]) -> Iterator[tuple[tuple[int, int | None], Mask, Mask]]:
    """Each code with where it was active and where that is known, (n,); a derate first."""
    derate, spn, fmi = (_stacked(n, e, prepared) for n in ("derate_active", "fault_spn", "fault_fmi"))
    if (derate == 1.0).any():
        yield (DERATE, None), derate == 1.0, ~np.isnan(derate)
    known = ~np.isnan(spn) & ~np.isnan(fmi)
    for code in sorted(set(zip(spn[known].tolist(), fmi[known].tolist(), strict=True))):
        if code[0] > 0:
            yield (int(code[0]), int(code[1])), (spn == code[0]) & (fmi == code[1]), known


def _stacked(name: str, e: Evidence, prepared: Sequence[Prepared]) -> Array:
    """A channel at the first sample of each row of the evidence, NaN where it was not recorded."""
    out = np.full(len(e), np.nan)
    for p, s in zip(prepared, e.stretches, strict=True):
        if name in p.recording.channels:
            block = round(e.dt / p.dt)
            out[s.rows] = p.recording.channels[name][::block][: s.stop - s.start]
    return out
