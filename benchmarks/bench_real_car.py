"""A real car, `bmw_i3`: the slope of its roads from its accelerometer, withheld and recovered, and what
training gains from it.

python benchmarks/bench_real_car.py [--updates 1200] [--out build/real_car]

Trips of an electric car (TUM). The logs (docs/recordings.md) are no part of this project: put them under
../shared/data or the folder in DEEPTRUCK_REAL_DATA. NEAR_M, the length over which a road is
the same, was chosen after results with 2 and 4 km were seen; no other setting was chosen on them.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import harness
import numpy as np

from deeptruck_core.constants import GRAVITY
from deeptruck_exam.real.withheld import LAYOUTS, trained, whole_log, withhold
from deeptruck_model.mismatch import find_mismatch
from deeptruck_model.recordings import Recording, split
from deeptruck_model.recordings.grade import with_slope
from deeptruck_model.simulators import Simulator, free_run, load

Array = np.ndarray[Any, Any]

TRAINERS = ("A06", "A07", "A08")
JUDGED = ("A01", "A03", "A04", "A05", "A09", "A10", "A11", "A13", "A14", "B17")
WINTER = "B17"
HORIZON_S, SETTLE_S, WINDOW_S = 40.0, 5.0, 10.0
STEP_M, NEAR_M = 20.0, 6000.0  # as in mismatch/roads/windows.py: shorter spans agree by chance
LEAST_ALIKE = 0.9  # correlation from which two spans of NEAR_M are one road
HEADS = "trip | km | compared | named | correlation | left over | speed error, m/s"
HARD = 2.0  # m/s^2, mean over a second: the motor's -87 N m and resistance slow by less
KM = (0.0, 1.0, 4.0, 10.0, 50.0)
FREE = "grade of the trips | rms, m/s | median, m/s | without hard stops: rms"
SINCE = "km driven before | runs | mean, m/s | rms, m/s"


def trip(name: str, folder: Path) -> list[Recording]:
    """The pieces of one trip, with all channels."""
    return whole_log(harness.DATA / "bmw_i3" / f"Trip{name}.csv", LAYOUTS / "bmw_i3.yaml", folder / name)


def judged(
    name: str, simulator: Simulator, fit: Sequence[Recording], held: Sequence[Recording], folder: Path
) -> str:
    """What the tool says of fitted recordings, and what its correction does along held-out ones; a row that
    `folder` has is read from there."""
    path = folder / f"{name}.txt"
    if path.exists():
        return path.read_text()
    found = find_mismatch(simulator, fit, held)
    v, e = found.verdict, found.evidence
    line = v["headline"].rpartition(": ")[0].replace(NAMED, "slope")
    correlation = "-"
    if e is not None and "felt_slope" in e.signals:
        named = [f.force for f in found.findings if f.force is not None and f.effect == "road_grade"]
        felt, k = -GRAVITY * e["felt_slope"], max(1, round(WINDOW_S / e.dt))
        use = e.valid & np.isfinite(felt)
        count = int(use.sum()) // k * k
        if named and count >= 3 * k:
            means = [x[use][:count].reshape(-1, k).mean(axis=1) for x in (felt, sum(named))]
            correlation = f"{np.corrcoef(means)[0, 1]:.2f}"
    fit_ = v["fit"] or {}
    offered = {"as_given": "before", "parameters_only": "parameters_only"}.get(fit_.get("offered"), "after")
    errors = [(fit_.get(part) or {}).get("speed_rmse") for part in ("before", "after", offered)]
    parts = (v.get("budget") or {}).get("parts", ())
    left = next((p["share"] for p in parts if p["part"] == "left_over"), None)
    km = sum(float(np.nansum(r.channels["speed"])) * r.dt for r in (*fit, *held)) / 1000.0
    compared = "-" if v["data"]["compared"] is None else f"{v['data']['compared']:.0%}"
    speed = " -> ".join("-" if x is None else f"{x:.2f}" for x in errors)
    left_over = "-" if left is None else f"{left:.0%}"
    row = f"{name} | {km:.1f} | {compared} | {line} | {correlation} | {left_over} | {speed}"
    print(row, flush=True)
    path.write_text(row)
    return row


def free_errors(model: Simulator | Plain, pieces: Sequence[Recording]) -> Array:
    """Free runs of HORIZON_S, started every HORIZON_S, (runs, 3): speed error at the end, kilometres driven
    at the start, and the hardest second of slowing, m/s^2."""
    out = []
    for r in pieces:
        r = replace(r, interface=replace(r.interface, grade=model.interface.grade))
        n, km = round(HORIZON_S / r.dt), np.cumsum(np.nan_to_num(r.channels["speed"])) * r.dt / 1000.0
        for k in range(round(SETTLE_S / r.dt), len(r) - n - 1, n):
            part = r.piece(k, k + n + 1)
            speed, second = part.channels["speed"], round(1.0 / r.dt)
            known = np.isfinite(part.columns((*part.interface.u, *part.interface.w, "speed"))).all()
            if known and speed.min() > 0.5:
                y = model.free_run(part) if isinstance(model, Plain) else _free(model, part)
                out.append((y - speed[-1], km[k], float((speed[second:] - speed[:-second]).min())))
    return np.array(out)


def _free(simulator: Simulator, part: Recording) -> float:
    return float(free_run(simulator, part.u[None], part.w[None], part.y[:1]).y[0, -1, 1])


class Plain:
    """Five numbers by robust least squares on means over a second: gains of torque that pulls and slows, and
    a resistance of 1, v and v^2."""

    def __init__(self, pieces: Sequence[Recording]) -> None:
        self.interface = pieces[0].interface
        found = [self._rows(r) for r in pieces]
        x, y = (np.concatenate(column) for column in zip(*found, strict=True))
        weight = np.ones(len(y))
        for _ in range(20):
            self.b = np.linalg.lstsq(x * weight[:, None] ** 0.5, y * weight**0.5, rcond=None)[0]
            off = np.abs(y - x @ self.b)
            weight = 1.0 / (1.0 + (off / (2.0 * 1.4826 * np.median(off))) ** 2)

    @staticmethod
    def terms(torque: Array, v: Array) -> Array:
        return np.stack([np.maximum(torque, 0), np.minimum(torque, 0), np.ones_like(v), v, v * v], axis=-1)

    def _rows(self, r: Recording) -> tuple[Array, Array]:
        count, second = len(r), round(1.0 / r.dt)
        rate = np.gradient(r.channels["speed"]) / r.dt
        columns = np.stack([r.u[:, 0], r.channels["speed"], rate + GRAVITY * r.w.sum(axis=1)])
        torque, v, y = columns[:, : count // second * second].reshape(3, -1, second).mean(axis=2)
        use = (v > 1.0) & np.isfinite(torque + y)
        return self.terms(torque, v)[use], y[use]

    def free_run(self, part: Recording) -> float:
        """The speed at the end of a recording, from its first."""
        v = part.channels["speed"][0]
        for torque, slope in zip(part.u[:-1, 0], part.w[:-1].sum(axis=1), strict=True):
            v = max(v + (self.terms(torque, v) @ self.b - GRAVITY * slope) * part.dt, 0.0)
        return float(v)


def of_another_day(trips: dict[str, list[Recording]]) -> dict[str, list[Recording]]:
    """Spans of trips with the slope that another trip felt on the same road, the same way or turned."""
    profiles = {name: _profile(pieces) for name, pieces in trips.items()}
    width = round(NEAR_M / STEP_M)
    out: dict[str, list[Recording]] = {}
    for name, pieces in trips.items():
        distance, own = profiles[name]
        for at in range(0, len(own) - width + 1, width):
            span = own[at : at + width]
            best, slope = LEAST_ALIKE, None
            for other, (_, there) in profiles.items():
                for road in (there, -there[::-1]) if other != name else ():
                    if len(road) < width:
                        continue
                    near = np.lib.stride_tricks.sliding_window_view(road, width)
                    a, b = span - span.mean(), near - near.mean(axis=1, keepdims=True)
                    alike = b @ a / np.maximum(np.linalg.norm(a) * np.linalg.norm(b, axis=1), 1e-9)
                    if alike.max() > best:
                        best, slope = float(alike.max()), near[int(alike.argmax())]
            if slope is None:
                continue
            (r,) = pieces
            rows = np.flatnonzero((distance >= at * STEP_M) & (distance < (at + width) * STEP_M))
            part = r.piece(int(rows[0]), int(rows[-1]) + 1)
            along = (distance[rows] - at * STEP_M) / STEP_M
            grade = np.interp(along, np.arange(width) + 0.5, slope)
            out.setdefault(name, []).append(replace(part, channels={**part.channels, "grade": grade}))
    return out


def _profile(pieces: Sequence[Recording]) -> tuple[Array, Array]:
    """Distance (n,), m, of a trip's one piece, and its felt slope every STEP_M."""
    (r,) = pieces
    distance = np.cumsum(np.nan_to_num(r.channels["speed"])) * r.dt
    grid = np.arange(0.5 * STEP_M, distance[-1], STEP_M)
    return distance, np.interp(grid, distance, r.channels["grade"])


