"""Worlds whose land is shaped by its rock."""

from __future__ import annotations

from deeptruck_exam.worlds import badlands, cones, folds, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

BY_ROCK = {
    "folds": World(  # folded ridges and timetables; people who hurry, who look far ahead, or who fidget
        Fleet(
            shape=1.8,
            tied=trucks.WITH_SIZE,
            lines={
                "rolling_resistance": (0.83, 0.98, 1.12, 1.27),
                "friction_quadratic": (0.88, 1.0, 1.18),
                "drag_area": (0.85, 0.99, 1.13),
            },
            load_shape=0.65,
            highest_m=900.0,
        ),
        folds.folds,
        folds.waves_down,
        folds.timetable,
        (
            Habits((0.6, 1.4), (0.15, 0.45), (0.28, 0.48), 0.006, (1.2, 3.0), (0.04, 0.12), mood=(0.04, 2.0)),
            Habits((2.8, 5.0), (0.25, 0.7), (0.15, 0.28), 0.005, (0.5, 1.3), mood=(0.025, 5.0), glides=0.3),
            Habits(
                (1.0, 2.2), (0.1, 0.35), (0.22, 0.4), 0.007, (2.4, 5.0), notch=(0.01, 0.04), mood=(0.055, 0.9)
            ),
        ),
        Logger(
            {
                "speed": Sense((0.007, 0.022), 0.4, (KMH / 256.0,), lag_s=(0.02, 0.17)),
                "acceleration": Sense(
                    (0.03, 0.1), 0.25, (0.01, 0.02, 0.04), lag_s=(0.01, 0.16), bias=0.005, walk=(0.0, 0.002)
                ),
                "grade": Sense((0.0006, 0.0018), 2.2, (0.0003, 0.001), (0.0, 0.55), 0.0004, every=(1, 2, 4)),
                "fuel_rate": Sense((0.006, 0.02), 0.35, (0.05 / 3.6,), every=(1, 3, 5)),
                "engine_torque": Sense((0.25, 0.85), 0.2, (1.0, 0.5, 0.125), every=(1, 2)),
            },
            jitter_s=(0.001, 0.012),
            jitter_tau_s=0.3,
            late_s=(0.0, 0.06),
            lost=(0.0, 0.01),
            gaps=(0.0, 2.4),
            spikes=(0.0, 1.0),
            runout=(0.0002, 0.0015),
            joined=False,
            pedal_steps=(0.4, 0.2),
        ),
        Machine(ahead_s=2.0, band_mps=0.35, gain_per_s=0.36, integral=0.02),
    ),
    "cones": World(  # cinder cones and lights; people who jump at green, who coast up to red, or who dab
        Fleet(
            shape=1.4,
            tied=trucks.WITH_AGE,
            lines={
                "rolling_resistance": (0.8, 0.95, 1.08, 1.24),
                "final_drive": (0.93, 0.99, 1.06),
                "full_load_gain": (0.9, 1.0, 1.1),
            },
            load_shape=0.5,
            highest_m=1600.0,
        ),
        cones.cones,
        cones.flanks_down,
        cones.lights,
        (
            Habits((0.5, 1.2), (0.1, 0.4), (0.32, 0.52), 0.005, (1.6, 3.6), mood=(0.045, 1.2)),
            Habits(
                (2.6, 4.8),
                (0.3, 0.8),
                (0.16, 0.3),
                0.006,
                (0.6, 1.6),
                (0.03, 0.1),
                mood=(0.02, 6.0),
                glides=0.55,
            ),
            Habits(
                (1.2, 2.4),
                (0.2, 0.5),
                (0.2, 0.36),
                0.008,
                (1.0, 2.2),
                (0.06, 0.18),
                (0.03, 0.07),
                (0.03, 3.0),
            ),
        ),
        Logger(
            {
                "speed": Sense((0.006, 0.023), 0.25, (KMH / 256.0,), lag_s=(0.03, 0.2)),
                "acceleration": Sense(
                    (0.03, 0.1),
                    0.15,
                    (0.005, 0.02, 0.04),
                    lag_s=(0.0, 0.17),
                    bias=0.005,
                    walk=(0.0001, 0.0022),
                ),
                "grade": Sense(
                    (0.0005, 0.0018), 3.2, (0.0002, 0.0008), (0.05, 0.55), 0.0004, every=(1, 3, 4)
                ),
                "fuel_rate": Sense((0.006, 0.021), 0.2, (0.05 / 3.6,), every=(1, 2, 3)),
                "engine_torque": Sense((0.2, 0.85), 0.35, (1.0, 0.5, 0.125), every=(1, 3)),
            },
            jitter_s=(0.0015, 0.011),
            jitter_tau_s=0.8,
            late_s=(0.0, 0.058),
            lost=(0.0, 0.012),
            gaps=(0.1, 2.0),
            spikes=(0.0, 1.3),
            runout=(0.0001, 0.0014),
            joined=True,
            pedal_steps=(0.4, 0.3),
        ),
        Machine(ahead_s=2.6, band_mps=0.5, gain_per_s=0.34, integral=0.016),
    ),
    "badlands": World(  # badlands and fog; people who creep up to what they see, who dash on, or who waver
        Fleet(
            shape=1.6,
            tied=trucks.WITH_SIZE,
            lines={
                "rolling_resistance": (0.82, 0.96, 1.1, 1.25),
                "drag_area": (0.88, 1.0, 1.1),
                "driveline_efficiency": (0.985, 1.0, 1.01),
            },
            load_shape=0.8,
            highest_m=1200.0,
        ),
        badlands.badlands,
        badlands.knicks_down,
        badlands.fog,
        (
            Habits((1.8, 3.4), (0.3, 0.7), (0.18, 0.32), 0.006, (0.8, 1.8), (0.04, 0.1), mood=(0.025, 4.0)),
            Habits((0.5, 1.1), (0.1, 0.35), (0.3, 0.5), 0.006, (1.8, 4.0), mood=(0.05, 1.0), glides=0.2),
            Habits(
                (1.0, 2.0), (0.15, 0.45), (0.2, 0.4), 0.007, (1.4, 3.0), notch=(0.02, 0.05), mood=(0.06, 2.4)
            ),
        ),
        Logger(
            {
                "speed": Sense((0.007, 0.021), 0.5, (KMH / 256.0,), lag_s=(0.02, 0.18)),
                "acceleration": Sense(
                    (0.035, 0.1), 0.2, (0.01, 0.02, 0.04), lag_s=(0.01, 0.15), bias=0.005, walk=(0.0, 0.0021)
                ),
                "grade": Sense((0.0006, 0.0017), 2.6, (0.0002, 0.001), (0.0, 0.5), 0.0004, every=(1, 2, 5)),
                "fuel_rate": Sense((0.007, 0.02), 0.3, (0.05 / 3.6,), every=(1, 2, 5)),
                "engine_torque": Sense((0.25, 0.8), 0.3, (1.0, 0.5, 0.125), every=(1, 2)),
            },
            jitter_s=(0.001, 0.011),
            jitter_tau_s=0.5,
            late_s=(0.0, 0.055),
            lost=(0.0, 0.011),
            gaps=(0.0, 2.2),
            spikes=(0.0, 1.1),
            runout=(0.0001, 0.0015),
            joined=True,
            pedal_steps=(0.4, 0.25),
        ),
        Machine(ahead_s=1.6, band_mps=0.45, gain_per_s=0.35, integral=0.025),
    ),
}
