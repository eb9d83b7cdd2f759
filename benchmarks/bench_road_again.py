"""Is a stretch that was driven before predicted better? The real truck `veh002` without its elevation.

python benchmarks/bench_road_again.py [--work runs/road_again]        (needs DEEPTRUCK_REAL_DATA)

The mismatch tool recovers slopes blind. A second deep truck is trained on the same drives with these as
grade. On drives that trained neither, wherever the force of 6 km agrees with that of another pass (the same
way, or the other with its sign turned), a minute is driven free with the slope of that pass. It begins half a
minute after the 6 km.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deeptruck_exam.concealed import SOURCES, examine_concealed
from deeptruck_model import deep, simulators
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.correction.recovered_road import Roads, with_road
from deeptruck_model.mismatch.data.prepared import prepare
from deeptruck_model.recordings import Recording, read
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]

STEP_M, PAST, NEXT = 100.0, 60, 25  # steps of 100 m: 6 km to find the place by, 2.5 km to drive
EVERY = 5  # steps between two tries
AGREES = 0.9  # as in mismatch/road_lock.py, where by chance 99 % of windows agree less
SETTLE_S, FREE_S = 100, 60
SEAM_S = 30  # between the 6 km and the free minute: a recovered slope is smoothed over 8 s on either side
RESAMPLED = 2000
UPDATES = 1200


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


def main() -> None:
    """Print the table and write it to docs/results/road_again.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", type=Path, default=Path("runs/road_again"))
    args = parser.parse_args()
    if not examine_concealed(args.work, sources=SOURCES[:1]):
        print("left out: DEEPTRUCK_REAL_DATA names no folder with the log of veh002")
        return
    folder = args.work / SOURCES[0].name
    roads = Roads.read(folder / "found")
    taught = folder / "with_road"
    if not (taught / simulators.MANIFEST).exists():
        teach, _ = with_road(roads, read(folder / "recordings" / "fit"))
        deep.train(teach, taught, deep.Arguments(updates=UPDATES))
    blind, knowing = simulators.load(folder / "simulator"), simulators.load(taught)
    drives = [
        drive
        for part in ("fit", "held")
        for drive in profiles(roads, read(folder / "recordings" / part), part == "held")
    ]
    lines = table(drives, starts(drives), blind, knowing)
    out = Path(__file__).parents[1] / "docs" / "results" / "road_again.md"
    out.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


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


def starts(drives: Sequence[Drive]) -> list[Start]:
    """Every place of a held-out drive that another pass is found to have been at."""
    seen = [(i, k) for i, d in enumerate(drives) for k in range(len(d.slope) - PAST + 1)]
    windows = np.stack([drives[i].slope[k : k + PAST] for i, k in seen])
    windows -= windows.mean(axis=1, keepdims=True)
    out = []
    for n in range(0, len(seen), EVERY):
        i, k = seen[n]
        if not drives[i].held:
            continue
        elsewhere = np.array([j != i or abs(m - k) > PAST + NEXT for j, m in seen])
        for window, reverse in ((windows[n], False), (-windows[n][::-1], True)):
            size = np.sum(windows**2, axis=1) + np.sum(window**2)
            alike = np.where(elsewhere, 2.0 * windows @ window / (size + 1e-12), -1.0)
            best = int(np.argmax(alike))
            j, m = seen[best]
            ahead = _ahead(drives[j].slope, m, reverse)
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


def table(drives: Sequence[Drive], found: Sequence[Start], blind: Simulator, knowing: Simulator) -> list[str]:
    """Errors of speed in free runs of a minute."""
    other = np.roll(np.arange(len(found)), len(found) // 2)
    of = np.array([s.drive for s in found])
    errors = {
        "trained without slopes": drive_free(drives, found, blind, None),
        "trained with recovered slopes, on the slope of the other pass": drive_free(
            drives, found, knowing, np.stack([s.ahead for s in found])
        ),
        "the same, told that the road is level from there": drive_free(
            drives, found, knowing, np.zeros((len(found), NEXT))
        ),
        "the same, on the slope of another place": drive_free(
            drives, found, knowing, np.stack([found[n].ahead for n in other])
        ),
    }
    first = errors["trained without slopes"]
    lines = [
        "# A stretch that was driven before",
        "",
        "`python benchmarks/bench_road_again.py`",
        "",
        f"The truck `veh002` without its elevation: {len(found)} minutes (they overlap) of",
        f"{len(set(of))} drives that trained no truck, wherever the force of 6 km agrees with that of",
        "another pass. Speed error in the free minute that begins half a minute later (m/s), and how much",
        "smaller its rms is than without slopes (95 %, resampled drives).",
        "",
        "| deep truck | rms over 60 s | rms at 60 s | median at 60 s | smaller by |",
        "|---|---|---|---|---|",
    ]
    for name, e in errors.items():
        low, high = interval(first, e, of)
        rms, end = np.sqrt(np.mean(e**2)), np.sqrt(np.mean(e[:, -1] ** 2))
        said = "" if e is first else f"{1 - rms / np.sqrt(np.mean(first**2)):.2f} ({low:.2f} to {high:.2f})"
        lines.append(f"| {name} | {rms:.2f} | {end:.2f} | {np.median(np.abs(e[:, -1])):.2f} | {said} |")
    return lines


def drive_free(
    drives: Sequence[Drive], found: Sequence[Start], truck: Simulator, ahead: Array | None
) -> Array:
    """Speed errors (starts, FREE_S): fed the recording over the end of the 6 km and the seam, then free;
    `ahead` is the slope from the seam on, of a truck that has it as an input."""
    parts = [drives[s.drive].recording for s in found]
    cuts = [slice(s.sample - SETTLE_S, s.sample + SEAM_S + FREE_S + 1) for s in found]
    ready = [prepare(r, False, truck.interface.y) for r in parts]
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


def interval(first: Array, other: Array, of: NDArray[np.intp]) -> tuple[float, float]:
    """95 % interval of how much smaller the rms of `other` is, over resampled drives."""
    rng, names = np.random.default_rng(0), np.unique(of)
    a, b = np.mean(first**2, axis=1), np.mean(other**2, axis=1)
    gains = []
    for _ in range(RESAMPLED):
        pick = np.concatenate([np.flatnonzero(of == name) for name in rng.choice(names, len(names))])
        gains.append(1.0 - np.sqrt(b[pick].mean() / a[pick].mean()))
    low, high = np.quantile(gains, [0.025, 0.975])
    return float(low), float(high)


if __name__ == "__main__":
    main()