def free_row(what: str, runs: Array) -> str:
    """A line of the table of free runs."""
    errors, soft = runs[:, 0], runs[:, 2] > -HARD
    row = f"{what}, {len(errors)} runs | {rms(errors):.2f} | {np.median(np.abs(errors)):.2f}"
    row += f" | {rms(errors[soft]):.2f} of {soft.sum()}"
    print(row, flush=True)
    return row


def since_start(runs: Array) -> list[str]:
    """Lines of the table of signed errors by the distance driven before, without hard stops."""
    out = []
    for low, high in pairwise(KM):
        error = runs[(runs[:, 1] >= low) & (runs[:, 1] < high) & (runs[:, 2] > -HARD), 0]
        out.append(f"{low:g} to {high:g} | {len(error)} | {error.mean():+.2f} | {rms(error):.2f}")
        print(out[-1], flush=True)
    return out


def rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def main() -> None:
    given = harness.options(
        __doc__,
        {
            "--updates": (1200, "of the car's simulators"),
            "--out": (harness.ROOT / "build" / "real_car", "a stopped run in it goes on"),
        },
    )
    harness.check_data(harness.DATA / "bmw_i3" / "TripA11.csv")
    folder = given.out
    first = [r for t in TRAINERS for r in trip(t, folder)]
    unseen = {t: trip(t, folder) for t in JUDGED}
    whole = [r for pieces in unseen.values() for r in pieces]
    sources = {
        "none": ([withhold(r) for r in first], [withhold(r) for r in whole]),
        "elevation": ([r for x in first for r in with_slope([x], "elevation")],
                      [r for x in whole for r in with_slope([x], "elevation")]),
        "accelerometer, fused with elevation": (first, whole),
    }  # fmt: skip
    plain = Plain(first)
    rows, simulators = [free_row("accelerometer, five numbers", free_errors(plain, whole))], {}
    for name, (learned, runs) in sources.items():
        simulators[name] = load(trained(learned, folder / name.partition(",")[0], given.updates))
        rows.append(free_row(name, errors := free_errors(simulators[name], runs)))
    *_, felt = simulators.values()
    since = since_start(errors)
    rows.append(free_row(f"of these {WINTER}, in winter", free_errors(felt, unseen[WINTER])))
    elsewhere = of_another_day(unseen | {t: trip(t, folder) for t in TRAINERS})
    if again := [r for t in JUDGED for r in elsewhere.get(t, [])]:
        level = free_errors(simulators["none"], [withhold(r) for r in again])
        rows.append(free_row("none, on roads that another trip drove", level))
        rows.append(free_row("accelerometer of another trip there", free_errors(felt, again)))
    table = []
    for name, pieces in unseen.items():
        halves = split([withhold(r) for r in pieces], (0.5, 0.5, 0.0))[:2]
        table.append(judged(name, simulators["none"], *halves, folder))
    named = sum("slope," in row for row in table)
    lines = [
        *harness.heading("An electric car: `bmw_i3`"), ABOVE, "", *harness.table(FREE, rows, right=True), "",
        SINCE_START, "", *harness.table(SINCE, since, right=True), "",
        MIDDLE, "", *harness.table(HEADS, table), "",
        f"The slope is named in {named} of {len(unseen)}.", BELOW,
    ]  # fmt: skip
    harness.store("real_truck", lines)


