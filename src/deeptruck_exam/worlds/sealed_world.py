"""The world of the sealed family: it joins the others' table when the family has been proved."""

from __future__ import annotations

from deeptruck_exam.worlds import ferries, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

SEALED_WORLD = World(  # fjords and narrow roads; people who give way early, press on, or drive by notches
    Fleet(
        shape=1.6,
        tied=trucks.WITH_AGE,
        lines={
            "drag_area": (0.87, 0.98, 1.14),
            "engine_inertia": (0.9, 1.0, 1.15),
            "brake_heat_capacity": (0.9, 1.0, 1.12),
        },
        load_shape=0.55,
        highest_m=500.0,
    ),
    ferries.fjords,
    ferries.troughs_down,
    ferries.narrow,
    (
        Habits((2.0, 4.0), (0.15, 0.5), (0.18, 0.32), 0.005, (0.8, 2.0), mood=(0.025, 4.0), glides=0.35),
        Habits((0.7, 1.4), (0.1, 0.4), (0.28, 0.5), 0.006, (1.8, 4.0), (0.05, 0.15), mood=(0.05, 1.6)),
        Habits((1.2, 2.4), (0.2, 0.6), (0.22, 0.4), 0.006, (0.9, 2.2), notch=(0.02, 0.05), mood=(0.035, 3.0)),
    ),
    Logger(
        {
            "speed": Sense((0.006, 0.024), 0.2, (KMH / 256.0,), lag_s=(0.03, 0.2)),
            "acceleration": Sense(
                (0.03, 0.1), 0.1, (0.01, 0.03), lag_s=(0.0, 0.15), bias=0.005, walk=(0.0, 0.0022)
            ),
            "grade": Sense((0.0006, 0.0018), 2.8, (0.0002, 0.001), (0.0, 0.5), 0.0004, every=(1, 2, 5)),
            "fuel_rate": Sense((0.006, 0.02), 0.2, (0.05 / 3.6,), every=(1, 2, 3)),
            "engine_torque": Sense((0.25, 0.8), 0.3, (1.0, 0.5, 0.125), every=(1, 2)),
        },
        jitter_s=(0.001, 0.01),
        jitter_tau_s=0.4,
        late_s=(0.0, 0.055),
        lost=(0.0, 0.012),
        gaps=(0.0, 2.0),
        spikes=(0.0, 1.0),
        runout=(0.0001, 0.0015),
        joined=True,
        pedal_steps=(0.4, 0.3),
    ),
    Machine(ahead_s=2.2, band_mps=0.45, gain_per_s=0.34, integral=0.015),
)
