"""Real logs of more than one vehicle: what the tool states with and without a withheld channel.

`prove --real DATA --out DIR`. In addition to the logs whose road is withheld (`withheld`) there are pairs of
drives of one vehicle with all channels, and a simulator trained on other drives of it. A validated name is
then a false alarm, or something that the log's owner did not know; reported of a pair is the budget of its
speed error. One vehicle and the first trips were available when settings were chosen.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core import files
from deeptruck_core.errors import InputError
from deeptruck_exam.cases.case import Case
from deeptruck_exam.folder import REAL, check_real
from deeptruck_exam.real.withheld import LAYOUTS, SOURCES, Source, examine_withheld, trained, whole_log
from deeptruck_exam.tool import run_tool, summary
from deeptruck_model.recordings import split, write_bag

CHOSEN_ON, REPORTED = "settings were chosen", "only reported"
LIMIT_S = 3600.0
MOST_DRIVES, MOSTLY = 6, 0.8
LEFT_OVER, LEAVES = "left_over", 0.35  # the part of a budget, and the largest share of it in an answer
UPDATES = 1200


@dataclass(frozen=True)
class Fleet:
    """Drives of one vehicle: logs that train its simulator, and logs that are judged.

    If `trainers` is empty, the simulator is trained on the first half of the only log. Drives shorter than
    `least_s` are omitted; `lacks` names the channels that the log does not have.
    """

    name: str
    layout: str
    trainers: tuple[str, ...]
    judged: tuple[str, ...]
    part: str
    lacks: str
    least_s: float = 300.0


def _trips(*names: str) -> tuple[str, ...]:
    return tuple(f"bmw_i3/Trip{name}.csv" for name in names)


TRUCK, CAR = "brake, gear, load, wind", "friction brake, load, wind"
FLEETS = (
    Fleet("veh002", "veh002.yaml", (), ("vt_heavy_truck/veh002_all.csv",), CHOSEN_ON, TRUCK),
    Fleet("veh003", "veh002.yaml", (), ("vt_heavy_truck/veh003_all.csv",), REPORTED, TRUCK),
    Fleet("car_1", "bmw_i3.yaml", _trips("A05", "A06", "A07"), _trips("A01", "A03", "A04"), CHOSEN_ON, CAR),
    Fleet("car_2", "bmw_i3.yaml", _trips("A08", "A09", "A10"), _trips("A11", "A13", "A14"), REPORTED, CAR),
)


@dataclass(frozen=True)
class Row:
    """One comparison: what was withheld or never recorded, what the tool stated, and the sizes.

    `sizes` are the strengths of the findings in their units; `speed_error` and `after` (m/s) those of free
    runs on held-out drives before and after the correction.
    """

    vehicle: str
    drives: str
    part: str
    withheld: str
    lacks: str
    verdict: str
    said: tuple[str, ...]
    sizes: tuple[str, ...]
    validated: bool
    speed_error: float | None
    after: float | None
    budget: Mapping[str, float] | None = None
    agreement: Mapping[str, float] | None = None

    @property
    def false_alarm(self) -> bool:
        """Whether a name is validated although nothing was withheld."""
        return not self.withheld and bool(self.said) and self.validated

    @property
    def answered(self) -> bool:
        """Whether little of the budget is unexplained and no false name is accepted."""
        left = (self.budget or {}).get(LEFT_OVER)
        return left is not None and left <= LEAVES and not self.false_alarm


def examine_real(
    data: Path,
    out: Path,
    *,
    fleets: Sequence[Fleet] = FLEETS,
    sources: Sequence[Source] = SOURCES,
    updates: int = UPDATES,
) -> list[Row]:
    """Judge every available log of `data`; writes real.json and real.md into `out`.

    Logs with a result in `out` are not run again. Raises InputError as `folder.check_real` does, and if none
    of the logs is available.
    """
    check_real(data, out)
    if not any((data / log).is_file() for fleet in fleets for log in fleet.judged):
        raise InputError(f"--real: {data} has none of the logs, such as {fleets[0].judged[0]}")
    with REAL.in_place(out):
        known = examine_withheld(out / "withheld", data, sources=sources, updates=updates)
        rows = [_of_withheld(r) for r in known]
        for fleet in fleets:
            if all((data / log).is_file() for log in (*fleet.trainers, *fleet.judged)):
                rows += _judge(fleet, data, out / fleet.name, updates)
            else:
                print(f"{fleet.name}: skipped, a log of it is not in {data}")
        files.write(out / "real.json", json.dumps([asdict(r) for r in rows], indent=1).encode())
        files.write(out / "real.md", ("\n".join(page(rows)) + "\n").encode())
    return rows


def _judge(fleet: Fleet, data: Path, out: Path, updates: int) -> list[Row]:
    """Fit every drive of a fleet, with the next drive held out."""
    layout = LAYOUTS / fleet.layout
    logs = [whole_log(data / log, layout, out / "import") for log in fleet.judged]
    trainers = [r for log in fleet.trainers for r in whole_log(data / log, layout, out / "import")]
    if not fleet.trainers:
        (log,) = logs
        trainers, rest, _ = split(log, (0.5, 0.5, 0.0))
        whole = [r for r in rest if np.isfinite(np.hstack([r.u, r.w])).all(axis=1).mean() > MOSTLY]
        logs = [[r] for r in sorted(whole, key=len)[-MOST_DRIVES:]]  # a simulator needs all inputs
    simulator = trained(trainers, out / "simulator", updates)
    drives = [drive for drive in logs if max(len(r) * r.dt for r in drive) >= fleet.least_s]
    if len(drives) < 2:
        print(f"{fleet.name}: skipped, fewer than two drives of {fleet.least_s:g} s")
        return []
    names = [f"drive_{k}" for k in range(len(drives))]
    for name, drive in zip(names, drives, strict=True):
        if not (bag := out / "recordings" / name).exists():
            write_bag(bag, drive, interface=drive[0].interface)
    return [_pair(fleet, out, simulator, fit, held) for fit, held in pairwise([*names, *names[:1]])]


def _pair(fleet: Fleet, out: Path, simulator: Path, fit: str, held: str) -> Row:
    path = out / f"{fit}-{held}.json"
    if not path.exists():
        case = Case(out, str(simulator), (fit,), (held,), {}, "")
        run = run_tool(case, out / f"{fit}-{held}" / "found", limit_s=LIMIT_S)
        row = Row(fleet.name, f"{fit}, {held}", fleet.part, "", fleet.lacks, **summary(run))
        files.write(path, json.dumps(asdict(row), indent=1).encode())
    kept = json.loads(path.read_text())
    return Row(**{**kept, "said": tuple(kept["said"]), "sizes": tuple(kept["sizes"])})


def _of_withheld(result: Mapping[str, Any]) -> Row:
    """A row for a result of `withheld`."""
    source = next(s for s in SOURCES if s.name == result["source"])
    part = CHOSEN_ON if source.name in ("veh002", "bmw_i3 A01", "bmw_i3 B17") else REPORTED
    known: dict[str, Any] = {
        k: result.get(k) for k in ("verdict", "said", "sizes", "validated", "speed_error", "after", "budget")
    }
    known |= {"said": tuple(known["said"] or ()), "sizes": tuple(known["sizes"] or ())}
    hidden = ", ".join(source.hide)
    road = {"agreement": result["agreement"]}
    return Row(source.name, "its own", part, hidden, "", **known, **road)


HEAD = (
    "vehicle",
    "drives",
    "withheld",
    "said",
    "size",
    "validated",
    "speed error, m/s",
    "after",
    "budget, %",
)


def page(rows: Sequence[Row]) -> list[str]:
    """real.md: a table for each part, and the share of false alarms."""
    lines = ["# Real logs", "", "`deeptruck-model prove --real DATA --out DIR`", ""]
    for part in (CHOSEN_ON, REPORTED):
        of_it = [r for r in rows if r.part == part]
        pairs = [r for r in of_it if not r.withheld]
        alarms = sum(r.false_alarm for r in pairs)
        lines += [f"## Vehicles and days where {part}" if part == CHOSEN_ON else "## Only reported", ""]
        answered = sum(r.answered for r in pairs)
        lines += [
            f"Nothing withheld: {answered} of {len(pairs)} pairs are answered,"
            f" and {alarms} have a validated name.",
            "",
        ]
        lines += [f"| {' | '.join(HEAD)} |", "| --- " * len(HEAD) + "|"]
        lines += [f"| {' | '.join(_cells(r))} |" for r in of_it]
        lines += [""]
    return lines


def _cells(row: Row) -> tuple[str, ...]:
    road = row.agreement
    more = f" (slope: correlation {road['correlation']:.2f}, factor {road['slope']:.2f})" if road else ""
    said = " ".join(row.said) or row.verdict
    errors = ("" if x is None else f"{x:.2f}" for x in (row.speed_error, row.after))
    parts = sorted((row.budget or {}).items(), key=lambda item: -item[1])
    budget = ", ".join(f"{part} {100.0 * share:.0f}" for part, share in parts if abs(share) >= 0.005)
    withheld = row.withheld or f"nothing; not in the log: {row.lacks}"
    sizes = ", ".join(filter(None, row.sizes))
    return (
        row.vehicle,
        row.drives,
        withheld,
        said + more,
        sizes,
        "yes" if row.validated else "no",
        *errors,
        budget,
    )