NAMED = "The road's slope, which your log has in its accelerometer"
ABOVE = f"""Free runs of {HORIZON_S:g} s of deep trucks of an electric car, trained on trips
{", ".join(TRAINERS)} of summer, along {", ".join(JUDGED)},
which they have not seen; speed error at the end. Five numbers: gains of pulling and braking torque and a
resistance of 1, v and v², by least squares on the same trips. A hard stop has a second beyond
{HARD:g} m/s², where the friction brake, which is not recorded, adds to the motor's. A drive's own slope
contains its own dv/dt where that changes within 50 m; the last row takes the slope of another trip on the
same road, found by spans of {NEAR_M / 1000:g} km (chosen after 2 and 4 km had been seen)."""
SINCE_START = """With the accelerometer's slope, without hard stops, by the distance driven before; a positive
error is a simulator that is too fast."""
MIDDLE = """Slope, heights and positions are withheld; the tool has the accelerometer and a simulator without
slope. The first half of a trip is fitted, the second held out. Correlation: 10 s means of the force named
road_grade with the slope of the drive's own accelerometer, not with the true one. Named: in the first line,
with its share of the squared error. Free runs along the held-out half: as given -> corrected -> what is
offered."""
BELOW = "Settings of noise for learned simulators were chosen on A04 and A13."


if __name__ == "__main__":
    main()
