"""The world of the sealed family: it joins the others' table when the family has been proved."""

from __future__ import annotations

from deeptruck_exam.worlds import playas, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

SEALED_WORLD = (
    World(  # basins and ranges; people who drive on and on, who press to pass, or who tread in steps
        Fleet(
            shape=1.3,
            tied=trucks.WITH_SIZE,
            lines={
                "full_load_gain": (0.92, 1.0, 1.1),
                "shift_time": (0.8, 1.0, 1.2),
                "drag_area": (0.86, 1.0, 1.15),
            },
            load_shape=0.5,
            highest_m=1800.0,
        ),
        playas.basins,
        playas.washes_down,
        playas.held_up,
        (
            Habits((2.0, 4.2), (0.3, 0.9), (0.14, 0.28), 0.005, (0.5, 1.4), mood=(0.02, 6.5), glides=0.4),
            Habits((0.5, 1.2), (0.1, 0.4), (0.3, 0.55), 0.007, (1.6, 3.8), (0.06, 0.2), mood=(0.05, 1.3)),
            Habits(
                (1.2, 2.6), (0.2, 0.7), (0.2, 0.38), 0.006, (0.7, 1.8), notch=(0.025, 0.07), mood=(0.03, 4.0)
            ),
        ),
        Logger(
            {
                "speed": Sense((0.007, 0.025), 0.25, (KMH / 256.0,), lag_s=(0.02, 0.2)),
                "acceleration": Sense(
                    (0.03, 0.1), 0.15, (0.01, 0.035), lag_s=(0.0, 0.14), bias=0.005, walk=(0.0, 0.0024)
                ),
                "grade": Sense(
                    (0.0006, 0.0018), 3.5, (0.0002, 0.0005), (0.0, 0.5), 0.0004, every=(1, 2, 3, 5)
                ),
                "fuel_rate": Sense((0.006, 0.02), 0.3, (0.05 / 3.6,), every=(1, 2, 4)),
                "engine_torque": Sense((0.2, 0.8), 0.3, (1.0, 0.5, 0.125), every=(1, 2)),
            },
            jitter_s=(0.001, 0.01),
            jitter_tau_s=0.9,
            late_s=(0.0, 0.055),
            lost=(0.0, 0.012),
            gaps=(0.0, 2.0),
            spikes=(0.0, 1.4),
            runout=(0.0001, 0.0016),
            pedal_steps=(0.4, 0.25, 0.5),
        ),
        Machine(ahead_s=3.0, band_mps=0.55, gain_per_s=0.3, integral=0.014),
    )
)
