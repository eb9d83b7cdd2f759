"""A real truck, `veh002`: free runs on the second half of its log, compared with least squares. With
--every-log a table of all real logs: what import makes of each.

The logs (docs/recordings.md) are no part of this project: put them under ../shared/data or the folder in
DEEPTRUCK_REAL_DATA. Of veh002 settings, and the delay of the fuel's stamps, were chosen inside the first
half; the second is evaluated here, once.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import harness
import numpy as np

from deeptruck_model.deep import Arguments, DeepTruck, train
from deeptruck_model.deep.data import common_interface, cut, unexplained
from deeptruck_model.recordings import Recording, import_table
from deeptruck_model.recordings.consistency.sensors import doubts

LOG = harness.DATA / "vt_heavy_truck" / "veh002_all.csv"
COLUMNS = harness.ROOT / "layouts" / "columns" / "veh002.yaml"
EVERY = 20  # s between starts
SEEDS = 3

Array = np.ndarray[Any, Any]


def halves() -> tuple[list[Recording], list[Recording]]:
    """Recordings that end within the first half of the driven time, and the others."""
    with tempfile.TemporaryDirectory() as folder:
        recordings = import_table(LOG, COLUMNS, Path(folder) / "bag").recordings
    ends = np.cumsum([len(r) for r in recordings])
    early = ends <= ends[-1] / 2
    return (
        [r for r, e in zip(recordings, early, strict=True) if e],
        [r for r, e in zip(recordings, early, strict=True) if not e],
    )


def terms(u: Array, w: Array, v: Array) -> Array:
    """The regressors of the least-squares model, (n, terms): fuel over speed, fuel, drag, friction, grade."""
    return np.stack([u / np.maximum(v, 3.0), u, v * v, v, np.ones_like(v), *w.T], axis=1)


class LeastSquares:
    """Linear least squares on the rows in which the engine drives, simulated as free runs."""

    def __init__(self, pieces: list[Recording]) -> None:
        pairs = [
            (terms(p.u[:-1, 0], p.w[:-1], p.y[:-1, 1]), np.diff(p.y[:, 1]), p.u[:-1, 0], p.y[:-1, 1])
            for p in pieces
        ]
        x, gained, fuel, speed = (np.concatenate(column) for column in zip(*pairs, strict=True))
        pulls = (fuel > 0.5) & (speed > 6) & np.isfinite(x).all(axis=1) & np.isfinite(gained)
        self.weights = np.linalg.lstsq(x[pulls], gained[pulls], rcond=None)[0]

    def speed(self, u: Array, w: Array, y0: Array) -> Array:
        v = [y0[:, 1]]
        for k in range(u.shape[1] - 1):
            v.append(np.maximum(v[-1] + terms(u[:, k, 0], w[:, k], v[-1]) @ self.weights, 0.0))
        return np.stack(v, axis=1)


class Deep:
    """The mean of some deep trucks."""

    def __init__(self, truck: DeepTruck) -> None:
        self.truck = truck

    @classmethod
    def trained(cls, recordings: list[Recording], **settings: Any) -> Deep:
        with tempfile.TemporaryDirectory() as folder:
            return cls(train(recordings, Path(folder) / "truck", Arguments(**settings)))

    def speed(self, u: Array, w: Array, y0: Array) -> Array:
        return self.truck.rollout(u, w, y0, None).y[..., 1]


def windows(pieces: list[Recording], seconds: int, every_s: int = EVERY) -> tuple[Array, Array, Array]:
    """u, w, y (runs, T, n) of all segments of `seconds`, `every_s` apart."""
    steps, every = (round(s / pieces[0].dt) for s in (seconds, every_s))
    chosen = [(p, k) for p in pieces for k in range(0, len(p) - steps, every)]
    u, w, y = (np.stack([getattr(p, n)[k : k + steps + 1] for p, k in chosen]) for n in ("u", "w", "y"))
    return u, w, y


def row(name: str, model: LeastSquares | Deep, pieces: list[Recording]) -> str:
    """One line of the table."""
    cells = []
    for seconds in (15, 60):
        u, w, y = windows(pieces, seconds)
        error = model.speed(u, w, y[:, 0])[:, -1] - y[:, -1, 1]
        pulls = (u[:, :-1, 0] > 0.5).all(axis=1) & (y[..., 1] > 6).all(axis=1)
        cells += [f"{rms(error):.2f}", f"{np.median(np.abs(error)):.2f}", f"{rms(error[pulls]):.2f}"]
        runs = f"{len(error)} and {pulls.sum()}"
        print(f"{name}, {seconds} s: {runs} runs, {cells[-3:]}", flush=True)
    return f"{name} | {' | '.join(cells)}"


def rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


LAYOUTS = {"bmw_i3": "bmw_i3", "fhwa_pav": "fhwa_pav", "openacc": "openacc", "vt_heavy_truck": "veh002"}
NOT_LISTED = ("speed", "latitude", "longitude", "ambient_temperature", "brake_switch")
EVERY_LOG = (
    "log | `--columns` | min | pieces | read | set aside: rows | samples | channels besides speed | doubts"
)


def of_logs() -> Iterator[str]:
    """A row for each log."""
    with tempfile.TemporaryDirectory() as folder:
        for path in sorted(x for x in harness.DATA.glob("*/*") if x.suffix in (".csv", ".log")):
            layout = LAYOUTS.get(path.parent.name)
            columns: Any = harness.ROOT / "layouts" / "columns" / f"{layout}.yaml" if layout else {}
            got = import_table(path, columns, Path(folder) / path.stem).recordings
            account = got[0].account
            assert account is not None  # import counts what it reads
            samples = sum(one.left_out for one in account.channels.values())
            named = [c for c in got[0].channels if not c.endswith("lamp") and "fault" not in c]
            cells = [
                f"{path.parent.name}/{path.name}",
                f"{layout}.yaml" if layout else "none",
                f"{sum(len(r) * r.dt for r in got) / 60.0:.1f}",
                f"{len(got)}",
                f"{account.total.read:,} {account.items}",
                f"{account.total.left_out}",
                f"{samples}",
                ", ".join(c.replace("_", " ") for c in named if c not in NOT_LISTED),
                "; ".join(one.says for one in doubts(got)) or "none",
            ]
            yield " | ".join(cells)


def main() -> None:
    if harness.options(
        __doc__, {"--every-log": (False, "the table of all logs, and nothing else")}
    ).every_log:
        rows = list(of_logs())
        harness.store("real", [*harness.heading("Every log"), OF_LOGS, "", *harness.table(EVERY_LOG, rows)])
        return
    harness.check_data(LOG)
    first, second = halves()
    interface = common_interface(first)
    training, test = ([p for r in part for p in cut(r, interface)] for part in (first, second))
    share = np.concatenate([unexplained(r, interface) for r in second]).mean()
    rows = [row("least squares", LeastSquares(training), test)]
    for kind in ("black", "grey"):
        deep = Deep.trained(first, members=SEEDS, kind=kind)
        rows.append(row(f"deep truck, {kind}, mean of {SEEDS} seeds", deep, test))
    lines = [*harness.heading("Half a log: `veh002`"), ABOVE, "", *harness.table(HEADS, rows, right=True)]
    harness.store("real_truck", [*lines, "", BELOW.format(share=100 * share)])


OF_LOGS = """The logs of [recordings](../recordings.md), which are no part of this project, as
`deeptruck-model import` takes them: with a file of `layouts/columns`, or as they are. Import counts what it
sets aside with the reason. Doubts: channels that contradict one another."""
HEADS = " | 15 s: rms | median | pulling: rms | 60 s: rms | median | pulling: rms"
ABOVE = """A heavy diesel on the road, 1 Hz, fuel rate as engine command, grade from the elevation. The first
half of the log trains. Free runs on the second start every 20 s. Speed error at the end, m/s; *pulling*: runs
with fuel above 0.5 g/s and speed above 6 m/s throughout."""
BELOW = """Braking is not recorded. Rows that slow by more than 0.6 m/s² beyond the grade ({share:.1f} % of
the second half) end a run; softer braking is part of every error above."""


if __name__ == "__main__":
    main()
