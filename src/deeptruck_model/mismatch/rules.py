"""The thresholds by which a verdict is reached, in the order of the algorithm; `Rules()` is what is used.

Evidence carries the rules it is judged by, and `find_mismatch` takes others. What vehicles can do stands in
vehicle_kinds.py. Beside their code stand numbers that choose the rows of a recording, say how much driving it
takes or what cannot be at all, or steer the computation (grids, iterations, smoothing, how many candidates
are fitted).

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
    accelerometer_bias: float = _of(0.05, "m/s^2", "a larger bias of the accelerometer is a fault", SENSORS)
    speed_scale: float = _of(
        0.03, "1", "a larger scale error between speed and accelerometer is a fault", SENSORS
    )
    clock_offset_s: float = _of(
        0.3, "s", "a larger delay between speed and accelerometer is a fault", SENSORS
    )

    # noise
    noise_floor: float = _of(0.01, "m/s^2", "least sd of the innovations: no simulator is better", CHOSEN)
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
        0.015, "m/s^2", "sd of a mean over 10 s that may still be noise, of a physics truck", CHOSEN
    )
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
        0.15,
        "s",
        "a delay or lag must surely be longer: shorter ones are those of message periods and filters",
        SENSORS,
    )

    # evidence: what a term must gain
    least_gain: float = _of(
        20.0, "nats", "any term: the penalty of the search; so much more if it is time-varying", CHOSEN
    )
    least_gain_learned: float = _of(35.0, "nats", "any term beside a learned simulator", CHOSEN)
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

    # parameters
    nearly_right: float = _of(
        0.015, "1", "relative error that any simulator may have; the interval must not reach it", CHOSEN
    )
    slope_zero: float = _of(0.002, "rise over run", "zero that an ordinary slope sensor may have", SENSORS)

    # groups: what is not distinguishable
    credible: float = _of(0.8, "1", "probability that a group of names holds the right one", FITTED)
    recognised: float = _of(0.8, "1", "probability that a law is of the name whose form is nearest", FITTED)

    # slow forces
    slow_force: float = _of(
        0.08, "m/s^2", "rms that a slow force must exceed: ordinary wind gives a light vehicle less", TRUCKS
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

    @property
    def told_gain(self) -> float:
        """Half of what a term needs: a law without a name, or a word for or against what was found."""
        return self.least_gain / 2.0

    @property
    def slope_zero_gain(self) -> float:
        """Twice what is clear: below, a parameter that a slope sensor's zero explains is not reported."""
        return 2.0 * self.clear


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
