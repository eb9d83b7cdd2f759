"""The world of the sealed family: it joins the others' table when the family has been proved."""

from __future__ import annotations

from deeptruck_exam.worlds import courses, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

SEALED_WORLD = World(  # rounds with obstacles; calm people of few moves, quick ones, and some who roll far
    Fleet(
        shape=1.9,
        tied=trucks.WITH_SIZE,
        lines={
            "final_drive": (0.92, 1.0, 1.06),
            "friction_constant": (0.85, 1.0, 1.2),
            "drag_area": (0.88, 1.02, 1.16),
        },
        load_shape=0.5,
        highest_m=1000.0,
    ),
    courses.karst,
    courses.lava_down,
    courses.errands,
    (
        Habits((1.3, 2.6), (0.2, 0.5), (0.22, 0.36), 0.005, (0.8, 1.8), (0.06, 0.18), mood=(0.025, 4.5)),
        Habits((0.6, 1.2), (0.05, 0.3), (0.3, 0.55), 0.007, (2.2, 4.8), mood=(0.055, 1.1)),
        Habits((2.4, 4.4), (0.3, 0.8), (0.14, 0.26), 0.005, (0.7, 1.6), mood=(0.03, 6.0), glides=0.5),
        Habits(
            (1.0, 2.0), (0.15, 0.5), (0.26, 0.44), 0.006, (1.0, 2.6), notch=(0.02, 0.06), mood=(0.04, 2.4)
        ),
    ),
    Logger(
        {
            "speed": Sense((0.007, 0.023), 0.15, (KMH / 256.0,), lag_s=(0.02, 0.18)),
            "acceleration": Sense(
                (0.03, 0.1), 0.06, (0.01, 0.025), lag_s=(0.01, 0.14), bias=0.005, walk=(0.0, 0.0024)
            ),
            "grade": Sense((0.0006, 0.0017), 3.2, (0.0002, 0.0005), (0.0, 0.45), 0.0004, every=(1, 2, 4, 5)),
            "fuel_rate": Sense((0.006, 0.02), 0.25, (0.05 / 3.6,), every=(1, 2)),
            "engine_torque": Sense((0.25, 0.85), 0.35, (1.0, 0.5, 0.125), every=(1, 2)),
        },
        jitter_s=(0.001, 0.009),
        jitter_tau_s=0.6,
        late_s=(0.0, 0.05),
        lost=(0.0, 0.011),
        gaps=(0.0, 1.8),
        spikes=(0.0, 1.2),
        runout=(0.0002, 0.0014),
        joined=False,
        pedal_steps=(0.4, 0.2, 0.6),
    ),
    Machine(ahead_s=2.4, band_mps=0.5, gain_per_s=0.3, integral=0.016),
)
