"""A real truck, `veh002`: free runs on the second half of its log, compared with least squares. With
--every-log a table of all real logs: what import makes of each, and what a generic vehicle lacks.

The logs (docs/recordings.md) are no part of this project: put them under ../shared/data or the folder in
DEEPTRUCK_REAL_DATA. Of veh002 settings, and the delay of the fuel's stamps, were chosen inside the first
half; the second is evaluated here, once.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import harness
import numpy as np

from deeptruck_core.constants import AIR_DENSITY, GRAVITY
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.deep import Arguments, DeepTruck, train
from deeptruck_model.deep.data import common_interface, cut, unexplained
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.recordings import Recording, import_table, split

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


@dataclass(frozen=True)
class Generic:
    """A vehicle of nobody's: traction by its command, drag, rolling resistance, slope; brakes where there are
    commands of them. A fuel rate gives power."""

    interface: TruckInterface
    body: Mapping[str, float]
    dt: float

    def reset(self, y0: Array) -> Array:
        return y0[:, 1].copy()

    def step(self, state: Array, u: Array, w: Array) -> tuple[Array, Array]:
        b, engine = self.body, u[:, 0]
        pull = engine / np.maximum(state, 3.0) if self.interface.engine_unit == "g/s" else engine
        force = b["torque_gain"] * PULLS[self.interface.engine_unit] * pull
        force = force - 0.5 * AIR_DENSITY * b["drag_area"] * state**2
        slope = w[:, 0] if w.shape[1] else 0.0
        speed = state + self.dt * (force / b["mass"] - GRAVITY * (b["rolling_resistance"] + slope))
        speed = np.maximum(speed, 0.0)
        return speed, np.stack([(speed - state) / self.dt, speed], axis=1)

    def force(self, state: Array, y: Array) -> Array:
        return np.where(np.isnan(y[:, 1]), state, y[:, 1])

    def parameters(self) -> dict[str, float]:
        return dict(self.body)

    def with_parameters(self, values: Mapping[str, float]) -> Generic:
        return replace(self, body={**self.body, **values})


TRUCK = {"mass": 25000.0, "drag_area": 6.0, "rolling_resistance": 0.006, "torque_gain": 1.0}
CAR = {"mass": 1400.0, "drag_area": 0.65, "rolling_resistance": 0.01, "torque_gain": 1.0}
# W of 1 g/s of diesel at 40 % efficiency; N of 1 N m of an electric motor through 9.7 and a wheel of 0.35 m
LOOKED_AT_S = 900.0
PULLS = {"g/s": 0.4 * 42.7e3, "N m": 9.7 / 0.35}
EVERY_LOG = (
    "log | by | min | pieces | rows, of them set aside | channels | what a generic vehicle lacks | "
    "speed error, m/s"
)


def of_logs() -> Iterator[str]:
    """A row for each log."""
    with tempfile.TemporaryDirectory() as folder:
        for path in sorted(x for x in harness.DATA.glob("*/*") if x.suffix in (".csv", ".log")):
            layout = LAYOUTS.get(path.parent.name)
            columns: Any = harness.ROOT / "layouts" / "columns" / f"{layout}.yaml" if layout else {}
            got = import_table(path, columns, Path(folder) / path.stem).recordings
            minutes = sum(len(r) * r.dt for r in got) / 60.0
            count = got[0].account.total if got[0].account else None
            channels = ", ".join(c.replace("_", " ") for c in got[0].channels if c in SHOWN)
            rows = f"{count.read:,}, {count.left_out}" if count else "-"
            by = f"`--columns {layout}.yaml`" if layout else "as it is"
            cells = [f"{path.parent.name}/{path.name}", by, f"{minutes:.1f}", f"{len(got)}", rows, channels]
            yield " | ".join([*cells, *by_generic(got)])
            print(cells[0], flush=True)


SHOWN = (
    "engine_command",
    "brake_command",
    "acceleration",
    "grade",
    "gear",
    "engine_speed",
    "elevation",
    "gap",
)


def by_generic(got: list[Recording]) -> tuple[str, str]:
    """The first line about a generic vehicle, and its speed errors as given and as offered."""
    i = got[0].interface
    if i.engine_unit not in PULLS or not any("engine_command" in r.channels for r in got):
        return "no command of a unit that it takes", "-"
    simulator = Generic(
        replace(i, brake_unit=None, fuel=False), CAR if i.vehicle == "car" else TRUCK, got[0].dt
    )
    share = min(1.0, LOOKED_AT_S / sum(len(r) * r.dt for r in got))
    try:
        v = find_mismatch(simulator, split(got, (share, 1.0 - share, 0.0))[0], say=lambda step: None).verdict
    except InputError as error:
        return str(error).partition(";")[0], "-"
    fit = v["fit"]
    offered = {"as_given": "before", "parameters_only": "parameters_only"}.get(fit.get("offered"), "after")
    errors = [(fit.get(part) or {}).get("speed_rmse") for part in ("before", offered)]
    return v["headline"].partition(": ")[0], " -> ".join("-" if x is None else f"{x:.2f}" for x in errors)


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


OF_LOGS = """The logs of [recordings](../recordings.md), which are no part of this project: what
`deeptruck-model import LOG` makes of each, and what `mismatch` says of its first 15 minutes with a vehicle
that is none of these: a truck of 25 t or a car of 1.4 t, a straight line from command to force. Speed error:
free runs along the last 30 % of these minutes, as given, and with what is offered."""
HEADS = " | 15 s: rms | median | pulling: rms | 60 s: rms | median | pulling: rms"
ABOVE = """A heavy diesel on the road, 1 Hz, fuel rate as engine command, grade
from the elevation. The first half of the log trains. Free runs on the second start every 20 s wherever
the next 15 or 60 s can be explained. Speed error at the end of the run, m/s; *pulling* are the runs with fuel
above 0.5 g/s and speed above 6 m/s throughout."""
BELOW = """Braking is not recorded. {share:.1f} % of the second half slows by more than 0.6 m/s² beyond the
grade, which no input explains; those rows end a run. Softer braking stays in: it is part of every error
above, and no model that sees fuel and grade alone can know of it."""


if __name__ == "__main__":
    main()
