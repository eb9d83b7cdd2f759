"""The world of the sealed family: it joins the others' table when the family has been proved."""

from __future__ import annotations

from deeptruck_exam.worlds import badlands, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

SEALED_WORLD = World(  # badlands and fog; people who creep up to what they see, who dash on, or who waver
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
        Habits((1.0, 2.0), (0.15, 0.45), (0.2, 0.4), 0.007, (1.4, 3.0), notch=(0.02, 0.05), mood=(0.06, 2.4)),
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
)
