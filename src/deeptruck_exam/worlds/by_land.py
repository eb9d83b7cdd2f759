"""Worlds that are named by their land."""

from __future__ import annotations

from deeptruck_exam.worlds import bends, congestion, modes, roads, roundabouts, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

BY_LAND = {
    "cuestas": World(  # dense traffic; some drive by large notches, some look far and act early
        Fleet(
            shape=1.2,
            tied=trucks.WITH_AGE,
            lines={"drag_area": (0.85, 1.0, 1.18), "wheel_radius": (0.96, 1.0, 1.03)},
            load_shape=0.45,
            highest_m=700.0,
        ),
        roads.cuestas,
        roads.terraces_down,
        congestion.waves_back,
        (
            Habits(
                (0.6, 1.3),
                (0.3, 0.8),
                (0.25, 0.45),
                0.007,
                (0.8, 2.5),
                (0.15, 0.35),
                (0.03, 0.07),
                (0.04, 2.2),
            ),
            Habits(
                (2.5, 4.5),
                (0.05, 0.25),
                (0.15, 0.28),
                0.004,
                (1.5, 3.5),
                (0.05, 0.15),
                mood=(0.025, 5.0),
                glides=0.3,
            ),
        ),
        Logger(
            {
                "speed": Sense((0.01, 0.025), 0.4, (KMH / 256.0,), lag_s=(0.05, 0.18)),
                "acceleration": Sense(
                    (0.04, 0.10), 0.3, (0.005, 0.025), lag_s=(0.0, 0.08), bias=0.005, walk=(0.0, 0.002)
                ),
                "grade": Sense((0.0007, 0.0018), 4.0, (0.0002, 0.0005), (0.1, 0.4), 0.0004, every=(1, 2, 5)),
                "fuel_rate": Sense((0.008, 0.02), 0.0, (0.05 / 3.6,), every=(1, 2, 5)),
                "engine_torque": Sense((0.2, 0.6), 0.2, (1.0, 0.5, 0.125)),
            },
            jitter_s=(0.003, 0.009),
            jitter_tau_s=0.3,
            late_s=(0.005, 0.05),
            lost=(0.0, 0.006),
            gaps=(0.0, 2.0),
            spikes=(0.0, 1.0),
            runout=(0.0002, 0.0015),
            pedal_steps=(0.4, 0.2),
        ),
        Machine(ahead_s=1.8, band_mps=0.8, gain_per_s=0.25, integral=0.015),
    ),
    "drumlins": World(  # a fleet for hire; hasty, patient and heavy-footed people, a lax machine
        Fleet(
            shape=1.7,
            tied=trucks.WITH_AGE,
            lines={"rolling_resistance": (0.82, 0.95, 1.1, 1.25), "engine_inertia": (0.85, 1.0, 1.2)},
            load_shape=0.6,
            highest_m=1100.0,
        ),
        roads.drumlins,
        roads.fans_down,
        modes.modes,
        (
            Habits((0.7, 1.4), (0.1, 0.4), (0.35, 0.6), 0.006, (2.0, 4.5), mood=(0.06, 0.9)),
            Habits(
                (1.8, 3.2),
                (0.4, 1.0),
                (0.12, 0.24),
                0.005,
                (0.5, 1.4),
                (0.1, 0.25),
                mood=(0.03, 4.0),
                glides=0.4,
            ),
            Habits(
                (1.0, 2.2), (0.2, 0.6), (0.2, 0.4), 0.007, (0.8, 2.0), notch=(0.04, 0.09), mood=(0.05, 2.5)
            ),
        ),
        Logger(
            {
                "speed": Sense((0.008, 0.022), 0.2, (KMH / 256.0,), lag_s=(0.04, 0.2)),
                "acceleration": Sense(
                    (0.03, 0.11), 0.08, (0.01, 0.03), lag_s=(0.02, 0.18), bias=0.005, walk=(0.0, 0.0025)
                ),
                "grade": Sense((0.0006, 0.0017), 5.0, (0.0002, 0.001), (0.0, 0.5), 0.0004, every=(1, 3, 5)),
                "fuel_rate": Sense((0.006, 0.022), 0.3, (0.05 / 3.6,), every=(1, 2)),
                "engine_torque": Sense((0.3, 0.9), 0.5, (1.0, 0.125), every=(1, 2)),
            },
            jitter_s=(0.001, 0.010),
            jitter_tau_s=0.5,
            late_s=(0.0, 0.06),
            lost=(0.001, 0.012),
            gaps=(0.0, 1.2),
            spikes=(0.0, 2.0),
            runout=(0.0, 0.0018),
            joined=True,
            pedal_steps=(0.4, 0.5, 0.1),
        ),
        Machine(ahead_s=3.2, band_mps=0.35, gain_per_s=0.28, integral=0.012),
    ),
    "hummocks": World(  # bends decide; some plan far and roll, some follow late, some press hard by notches
        Fleet(
            shape=2.3,
            tied=trucks.WITH_SIZE,
            lines={
                "final_drive": (0.94, 1.0, 1.08),
                "drag_area": (0.84, 0.97, 1.12),
                "boost_lag": (0.7, 1.0, 1.3),
            },
            load_shape=0.55,
            highest_m=800.0,
        ),
        roads.hummocks,
        roads.slumps_down,
        bends.bendy,
        (
            Habits((2.2, 4.2), (0.2, 0.6), (0.16, 0.3), 0.005, (0.9, 2.2), mood=(0.025, 5.0), glides=0.6),
            Habits((0.5, 1.1), (0.15, 0.5), (0.28, 0.5), 0.008, (1.5, 3.5), mood=(0.05, 1.4)),
            Habits(
                (1.1, 2.0),
                (0.3, 0.7),
                (0.3, 0.5),
                0.005,
                (0.6, 1.4),
                (0.12, 0.3),
                (0.025, 0.06),
                (0.035, 3.0),
            ),
        ),
        Logger(
            {
                "speed": Sense((0.006, 0.026), 0.1, (KMH / 256.0,), lag_s=(0.02, 0.16)),
                "acceleration": Sense(
                    (0.035, 0.10), 0.2, (0.01, 0.02), lag_s=(0.0, 0.12), bias=0.004, walk=(0.0, 0.002)
                ),
                "grade": Sense((0.0005, 0.0018), 3.0, (0.0002, 0.0005), (0.0, 0.6), 0.0004, every=(1, 2, 4)),
                "fuel_rate": Sense((0.007, 0.018), 0.15, (0.05 / 3.6,), every=(1, 2, 4)),
                "engine_torque": Sense((0.25, 0.75), 0.15, (1.0, 0.5), every=(1, 2)),
            },
            jitter_s=(0.002, 0.007),
            jitter_tau_s=1.2,
            late_s=(0.0, 0.05),
            lost=(0.0, 0.015),
            gaps=(0.2, 1.6),
            spikes=(0.0, 1.5),
            runout=(0.0003, 0.0012),
            pedal_steps=(0.4, 0.25),
        ),
        Machine(ahead_s=2.0, band_mps=0.6, gain_per_s=0.32, integral=0.018),
    ),
    "gorges": World(  # between roundabouts; some read the road early, some late, some tread in steps
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
            Habits(
                (1.0, 2.4), (0.1, 0.4), (0.3, 0.55), 0.004, (1.8, 4.2), notch=(0.015, 0.05), mood=(0.02, 7.0)
            ),
        ),
        Logger(
            {
                "speed": Sense((0.005, 0.024), 0.3, (KMH / 256.0,), lag_s=(0.03, 0.22)),
                "acceleration": Sense(
                    (0.03, 0.095), 0.12, (0.01, 0.04), lag_s=(0.0, 0.16), bias=0.005, walk=(0.0002, 0.0022)
                ),
                "grade": Sense(
                    (0.0006, 0.0019), 2.2, (0.0002, 0.001), (0.05, 0.5), 0.0004, every=(1, 2, 3, 5)
                ),
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
    ),
}
