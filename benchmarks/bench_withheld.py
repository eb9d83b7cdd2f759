"""Real logs from which a channel is withheld: the verdict of the mismatch tool, and what it recovers of the
channel.

python benchmarks/bench_withheld.py [--updates 1200]

An electric car (TUM): its braking by the motor, and the temperature of the air, which no simulator takes
(its slope: bench_real_car.py). A truck's bus of 30 s (Colorado State University): the gear. The logs
(docs/recordings.md) are no part of this project: put them under ../shared/data or the folder in
DEEPTRUCK_REAL_DATA. No setting was chosen on these results.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import harness
import numpy as np
import yaml

from deeptruck_exam.plants.simulators import command
from deeptruck_exam.real.withheld import LAYOUTS, trained, whole_log, withhold
from deeptruck_model.errors import InputError
from deeptruck_model.mismatch import find_mismatch, unrecorded
from deeptruck_model.mismatch.found import Mismatch
from deeptruck_model.mismatch.report import wording
from deeptruck_model.recordings import Recording, split, write_bag
from deeptruck_model.simulators import Simulator, load

Array = np.ndarray[Any, Any]

TRAINERS = ("A06", "A07", "A08")  # summer trips with motorways, as some of those that are judged
FITTED, HELD_OUT = ("A01", "A03", "A13"), ("A04", "A14")
WINTER = "B17"
WINDOW_S = 10.0  # of the means that are compared
PIECES = 2  # of which the second is held out
TORQUE = "engine_command"
SHEET = {  # of the bus's truck, which nobody states: a medium one
    "mass_kg": 12_000.0,
    "axle_ratio": 4.0,
    "tyres": 0.5,
    "rated_torque_nm": 1000.0,
    "frontal_area_m2": 8.0,
    "full_braking_m_s2": 6.0,
}
HEADS = "withheld | said | kind of input named | correlation: recovered; residual | speed error, m/s"


@dataclass(frozen=True)
class Withheld:
    """A channel that is withheld from logs. `what` describes it; `right` are the inputs and effects that are
    correct answers; `channel` has by log the withheld channel (n,), proportional to its force. `fitted` and
    `held_out` are the logs without it."""

    what: str
    right: tuple[str, ...]
    simulator: Simulator
    fitted: Sequence[Recording]
    held_out: Sequence[Recording]
    channel: dict[str, Array]
    each_drive: bool = False


def trip(name: str, folder: Path) -> list[Recording]:
    """The pieces of one of the car's trips, with all channels."""
    whole = whole_log(harness.DATA / "bmw_i3" / f"Trip{name}.csv", LAYOUTS / "bmw_i3.yaml", folder / name)
    return [replace(r, name=f"{name}#{k}" if k else name) for k, r in enumerate(whole)]


def without_braking(r: Recording) -> Recording:
    """The recording with the motor's torque where it drives the car, and zero where it brakes it."""
    return replace(r, channels={**r.channels, TORQUE: np.maximum(r.channels[TORQUE], 0.0)})


def braking(simulator: Simulator, folder: Path) -> Withheld:
    """A simulator that knows the motor's braking, with logs that lack it."""
    fitted, held = ([r for t in trips for r in trip(t, folder)] for trips in (FITTED, HELD_OUT))
    channel = {r.name: np.minimum(r.channels[TORQUE], 0.0) for r in (*fitted, *held)}
    right = ("brake", "dragging_brake", "engine_brake")
    blind, blind_held = ([without_braking(r) for r in part] for part in (fitted, held))
    return Withheld("braking by the motor", right, simulator, blind, blind_held, channel)


def temperature(simulator: Simulator, folder: Path) -> Withheld:
    """A simulator of summer trips, with other summer trips and one in winter: denser air, and stiffer
    tyres."""
    fitted, held = split(trip(WINTER, folder), (1 / PIECES, 1 - 1 / PIECES, 0.0))[:PIECES]
    fitted += [r for t in FITTED for r in trip(t, folder)]
    channel = {r.name: r.channels["ambient_temperature"] for r in (*fitted, *held)}
    right = ("drag_area", "rolling_resistance", "rolling_resistance_speed", "rolling_resistance_warmup")
    return Withheld("temperature: winter", right, simulator, fitted, held, channel, each_drive=True)


def gear(folder: Path) -> Withheld:
    """A physics truck that learned to shift from the bus, with the same bus without gear and engine speed.
    Its overall ratios are those of the logs, its other data those of a medium truck."""
    logs = (harness.DATA / "j1939_csu" / f"{name}.log" for name in ("normal", "tsc1"))
    normal, forged = (whole_log(log, {}, folder / log.stem) for log in logs)
    normal = [_unbraked(r) for r in normal]  # the brake switch of this log is off throughout
    write_bag(folder / "bus", normal, interface=normal[0].interface)
    sheet, truck = folder / "sheet.yaml", folder / "bus.yaml"
    sheet.write_text(yaml.safe_dump({**SHEET, "gear_ratios": ratios([*normal, *forged])}))
    command("new", str(truck), "--from", str(sheet), "--recordings", str(folder / "bus"))
    parts = split(normal, (1 / PIECES, 1 - 1 / PIECES, 0.0))[:PIECES]
    channel = {r.name: r.channels["gear"] for part in parts for r in part}
    blind, held = ([withhold(r, ("gear", "engine_speed")) for r in part] for part in parts)
    return Withheld("gear", ("gear",), load(f"truck:{truck}"), blind, held, channel)


def _unbraked(r: Recording) -> Recording:
    brake = {"brake_command": np.zeros(len(r))}
    return replace(r, channels=r.channels | brake, interface=replace(r.interface, brake_unit="percent"))


