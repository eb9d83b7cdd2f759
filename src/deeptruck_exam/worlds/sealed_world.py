"""The world of the sealed family: it joins the others' table when the family has been proved."""

from __future__ import annotations

from deeptruck_exam.worlds import cones, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

SEALED_WORLD = World(  # cinder cones and lights; people who jump at green, who coast up to red, or who dab
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
            (2.6, 4.8), (0.3, 0.8), (0.16, 0.3), 0.006, (0.6, 1.6), (0.03, 0.1), mood=(0.02, 6.0), glides=0.55
        ),
        Habits(
            (1.2, 2.4), (0.2, 0.5), (0.2, 0.36), 0.008, (1.0, 2.2), (0.06, 0.18), (0.03, 0.07), (0.03, 3.0)
        ),
    ),
    Logger(
        {
            "speed": Sense((0.006, 0.023), 0.25, (KMH / 256.0,), lag_s=(0.03, 0.2)),
            "acceleration": Sense(
                (0.03, 0.1), 0.15, (0.005, 0.02, 0.04), lag_s=(0.0, 0.17), bias=0.005, walk=(0.0001, 0.0022)
            ),
            "grade": Sense((0.0005, 0.0018), 3.2, (0.0002, 0.0008), (0.05, 0.55), 0.0004, every=(1, 3, 4)),
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
)
