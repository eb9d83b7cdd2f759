"""The world of the sealed family: it joins the others' table when the family has been proved."""

from __future__ import annotations

from deeptruck_exam.worlds import loess, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

SEALED_WORLD = World(  # round hills and convoys; people who follow closely, who let it roll, who tread late
    Fleet(
        shape=1.1,
        tied=trucks.WITH_AGE,
        lines={
            "wheel_radius": (0.97, 1.0, 1.03),
            "final_drive": (0.94, 1.0, 1.07),
            "drag_area": (0.88, 1.02, 1.17),
        },
        load_shape=0.6,
        highest_m=1300.0,
    ),
    loess.round_hills,
    loess.gullies_down,
    loess.convoys,
    (
        Habits((0.7, 1.6), (0.1, 0.35), (0.26, 0.46), 0.007, (1.4, 3.4), mood=(0.035, 1.8)),
        Habits((2.4, 4.6), (0.35, 0.9), (0.14, 0.26), 0.004, (0.6, 1.5), mood=(0.02, 5.5), glides=0.45),
        Habits((0.9, 1.8), (0.3, 0.7), (0.3, 0.5), 0.006, (0.5, 1.2), (0.1, 0.3), (0.02, 0.06), (0.045, 2.5)),
    ),
    Logger(
        {
            "speed": Sense((0.006, 0.024), 0.3, (KMH / 256.0,), lag_s=(0.03, 0.19)),
            "acceleration": Sense(
                (0.03, 0.1), 0.2, (0.01, 0.04), lag_s=(0.0, 0.15), bias=0.005, walk=(0.0, 0.0022)
            ),
            "grade": Sense((0.0006, 0.0019), 2.5, (0.0002, 0.001), (0.0, 0.5), 0.0004, every=(1, 2, 3, 5)),
            "fuel_rate": Sense((0.006, 0.02), 0.25, (0.05 / 3.6,), every=(1, 2, 5)),
            "engine_torque": Sense((0.2, 0.8), 0.25, (1.0, 0.5, 0.125), every=(1, 2, 3)),
        },
        jitter_s=(0.001, 0.011),
        jitter_tau_s=0.6,
        late_s=(0.0, 0.055),
        lost=(0.0, 0.011),
        gaps=(0.0, 2.2),
        spikes=(0.0, 1.2),
        runout=(0.0001, 0.0016),
        joined=True,
        pedal_steps=(0.4, 0.25),
    ),
    Machine(ahead_s=1.8, band_mps=0.4, gain_per_s=0.32, integral=0.018),
)
