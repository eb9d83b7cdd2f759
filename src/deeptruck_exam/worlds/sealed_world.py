"""The world of the sealed family: it joins the others' table when the family has been proved."""

from __future__ import annotations

from deeptruck_exam.worlds import roads, roundabouts, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

SEALED_WORLD = World(  # between roundabouts; some read the road early, some late, some tread in steps
    Fleet(
        shape=1.4,
        tied=trucks.WITH_AGE,
        lines={
            "full_load_gain": (0.9, 1.0, 1.08),
            "rolling_resistance": (0.8, 0.97, 1.15),
            "wheel_radius": (0.97, 1.0, 1.025),
        },
        load_shape=0.5,
        highest_m=1300.0,
    ),
    roads.gorges,
    roads.noses_down,
    roundabouts.roundabouts,
    (
        Habits((1.6, 3.6), (0.1, 0.5), (0.18, 0.34), 0.006, (1.2, 3.2), mood=(0.03, 3.5), glides=0.45),
        Habits((0.6, 1.3), (0.25, 0.8), (0.25, 0.42), 0.007, (0.7, 1.8), (0.08, 0.2), mood=(0.045, 1.8)),
        Habits((1.0, 2.4), (0.1, 0.4), (0.3, 0.55), 0.004, (1.8, 4.2), notch=(0.015, 0.05), mood=(0.02, 7.0)),
    ),
    Logger(
        {
            "speed": Sense((0.005, 0.024), 0.3, (KMH / 256.0,), lag_s=(0.03, 0.22)),
            "acceleration": Sense(
                (0.03, 0.095), 0.12, (0.01, 0.04), lag_s=(0.0, 0.16), bias=0.005, walk=(0.0002, 0.0022)
            ),
            "grade": Sense((0.0006, 0.0019), 2.2, (0.0002, 0.001), (0.05, 0.5), 0.0004, every=(1, 2, 3, 5)),
            "fuel_rate": Sense((0.005, 0.02), 0.4, (0.05 / 3.6,), every=(1, 3)),
            "engine_torque": Sense((0.2, 0.8), 0.25, (1.0, 0.5, 0.125), every=(1, 2, 3)),
        },
        jitter_s=(0.0015, 0.011),
        jitter_tau_s=0.15,
        late_s=(0.01, 0.055),
        lost=(0.0, 0.01),
        gaps=(0.0, 2.2),
        spikes=(0.0, 0.8),
        runout=(0.0, 0.0016),
        joined=True,
        pedal_steps=(0.4, 0.8),
    ),
    Machine(ahead_s=2.8, band_mps=0.4, gain_per_s=0.38, integral=0.014),
)
