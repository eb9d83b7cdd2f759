"""Worlds whose land was made by people."""

from __future__ import annotations

from deeptruck_exam.worlds import polders, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

BY_PEOPLE = {
    "polders": World(  # polders and bridges; people who look up seldom, who set right, or who idle along
        Fleet(
            shape=1.3,
            tied=trucks.WITH_AGE,
            lines={
                "rolling_resistance": (0.84, 0.98, 1.08, 1.22),
                "wheel_radius": (0.965, 1.0, 1.03),
                "friction_constant": (0.86, 1.0, 1.16),
            },
            load_shape=0.6,
            highest_m=60.0,
        ),
        polders.polders,
        polders.hairpins_down,
        polders.lapses,
        (
            Habits((1.4, 2.8), (0.3, 0.75), (0.16, 0.3), 0.004, (0.4, 1.0), (0.08, 0.2), mood=(0.015, 8.0)),
            Habits(
                (0.7, 1.5), (0.1, 0.3), (0.32, 0.5), 0.008, (2.0, 4.4), notch=(0.01, 0.05), mood=(0.045, 1.4)
            ),
            Habits((2.2, 4.2), (0.25, 0.6), (0.18, 0.32), 0.006, (0.9, 2.0), mood=(0.03, 3.0), glides=0.4),
        ),
        Logger(
            {
                "speed": Sense((0.006, 0.022), 0.3, (KMH / 256.0,), lag_s=(0.03, 0.19)),
                "acceleration": Sense(
                    (0.03, 0.1),
                    0.12,
                    (0.005, 0.02, 0.04),
                    lag_s=(0.0, 0.16),
                    bias=0.005,
                    walk=(0.0001, 0.002),
                ),
                "grade": Sense((0.0005, 0.0017), 2.8, (0.0002, 0.0009), (0.0, 0.3), 0.0004, every=(1, 2, 3)),
                "fuel_rate": Sense((0.006, 0.021), 0.25, (0.05 / 3.6,), every=(1, 2, 4)),
                "engine_torque": Sense((0.2, 0.85), 0.25, (1.0, 0.5, 0.125), every=(1, 2)),
            },
            jitter_s=(0.001, 0.011),
            jitter_tau_s=0.4,
            late_s=(0.0, 0.056),
            lost=(0.0, 0.012),
            gaps=(0.1, 2.1),
            spikes=(0.0, 1.2),
            runout=(0.0001, 0.0014),
            joined=False,
            pedal_steps=(0.4, 0.35),
        ),
        Machine(ahead_s=1.2, band_mps=0.4, gain_per_s=0.33, integral=0.03),
    ),
}
