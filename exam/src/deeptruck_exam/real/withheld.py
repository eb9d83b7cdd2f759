"""Real recordings with a withheld channel: the tool runs first, then its recovered profile is compared with
it.

The simulator is a deep truck trained without the withheld channel. The data are not part of the project;
missing logs are skipped.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core import files
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_exam.cases.case import Case
from deeptruck_exam.tool import run_tool, summary
from deeptruck_model import simulators
from deeptruck_model.recordings import Recording, import_table, read, split, write_bag

LAYOUTS = Path(__file__).parents[4] / "layouts" / "columns"
WINDOW_S = 21.0
HIDE = ("elevation", "grade", "latitude", "longitude")


@dataclass(frozen=True)
class Source:
    """A log, the layout that reads it, the channels to withhold, and the logs that train a simulator (by
    default its own first part)."""

    name: str
    log: str
    layout: str
    trained_on: tuple[str, ...] = ()
    least_s: float = 60.0  # shorter pieces are left out
    share: float = 0.6  # of the log, to fit; the rest is held out
    hide: tuple[str, ...] = HIDE


SOURCES = (
    Source("veh002", "vt_heavy_truck/veh002_all.csv", "veh002.yaml"),
    Source("veh003", "vt_heavy_truck/veh003_all.csv", "veh002.yaml"),
    Source("bmw_i3 A11", "bmw_i3/TripA11.csv", "bmw_i3.yaml", ("bmw_i3/TripA01.csv", "bmw_i3/TripB17.csv")),
    Source("bmw_i3 A01", "bmw_i3/TripA01.csv", "bmw_i3.yaml", ("bmw_i3/TripB17.csv",)),
    Source("bmw_i3 B17", "bmw_i3/TripB17.csv", "bmw_i3.yaml", ("bmw_i3/TripA01.csv",)),
    Source(
        "normal.log",
        "j1939_csu/normal.log",
        "",
        least_s=5.0,
        share=1.0,  # 30 s: one recording, nothing to hold out
        hide=(*HIDE, "gear", "engine_speed"),
    ),
)


@dataclass(frozen=True)
class Agreement:
    """Recovered against withheld profile: means over WINDOW_S seconds, their correlation, and the slope of
    the regression of recovered on withheld."""

    windows: int
    correlation: float
    slope: float


def examine_withheld(
    out: Path,
    data: Path,
    *,
    sources: Sequence[Source] = SOURCES,
    updates: int = 1200,
) -> list[dict[str, Any]]:
    """Run each source whose log is in `data`; writes withheld.json into `out` and returns its content. A
    source with a result there is not run again."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / "withheld.json"
    results: list[dict[str, Any]] = json.loads(path.read_text()) if path.exists() else []
    for source in sources:
        if any(r["source"] == source.name for r in results):
            continue
        if not (data / source.log).exists():
            print(f"{source.name}: skipped, no {source.log} in {data}")
            continue
        results.append(_examine(source, data, out / source.name.replace(" ", "_"), updates))
        files.write(path, json.dumps(results, indent=1).encode())
    return results


def _examine(source: Source, folder: Path, out: Path, updates: int) -> dict[str, Any]:
    layout: Path | dict[str, Any] = LAYOUTS / source.layout if source.layout else {}
    whole = whole_log(folder / source.log, layout, out / "import")
    parts = split(whole, (source.share, 1.0 - source.share, 0.0))
    fit, held = ([r for r in part if len(r) * r.dt > source.least_s] for part in parts[:2])
    opened = _written_blind(fit, out / "recordings" / "fit", source.hide)
    if held:
        opened += _written_blind(held, out / "recordings" / "held", source.hide)
    trainers = [
        r
        for k, log in enumerate(source.trained_on)
        for r in whole_log(folder / log, layout, out / f"import_{k}")
    ]
    simulator = trained([withhold(r, source.hide) for r in trainers or fit], out / "simulator", updates)
    case = Case(out, str(simulator), ("fit",), ("held",) if held else (), {}, "")
    run = run_tool(case, out / "found", limit_s=3600.0)
    profile = out / "found" / "profiles.csv"
    agreement = None
    if profile.exists():
        agreement = compare_profile(read_profiles(profile), opened)
    return {
        "source": source.name,
        "returncode": run.returncode,
        "seconds": run.seconds,
        **summary(run),
        "says": run.says if run.returncode else "",
        "agreement": asdict(agreement) if agreement else None,
    }


