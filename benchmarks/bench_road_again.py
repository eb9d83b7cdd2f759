"""Is a stretch that was driven before predicted better? Two real trucks without their elevation.

python benchmarks/bench_road_again.py [--work runs/road_again]        (needs DEEPTRUCK_REAL_DATA)

The mismatch tool recovers slopes blind, of each truck from its own drives. A second deep truck is trained on
the same drives with these as grade. On drives that trained neither, wherever the force of 6 km agrees with
that of another pass (the same way, or the other with its sign turned), a minute is driven free with the slope
of that pass, by the same truck or by the other one. It begins half a minute after the 6 km.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.real.withheld import SOURCES, examine_withheld
from deeptruck_model import deep, simulators
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.correction.recovered_road import Roads, with_road
from deeptruck_model.mismatch.data.prepared import prepare
from deeptruck_model.mismatch.residual.stretches import likeness, turned
from deeptruck_model.recordings import Recording, read
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]

STEP_M, PAST, NEXT = 100.0, 60, 25  # steps of 100 m: 6 km to find the place by, 2.5 km to drive
EVERY = 5  # steps between two tries
AGREES = 0.9  # as in mismatch/road_lock.py, where by chance 99 % of windows agree less
SETTLE_S, FREE_S = 100, 60
SEAM_S = 30  # between the 6 km and the free minute: a recovered slope is smoothed over 8 s on either side
RESAMPLED, FEWEST = 2000, 3
UPDATES = 1200
NAMES = ("veh002", "veh003")
HEAD = (
    "# A stretch that was driven before",
    "",
    "`python benchmarks/bench_road_again.py`",
    "",
    "Two trucks without their elevation. On drives that trained no deep truck, 6 km are sought whose force",
    "agrees with that of another pass. A free minute begins half a minute later. Told is its speed error",
    "(m/s), and how much smaller its rms is than without slopes (95 %, resampled drives, if three or more).",
)


@dataclass(frozen=True)
class Drive:
    """A recording with its blind slope every STEP_M; `held` where it trained no truck."""

    recording: Recording
    distance: Array
    slope: Array
    held: bool


@dataclass(frozen=True)
class Start:
    """Where a minute is driven: drive, sample at which the 6 km end, slope of the SETTLE_S before, and of the
    other pass ahead."""

    drive: int
    sample: int
    past: Array
    ahead: Array


@dataclass(frozen=True)
class Truck:
    """A truck's drives, and its deep trucks: trained without slopes and with the recovered ones."""

    name: str
    drives: list[Drive]
    blind: Simulator
    knowing: Simulator


def main() -> None:
    """Print the tables and write them to docs/results/road_again.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", type=Path, default=Path("runs/road_again"))
    args = parser.parse_args()
    sources = [s for s in SOURCES if s.name in NAMES]
    examined = examine_withheld(args.work, sources=sources)
    if len(examined) < len(NAMES):
        print("left out: DEEPTRUCK_REAL_DATA names no folder with the logs of the two trucks")
        return
    a, b = (truck(args.work / name, name) for name in NAMES)
    lines = [*HEAD, *sizes(examined), *table(a, a), *table(a, b), *table(b, b), *table(b, a)]
    out = Path(__file__).parents[1] / "docs" / "results" / "road_again.md"
    out.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def sizes(examined: Sequence[Mapping[str, Any]]) -> list[str]:
    """How the recovered slopes agree with the concealed ones, means over 21 s."""
    lines = [
        "",
        "## Recovered and concealed slope",
        "",
        "| truck | windows | correlation | slope of the line |",
    ]
    lines.append("|---|---|---|---|")
    for one in examined:
        if one["source"] in NAMES and (agreed := one["agreement"]):
            told = f"{agreed['windows']} | {agreed['correlation']:.2f} | {agreed['slope']:.2f} |"
            lines.append(f"| `{one['source']}` | {told}")
    return lines


def truck(folder: Path, name: str) -> Truck:
    """What is known of a truck, in the folder of its blind examination; a deep truck trains there once."""
    roads = Roads.read(folder / "found")
    taught = folder / "with_road"
    if not (taught / simulators.MANIFEST).exists():
        teach, _ = with_road(roads, read(folder / "recordings" / "fit"))
        deep.train(teach, taught, deep.Arguments(updates=UPDATES))
    drives = [
        drive
        for part in ("fit", "held")
        for drive in profiles(roads, read(folder / "recordings" / part), part == "held")
    ]
    return Truck(name, drives, simulators.load(folder / "simulator"), simulators.load(taught))


def profiles(roads: Roads, recordings: Sequence[Recording], held: bool) -> list[Drive]:
    """The recordings of which a slope was told."""
    out = []
    for r in recordings:
        try:
            (graded,), _ = with_road(roads, [r])
        except InputError:
            continue
        distance = np.cumsum(np.nan_to_num(r.channels["speed"])) * r.dt
        grid = np.arange(0.0, distance[-1], STEP_M)
        out.append(Drive(r, distance, np.interp(grid, distance, graded.channels["grade"]), held))
    return out


def starts(drives: Sequence[Drive], passes: Sequence[Drive]) -> list[Start]:
    """Every place of a held-out drive that another pass is found to have been at: one of the same truck,
    where `passes` are its own drives, or of another."""
    seen = [(i, k) for i, d in enumerate(passes) for k in range(len(d.slope) - PAST + 1)]
    windows = np.stack([passes[i].slope[k : k + PAST] for i, k in seen])
    windows -= windows.mean(axis=1, keepdims=True)
    sought = [(i, k) for i, d in enumerate(drives) for k in range(len(d.slope) - PAST + 1)][::EVERY]
    out = []
    for i, k in sought:
        if not drives[i].held:
            continue
        window = drives[i].slope[k : k + PAST] - drives[i].slope[k : k + PAST].mean()
        elsewhere = np.array([passes is not drives or j != i or abs(m - k) > PAST + NEXT for j, m in seen])
        for way, reverse in ((window, False), (turned(window[None])[0], True)):
            alike = np.where(elsewhere, likeness(way[None], windows)[0], -1.0)
            best = int(np.argmax(alike))
            j, m = seen[best]
            ahead = _ahead(passes[j].slope, m, reverse)
            start = _start(drives, i, k, ahead) if alike[best] > AGREES and ahead is not None else None
            out += [start] if start is not None else []
    return out


def _ahead(slope: Array, begin: int, reverse: bool) -> Array | None:
    """The other pass's slope over the NEXT steps, as this drive will feel it; None where it ends before."""
    if reverse:
        return -slope[begin - NEXT : begin][::-1] if begin >= NEXT else None
    end = begin + PAST
    return slope[end : end + NEXT] if end + NEXT <= len(slope) else None


