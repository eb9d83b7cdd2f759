"""Worlds whose land a river made."""

from __future__ import annotations

from deeptruck_exam.worlds import terraces, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

BY_RIVER = {
    "terraces": World(  # terraces and roadworks; people who are calm, who close up, or who are unsure
        Fleet(
            shape=1.5,
            tied=trucks.WITH_SIZE,
            lines={
                "rolling_resistance": (0.82, 0.95, 1.06, 1.24),
                "final_drive": (0.94, 1.0, 1.05),
                "drag_area": (0.87, 1.0, 1.14),
            },
            load_shape=0.7,
            highest_m=700.0,
        ),
        terraces.terraces,
        terraces.stair_down,
        terraces.works,
        (
            Habits((2.0, 3.8), (0.3, 0.75), (0.16, 0.28), 0.005, (0.6, 1.5), (0.05, 0.14), mood=(0.02, 5.0)),
            Habits((0.6, 1.3), (0.1, 0.35), (0.3, 0.48), 0.007, (1.8, 4.2), mood=(0.04, 1.6), glides=0.15),
            Habits(
                (1.2, 2.6),
                (0.2, 0.55),
                (0.2, 0.36),
                0.006,
                (1.2, 2.6),
                notch=(0.015, 0.05),
                mood=(0.055, 2.0),
            ),
        ),
        Logger(
            {
                "speed": Sense((0.006, 0.021), 0.35, (KMH / 256.0,), lag_s=(0.02, 0.18)),
                "acceleration": Sense(
                    (0.03, 0.1), 0.18, (0.005, 0.02, 0.04), lag_s=(0.01, 0.16), bias=0.005, walk=(0.0, 0.002)
                ),
                "grade": Sense((0.0005, 0.0017), 2.4, (0.0002, 0.001), (0.0, 0.4), 0.0004, every=(1, 2, 4)),
                "fuel_rate": Sense((0.006, 0.02), 0.3, (0.05 / 3.6,), every=(1, 2, 5)),
                "engine_torque": Sense((0.2, 0.8), 0.28, (1.0, 0.5, 0.125), every=(1, 2)),
            },
            jitter_s=(0.001, 0.011),
            jitter_tau_s=0.6,
            late_s=(0.0, 0.057),
            lost=(0.0, 0.011),
            gaps=(0.0, 2.2),
            spikes=(0.0, 1.2),
            runout=(0.0001, 0.0015),
            joined=True,
            pedal_steps=(0.4, 0.28),
        ),
        Machine(ahead_s=1.8, band_mps=0.4, gain_per_s=0.34, integral=0.022),
    ),
}