def _written_blind(part: Sequence[Recording], bag: Path, hide: Sequence[str] = HIDE) -> list[Recording]:
    """Write the recordings without the hidden channels; returns them complete, with the names and starts that
    a reader gives them."""
    if not bag.exists():
        blind = [withhold(r, hide) for r in part]
        write_bag(bag, blind, interface=blind[0].interface)
    seen = read(bag)
    if [len(r) for r in seen] != [len(r) for r in part]:
        raise InputError(f"{bag} was cut otherwise when read back; remove its folder and run again")
    return [replace(r, name=s.name, start_s=s.start_s) for r, s in zip(part, seen, strict=True)]


def whole_log(log: Path, layout: Path | dict[str, Any], bag: Path) -> list[Recording]:
    """Every piece of a log with all its channels; imported each time, because the bag has no other use."""
    bag.parent.mkdir(parents=True, exist_ok=True)
    return import_table(log, layout, bag, overwrite=True).recordings


def withhold(recording: Recording, hide: Sequence[str] = HIDE) -> Recording:
    """The recording without the channels in `hide`: by default slope, height and position."""
    shown = {name: values for name, values in recording.channels.items() if name not in hide}
    return replace(recording, channels=shown, interface=replace(recording.interface, grade=False))


def trained(recordings: Sequence[Recording], path: Path, updates: int) -> Path:
    """A deep truck of the recordings at `path`, trained if there is none yet."""
    from deeptruck_model import deep

    if not (path / simulators.MANIFEST).exists():
        deep.train(recordings, path, deep.Arguments(updates=updates))
    return path


Profiles = Mapping[str, tuple[Array, Array]]
"""Per recording name: times s and recovered slopes."""


def read_profiles(path: Path) -> Profiles:
    """The recovered slopes in a profiles.csv (columns recording, time_s, distance_m, name,
    value)."""
    rows: dict[str, list[tuple[float, float]]] = {}
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            if row["name"] in ("grade", "road_grade"):
                rows.setdefault(row["recording"], []).append((float(row["time_s"]), float(row["value"])))
    return {key: (np.array(v)[:, 0], np.array(v)[:, 1]) for key, v in rows.items()}


def compare_profile(profiles: Profiles, withheld: Sequence[Recording]) -> Agreement | None:
    """Recovered slope against the withheld one over all windows that have both; None if there are fewer than
    three.

    `withheld` are the recordings with all channels, under the names that the tool used.
    """
    known = [r for r in withheld if r.name in profiles and "grade" in r.channels]
    found = [_windows(profiles[r.name], r) for r in known]
    rows = np.concatenate(found) if found else np.zeros((0, 2))
    rows = rows[np.isfinite(rows).all(axis=1)]
    if len(rows) < 3:
        return None
    recovered, true = rows.T
    return Agreement(
        len(rows),
        float(np.corrcoef(recovered, true)[0, 1]),
        float(np.polyfit(true, recovered, 1)[0]),
    )


def _windows(profile: tuple[Array, Array], piece: Recording) -> Array:
    """(windows, 2): means of recovered and of withheld slope."""
    time, value = profile
    since_bag = piece.start_s > 0.0 and time.min() > piece.start_s - piece.dt
    time = time - piece.start_s if since_bag else time
    sample = piece.dt * np.arange(len(piece))
    recovered = np.interp(sample, time, value)
    nearest = np.abs(time[np.clip(np.searchsorted(time, sample), 1, len(time) - 1)] - sample)
    nearest = np.minimum(nearest, np.abs(time[np.clip(np.searchsorted(time, sample) - 1, 0, None)] - sample))
    outside = nearest > max(1.0, piece.dt) + 0.01
    columns = np.stack([np.where(outside, np.nan, recovered), piece.channels["grade"]], axis=1)
    width = max(1, round(WINDOW_S / piece.dt))
    count = len(columns) // width
    windows = columns[: count * width].reshape(count, width, 2)
    windows[np.isnan(windows[:, :, 0]).mean(axis=1) > 0.5] = np.nan  # known of less than half of it
    known = np.isfinite(windows).all(axis=2)[..., None]
    rows = known.sum(axis=1)
    sums = np.where(known, windows, 0.0).sum(axis=1)
    return np.where(rows > 0, sums / np.maximum(rows, 1), np.nan)
