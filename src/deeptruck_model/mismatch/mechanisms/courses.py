"""How a coefficient may vary: constant, from a moment on, one for each recording, or along knots.

A `Course` multiplies the columns of a form by `factors`. An `Offer` gives the courses that a set of
recordings can show for a form.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from deeptruck_model.mismatch.mechanisms.symbols import CRAWL_SPEED, PLACE
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.expression import (
    AtPlace,
    Expression,
    InRecording,
    Knot,
    Signal,
    lift,
    tanh,
)
from deeptruck_model.mismatch.rules import Limits

Along = Literal["elapsed", "distance"]

SLOW_KNOT_S = (20.0, 40.0)  # shortest and longest distance of the finer knots
COARSER = 3.0
SLOW_SIZES = (0.025, 0.1)  # m/s^2 sd of a force that is time-varying
FINE_M = 100.0  # knots of a hilly road
MOST_KNOTS = 80
BIN_M = 10.0  # in which a road is counted
CONDITIONS = ("speed", "grade", "engine")  # signals that part driving
SOFT = 0.05  # of a signal's range, over which a condition begins


@dataclass(frozen=True)
class Course:
    """Variation of a coefficient; this base class is constant: one coefficient for each column, on every
    drive."""

    @property
    def sd(self) -> float | None:
        """Prior sd of a coefficient; None where it is that of the form's column."""
        return None

    @property
    def varies_in_time(self) -> bool:
        """Whether it has knots in time or along the road, and can therefore represent any slow force."""
        return False

    @property
    def general(self) -> bool:
        """Whether it is valid on other drives too."""
        return True

    def factors(self) -> Iterator[tuple[str, Expression]]:
        """Factors on the columns, each with a suffix for their names."""
        yield "", lift(1.0)


ALWAYS = Course()


@dataclass(frozen=True)
class FromMoment(Course):
    """A factor of 0 until `after_s` (s) in recording `first` of `count`, and of 1 afterwards. In simulations
    of other drives the factor is 1 throughout."""

    first: int
    after_s: float
    count: int

    def factors(self) -> Iterator[tuple[str, Expression]]:
        later: Expression = InRecording(self.first, from_s=self.after_s, elsewhere=1.0)
        for i in range(self.first + 1, self.count):
            later = later + InRecording(i)
        yield "", later


@dataclass(frozen=True)
class EachDrive(Course):
    """A coefficient for each of the recordings `names`; in a simulation of another drive each has the share
    `mean`."""

    names: tuple[str, ...]
    mean: float
    size: float | None = None  # prior sd of a coefficient

    @property
    def sd(self) -> float | None:
        return self.size

    @property
    def general(self) -> bool:
        return False

    def factors(self) -> Iterator[tuple[str, Expression]]:
        for i, name in enumerate(self.names):
            yield f"[{name}]", InRecording(i, elsewhere=self.mean)


@dataclass(frozen=True)
class Spline(Course):
    """A linear spline with knots every `spacing` along `along` (s, or m), `knots` of them in each recording.

    A `shared` spline has the same knots, at road positions, for all recordings. `size` is the prior sd of a
    coefficient. In a simulation of another drive each knot has the share `mean`.
    """

    along: Along
    knots: tuple[int, ...]
    names: tuple[str, ...]
    spacing: float
    mean: float
    size: float
    shared: bool = False

    @property
    def sd(self) -> float | None:
        return self.size

    @property
    def varies_in_time(self) -> bool:
        return True

    @property
    def general(self) -> bool:
        return self.shared

    def factors(self) -> Iterator[tuple[str, Expression]]:
        signal, unit = (Signal(self.along),), "s" if self.along == "elapsed" else "m"
        for i, count in enumerate(self.knots):
            for k in range(count):
                at = k * self.spacing
                if self.shared:
                    yield f"[{at:.0f} {unit}]", AtPlace((PLACE,), at, self.spacing, self.mean)
                else:
                    label = f"[{self.names[i]}, {at:.0f} {unit}]"
                    yield label, Knot(signal, i, at, self.spacing, self.mean)


@dataclass(frozen=True)
class Where(Course):
    """One where a signal exceeds `above`, or is below it if `below`, and zero elsewhere, with a smooth change
    over `width`, both in the signal's unit."""

    signal: str
    above: float
    width: float
    below: bool

    def __post_init__(self) -> None:
        if self.signal not in CONDITIONS or not self.width > 0.0:
            raise ValueError(f"{self.signal!r} within {self.width} is no condition")

    @property
    def expression(self) -> Expression:
        """The factor itself."""
        beyond = (Signal(self.signal) - self.above) * (0.5 / self.width)
        return (1.0 + tanh(-beyond if self.below else beyond)) * 0.5

    def factors(self) -> Iterator[tuple[str, Expression]]:
        yield "", self.expression


COURSES = {kind.__name__: kind for kind in (Course, FromMoment, EachDrive, Spline, Where)}

Offer = Callable[[Evidence, Expression], Iterator[Course]]
"""The courses that recordings can show of a coefficient that multiplies an expression."""


def always(e: Evidence, carrier: Expression) -> Iterator[Course]:
    """One constant coefficient."""
    yield ALWAYS


def each_drive(sd: float | None = None, *, more_than: int = 1, most: float = MOST_KNOTS) -> Offer:
    """A coefficient for every recording, for between `more_than` and `most` recordings."""

    def offer(e: Evidence, carrier: Expression) -> Iterator[Course]:
        if more_than < len(e.drives) <= most:
            fitted = sum(not s.held_out for s in e.drives)
            yield EachDrive(tuple(s.name for s in e.drives), 1.0 / max(fitted, 1), sd)

    return offer