def ratios(recordings: Sequence[Recording]) -> list[float]:
    """Median ratio of engine speed to wheel speed in each gear that was driven, from the lowest to the
    highest."""
    seen: dict[int, list[float]] = {}
    for r in recordings:
        c = r.channels
        for engaged, turning, speed in zip(c["gear"], c["engine_speed"], c["speed"], strict=True):
            if engaged >= 1 and speed > 3.0:
                seen.setdefault(int(engaged), []).append(
                    turning / speed * SHEET["tyres"] / SHEET["axle_ratio"]
                )
    return [round(float(np.median(seen[g])), 2) for g in sorted(seen)]


def judged(w: Withheld) -> str:
    """A row of the table."""
    began = time.process_time()
    try:
        found = find_mismatch(w.simulator, w.fitted, w.held_out)
    except InputError as error:
        return f"{w.what} | refused: {error} | no | - | -"
    v = found.verdict
    fit = v["fit"] or {}
    errors = [(fit.get(name) or {}).get("speed_rmse") for name in ("before", "parameters_only", "after")]
    speed = " -> ".join("-" if x is None else f"{x:.2f}" for x in errors)
    print(f"{w.what}: {time.process_time() - began:.0f} CPU s", flush=True)
    right = "yes" if {*_said(v)} & {*w.right} else "no"
    says = "; ".join(_said(v).values()) or v["verdict"]
    return f"{w.what} | {says} | {right} | {_correlations(w, found)} | {speed}; {fit.get('offered', '-')}"


def _said(verdict: Mapping[str, Any]) -> dict[str, str]:
    """The named effects and the missing inputs that were found to act, with what is said of each."""
    said = {f["effect"]: f"{f['effect']} {f['probability']:.2f}" for f in verdict["findings"]}
    for m in verdict["not_recorded"]:
        if share := m.get("share_of_time"):
            said[m["input"]] = f"{m['input']} was not recorded and acts in {100 * share:.0f} % of the time"
    for f in verdict["findings"]:
        if f["says"] in (wording.DRIFT["slow"], wording.DRIFT["place"]):  # 'as a slope is'
            said["slope"] = said.pop(f["effect"], f["effect"]) + f": {f['says']}"
    return said


def _correlations(w: Withheld, found: Mismatch) -> str:
    """Correlations of the channel with the forces that were found, and with the whole residual."""
    e = found.evidence
    if e is None:
        return "-"
    seen = np.isfinite(e.residual)
    shown, _ = unrecorded.braking(replace(e, valid=seen))
    hidden = seen & ~shown.valid
    force = np.sum([f.force for f in found.findings if f.force is not None] or [np.zeros(len(e))], axis=0)
    force = np.where(hidden, e.residual, force)
    of_bags = {r.name: r for r in (*w.fitted, *w.held_out)}
    rows = []
    for s in e.stretches:
        bag, count = of_bags[s.name], s.stop - s.start
        at = s.start_s - bag.start_s + e.dt * (np.arange(count) + 0.5)
        channel = np.interp(at, bag.dt * np.arange(len(bag)), w.channel[s.name])
        columns = np.stack([channel, force[s.rows], e.residual[s.rows]])
        columns = columns[:, seen[s.rows] & np.isfinite(channel)]
        width = columns.shape[1] if w.each_drive else round(WINDOW_S / e.dt)
        whole = columns.shape[1] // max(width, 1) * width
        rows += list(columns[:, :whole].reshape(3, -1, width).mean(axis=2).T) if whole else []
    table = np.array(rows)
    if len(table) < 3 or not table.std(axis=0)[[0, 2]].all():
        return "-"
    each = np.corrcoef(table.T)[0, 1:] if table[:, 1].any() else (np.nan, np.corrcoef(table.T[[0, 2]])[0, 1])
    return "; ".join("-" if np.isnan(x) else f"{x:.2f}" for x in each) + f" of {len(table)}"


def main() -> None:
    updates = harness.options(__doc__, {"--updates": (1200, "of the car's simulators")}).updates
    harness.check_data(harness.DATA / "bmw_i3" / f"Trip{WINTER}.csv")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        trips = [r for t in TRAINERS for r in trip(t, folder)]
        whole = load(trained(trips, folder / "whole", updates))
        cases = (
            braking(whole, folder),
            temperature(whole, folder),
            gear(folder),
        )
        rows = [judged(w) for w in cases]
    lines = [*harness.heading("Channels of real logs withheld"), ABOVE, "", *harness.table(HEADS, rows)]
    harness.store("foreign", [*lines, "", BELOW])


ABOVE = f"""A channel that was recorded is withheld from the tool, which compares the log with a simulator:
braking by the motor of an electric car (negative torque is logged as none), beside a simulator that takes
the whole torque; a winter trip of 3 degC, beside one that learned in summer; and the gear of a truck's
bus, beside a physics truck of the bus's ratios.
Correlations are those of means over {WINDOW_S:g} s (of temperature, of whole trips) of the channel with
the forces that were found, and with the whole residual. Speed errors are those of free runs along logs
held out: as given -> refitted -> corrected; what is offered."""
BELOW = f"""The car's simulators learned from trips {", ".join(TRAINERS)}; fitted are {", ".join(FITTED)}
and held out {", ".join(HELD_OUT)}; of {WINTER} the first half is fitted and the second held
out. A kind is named where one of its names is said, or the missing input with a share of the time in which
it acts. A first run learned from A05 and A08, which drive slower than the trips that are judged; of the
car's three channels it named the same one. The truck's bus is too short for a free run of 40 s, so that
nothing is compared."""


if __name__ == "__main__":
    main()
