"""Every number by which the verdict is decided, with its unit and where it comes from.

What vehicles can do stands in vehicle_kinds.py. Numbers that steer a computation (grids, iterations,
smoothing) stand beside their code. `python -m deeptruck_model.mismatch.rules` renews the table of
docs/mismatch_rules.md.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TypeVar

SENSORS = "ordinary sensors"
TRUCKS = "what trucks do"
STATISTICS = "convention"
CHOSEN = "chosen on development cases"

T = TypeVar("T")


def _rule(default: T, unit: str, means: str, source: str) -> T:
    return field(default=default, metadata={"unit": unit, "means": means, "source": source})


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Thresholds of the verdict. Forces per mass in m/s^2, gains of log evidence in nats."""

    # faults of sensors
    accelerometer_bias: float = _rule(0.05, "m/s^2", "a larger bias of the accelerometer is a fault", SENSORS)
    speed_scale: float = _rule(
        0.03, "1", "a larger scale error between speed and accelerometer is a fault", SENSORS
    )
    clock_offset_s: float = _rule(
        0.3, "s", "a larger delay between speed and accelerometer is a fault", SENSORS
    )
    sensor_sd: float = _rule(
        6.5, "standard deviations", "by which a fault of a sensor must differ from none", STATISTICS
    )
    least_delay_s: float = _rule(
        0.15, "s", "a shorter delay of commands is that of message periods and filters", SENSORS
    )

    # noise
    noise_floor: float = _rule(0.01, "m/s^2", "least standard deviation of the innovations", SENSORS)
    slow_noise: float = _rule(
        0.015, "m/s^2", "standard deviation of a mean over 10 s that may be noise, of a physics truck", CHOSEN
    )
    tolerance: float = _rule(
        2.0, "1", "tolerance factor on the spread of the simulator under its own input noise", CHOSEN
    )
    evidence_temperature: float = _rule(
        3.0,
        "1",
        "log evidence is divided by it because the noise model is approximate; nats that a choice costs",
        CHOSEN,
    )
    slow_force: float = _rule(
        0.08, "m/s^2", "rms that a slow force must exceed: ordinary wind gives a light vehicle less", TRUCKS
    )

    # detection
    discrepancy: float = _rule(
        2.0,
        "1",
        "times the gain on a learned simulator's own recordings that a name must exceed on others",
        CHOSEN,
    )
    parameter_gain: float = _rule(
        20.0,
        "nats",
        "gain of a free parameter, or of unrecorded braking, below which it is not reported",
        CHOSEN,
    )
    nearly_right: float = _rule(
        0.015,
        "1",
        "relative error that any simulator's parameter may have; beyond it is a standard deviation more",
        CHOSEN,
    )

    odds: float = _rule(
        0.02, "1", "prior odds that a mechanism is in, times its chance beside the others", CHOSEN
    )

    # names
    stated: float = _rule(0.9, "1", "probability of the deepest node of the tree that is stated", STATISTICS)
    named: float = _rule(
        0.5, "1", "probability that a family is in, from which on it is a finding", STATISTICS
    )
    credible: float = _rule(
        0.8, "1", "probability that a credible set of names holds the right one", STATISTICS
    )
    most_findings: int = _rule(4, "1", "names of one verdict", CHOSEN)

    # events
    false_events: float = _rule(
        0.05, "1/h", "expected events in driving in which nothing happens", STATISTICS
    )

    # budget
    witness: float = _rule(
        0.1,
        "1",
        "share of a part's variance on drives left out, above which a channel is a witness of it",
        CHOSEN,
    )

    # 'nothing missing'
    visible: float = _rule(
        0.3, "m/s", "speed error of free runs below which nothing that matters is left", CHOSEN
    )
    largest: float = _rule(
        1.0,
        "m/s",
        "speed error of free runs above which a learned simulator misses something, "
        "even if its own recordings show as much",
        CHOSEN,
    )
    differs: float = _rule(
        1.33, "of its own error", "beyond which a learned simulator differs from these recordings", CHOSEN
    )

    drift: float = _rule(
        0.1, "m/s", "speed error that a drift or a constant per drive must make, to be a finding", CHOSEN
    )

    # the correction
    better: float = _rule(
        0.97, "of the error as given", "above which a correction is no better on drives left out", CHOSEN
    )


BEGIN, END = "<!-- rules: begin -->", "<!-- rules: end -->"


def table() -> str:
    """One row for each rule: name, value, unit, what it means and where it comes from."""
    rows = [
        f"| `{f.name}` | {f.default:g} | {f.metadata['unit']} | {f.metadata['means']} "
        f"| {f.metadata['source']} |"
        for f in fields(Rules)
    ]
    return "\n".join(["| rule | value | unit | means | source |", "| --- | --- | --- | --- | --- |", *rows])


def put_into(page: Path) -> None:
    """Replace the table between the marks of a page."""
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    page.write_text(f"{before}{BEGIN}\n{table()}\n{END}{rest.partition(END)[2]}", encoding="utf-8")


if __name__ == "__main__":
    put_into(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/mismatch_rules.md"))