def each_wind(e: Evidence, carrier: Expression) -> Iterator[Course]:
    """A coefficient for every recording; a simulation uses the mean of all."""
    if 1 < len(e.drives) <= MOST_KNOTS:
        yield EachDrive(tuple(s.name for s in e.drives), 1.0 / len(e.drives))


def from_moments(e: Evidence, carrier: Expression) -> Iterator[Course]:
    """32 start times that are evenly spread, and the start of every recording."""
    spread = np.arange(len(e))[:: max(1, len(e) // 32)].tolist()
    yield from _from_each(_starts(e) | set(spread), e)


def from_standstills(e: Evidence, carrier: Expression) -> Iterator[Course]:
    """Start times at standstills and starts of recordings, where a load may change."""
    entering = np.flatnonzero(np.diff((e["speed"] < CRAWL_SPEED).astype(int)) > 0) + 1
    yield from _from_each(_starts(e) | set(entering.tolist()), e, 24)


def conditions(e: Evidence) -> list[Where]:
    """Conditions in which an effect may act and otherwise not: above or below a third and two thirds of the
    speeds, slopes and engine forces that were driven."""
    out = []
    for signal in CONDITIONS:
        x = e[signal][e.valid & np.isfinite(e[signal])] if signal in e.signals else np.zeros(0)
        if len(x):
            low, *borders, high = np.quantile(x, [0.05, 1.0 / 3.0, 2.0 / 3.0, 0.95])
            out += [
                Where(signal, float(border), SOFT * float(high - low), below)
                for border in borders
                for below in (False, True)
                if low < border < high
            ]
    return out


def _starts(e: Evidence) -> set[int]:
    return {s.start for s in e.drives}


def _from_each(points: set[int], e: Evidence, most: int | None = None) -> Iterator[FromMoment]:
    inner = [p for p in sorted(points) if 0.04 * len(e) < p < 0.96 * len(e)]
    inner = inner[:: max(1, len(inner) // most)] if most else inner
    record, elapsed = e.record, e["elapsed"]
    for p in inner:
        yield FromMoment(int(record[p]), float(elapsed[p]), len(e.drives))


def slowly(largest: float, along: Along = "elapsed", *, quick: bool = True) -> Offer:
    """Knots in time or distance, separate in every recording.

    All names get the same knots and the same force sizes, up to the `largest` physically possible sd of their
    coefficient, so that between two names only the variation with the carrier decides. Unless `quick`, an
    effect cannot change from one of the finer knots to the next.
    """

    def offer(e: Evidence, carrier: Expression) -> Iterator[Course]:
        moving = e.valid & (e["speed"] > CRAWL_SPEED)
        typical = float(np.sqrt(np.mean(np.square(carrier.rows(e)[moving])))) if moving.any() else 0.0
        if typical <= 0.0:
            return
        pace = float(np.mean(e["speed"][moving])) if along == "distance" else 1.0
        lengths = [float(np.ptp(e[along][s.rows])) for s in e.drives]
        spare = max(MOST_KNOTS - 2 * len(lengths), 1)
        fine_s = float(np.clip(len(e) * e.dt / spare, *SLOW_KNOT_S))
        for knot_s in (fine_s, COARSER * fine_s) if quick else (COARSER * fine_s,):
            for sd in sorted({min(size / typical, largest) for size in SLOW_SIZES}):
                yield profile(e, along, share_out(lengths, knot_s * pace), knot_s * pace, sd)

    return offer


def along_the_road(largest: float) -> Offer:
    """Profiles over distance, separate in every recording, and profiles shared by all passes of a road
    position; as slow as wind, and as fine as hills."""

    def offer(e: Evidence, carrier: Expression) -> Iterator[Course]:
        lengths = [float(np.ptp(e["distance"][s.rows])) for s in e.drives]
        fine = [
            profile(e, "distance", share_out(lengths, knot), knot, largest) for knot in (FINE_M, 2.5 * FINE_M)
        ]
        for own in (*slowly(largest, "distance")(e, carrier), *fine):
            assert isinstance(own, Spline)
            yield own
            yield from of_all(e, own)

    return offer


def share_out(lengths: Sequence[float], spacing: float) -> list[int]:
    """Number of knots for each recording at `spacing`, up to MOST_KNOTS in total; later recordings get none.

    Spreading the knots over a log of many hours would place them too far apart to resolve anything.
    """
    out, left = [], MOST_KNOTS
    for length in lengths:
        count = int(length / spacing) + 2
        count = count if count <= left else (left if left == MOST_KNOTS else 0)
        out.append(count)
        left -= count
    return out


def profile(e: Evidence, along: Along, knots: Sequence[int], spacing: float, sd: float) -> Spline:
    """A spline with the given number of knots in each recording; a simulation uses the mean over fitted
    recordings."""
    fitted = sum(k for k, s in zip(knots, e.drives, strict=True) if not s.held_out)
    mean = 1.0 / max(fitted or sum(knots), 1)
    return Spline(along, tuple(knots), tuple(s.name for s in e.drives), spacing, mean, sd)


def of_all(e: Evidence, spline: Spline) -> Iterator[Spline]:
    """The spline with knots at road positions, shared by all drives that pass; wider apart if the road is
    long. None if hardly any of it is driven twice."""
    known = e.valid & (e["place"] >= 0.0)
    driven = float(np.sum(e["speed"][known])) * e.dt
    if driven < Limits.times_driven * BIN_M * len(np.unique((e["place"][known] / BIN_M).astype(int))):
        return
    last = float(np.max(e["place"][known], initial=0.0))
    spacing = max(spline.spacing, last / (MOST_KNOTS - 2))
    knots = int(last / spacing) + 2
    yield replace(spline, knots=(knots,), spacing=spacing, shared=True, mean=1.0 / knots)
