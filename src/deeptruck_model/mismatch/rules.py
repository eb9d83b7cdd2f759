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
        9.0,
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
        0.02, "1", "prior odds that a mechanism is in, times its chance among the others", CHOSEN
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
        0.1,
        "m/s",
        "speed error that a drift, a constant per drive or an event must make, to be a finding",
        CHOSEN,
    )

    # the correction
    better: float = _rule(
        0.97, "of the error as given", "above which a correction is no better on drives left out", CHOSEN
    )


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits for comparing, reporting and correcting that are the same in every run."""

    # recordings
    least_moving: int = _rule(
        100, "samples", "while moving, below which two sensors are not compared", CHOSEN
    )
    least_driving_s: float = _rule(60.0, "s", "usable driving, below which nothing can be said", CHOSEN)
    least_speed_sd: float = _rule(
        0.3, "m/s", "standard deviation of speed, below which a drive shows nothing", CHOSEN
    )
    held_out_share: float = _rule(
        0.3, "1", "of the driving, held out where no drive was given for it", STATISTICS
    )
    settle_s: float = _rule(
        6.0,
        "s",
        "at the start of a drive or free run, in which the simulator's unknown inner state decays",
        TRUCKS,
    )
    braking_speed: float = _rule(1.0, "m/s", "below which no unrecorded braking is sought", SENSORS)
    standing_m_s: float = _rule(
        0.1, "m/s", "below which a truck may stand, and a force has no visible effect", SENSORS
    )
    no_vehicle: float = _rule(
        0.01,
        "1",
        "of the simulated samples beyond what a vehicle can do: with more the simulator is none of a vehicle",
        CHOSEN,
    )
    forgotten: float = _rule(
        0.1, "1", "of the acceleration, that a simulator may lose when it is set to a recorded state", CHOSEN
    )

    speed_noise: float = _rule(0.003, "m/s", "least standard deviation of a speed signal", SENSORS)

    # free runs
    horizons_s: tuple[float, ...] = _rule(
        (40.0, 20.0, 10.0),
        "s",
        "lengths of free runs, the longest first: what helps for 20 s may harm after 40",
        CHOSEN,
    )
    least_runs: int = _rule(4, "runs", "needed to choose a length of free runs", CHOSEN)
    least_compared: float = _rule(
        0.9, "1", "of the samples of a free run, above which its error counts", CHOSEN
    )
    least_windows: int = _rule(3, "windows", "needed to split the error into parts", CHOSEN)

    # detection
    usual_discrepancy: float = _rule(
        0.08,
        "m/s^2",
        "rms, by which learned simulators are wrong where the error of this one is not known",
        CHOSEN,
    )
    least_drives: int = _rule(
        4, "drives", "below which their disagreement on a size is not estimated", CHOSEN
    )
    event_compared: float = _rule(
        0.7, "1", "of the samples of a window, above which an event may be in it", CHOSEN
    )
    notable: float = _rule(
        0.02, "m/s^2", "of a 1 s mean, above which a force acts: noise of ordinary sensors", SENSORS
    )
    witness_known: float = _rule(
        0.5, "1", "of a drive in which a channel must be recorded to be a witness", CHOSEN
    )
    witness_drives: int = _rule(
        5,
        "drives",
        "left out in turn, below which no channel is a witness of a constant of each drive",
        CHOSEN,
    )
    witness_drives_slow: int = _rule(
        2, "drives", "left out in turn, below which no channel is a witness of a slow drift", CHOSEN
    )
    least_effective_mass_gain: float = _rule(
        0.5, "1", "below which the brakes compensate a force, so that its size is not identifiable", CHOSEN
    )
    least_sensitivity: float = _rule(
        1e-4, "m/s^2", "by 100 % of a parameter, below which the drives say nothing of it", CHOSEN
    )
    least_effect: float = _rule(
        1e-6, "m/s", "by 20 % of a parameter, below which a simulator does not have it", CHOSEN
    )

    # names
    rare: float = _rule(0.02, "1", "probability below which a name is left out", CHOSEN)
    not_always: float = _rule(
        0.3, "1", "prior odds that an effect varies in time or by condition, times those of its law", CHOSEN
    )
    nameless: float = _rule(
        0.3, "1", "prior odds that a force follows no mechanism, times those of a mechanism", CHOSEN
    )
    form_error: float = _rule(
        0.1,
        "1",
        "model-form error, of the standard deviation of the lasting residual",
        CHOSEN,
    )
    law_error: float = _rule(
        0.005,
        "1",
        "of the gain of the best name, which is added to the evidence temperature: laws are approximate too",
        CHOSEN,
    )
    least_ratio: float = _rule(
        0.5,
        "1",
        "of the driving on a learned simulator's own recordings: its discrepancy is scaled by no less",
        CHOSEN,
    )
    in_drive: float = _rule(
        0.15, "1", "of a force's largest rms in a drive, above which it acts in another", CHOSEN
    )

    mean_wind: float = _rule(
        15.0, "m/s", "headwind of a whole drive, above which its estimate is invalid", TRUCKS
    )

    # the correction
    drives_that_agree: int = _rule(
        4, "drives", "below which only free runs show whether a correction is better", STATISTICS
    )
    falls: float = _rule(
        0.9,
        "1",
        "one-sided confidence that drives' errors fall, above which a correction is offered",
        CHOSEN,
    )
    least_in: float = _rule(0.1, "1", "probability of a mechanism, above which it is corrected", CHOSEN)
    form_left: float = _rule(0.03, "1", "of the squares of a mean force, that its forms may leave", CHOSEN)
    least_carried: float = _rule(
        0.5,
        "1",
        "of these squares, that forms must carry to other drives, for the name to be corrected",
        CHOSEN,
    )
    simpler: float = _rule(
        0.1, "1", "of these squares, that a form with fewer coefficients may leave more", CHOSEN
    )
    most_forms: int = _rule(3, "forms", "of a mechanism that stand for its mean force, at most", CHOSEN)
    least_shift: float = _rule(
        0.005, "1", "relative change of a parameter, below which it is not set", CHOSEN
    )
    least_error: float = _rule(1e-3, "m/s", "error of a free run that counts as none", CHOSEN)
    pair_correlation: float = _rule(
        0.9, "1", "correlation, above which drives identify two parameters only as a pair", CHOSEN
    )
    mass_saves: float = _rule(
        0.1,
        "1",
        "of the held-out speed error that a mass moved together with a gain must save, at 95 %",
        CHOSEN,
    )
    gain_farther: float = _rule(
        0.05,
        "1",
        "by which a gain may be farther from the given one with the mass moved than with it held",
        CHOSEN,
    )

    # roads
    line_s: float = _rule(300.0, "s", "of driving, from which on a slow force is identifiable", CHOSEN)
    line_r2: float = _rule(
        0.4, "1", "of the fast changes that a line through the recordings must explain", CHOSEN
    )
    by_chance: float = _rule(
        0.99, "1", "quantile of the agreement by chance, which the windows of a road must exceed", STATISTICS
    )
    road_share: float = _rule(0.05, "1", "of the windows that must be found again on a road", CHOSEN)
    road_windows: int = _rule(
        3, "windows", "apart from each other, that must be found again on a road", CHOSEN
    )
    position_agrees: float = _rule(
        0.5, "1", "of the distance driven, or its inverse, that recorded positions must give", CHOSEN
    )
    least_road_km: float = _rule(0.5, "km", "of a recording on a known road, below which it has none", CHOSEN)
    least_road_s: int = _rule(10, "s", "of a recording with a slope, below which it has no road", CHOSEN)
    driven_again: float = _rule(
        0.3, "1", "of the way that must be driven again, for what is there to be position-dependent", CHOSEN
    )
    times_driven: float = _rule(
        1.5,
        "1",
        "times that a road was driven, below which nothing position-dependent is identifiable",
        CHOSEN,
    )