def _start(drives: Sequence[Drive], i: int, k: int, ahead: Array) -> Start | None:
    d = drives[i]
    sample = int(np.searchsorted(d.distance, (k + PAST) * STEP_M))
    # without braking, which is not recorded
    whole = prepare(d.recording, False).valid[sample : sample + SEAM_S + FREE_S]
    if sample < SETTLE_S or sample + SEAM_S + FREE_S >= len(d.distance) or whole.mean() < 0.9:
        return None
    grid = STEP_M * np.arange(len(d.slope))
    return Start(i, sample, np.interp(d.distance[sample - SETTLE_S : sample], grid, d.slope), ahead)


def table(truck: Truck, by: Truck) -> list[str]:
    """Errors of a truck's speed in free runs of a minute, on slopes that truck `by` has told."""
    found = starts(truck.drives, by.drives)
    whose = "another pass of its own" if by is truck else f"a pass of `{by.name}`"
    lines = ["", f"## `{truck.name}` on the road of {whose}", ""]
    if not found:
        return [*lines, "No place was found."]
    other = np.roll(np.arange(len(found)), len(found) // 2)
    of = np.array([s.drive for s in found])
    ahead = np.stack([s.ahead for s in found])
    errors = {
        "trained without slopes": drive_free(truck.drives, found, truck.blind, None),
        "trained with recovered slopes, on the slope of that pass": drive_free(
            truck.drives, found, truck.knowing, ahead
        ),
        "the same, told that the road is level from there": drive_free(
            truck.drives, found, truck.knowing, np.zeros((len(found), NEXT))
        ),
        "the same, on the slope of another place": drive_free(
            truck.drives, found, truck.knowing, ahead[other]
        ),
    }
    first = errors["trained without slopes"]
    lines += [
        f"{len(found)} minutes (they overlap) of {len(set(of))} drives.",
        "",
        "| deep truck | rms over 60 s | rms at 60 s | median at 60 s | smaller by |",
        "|---|---|---|---|---|",
    ]
    for name, e in errors.items():
        rms, end = np.sqrt(np.mean(e**2)), np.sqrt(np.mean(e[:, -1] ** 2))
        said = "" if e is first else f"{1 - rms / np.sqrt(np.mean(first**2)):.2f}{interval(first, e, of)}"
        lines.append(f"| {name} | {rms:.2f} | {end:.2f} | {np.median(np.abs(e[:, -1])):.2f} | {said} |")
    return lines


def drive_free(
    drives: Sequence[Drive], found: Sequence[Start], truck: Simulator, ahead: Array | None
) -> Array:
    """Speed errors (starts, FREE_S): fed the recording over the end of the 6 km and the seam, then free;
    `ahead` is the slope from the seam on, of a truck that has it as an input."""
    parts = [drives[s.drive].recording for s in found]
    cuts = [slice(s.sample - SETTLE_S, s.sample + SEAM_S + FREE_S + 1) for s in found]
    ready = [prepare(r, False, truck.interface) for r in parts]
    u, y = (np.stack([getattr(p, f)[c] for p, c in zip(ready, cuts, strict=True)]) for f in ("u", "y"))
    past, grid = np.stack([s.past for s in found]), STEP_M * np.arange(NEXT)
    state, way, out = truck.reset(y[:, 0]), np.zeros(len(found)), []
    for k in range(SETTLE_S + SEAM_S + FREE_S):
        w = np.zeros((len(found), 0))
        if ahead is not None:
            beyond = [np.interp(x, grid, row) for x, row in zip(way, ahead, strict=True)]
            w = past[:, k, None] if k < SETTLE_S else np.array(beyond)[:, None]
        state, response = truck.step(state, u[:, k], w)
        if k < SETTLE_S + SEAM_S:
            state, speed = truck.force(state, y[:, k + 1]), y[:, k + 1, 1]
        else:
            speed = response[:, 1]
            out.append(speed - y[:, k + 1, 1])
        way += speed * truck.dt if k >= SETTLE_S else 0.0
    return np.stack(out, axis=1)


def interval(first: Array, other: Array, of: NDArray[np.intp]) -> str:
    """95 % interval of how much smaller the rms of `other` is, over resampled drives; of two drives there is
    none."""
    rng, names = np.random.default_rng(0), np.unique(of)
    if len(names) < FEWEST:
        return ""
    a, b = np.mean(first**2, axis=1), np.mean(other**2, axis=1)
    gains = []
    for _ in range(RESAMPLED):
        pick = np.concatenate([np.flatnonzero(of == name) for name in rng.choice(names, len(names))])
        gains.append(1.0 - np.sqrt(b[pick].mean() / a[pick].mean()))
    low, high = np.quantile(gains, [0.025, 0.975])
    return f" ({low:.2f} to {high:.2f})"


if __name__ == "__main__":
    main()
