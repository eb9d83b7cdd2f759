"""Worlds whose land water has dissolved or cut, ice has deepened, or has no way out for its rivers."""

from __future__ import annotations

from deeptruck_exam.worlds import courses, ferries, loess, playas, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

BY_WATER = {
    "karst": World(  # rounds with obstacles; calm people of few moves, quick ones, and some who roll far
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
                "grade": Sense(
                    (0.0006, 0.0017), 3.2, (0.0002, 0.0005), (0.0, 0.45), 0.0004, every=(1, 2, 4, 5)
                ),
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
    ),
    "fjords": World(  # fjords and narrow roads; people who give way early, press on, or drive by notches
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
            Habits(
                (1.2, 2.4), (0.2, 0.6), (0.22, 0.4), 0.006, (0.9, 2.2), notch=(0.02, 0.05), mood=(0.035, 3.0)
            ),
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
    ),
    "basins": World(  # basins and ranges; people who drive on and on, press to pass, or tread in steps
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
    ),
    "round hills": World(  # round hills and convoys; people who follow closely, let it roll, or tread late
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
            Habits(
                (0.9, 1.8), (0.3, 0.7), (0.3, 0.5), 0.006, (0.5, 1.2), (0.1, 0.3), (0.02, 0.06), (0.045, 2.5)
            ),
        ),
        Logger(
            {
                "speed": Sense((0.006, 0.024), 0.3, (KMH / 256.0,), lag_s=(0.03, 0.19)),
                "acceleration": Sense(
                    (0.03, 0.1), 0.2, (0.01, 0.04), lag_s=(0.0, 0.15), bias=0.005, walk=(0.0, 0.0022)
                ),
                "grade": Sense(
                    (0.0006, 0.0019), 2.5, (0.0002, 0.001), (0.0, 0.5), 0.0004, every=(1, 2, 3, 5)
                ),
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
    ),
}
