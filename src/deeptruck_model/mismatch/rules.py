"""Every number that decides the verdict, with its unit and source.

Physical limits of vehicles are in vehicle_kinds.py. Numbers that control a computation (grids, iterations,
smoothing) are next to their code and listed by the tests. docs/mismatch_rules.md has the table.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar

SENSORS = "ordinary sensors"
TRUCKS = "what trucks do"
STATISTICS = "convention"
CHOSEN = "chosen on development cases"

T = TypeVar("T")


def _rule(default: T, unit: str, source: str, means: str) -> T:
    return field(default=default, metadata={"unit": unit, "means": means, "source": source})


# fmt: off
@dataclass(frozen=True, kw_only=True)
class Rules:
    """Thresholds of the verdict. Forces per mass in m/s^2, gains of log evidence in nats."""

    # faults of sensors
    accelerometer_bias: float = _rule(0.05, "m/s^2", SENSORS, "a larger bias of the accelerometer is a fault")
    speed_scale: float = _rule(0.03, "1", SENSORS,
        "a larger scale error between speed and accelerometer is a fault")
    clock_offset_s: float = _rule(0.3, "s", SENSORS,
        "a larger delay between speed and accelerometer is a fault")
    sensor_sd: float = _rule(6.5, "standard deviations", STATISTICS,
        "by which a fault of a sensor must differ from none")
    least_delay_s: float = _rule(0.15, "s", SENSORS,
        "a shorter delay of commands is that of message periods and filters")

    # noise
    noise_floor: float = _rule(0.01, "m/s^2", SENSORS, "least standard deviation of the innovations")
    slow_noise: float = _rule(0.015, "m/s^2", CHOSEN,
        "standard deviation of a mean over 10 s that may be noise, of a physics truck")
    tolerance: float = _rule(2.0, "1", CHOSEN,
        "tolerance factor on the spread of the simulator under its own input noise")
    evidence_temperature: float = _rule(9.0, "1", CHOSEN,
        "log evidence is divided by it because the noise model is approximate; nats that a choice costs")
    slow_force: float = _rule(0.08, "m/s^2", TRUCKS,
        "rms that a slow force must exceed: ordinary wind gives a light vehicle less")

    # detection
    discrepancy: float = _rule(2.0, "1", CHOSEN,
        "times the gain on a learned simulator's own recordings that a name must exceed on others")
    parameter_gain: float = _rule(20.0, "nats", CHOSEN,
        "gain of unrecorded braking, below which it is not reported")
    nearly_right: float = _rule(0.015, "1", CHOSEN,
        "relative error that any simulator's parameter may have: its interval is beyond it")

    odds: float = _rule(0.02, "1", CHOSEN,
        "prior odds that a mechanism is in, times its chance among the others")

    # names
    stated: float = _rule(0.9, "1", STATISTICS, "probability of the deepest node of the tree that is stated")
    named: float = _rule(0.5, "1", STATISTICS,
        "probability that a family is in, from which on it is a finding")
    credible: float = _rule(0.8, "1", STATISTICS,
        "probability that a credible set of names holds the right one")
    most_findings: int = _rule(4, "1", CHOSEN, "names of one verdict")

    # events
    false_events: float = _rule(0.05, "1/h", STATISTICS,
        "expected events in driving in which nothing happens")
    several: int = _rule(2, "events", STATISTICS,
        "in which a name must act, if it has no force outside events")

    # budget
    witness: float = _rule(0.1, "1", CHOSEN,
        "share of a part's variance on drives left out, above which a channel is a witness of it")

    # 'nothing missing'
    visible: float = _rule(0.3, "m/s", CHOSEN,
        "speed error of free runs below which nothing that matters is left")
    largest: float = _rule(1.0, "m/s", CHOSEN,
        "speed error of free runs above which a learned simulator misses something, even if its own "
        "recordings show as much")
    differs: float = _rule(1.33, "of its own error", CHOSEN,
        "beyond which a learned simulator differs from these recordings")

    drift: float = _rule(0.1, "m/s", CHOSEN,
        "speed error that a drift, a constant per drive or an event must make, to be a finding")

    # the correction
    better: float = _rule(0.95, "of the error as given", CHOSEN,
        "above which a correction is no better on drives left out")


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits for comparing, reporting and correcting that are the same in every run."""

    # recordings
    least_moving: int = _rule(100, "samples", CHOSEN,
        "while moving, below which two sensors are not compared")
    least_driving_s: float = _rule(60.0, "s", CHOSEN, "usable driving, below which nothing can be said")
    least_speed_sd: float = _rule(0.3, "m/s", CHOSEN,
        "standard deviation of speed, below which a drive shows nothing")
    held_out_share: float = _rule(0.3, "1", STATISTICS,
        "of the driving, held out where no drive was given for it")
    settle_s: float = _rule(6.0, "s", TRUCKS,
        "at the start of a drive or free run, in which the simulator's unknown inner state decays")
    braking_speed: float = _rule(1.0, "m/s", SENSORS, "below which no unrecorded braking is sought")
    standing_m_s: float = _rule(0.1, "m/s", SENSORS,
        "below which a truck may stand, and a force has no visible effect")
    no_vehicle: float = _rule(0.01, "1", CHOSEN,
        "of the simulated samples beyond what a vehicle can do: with more the simulator is none of a vehicle")
    forgotten: float = _rule(0.1, "1", CHOSEN,
        "of the acceleration, that a simulator may lose when it is set to a recorded state")

    speed_noise: float = _rule(0.003, "m/s", SENSORS, "least standard deviation of a speed signal")

    # free runs
    horizons_s: tuple[float, ...] = _rule((40.0, 20.0, 10.0), "s", CHOSEN,
        "lengths of free runs, the longest first: what helps for 20 s may harm after 40")
    high_speed: float = _rule(25.0, "m/s", TRUCKS,
        "of free runs that show what a parameter adds up to on a motorway")
    least_runs: int = _rule(4, "runs", CHOSEN, "needed to choose a length of free runs")
    least_compared: float = _rule(0.9, "1", CHOSEN,
        "of the samples of a free run, above which its error counts")
    least_windows: int = _rule(3, "windows", CHOSEN, "needed to split the error into parts")

    # detection
    usual_discrepancy: float = _rule(0.08, "m/s^2", CHOSEN,
        "rms, by which learned simulators are wrong where the error of this one is not known")
    event_compared: float = _rule(0.7, "1", CHOSEN,
        "of the samples of a window, above which an event may be in it")
    notable: float = _rule(0.02, "m/s^2", SENSORS,
        "of a 1 s mean, above which a force acts: noise of ordinary sensors")
    witness_known: float = _rule(0.5, "1", CHOSEN,
        "of a drive in which a channel must be recorded to be a witness")
    seldom: float = _rule(0.05, "1", CHOSEN,
        "share of the spans of a drive in which a channel moves as in an event that names it, at most")
    witness_drives: int = _rule(5, "drives", CHOSEN,
        "left out in turn, below which no channel is a witness of a constant of each drive")
    witness_drives_slow: int = _rule(2, "drives", CHOSEN,
        "left out in turn, below which no channel is a witness of a slow drift")
    least_effective_mass_gain: float = _rule(0.5, "1", CHOSEN,
        "below which the brakes compensate a force, so that its size is not identifiable")
    least_sensitivity: float = _rule(1e-4, "m/s^2", CHOSEN,
        "by 100 % of a parameter, below which the drives say nothing of it")

    # names
    rare: float = _rule(0.02, "1", CHOSEN, "probability below which a name is left out")
    not_always: float = _rule(0.3, "1", CHOSEN,
        "prior odds that an effect varies in time or by condition, times those of its law")
    nameless: float = _rule(0.3, "1", CHOSEN,
        "prior odds that a force follows no mechanism, times those of a mechanism")
    adds_up: float = _rule(0.05, "m/s", CHOSEN,
        "speed error that a force must add up to where it acts, to be a finding")
    form_error: float = _rule(0.1, "1", CHOSEN,
        "model-form error, of the standard deviation of the lasting residual")
    law_error: float = _rule(0.005, "1", CHOSEN,
        "of what laws gain, added to the evidence temperature in the choice of names: laws are approximate")
    least_ratio: float = _rule(0.5, "1", CHOSEN,
        "of the driving on a learned simulator's own recordings: its discrepancy is scaled by no less")
    in_drive: float = _rule(0.15, "1", CHOSEN,
        "of a force's largest rms in a drive, above which it acts in another")


    # the correction
    drives_that_agree: int = _rule(4, "drives", STATISTICS,
        "below which only free runs show whether a correction is better")
    falls: float = _rule(0.9, "1", CHOSEN,
        "one-sided confidence that drives' errors fall, above which a correction is offered")
    least_in: float = _rule(0.1, "1", CHOSEN, "probability of a mechanism, above which it is corrected")
    form_left: float = _rule(0.03, "1", CHOSEN, "of the squares of a mean force, that its forms may leave")
    least_carried: float = _rule(0.5, "1", CHOSEN,
        "of these squares, that forms must carry to other drives, for the name to be corrected")
    simpler: float = _rule(0.05, "1", CHOSEN,
        "of these squares, that a form with fewer coefficients may leave more")
    most_forms: int = _rule(3, "forms", CHOSEN, "of a mechanism that stand for its mean force, at most")
    least_shift: float = _rule(0.005, "1", CHOSEN,
        "relative change of a parameter, below which it is not set")
    least_error: float = _rule(1e-3, "m/s", CHOSEN, "error of a free run that counts as none")
    identified: float = _rule(0.6, "1", CHOSEN,
        "standard deviation of a parameter over that of its prior, below which the drives identify it")
    pair_correlation: float = _rule(0.9, "1", CHOSEN,
        "correlation, above which drives identify two parameters only as a pair")
    mass_saves: float = _rule(0.1, "1", CHOSEN,
        "of the held-out speed error that a mass moved together with a gain must save, at 95 %")
    gain_farther: float = _rule(0.05, "1", CHOSEN,
        "by which a gain may be farther from the given one with the mass moved than with it held")

    # roads
    line_s: float = _rule(300.0, "s", CHOSEN, "of driving, from which on a plain truck can be fitted")
    line_r2: float = _rule(0.4, "1", CHOSEN,
        "of the fast changes that the engine's force of a plain truck must explain")
    position_agrees: float = _rule(0.5, "1", CHOSEN,
        "of the distance driven, or its inverse, that recorded positions must give")
    driven_again: float = _rule(0.3, "1", CHOSEN,
        "of the way that must be driven again, for what is there to be position-dependent")
    times_driven: float = _rule(1.5, "1", CHOSEN,
        "times that a road was driven, below which nothing position-dependent is identifiable")
