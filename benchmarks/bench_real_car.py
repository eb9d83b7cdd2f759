"""A real car, `bmw_i3`: free runs on the last part of every trip, beside least squares.

The trips (TUM, docs/recordings.md) are no part of this project: put them under ../shared/data or the folder
in DEEPTRUCK_REAL_DATA. The last parts are read here, once, with the settings that training chooses by itself.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_model.deep import Arguments, DeepTruck, train
from deeptruck_model.recordings import Recording, import_table

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("DEEPTRUCK_REAL_DATA", ROOT.parent / "shared" / "data")) / "bmw_i3"
COLUMNS = ROOT / "layouts" / "columns" / "bmw_i3.yaml"
RESULTS = ROOT / "docs" / "results" / "real_car.md"
TRIPS = ("TripA01", "TripA11", "TripB17")
TRAINED, EVERY_S, SHORT_S, SEEDS = 0.7, 5, 15, 3

Array = np.ndarray[Any, Any]


def parts() -> tuple[list[Recording], list[Recording]]:
    """The first part of every trip, and the rest."""
    first, rest = [], []
    with tempfile.TemporaryDirectory() as folder:
        for trip in TRIPS:
            (whole,) = import_table(DATA / f"{trip}.csv", COLUMNS, Path(folder) / trip).recordings
            edge = round(TRAINED * len(whole))
            first.append(whole.piece(0, edge))
            rest.append(whole.piece(edge, len(whole)))
    return first, rest


def terms(u: Array, w: Array, v: Array) -> Array:
    """What least squares adds up, (n, 5): torque, drag, friction, grade."""
    return np.stack([u, v * v, v, np.ones_like(v), w], axis=1)


class LeastSquares:
    """The car has one gear, so its acceleration is nearly linear in these terms; fitted over 1 s, where the
    speed's resolution no longer counts, to rows of a car that moves."""

    def __init__(self, pieces: list[Recording]) -> None:
        self.dt, rows, gained = pieces[0].dt, [], []
        n = round(1 / self.dt)
        for p in pieces:
            x = terms(p.u[:, 0], p.w[:, 0], p.y[:, 1])
            means = np.stack([np.convolve(c, np.full(n, 1 / n), "valid")[:-1] for c in x.T], axis=1)
            moves = (p.y[:-n, 1] > 1) & (p.y[n:, 1] > 1)
            rows.append(means[moves])
            gained.append((p.y[n:, 1] - p.y[:-n, 1])[moves])
        self.weights = np.linalg.lstsq(np.concatenate(rows), np.concatenate(gained), rcond=None)[0]

    def speed(self, u: Array, w: Array, y0: Array) -> Array:
        v = [y0[:, 1]]
        for k in range(u.shape[1] - 1):
            gained = terms(u[:, k, 0], w[:, k, 0], v[-1]) @ self.weights
            v.append(np.maximum(v[-1] + gained * self.dt, 0.0))
        return np.stack(v, axis=1)


class Deep:
    """Deep trucks, their mean."""

    def __init__(self, recordings: list[Recording]) -> None:
        with tempfile.TemporaryDirectory() as folder:
            self.truck: DeepTruck = train(recordings, Path(folder) / "car", Arguments(members=SEEDS))

    def speed(self, u: Array, w: Array, y0: Array) -> Array:
        return self.truck.rollout(u, w, y0, None).y[..., 1]


def windows(pieces: list[Recording], seconds: int) -> tuple[Array, Array, Array]:
    """u, w, y (runs, T, n) of every stretch of `seconds`, EVERY_S apart."""
    steps, every = (round(s / pieces[0].dt) for s in (seconds, EVERY_S))
    chosen = [(p, k) for p in pieces for k in range(0, len(p) - steps, every)]
    u, w, y = (np.stack([getattr(p, n)[k : k + steps + 1] for p, k in chosen]) for n in ("u", "w", "y"))
    return u, w, y


def row(name: str, model: LeastSquares | Deep, pieces: list[Recording]) -> str:
    """One line of the table."""
    cells = []
    for seconds in (SHORT_S, 60):
        u, w, y = windows(pieces, seconds)
        error = model.speed(u, w, y[:, 0])[:, -1] - y[:, -1, 1]
        cells += [f"{rms(error):.2f}", f"{np.median(np.abs(error)):.2f}"]
        if seconds == SHORT_S:  # a minute in town has no run without a negative torque
            cells.append(f"{rms(error[(u[:, :-1, 0] >= 0).all(axis=1)]):.2f}")
        print(f"{name}, {seconds} s: {len(error)} runs, {cells}", flush=True)
    return f"| {name} | " + " | ".join(cells) + " |"


def rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def main() -> None:
    if not DATA.exists():
        sys.exit(f"{DATA} is not here; docs/recordings.md says where to get it")
    first, rest = parts()
    deep = Deep(first)
    rows = [row("least squares", LeastSquares(first), rest)]
    rows.append(row(f"deep truck, mean of {SEEDS} seeds", deep, rest))
    minutes = [sum(len(p) * p.dt for p in part) / 60 for part in (first, rest)]
    updates = deep.truck.details["training"]["updates"]
    text = TEXT.format(rows="\n".join(rows), trained=minutes[0], test=minutes[1], updates=updates)
    print(text)
    RESULTS.write_text(text)


TEXT = """# A real car: `bmw_i3`

`python benchmarks/bench_real_car.py`. An electric car, 10 Hz, motor torque (negative when it recuperates) as
engine command, grade from the elevation. Trained on the first 70 % of each of three trips, {trained:.0f} min
and {updates} updates; free runs on the last 30 %, {test:.0f} min, started every {every} s. Speed error at the
end of the run, m/s; *pulling* are the runs whose torque is never negative.

| | 15 s: rms | median | pulling: rms | 60 s: rms | median |
| --- | ---: | ---: | ---: | ---: | ---: |
{rows}

Least squares wins. The car has one gear, so that its acceleration is nearly linear in torque, drag and grade;
the deep truck would have to learn that, and the rest of these trips asks for more than 47 min taught it. The
friction brake is not recorded: a hard stop has no cause in the inputs, and both err there. A trip by hand:

```
deeptruck-model import TripA01.csv --columns layouts/columns/bmw_i3.yaml --out bags/A01
deeptruck-model import TripA11.csv --columns layouts/columns/bmw_i3.yaml --out bags/A11
deeptruck-model train bags/A11 --out simulators/i3 --members 3
deeptruck-model evaluate simulators/i3 bags/A01 --out evaluation
```
""".replace("{every}", str(EVERY_S))


if __name__ == "__main__":
    main()
