"""The result of a comparison: the verdict, and the data and simulators behind it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from deeptruck_core.errors import InputError
from deeptruck_core.signals import shown
from deeptruck_model.mismatch.correction.corrected_truck import CorrectedTruck
from deeptruck_model.mismatch.correction.fit_result import Errors
from deeptruck_model.mismatch.prepare.prepared import Prepared
from deeptruck_model.mismatch.report import lines
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.verdict.result import Finding, Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Mismatch:
    """The verdict and the data that the report plots; None if nothing could be compared.

    `errors` are those of free runs along the held-out drives: `before`, `parameters_only` and `after` the
    correction; and of the simulator as given along the drives that were `fitted`.
    """

    result: Verdict
    evidence: Evidence | None
    errors: Mapping[str, Errors]
    corrected: CorrectedTruck | None
    prepared: tuple[Prepared, ...]
    refitted: CorrectedTruck | None = None

    def __repr__(self) -> str:
        """The findings in one line, because the fields hold all samples."""
        names = ", ".join(f.effect for f in self.findings) or "no finding"
        return f"<Mismatch: {self.result.kind}; {names}; {'' if self.result.validated else 'not '}validated>"

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings, in the order of verdict.json."""
        return self.result.findings

    @property
    def verdict(self) -> dict[str, Any]:
        """The content of verdict.json."""
        return self.verdict_in("m/s")

    def verdict_in(self, units: str) -> dict[str, Any]:
        """The content of verdict.json, the speeds of its sentences in `units`."""
        said = [shown(line, units) for line in lines.lines(self.result)]
        headline = shown(lines.headline(self.result), units)
        return {**self.result.to_json(), "headline": headline, "sentences": said}

    def plot(self, recording: str | None = None) -> Figure:
        """A figure of what is missing along a recording over time, measured minus simulated acceleration in
        means of a second, and of what the findings explain, m/s^2. Without a name, along the recording in
        which they act most. Raises InputError for a recording that was not compared."""
        from matplotlib.figure import Figure  # seconds, and only for this

        e = self.evidence
        if e is None:
            raise InputError("nothing was compared, so that there is nothing to plot")
        first = self.result.segments[0].recording if self.result.segments else e.drives[0].name
        drive = next((s for s in e.drives if s.name == (recording or first)), None)
        if drive is None:
            raise InputError(
                f"there is no recording '{recording}'; there are {', '.join(s.name for s in e.drives)}"
            )
        rows, mean = drive.rows, max(1, round(1.0 / e.dt))
        figure = Figure(figsize=(9.0, 4.0), layout="constrained")
        axes = figure.add_subplot(xlabel="time, s", ylabel="m/s²", title=drive.name)
        missing = np.where(e.valid[rows], e.residual[rows], np.nan)
        time = drive.start_s + e.dt * np.arange(len(missing))
        axes.plot(time, np.convolve(missing, np.full(mean, 1.0 / mean), "same"), color="0.6", label="missing")
        for f in self.findings:
            if f.force is not None:
                axes.plot(time, f.force[rows], label=f.effect.replace("_", " "))
        axes.legend()
        return figure

    def _repr_html_(self) -> str:
        """The sentences, for a notebook."""
        first, *rest = (escape(line) for line in lines.lines(self.result))
        return f"<strong>{first}</strong><ul>{''.join(f'<li>{line}</li>' for line in rest)}</ul>"
