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

from deeptruck_model.vehicle_kinds import UNSTATED, VehicleKind

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
    sensor_fault_sure: float = _of(
        5.0, "standard errors", "and the fault must be so far from zero", STATISTICS
    )
    held_out_share: float = _of(0.3, "1", "share that is held out where no drive was given for it", CHOSEN)
    least_driving_s: float = _of(60.0, "s", "less usable driving tells nothing", CHOSEN)
    least_speed_sd: float = _of(0.3, "m/s", "a speed that varies less tells nothing", CHOSEN)
    least_speed: float = _of(
        1.5, "m/s", "slower driving is left out: standstill logic and wheel sensors rule it", SENSORS
    )
    other_gear_s: float = _of(
        1.5, "s", "for how long another gear than the recorded one is part of what may be missing", CHOSEN
    )
    other_gear_apart: float = _of(
        0.18, "log", "engine speeds farther apart are of two gears; neighbours are 0.2 to 0.4 apart", TRUCKS
    )
    other_gear_speed: float = _of(2.0, "m/s", "slower, engine speed does not tell the gear", TRUCKS)
    other_gear_most: float = _of(
        0.6, "1", "share of the time beyond which gears are numbered or built otherwise", CHOSEN
    )

    # noise
    noise_floor: float = _of(0.01, "m/s^2", "least sd of the innovations: no simulator is better", CHOSEN)
    least_drives: int = _of(
        4, "drives", "with fewer, nothing is said of how much drives disagree on a size", CHOSEN
    )
    doubt: float = _of(2.0, "1", "how often its spread under input noise a simulator may be wrong by", CHOSEN)
    slow_noise: float = _of(
        0.015, "m/s^2", "sd of a mean over slow_noise_s that may still be noise, of a physics truck", CHOSEN
    )
    slow_noise_s: float = _of(10.0, "s", "length of the means that slow noise is measured over", CHOSEN)
    temper: float = _of(
        3.0, "1", "log evidence is divided by it: the noise model is only nearly right", CHOSEN
    )

    # candidates: what is too small or too large to be a term
    least_force: float = _of(0.012, "m/s^2", "rms over all time that a force must reach, or ...", SENSORS)
    least_force_acting: float = _of(
        0.02, "m/s^2", "... rms over the tenth of the time in which it acts most", SENSORS
    )
    acting_discrepancies: float = _of(
        2.0, "1", "times the model discrepancy that the latter must reach", CHOSEN
    )
    least_delay_s: float = _of(0.15, "s", "a shorter delay is that of message periods", SENSORS)
    least_time_constant_s: float = _of(0.1, "s", "a shorter time constant is that of sensor filters", SENSORS)
    nuisance_delay_s: float = _of(
        0.5, "s", "longest delay of all commands whose share may be a nuisance", CHOSEN
    )
    surely: float = _of(1.96, "sd", "half width of a 95 % interval", STATISTICS)
    most_prior_sd: float = _of(
        4.0, "sd", "a coefficient farther from its prior mean is physically impossible", TRUCKS
    )
    possible_drag_area: tuple[float, float] = _of(
        (-0.6, 2.0), "1", "relative change from the simulator's drag area that can be", TRUCKS
    )
    possible_rolling_resistance: tuple[float, float] = _of(
        (-0.85, 3.0), "1", "the same of the rolling resistance", TRUCKS
    )
    possible_torque_gain: tuple[float, float] = _of(
        (-0.35, 2.0), "1", "the same of the torque for an engine command", TRUCKS
    )
    possible_brake_gain: tuple[float, float] = _of(
        (-0.5, 2.0), "1", "the same of the force for a brake command", TRUCKS
    )

    # evidence: what a term must gain
    least_gain: float = _of(20.0, "nats", "any term: the penalty of the search", CHOSEN)
    least_gain_learned: float = _of(35.0, "nats", "any term beside a learned simulator", CHOSEN)
    time_varying_penalty: float = _of(25.0, "nats", "more for a time-varying term, or ...", CHOSEN)
    time_varying_share: float = _of(
        0.1, "of its gain", "... more for it; also for one in windows beside one without", CHOSEN
    )
    regime_gain: float = _of(6.0, "nats", "a term confined to one regime, when screened", CHOSEN)
    regime_share: float = _of(0.15, "1", "share of a term's squares that must lie in its regime", CHOSEN)
    form_gain: float = _of(4.0, "nats", "a further form of a term, or its regime, when fitted", CHOSEN)
    freed_gain: float = _of(1.0, "nats", "a parameter that is set free beside the terms", CHOSEN)

    # stepwise selection
    most_terms: int = _of(4, "terms", "with a name, at once", CHOSEN)
    beside_most: float = _of(
        0.33, "of the others' gain", "what a further term must gain where it acts with them", CHOSEN
    )
    beside_least: float = _of(0.04, "of the others' gain", "the same where it acts when they do not", CHOSEN)
    swap_gain: float = _of(3.0, "nats", "for one term to take the place of another", CHOSEN)
    unnamed_share: float = _of(
        0.15, "of its gain", "what an unnamed time-varying force must gain beyond a name", CHOSEN
    )
    moved_gain: float = _of(20.0, "nats", "for parameters to be moved and all linearised again", CHOSEN)

    reported: float = _of(8.0, "nats", "for or against a force in the recorded torque, to say so", CHOSEN)

    # parameters
    least_change: float = _of(0.025, "1", "a smaller relative error of a parameter is none", CHOSEN)
    nearly_right: float = _of(
        0.015, "1", "relative error that any simulator may have; the interval must not reach it", CHOSEN
    )
    weak_gain: float = _of(
        10.0, "nats", "gain that a parameter counts with if it is clear beside one as given alone", CHOSEN
    )
    slope_zero: float = _of(0.002, "rise over run", "zero that an ordinary slope sensor may have", SENSORS)
    slope_zero_gain: float = _of(
        240.0, "nats", "below it, a parameter that such a zero explains is not reported", CHOSEN
    )
    beside_main: float = _of(
        0.15, "of the largest gain", "what a parameter must gain beside other findings", CHOSEN
    )

    told_share: float = _of(
        0.5, "of the prior's sd", "a parameter that drives leave less sure is not calibrated", CHOSEN
    )
    told_together: float = _of(0.9, "1", "correlation of two parameters that drives tell as a pair", CHOSEN)

    # groups: what is not distinguishable
    coarse: float = _of(
        0.05, "of its gain", "evidence for names is divided by it: no law is exactly of a form", FITTED
    )
    credible: float = _of(0.8, "1", "probability that a group of names holds the right one", FITTED)
    recognised: float = _of(0.8, "1", "probability that a law is one of the names it is like", FITTED)
    recognised_unknown: float = _of(0.6, "1", "probability that what is like no name is `unknown`", CHOSEN)
    manoeuvre_speed: float = _of(
        0.1, "m/s", "a manoeuvre tells two names apart if speeds differ by more than this ...", SENSORS
    )
    manoeuvre_drift: float = _of(0.01, "m/s^2", "... and this for each second since it began", SENSORS)

    # unknown: what has no name
    unknown_gain: float = _of(75.0, "nats", "what laws or trees must gain", CHOSEN)
    unknown_share: float = _of(
        0.3, "of the names' gain", "what they must gain beside names; a slow force, of all squares", CHOSEN
    )
    unknown_share_parameters: float = _of(
        0.06, "of their gain", "what they must gain where parameters alone were found", CHOSEN
    )
    unknown_discrepancies: float = _of(
        2.0, "1", "times the model discrepancy that their rms must reach", CHOSEN
    )
    doubt_gain: float = _of(40.0, "nats", "beyond it, and ...", CHOSEN)
    doubt_share: float = _of(
        0.15, "of the names' gain", "... beyond it, laws beside the main name make it doubtful", CHOSEN
    )
    explains: float = _of(
        0.55, "of both gains", "names that explain less are the nearest relatives of an unknown", CHOSEN
    )
    another_form: float = _of(
        0.3, "of both gains", "names that explain more, by the laws' own signals, have another form", CHOSEN
    )
    another_form_squares: float = _of(
        0.6, "of the squares", "of the laws that must act by a name's own signals for that", CHOSEN
    )
    trifle: float = _of(
        0.03, "1", "share of the explained below which a finding is the error of another's form", CHOSEN
    )
    before_parameters: float = _of(
        0.25, "of the largest share", "physics with a smaller share is listed after parameters", CHOSEN
    )
    most_laws: int = _of(4, "laws", "without a name, at once", CHOSEN)
    law_gain: float = _of(10.0, "nats", "a further law without a name", CHOSEN)
    trees_r2: float = _of(0.06, "1", "held-out r2 that trees must exceed", CHOSEN)
    formula_importance: float = _of(0.05, "1", "importance of the signals a formula may have", CHOSEN)
    formula_r2: float = _of(0.1, "1", "held-out r2 that a formula must reach", CHOSEN)
    formula_near_best: float = _of(0.98, "of the best r2", "that a simpler formula must reach", CHOSEN)
    formula_most_left: float = _of(2.0, "of the best's rest", "that a simpler formula may leave", CHOSEN)
    formula_beyond: float = _of(
        3.0, "of the largest force", "that a formula may reach between its places", CHOSEN
    )

    # slow forces and roads
    slow_force: float = _of(
        0.08, "m/s^2", "rms that a slow force must exceed: ordinary wind gives a light vehicle less", TRUCKS
    )
    slow_force_noise: float = _of(3.0, "1", "times what white noise leaves that it must exceed", CHOSEN)
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
    window_off: float = _of(6.5, "sd", "by which the mean innovation over a window must be off", CHOSEN)
    window_speed: float = _of(2.5, "m/s", "slower, idling engines and slipping clutches are left out", TRUCKS)
    window_longest_s: float = _of(
        300.0, "s", "a longer window is not narrowed to where the force sets in and lets go", CHOSEN
    )
    windows_most: float = _of(0.2, "of the time", "all windows together, where nothing has a name", CHOSEN)
    windows_most_beside: float = _of(0.06, "of the time", "the same beside names", CHOSEN)
    windows_share: float = _of(
        0.5, "of the gain", "that must lie in windows for a term there to take another's place", CHOSEN
    )
    window_penalty: float = _of(6.0, "nats", "of each window: the penalty of having looked for it", CHOSEN)
    windows_gain: float = _of(45.0, "nats", "a term in windows alone", CHOSEN)
    bursts_gain: float = _of(120.0, "nats", "forces of any size in windows, without a name", CHOSEN)

    # learned simulators: model discrepancy
    own_driving_s: float = _of(120.0, "s", "of kept recordings that measure the discrepancy", CHOSEN)
    unmeasured_discrepancy: float = _of(
        0.04, "m/s^2", "rms where none are kept: that of one trained on an hour", CHOSEN
    )
    discrepancy_safety: float = _of(
        1.5, "1", "times what is measured on its own recordings that is allowed for", CHOSEN
    )
    other_driving: float = _of(
        2.0, "1", "times the size a term has there that it may have on other driving", CHOSEN
    )
    learnable: float = _of(0.05, "m/s^2", "rms that no discrepancy of a signal it cannot see has", CHOSEN)

    # what the truck's controllers tell of their own faults
    fault_share: float = _of(
        0.8, "1", "of the time in which a force acts, that a fault must be active in to be told", CHOSEN
    )
    fault_odds: float = _of(
        3.0, "1", "times as often as without a fault the force must act with it to tell of it", CHOSEN
    )

    # validation: what is withdrawn
    weak: float = _of(
        60.0, "nats", "a stronger finding is told also where no held-out drive shows it", CHOSEN
    )
    clear: float = _of(120.0, "nats", "the same of a law, and of a time-varying term", CHOSEN)
    strong_learned: float = _of(
        150.0, "nats", "the same beside a learned simulator, where drives are worse", CHOSEN
    )
    clearly_better: float = _of(
        0.6, "of the error as given", "at which parameters are told by few nats", CHOSEN
    )
    drives_worse: float = _of(
        1.33,
        "of its own error",
        "beyond which a learned simulator differs here, though nothing has a name",
        CHOSEN,
    )
    no_better: float = _of(
        0.97,
        "of the error",
        "of other parameters, or as given, above which a correction is no better",
        CHOSEN,
    )

    def possible(self, parameter: str, vehicle: VehicleKind = UNSTATED) -> tuple[float, float]:
        """Smallest and largest relative change of a parameter that such a vehicle can have."""
        return {
            "mass": vehicle.mass_change,
            "drag_area": self.possible_drag_area,
            "rolling_resistance": self.possible_rolling_resistance,
            "torque_gain": self.possible_torque_gain,
            "brake_gain": self.possible_brake_gain,
        }[parameter]


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
