"""Minutes of a real truck, `veh002`: trained on these alone, and after a fleet of synthetic trucks.

The log and the test are those of bench_real_truck.py. Training, adapting and the size of the fleet are those
of `python benchmarks/paper/run.py minutes`; only the slopes of the fleet's roads were taken from this truck's
first half.
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OMP_NUM_THREADS", "1")

import tempfile
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path

import harness

sys.path.append(str(harness.ROOT))  # `benchmarks` is no part of the installed packages

# isort: split
import numpy as np
from bench_real_truck import LOG, Deep, LeastSquares, halves, rms, windows
from matplotlib.figure import Figure

from benchmarks.paper.drives import FLEET_SEED, by_fuel, fleet
from benchmarks.paper.experiments import ADAPTED, FLEET, FLEET_MINUTES, MINUTES, SCRATCH
from deeptruck_model.deep import Arguments, train
from deeptruck_model.deep.data import common_interface, cut
from deeptruck_model.recordings import Recording
from deeptruck_model.signals import TruckInterface
from deeptruck_model.trucks.driving_cycles import CycleSettings, RoadSettings

SEGMENTS = 3  # of each number of minutes
ROADS = CycleSettings(road=RoadSettings(limit=0.045))  # steeper than 99 % of the first half
ALONE, LINEAR = "the fleet alone", "least squares"
COLOURS = {LINEAR: "0.4", SCRATCH: "tab:blue", ADAPTED: "tab:red"}

Errors = dict[tuple[str, int], list[list[float]]]
"""By what was fitted and minutes, one list a segment: rms and median after 15 s, then after 60 s."""


def segments(recordings: list[Recording], minutes: int) -> list[list[Recording]]:
    """SEGMENTS pieces of `minutes` of driving, evenly spread over the recordings; gaps do not count."""
    total, length = sum(map(len, recordings)), 60 * minutes
    starts = np.linspace(0, total - length, SEGMENTS).round().astype(int)
    return [_between(recordings, int(start), int(start) + length) for start in starts]


def _between(recordings: list[Recording], start: int, stop: int) -> list[Recording]:
    """Samples start to stop of the concatenated recordings."""
    begins = np.cumsum([0, *map(len, recordings)])
    pieces = [r.piece(max(0, start - b), max(0, stop - b)) for r, b in zip(recordings, begins, strict=False)]
    return [p for p in pieces if len(p) > 3]


def errors(model: LeastSquares | Deep, test: list[Recording]) -> list[float]:
    """Errors of the predicted speed at the end of windows of 15 s and of 60 s, m/s: rms and median magnitude
    of each."""
    found = []
    for seconds in (15, 60):
        u, w, y = windows(test, seconds)
        error = model.speed(u, w, y[:, 0])[:, -1] - y[:, -1, 1]
        found += [rms(error), float(np.median(np.abs(error)))]
    return found


def measure(mine: list[Recording], test: list[Recording], folder: Path) -> Errors:
    """Errors of every kind of model with every amount of the truck's driving."""
    known, found = folder / "fleet", Errors()
    drives = fleet(TruckInterface("fleet"), FLEET, FLEET_MINUTES, FLEET_SEED, ROADS)
    alone = Deep(train([by_fuel(drive, mine[0].dt) for drive in drives], known, Arguments()))
    for key, model in chain([((ALONE, 0), alone)], fitted(mine, known)):
        found.setdefault(key, []).append(errors(model, test))
        print(*key, np.round(found[key][-1], 3), flush=True)
    return found


def fitted(mine: list[Recording], known: Path) -> Iterator[tuple[tuple[str, int], LeastSquares | Deep]]:
    """Fit each kind of model to each segment of `mine`; yield ((kind, minutes), model)."""
    ways: dict[str, Callable[[list[Recording]], LeastSquares | Deep]] = {
        LINEAR: LeastSquares,
        SCRATCH: Deep.trained,
        ADAPTED: lambda part: Deep.trained(part, start=str(known)),
    }
    for minutes in MINUTES:
        for part in segments(mine, minutes):
            for name, fit in ways.items():
                yield (name, minutes), fit(part)


def table(found: Errors) -> list[str]:
    """One row for each kind and amount: the mean over the segments, and their range."""
    rows = []
    for (name, minutes), each in found.items():
        low, mean, high = np.min(each, axis=0), np.mean(each, axis=0), np.max(each, axis=0)
        cells = [_cell(*of) for of in zip(low, mean, high, strict=True)]
        rows.append(f"{f'{minutes} min, ' if minutes else ''}{name} | {' | '.join(cells)}")
    return harness.table(" | 15 s: rms | median | 60 s: rms | median", rows, right=True)


def _cell(low: float, mean: float, high: float) -> str:
    if not np.isfinite(mean):
        return "one ran away"
    return f"{mean:.2f}" + (f" ({low:.2f} to {high:.2f})" if high > low else "")


def draw(found: Errors, path: Path) -> None:
    """Figure of the rms speed error after 60 s against minutes; the bars show the range over the segments."""
    figure = Figure(figsize=(6, 4), layout="constrained")
    axis = figure.subplots()
    for aside, (name, colour) in zip((0.94, 1.0, 1.06), COLOURS.items(), strict=True):
        each = np.array([[e[2] for e in found[name, minutes]] for minutes in MINUTES])
        mean = each.mean(axis=1)
        span = [mean - each.min(axis=1), each.max(axis=1) - mean]
        axis.errorbar(aside * np.array(MINUTES), mean, span, fmt="o-", color=colour, capsize=3, label=name)
    axis.axhline(found[ALONE, 0][0][2], color="0.5", ls=":", label=ALONE)
    axis.set(xscale="log", yscale="log", xlabel="minutes of its own driving", title="veh002")
    axis.set(ylabel="speed error after 60 s, rms [m/s]")
    axis.set_xticks(MINUTES, [str(m) for m in MINUTES])
    axis.set_yticks((1, 2, 4, 8, 16), ("1", "2", "4", "8", "16"))
    axis.minorticks_off()
    axis.legend()
    figure.savefig(path, dpi=120)


def main() -> None:
    """Print the table; write it and the figure."""
    harness.options(__doc__, {})
    harness.check_data(LOG)
    first, second = halves()
    interface = common_interface(first)
    mine, test = ([p for r in part for p in cut(r, interface)] for part in (first, second))
    with tempfile.TemporaryDirectory() as folder:
        found = measure(mine, test, Path(folder))
    lines = [*harness.heading("Minutes of it"), SAYS, "", *table(found), ""]
    harness.store("real_truck", [*lines, "![minutes of data](real_truck_minutes.png)"])
    draw(found, harness.RESULTS / "real_truck_minutes.png")


SAYS = f"""The truck and the free runs of [half a
log](#half-a-log-veh002): the test is the second half of the log. 5, 15 and 60 min of the first half train,
three times each, by segments spread evenly over it; only what can be explained counts as a minute. The
fleet are {FLEET} made-up trucks that drove 20 min each, logged like this truck: 1 Hz, fuel rate as engine
command, grade, no brake. Only how steep their roads are comes from the first half; no setting was chosen on
this truck. Speed error at the end of the run, m/s: the mean of the three segments, in brackets the lowest
and the highest; where one ran away there is no mean. Deep trucks are of one seed each."""


if __name__ == "__main__":
    main()
