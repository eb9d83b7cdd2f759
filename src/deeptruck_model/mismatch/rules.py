"""Every threshold that decides a verdict, in the order of the algorithm; `Rules()` is what the tool uses.

Evidence carries the rules it is judged by, and `find_mismatch` takes others. Numbers that only steer the
computation (grids, iterations, smoothing, how many candidates are fitted) stand beside their code.

`python -m deeptruck_model.mismatch.rules` renews the table of docs/mismatch_rules.md.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TypeVar

SENSORS = "ordinary sensors"
TRUCKS = "what trucks do"
STATISTICS = "convention"
CHOSEN = "chosen"  # nothing outside states it
FITTED = "fitted"  # to the log score on development cases


T = TypeVar("T")


def _of(default: T, unit: str, means: str, source: str) -> T:
    return field(default=default, metadata={"unit": unit, "means": means, "source": source})


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Thresholds by which a verdict is reached. Times in s, forces per mass in m/s^2, gains in nats."""

    # data
    impossible_acceleration: float = _of(
        12.0, "m/s^2", "a speed signal that changes faster is faulty there", TRUCKS
    )
    surely_braking: float = _of(-1.2, "m/s^2", "a mean over a second below it is braking", TRUCKS)
    no_coasting: float = _of(
        -0.5, "m/s^2", "a truck that slows harder than this brakes, where nothing tells it", TRUCKS
    )
    accelerometer_bias: float = _of(0.05, "m/s^2", "a larger bias of the accelerometer is a fault", SENSORS)
    speed_scale: float = _of(
        0.03, "1", "a larger scale error between speed and accelerometer is a fault", SENSORS
    )
    clock_offset_s: float = _of(
        0.3, "s", "a larger delay between speed and accelerometer is a fault", SENSORS
    )
    held_out_share: float = _of(0.3, "1", "share that is held out where no drive was given for it", CHOSEN)
    least_driving_s: float = _of(60.0, "s", "less usable driving tells nothing", CHOSEN)
    least_speed_sd: float = _of(0.3, "m/s", "a speed that varies less tells nothing", CHOSEN)
    least_speed: float = _of(
        1.5, "m/s", "slower driving is left out: standstill logic and wheel sensors rule it", SENSORS
    )
    clutch_closed: float = _of(2.5, "m/s", "slower, clutches slip and engines idle", TRUCKS)
    other_gear_s: float = _of(
        1.5, "s", "for how long another gear than the recorded one is part of what may be missing", CHOSEN
    )
    other_gear_apart: float = _of(
        0.18, "log", "engine speeds farther apart are of two gears; neighbours are 0.2 to 0.4 apart", TRUCKS
    )

    # noise
    noise_floor: float = _of(0.01, "m/s^2", "least sd of the innovations: no simulator is better", CHOSEN)
    least_drives: int = _of(
        4, "drives", "with fewer, nothing is said of how much drives disagree on a size", CHOSEN
    )
    allowance: float = _of(
        2.0,
        "1",
        "times what a simulator is off by elsewhere, or by its inputs, that it may be off",
        CHOSEN,
    )
    stands_out: float = _of(
        6.5, "sd", "by which a fault of a sensor, or a window among thousands, must be off", STATISTICS
    )
    slow_noise: float = _of(
        0.015, "m/s^2", "sd of a mean over slow_noise_s that may still be noise, of a physics truck", CHOSEN
    )
    slow_noise_s: float = _of(10.0, "s", "length of the means that slow noise is measured over", CHOSEN)
    temper: float = _of(
        3.0,
        "1",
        "log evidence is divided by it: the noise model is only nearly right; so a gain of so many "
        "nats pays for a choice: a parameter set free, a regime, a further form, each end of a window",
        CHOSEN,
    )

    # candidates: what is too small or too large to be a term
    least_force: float = _of(0.012, "m/s^2", "rms over all time that a force must reach, or ...", SENSORS)
    least_force_acting: float = _of(
        0.02, "m/s^2", "... rms over the tenth of the time in which it acts most", SENSORS
    )
    least_delay_s: float = _of(
        0.15, "s", "a shorter delay or lag is that of message periods and filters", SENSORS
    )
    surely: float = _of(1.96, "sd", "half width of a 95 % interval", STATISTICS)
    most_prior_sd: float = _of(
        4.0, "sd", "a coefficient farther from its prior mean is physically impossible", TRUCKS
    )

    # evidence: what a term must gain
    least_gain: float = _of(
        20.0, "nats", "any term: the penalty of the search; so much more if it is time-varying", CHOSEN
    )
    least_gain_learned: float = _of(35.0, "nats", "any term beside a learned simulator", CHOSEN)
    told_gain: float = _of(
        10.0, "nats", "a law without a name, or a word for or against what was found", CHOSEN
    )
    weak: float = _of(
        60.0,
        "nats",
        "what has no name, or acts in windows alone",
        CHOSEN,
    )
    clear: float = _of(
        120.0,
        "nats",
        "bursts of any size; weaker findings must help where they were not fitted",
        CHOSEN,
    )
    coarse: float = _of(
        0.05,
        "of a gain",
        "error of a law's form: evidence for names is divided by it, and what acts elsewhere must gain more",
        FITTED,
    )
    form_share: float = _of(
        0.15,
        "of a gain",
        "error of a law's form at most: a parameter, an unnamed or a time-varying force, "
        "laws that make a name doubtful must gain more; and of its squares in its regime",
        CHOSEN,
    )
    other_share: float = _of(
        0.3, "of a gain", "what has no name, or acts where another does, must gain to be of its own", CHOSEN
    )
    most_terms: int = _of(4, "terms", "with a name, or without, at once", CHOSEN)

    # parameters
    nearly_right: float = _of(
        0.015, "1", "relative error that any simulator may have; the interval must not reach it", CHOSEN
    )
    slope_zero: float = _of(0.002, "rise over run", "zero that an ordinary slope sensor may have", SENSORS)

    slope_zero_gain: float = _of(
        240.0, "nats", "below it, a parameter that such a zero explains is not reported", CHOSEN
    )
    told_together: float = _of(0.9, "1", "correlation of two parameters that drives tell as a pair", CHOSEN)

    # groups: what is not distinguishable
    credible: float = _of(0.8, "1", "probability that a group of names holds the right one", FITTED)
    recognised: float = _of(0.8, "1", "probability that a law is one of the names it is like", FITTED)
    recognised_unknown: float = _of(0.6, "1", "probability that what is like no name is `unknown`", CHOSEN)
    manoeuvre_speed: float = _of(
        0.1, "m/s", "a manoeuvre tells two names apart if speeds differ by more than this ...", SENSORS
    )
    manoeuvre_drift: float = _of(0.01, "m/s^2", "... and this for each second since it began", SENSORS)

    # unknown: what has no name
    formula_r2: float = _of(0.1, "1", "held-out r2 that trees, or a formula, must reach", CHOSEN)
    formula_beyond: float = _of(
        3.0, "of the largest force", "that a formula may reach between its places", CHOSEN
    )

    # slow forces and roads
    slow_force: float = _of(
        0.08, "m/s^2", "rms that a slow force must exceed: ordinary wind gives a light vehicle less", TRUCKS
    )
    slow_force_grade: float = _of(0.07, "rise over run", "largest rms that a road can have", TRUCKS)
    slow_force_wind: float = _of(9.0, "m/s", "largest rms that wind can have", TRUCKS)
    slow_force_derate: float = _of(0.25, "1", "largest rms of a change of the engine's force", TRUCKS)
    line_r2: float = _of(
        0.4, "1", "r2 of fast changes below which a line through the recordings is no truck", CHOSEN
    )
    line_s: float = _of(
        300.0, "s", "driving that a slow force takes, and a line through the recordings", CHOSEN
    )
    line_gain_doubt: float = _of(0.1, "1", "relative error its engine gain may have", CHOSEN)
    road_by_chance: float = _of(
        0.99, "1", "quantile of the agreement by chance that a road must exceed", STATISTICS
    )
    road_share: float = _of(0.05, "1", "share of the windows that must agree", CHOSEN)
    road_windows: int = _of(3, "windows", "that do not overlap must agree", CHOSEN)
    road_shared: int = _of(
        20, "windows", "in a row, 100 m apart, must agree with another vehicle's road, so 8 km in all", CHOSEN
    )

    # windows: what acts now and then
    windows_most: float = _of(0.2, "of the time", "all windows together: what is rare is no more", CHOSEN)

    # learned simulators: model discrepancy
    learnable: float = _of(
        0.05,
        "m/s^2",
        "rms that no discrepancy of a signal it cannot see has; of any, where none is measured",
        CHOSEN,
    )

    # what the truck's controllers tell of their own faults
    fault_odds: float = _of(
        3.0, "1", "times as often as without a fault the force must act with it to tell of it", CHOSEN
    )

    # validation: what is withdrawn
    no_better: float = _of(
        0.97, "of the error as given", "above which a correction is no better on held-out drives", CHOSEN
    )
    drives_worse: float = _of(
        1.33,
        "of its own error",
        "beyond which a learned simulator differs here, though nothing has a name",
        CHOSEN,
    )


BEGIN, END = "<!-- rules: begin -->", "<!-- rules: end -->"


def table() -> str:
    """One row for each rule: name, value, unit, what it means and where it comes from."""
    rows = [
        f"| `{f.name}` | {_value(f.default)} | {f.metadata['unit']} | {f.metadata['means']} "
        f"| {f.metadata['source']} |"
        for f in fields(Rules)
    ]
    return "\n".join(["| rule | value | unit | means | source |", "| --- | --- | --- | --- | --- |", *rows])


def _value(default: object) -> str:
    return ", ".join(f"{x:g}" for x in default) if isinstance(default, tuple) else f"{default:g}"


def put_into(page: Path) -> None:
    """Replace the table between the marks of a page."""
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    page.write_text(f"{before}{BEGIN}\n{table()}\n{END}{rest.partition(END)[2]}", encoding="utf-8")


if __name__ == "__main__":
    put_into(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/mismatch_rules.md"))
