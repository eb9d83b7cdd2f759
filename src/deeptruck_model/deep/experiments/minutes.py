"""Error against minutes of data: from scratch, and adapted from a fleet of other trucks."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from deeptruck_model.deep.arguments import Arguments
from deeptruck_model.deep.evaluation import statistics, trials
from deeptruck_model.deep.experiments.fleet import fleet
from deeptruck_model.deep.experiments.output import budget, table, write
from deeptruck_model.deep.experiments.setup import (
    FLEET_SEED,
    TEST_SEED,
    TRAIN_SEED,
    chosen,
    drive_of,
    trained,
)
from deeptruck_model.deep.training import train
from deeptruck_model.recordings import Recording

TRUCKS = ("trucksim", "freightliner", "volvo")
MINUTES = (5, 15, 60)
FLEET, FLEET_MINUTES = 24, 20  # trucks, of which none is a reference truck
TICKS = (0.2, 0.5, 1, 2)  # m/s
SCRATCH, ADAPTED = "from scratch", "adapted"
Curves = Mapping[str, Mapping[int, Mapping[str, Any]]]
"""statistics by SCRATCH or ADAPTED and minutes; 0 minutes are the fleet alone"""


def minutes_of_data(out: Path, seeds: int = 1, updates: int = 0) -> dict[str, Any]:
    """The three reference trucks: 90 x 40 s on 3 h of another drive, after 5, 15 and 60 min of their own."""
    arguments = chosen(seeds, updates)
    metrics, note = {}, ""
    for name in TRUCKS:
        whole, test = drive_of(name, max(MINUTES), TRAIN_SEED), drive_of(name, 180, TEST_SEED)
        metrics[name], note = curves(whole, [test], arguments)
    rows = [
        (f"{name}: {minutes} min, {how}" if minutes else f"{name}: the fleet alone", m)
        for name, by_way in metrics.items()
        for how, by_minutes in by_way.items()
        for minutes, m in by_minutes.items()
    ]
    title = f"Minutes of data, alone or after {FLEET} other trucks of {FLEET_MINUTES} min each"
    table(out, f"{title}: 3 h test, 90 x 40 s", rows, note)
    draw(metrics, out / "minutes.png")
    return write(out, metrics)


def curves(whole: Recording, test: Sequence[Recording], arguments: Arguments) -> tuple[dict[str, Any], str]:
    """Curves of the truck that drove `whole`, and a note of the updates that each training took."""
    found: dict[str, dict[int, Any]] = {SCRATCH: {}, ADAPTED: {}}
    with tempfile.TemporaryDirectory() as folder:
        known = Path(folder) / "fleet"
        truck = train(fleet(whole.interface, FLEET, FLEET_MINUTES, FLEET_SEED), known, arguments)
        found[ADAPTED][0] = statistics(trials(truck, test))
        for minutes in MINUTES:
            drives = [whole.piece(0, round(60 * minutes / whole.dt))]
            scratch, adapted = (
                trained(drives, arguments),
                trained(drives, replace(arguments, start=str(known))),
            )
            found[SCRATCH][minutes] = statistics(trials(scratch, test))
            found[ADAPTED][minutes] = statistics(trials(adapted, test))
    took = {"The fleet": truck, "Adapted": adapted, f"{MINUTES[-1]} min from scratch": scratch}
    return found, " ".join(f"{what}: {budget(of)}" for what, of in took.items())


def draw(metrics: Mapping[str, Curves], path: Path) -> None:
    """Mean absolute speed error against minutes, one panel a truck."""
    figure = Figure(figsize=(3.2 * len(metrics), 3.2), layout="constrained")
    panels = figure.subplots(1, len(metrics), sharey=True, squeeze=False)[0]
    for axis, (name, by_way) in zip(panels, metrics.items(), strict=True):
        for how, colour in ((SCRATCH, "tab:blue"), (ADAPTED, "tab:red")):
            errors = {minutes: m["speed"]["mean_abs"] for minutes, m in by_way[how].items()}
            alone = errors.pop(0, None)
            if alone is not None:
                axis.axhline(alone, color="0.5", ls=":", label="the fleet alone")
            axis.plot(list(errors), list(errors.values()), "o-", color=colour, label=how)
        axis.set(xscale="log", yscale="log", xlabel="minutes of its own driving", title=name)
        axis.set_xticks(MINUTES, [str(m) for m in MINUTES], minor=False)
        axis.set_yticks(TICKS, [str(tick) for tick in TICKS])
        axis.minorticks_off()
    panels[0].set_ylabel("mean absolute speed error in 40 s [m/s]")
    panels[-1].legend(fontsize="small")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
