"""The world of the sealed family: it joins the others' table when the family has been proved."""

from __future__ import annotations

from deeptruck_exam.worlds import sand_ridges, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

SEALED_WORLD = (
    World(  # sand ridges and cameras; people who let it run, who watch the needle, or who are worn out
        Fleet(
            shape=1.1,
            tied=trucks.WITH_AGE,
            lines={
                "rolling_resistance": (0.88, 1.0, 1.12, 1.3),
                "full_load_gain": (0.92, 1.0, 1.08),
                "drag_area": (0.9, 1.04, 1.2),
            },
            load_shape=0.8,
            highest_m=400.0,
        ),
        sand_ridges.sand_ridges,
        sand_ridges.dammed_down,
        sand_ridges.cameras,
        (
            Habits((1.0, 2.2), (0.35, 0.8), (0.18, 0.3), 0.005, (0.5, 1.2), mood=(0.025, 6.0), glides=0.35),
            Habits((0.8, 1.6), (0.08, 0.25), (0.3, 0.46), 0.008, (2.2, 4.6), mood=(0.035, 1.2)),
            Habits((1.6, 3.2), (0.3, 0.7), (0.2, 0.34), 0.005, (0.7, 1.8), (0.04, 0.16), mood=(0.05, 3.5)),
        ),
        Logger(
            {
                "speed": Sense((0.005, 0.02), 0.4, (KMH / 256.0,), lag_s=(0.02, 0.2)),
                "acceleration": Sense(
                    (0.03, 0.11), 0.15, (0.005, 0.01, 0.04), lag_s=(0.0, 0.17), bias=0.005, walk=(0.0, 0.0022)
                ),
                "grade": Sense((0.0005, 0.0018), 2.0, (0.0002, 0.001), (0.0, 0.3), 0.0004, every=(1, 2, 3)),
                "fuel_rate": Sense((0.006, 0.022), 0.35, (0.05 / 3.6,), every=(1, 2, 4)),
                "engine_torque": Sense((0.2, 0.8), 0.3, (1.0, 0.5, 0.125), every=(1, 2)),
            },
            jitter_s=(0.001, 0.012),
            jitter_tau_s=0.5,
            late_s=(0.0, 0.055),
            lost=(0.0, 0.012),
            gaps=(0.1, 2.0),
            spikes=(0.0, 1.3),
            runout=(0.0001, 0.0016),
            joined=False,
            pedal_steps=(0.4, 0.3),
        ),
        Machine(ahead_s=1.5, band_mps=0.5, gain_per_s=0.36, integral=0.026),
    )
)
