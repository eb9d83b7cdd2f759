"""A real car, `bmw_i3`: free runs on the last part of every trip, compared with a least-squares model.

The trips (TUM, docs/recordings.md) are no part of this project: put them under ../shared/data or the folder
in DEEPTRUCK_REAL_DATA. The last parts were evaluated for the default settings first, then for the chosen
ones. --choose reads only the first parts, trains on the beginning of each and prints the errors of every one
of CANDIDATES on its remainder; the settings were chosen by these errors.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import tempfile
from pathlib import Path
from typing import Any

import harness
import numpy as np
from bench_real_truck import Array, Deep, rms, windows

from deeptruck_model.recordings import Recording, import_table

DATA = harness.DATA / "bmw_i3"
COLUMNS = harness.ROOT / "layouts" / "columns" / "bmw_i3.yaml"
TRIPS = ("TripA01", "TripA11", "TripB17")
TRAINED, EVERY_S, SHORT_S, SEEDS = 0.7, 5, 15, 3
CHOSEN: dict[str, Any] = {"kind": "grey", "learning_rate": 2e-3}
CANDIDATES: tuple[dict[str, Any], ...] = (
    {},
    {"kind": "grey"},
    {"kind": "grey", "hidden": 24},
    {"kind": "grey", "learning_rate": 2e-3},
    {"kind": "grey", "weight_decay": 0.1},
)


def trips() -> list[Recording]:
    """The whole trips."""
    with tempfile.TemporaryDirectory() as folder:
        return [
            import_table(DATA / f"{trip}.csv", COLUMNS, Path(folder) / trip).recordings[0] for trip in TRIPS
        ]


def parts(whole: list[Recording]) -> tuple[list[Recording], list[Recording]]:
    """The first part of every recording, and its remainder."""
    edges = [round(TRAINED * len(r)) for r in whole]
    return (
        [r.piece(0, edge) for r, edge in zip(whole, edges, strict=True)],
        [r.piece(edge, len(r)) for r, edge in zip(whole, edges, strict=True)],
    )


def terms(u: Array, w: Array, v: Array) -> Array:
    """The regressors of the least-squares model, (n, 5): torque, drag, friction, grade."""
    return np.stack([u, v * v, v, np.ones_like(v), w], axis=1)


class LeastSquares:
    """Linear least squares on rows of a moving car, whose one gear makes its acceleration nearly linear in
    these terms. Fitted to means over 1 s, for which the resolution of the speed does not matter."""

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


def trained(recordings: list[Recording], **settings: Any) -> Deep:
    """The mean of deep trucks of some seeds."""
    return Deep.trained(recordings, members=SEEDS, **settings)


def row(name: str, model: LeastSquares | Deep, pieces: list[Recording]) -> str:
    """One line of the table."""
    cells = []
    for seconds in (SHORT_S, 60):
        u, w, y = windows(pieces, seconds, EVERY_S)
        error = model.speed(u, w, y[:, 0])[:, -1] - y[:, -1, 1]
        cells += [f"{rms(error):.2f}", f"{np.median(np.abs(error)):.2f}"]
        if seconds == SHORT_S:  # a minute in town has no run without a negative torque
            cells.append(f"{rms(error[(u[:, :-1, 0] >= 0).all(axis=1)]):.2f}")
        print(f"{name}, {seconds} s: {len(error)} runs, {cells}", flush=True)
    return f"{name} | {' | '.join(cells)}"


def choose(training: list[Recording], validation: list[Recording]) -> None:
    """Train every candidate setting and print its errors on validation drives, a row each."""
    print(row("least squares", LeastSquares(training), validation))
    for settings in CANDIDATES:
        print(row(f"deep truck, {settings}", trained(training, **settings), validation), flush=True)


def main() -> None:
    chooses = harness.options(__doc__, {"--choose": False}).choose
    harness.check_data(DATA)
    first, rest = parts(trips())
    if chooses:
        choose(*parts(first))
        return
    deep = trained(first, **CHOSEN)
    rows = [row("least squares", LeastSquares(first), rest)]
    rows.append(row(f"deep truck, {CHOSEN}", deep, rest))
    rows.append(row("deep truck, default settings", trained(first), rest))
    learned, tested = (sum(len(p) * p.dt for p in part) / 60 for part in (first, rest))
    updates = deep.truck.details["training"]["updates"]
    above = ABOVE.format(trained=learned, test=tested, updates=updates, every=EVERY_S)
    lines = [
        *harness.heading("An electric car: `bmw_i3`"),
        above,
        "",
        *harness.table(HEADS, rows, right=True),
    ]
    harness.store("real_truck", [*lines, "", BELOW])


HEADS = " | 15 s: rms | median | pulling: rms | 60 s: rms | median"
ABOVE = """An electric car, 10 Hz, motor torque (negative when it recuperates) as
engine command, grade from the elevation. Trained on the first 70 % of each of three trips, {trained:.0f} min
and {updates} updates; free runs on the last 30 %, {test:.0f} min, started every {every} s. Speed error at the
end of the run, m/s; *pulling* are the runs whose torque is never negative."""
BELOW = f"""Deep trucks are the mean of {SEEDS} seeds. The grey kind and a learning rate of 2e-3 were chosen
inside the first parts, by the rms after 15 s (`--choose` prints every candidate). The car has one gear, so
that its acceleration is nearly linear in torque, drag and grade; least squares starts there. The friction
brake is not recorded: a hard stop has no cause in the inputs, and all err there. A trip by hand:

```bash
deeptruck-model import TripA01.csv --columns layouts/columns/bmw_i3.yaml --out bags/A01
deeptruck-model import TripA11.csv --columns layouts/columns/bmw_i3.yaml --out bags/A11
deeptruck-model train bags/A11 --out simulators/i3 --members 3
deeptruck-model evaluate simulators/i3 bags/A01 --out evaluation
```"""


if __name__ == "__main__":
    main()
