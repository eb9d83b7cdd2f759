"""Every figure of the report that the verdict calls for, as PNG with a caption."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from deeptruck_model.mismatch.data.checks import derivative
from deeptruck_model.mismatch.data.prepared import SETTLE_S, Prepared
from deeptruck_model.mismatch.finding import Kind
from deeptruck_model.mismatch.report import error_figures, regime_figure, timeline_figure
from deeptruck_model.mismatch.report.drawing import BLUE, GREY, ORANGE, figure, png, strips, tidy
from deeptruck_model.mismatch.report.given import as_given
from deeptruck_model.mismatch.report.wording import counted
from deeptruck_model.mismatch.result import Mismatch
from deeptruck_model.recordings import coverage
from deeptruck_model.recordings.coverage_figure import draw as draw_coverage
from deeptruck_model.signals import SPEED
from deeptruck_model.vehicle_kinds import LEAST_SPEED

Array = NDArray[np.float64]

SMOOTH_S = 1.0
GAPS = (
    f"The force has gaps where nothing is compared: slower than {LEAST_SPEED:g} m/s, and in the first "
    f"{SETTLE_S:g} s and the last second of a recording. Nor is it compared beside samples that are missing "
    "or were set aside."
)
UNRECORDED = "Nor is anything compared where the truck slows hard, as its braking was not recorded."


@dataclass(frozen=True)
class Picture:
    """A PNG, the sentence below it, and the parts it is shown in where it is too tall for paper."""

    png: bytes
    caption: str
    parts: tuple[bytes, ...] = ()

    def _repr_png_(self) -> bytes:
        """By which a notebook shows it."""
        return self.png


def draw(m: Mismatch) -> dict[str, Picture]:
    """Figures by name: timeline, regimes, ranking, errors, horizon_and_regime, unknown, sensors, coverage.

    Only those for which there is anything to draw.
    """
    out = {"timeline": _timeline(m)}
    out |= _where_and_what(m)
    out |= _errors(m)
    measured = [p for p in m.prepared if p.measured_acceleration]
    if measured and any(f.kind is Kind.SENSOR and f.cause is None for f in m.result.findings):
        out["sensors"] = Picture(
            png(sensors(measured, _speed_scale(m))),
            "Accelerometer against the derivative of speed, means over 1 s. Off the grey line a sensor is at "
            "fault: no truck model enters here.",
        )
    out["coverage"] = Picture(
        draw_coverage(coverage(as_given(m.prepared))),
        "What the recordings cover, fit and held out together.",
    )
    return out


def _timeline(m: Mismatch) -> Picture:
    made, ends, left_out = timeline_figure.timeline(m)
    count = f"{left_out} more recording{'s are' if left_out > 1 else ' is'}"
    more = f" {count} not drawn: those with the most to see are." if left_out else ""
    shaded = " Shaded: the strongest stretches in which a finding acts." if m.result.segments else ""
    gaps = f" {_gaps(m)}" if m.evidence is not None else ""
    whole = png(made)
    return Picture(whole, f"The recordings along time.{shaded}{gaps}{more}", strips(whole, ends))


def _gaps(m: Mismatch) -> str:
    """Why the force is not drawn all along."""
    blind = any(p.recording.interface.brake_unit is None for p in m.prepared)
    return f"{GAPS} {UNRECORDED}" if blind else GAPS


def _where_and_what(m: Mismatch) -> dict[str, Picture]:
    out: dict[str, Picture] = {}
    if m.evidence is None or m.explanation is None:
        return out
    regimes = regime_figure.regime_map(m.evidence)
    if regimes is not None:
        out["regimes"] = Picture(
            png(regimes),
            "Observed minus simulated, as a force on the truck, over the two signals that tell most of it. "
            "Left: mean, positive forward. Right: where the squared error gathers.",
        )
    out["ranking"] = Picture(
        png(error_figures.ranking(m.explanation)),
        "How much better each name, tried alone beside all simulator parameters set free, predicts the data: "
        "a first look. The findings weigh the names again, one in place of the other in the whole "
        "explanation, and by the laws that each is like. So these bars differ by other numbers. "
        "1 nat is a factor of e in odds.",
    )
    unnamed = next((f for f in m.result.findings if f.cause is not None and f.cause.predictable), None)
    shape = regime_figure.shape(m.evidence, m.explanation, unnamed.equation) if unnamed else None
    if shape is not None:
        out["unknown"] = Picture(
            png(shape),
            "The force that has no name's form, against what it varies with: means and two standard errors.",
        )
    return out


def _errors(m: Mismatch) -> dict[str, Picture]:
    if m.evidence is None or not m.errors or not len(m.errors["before"].speed):
        return {}
    held_out = [p for p, s in zip(m.prepared, m.evidence.stretches, strict=True) if s.held_out]
    runs = counted(len(m.errors["before"].speed), "free run")
    return {
        "errors": Picture(
            png(error_figures.against_time(m.errors, held_out[0].dt)),
            f"Open-loop error of {runs} on held-out recordings: mean and standard deviation against time.",
        ),
        "horizon_and_regime": Picture(
            png(error_figures.by_horizon_and_regime(m.errors, held_out)),
            "The same free runs by horizon and by condition.",
        ),
    }


def _speed_scale(m: Mismatch) -> float:
    """By what speeds were divided when they were mended; 1 where they were not."""
    found = [f for f in m.result.findings if f.effect == "speed_scale" and f.cause is None]
    return found[0].parameters["value"].value if found else 1.0


def sensors(prepared: list[Prepared], speed_scale: float = 1.0) -> Figure:
    """Accelerometer against differentiated speed as it was recorded, one point a second."""
    made = figure(6.0, 4.4)
    ax = made.add_axes((0.12, 0.13, 0.84, 0.82))
    speeds = [_each_second(p, derivative(p.y[:, SPEED], p.dt)) for p in prepared]
    a = speed_scale * np.concatenate(speeds)
    b = np.concatenate(
        [_each_second(p, np.nan_to_num(p.recording.channels["acceleration"])) for p in prepared]
    )
    ends = np.array([min(a.min(), b.min()), max(a.max(), b.max())])
    ax.plot(ends, ends, color=GREY, lw=1, label="what healthy sensors read")
    ax.scatter(a, b, s=5, color=BLUE, alpha=0.4, lw=0)
    slope, offset = np.polyfit(a, b, 1)
    ax.plot(ends, slope * ends + offset, color=ORANGE, lw=2, label="as recorded")
    tidy(ax)
    ax.set_xlabel("derivative of speed, m/s²", fontsize=9)
    ax.set_ylabel("accelerometer, m/s²", fontsize=9)
    ax.legend(fontsize=8, frameon=False)
    return made


def _each_second(p: Prepared, signal: Array) -> Array:
    per = max(1, round(SMOOTH_S / p.dt))
    middle = slice(per // 2, None, per)
    out: Array = uniform_filter1d(signal, per)[middle][p.valid[middle]]
    return out


__all__ = ["Picture", "draw"]
