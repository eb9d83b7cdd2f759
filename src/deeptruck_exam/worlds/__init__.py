"""Worlds: trucks, roads, traffic, drivers and loggers that a case is made of, as tables of one `World`.

In: a generator of random numbers. Out: parameters of a truck, roads, speeds to follow, a driver, recordings.
Each family of effects came with a world of its own; that of the sealed one is not among `WORLDS`. A deep
simulator's cases keep the plain one, because it has learned from drives there.
"""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.planting import FAMILIES, SEALED
from deeptruck_exam.worlds import bends, car_following, congestion, modes, procedures, roads, traffic, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.sealed_world import SEALED_WORLD
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

HALVES = {"freightliner": (0.85, 1.1, 1.4), "trucksim": (0.7, 1.0, 1.5), "volvo": (0.6, 0.9, 1.3)}
BALLAST = {  # mass over the reference: unladen, part, reference and full load of a test
    "freightliner": (0.82, 1.15, 1.5, 1.85),
    "trucksim": (0.6, 0.95, 1.35, 1.75),
    "volvo": (0.48, 0.75, 1.1, 1.45),
}
WORLDS = {
    "plain": World(
        Fleet(),
        roads.waves,
        roads.steady_down,
        traffic.holds,
        (Habits(),),
        Logger(jitter_s=(0.0024, 0.0064)),
    ),
    "events": World(  # people who act on events (Gawthrop and others, Biological Cybernetics 104, 2011)
        Fleet(shape=3.0, loads=HALVES),
        roads.tangents,
        roads.steady_down,
        traffic.smooth_holds,
        (
            Habits(
                ahead_s=(1.5, 1.5),
                band_mps=(0.0, 0.0),
                gain_per_s=(0.15, 0.35),
                integral=0.006,
                looks_per_s=(0.4, 1.2),
                enough_mps2=(0.10, 0.30),
                mood=(0.03, 3.0),
            ),
        ),
        Logger(
            {"speed": Sense((0.012, 0.032), 0.25, (KMH / 256.0,), lag_s=(0.03, 0.12))},
            jitter_s=(0.005, 0.013),
            jitter_tau_s=0.8,
            lost=(0.002, 0.005),
        ),
    ),
    "vocations": World(
        Fleet(shape=2.0, vocations=True, highest_m=1400.0),
        roads.fractal,
        roads.ramps_down,
        traffic.zones,
        (
            Habits(
                ahead_s=(1.2, 2.8),
                band_mps=(0.25, 0.9),
                gain_per_s=(0.18, 0.32),
                integral=0.004,
                looks_per_s=(0.8, 2.0),
                notch=(0.02, 0.05),
                mood=(0.04, 6.0),
            ),
        ),
        Logger(
            {
                "acceleration": Sense((0.03, 0.08), 0.1, (0.1, 0.02, 1.0 / 2048.0), bias=0.004),
                "grade": Sense((0.0006, 0.0018), 2.5, (0.0001, 0.0005, 0.001), bias=0.0004, every=(1, 2, 5)),
                "engine_torque": Sense((0.4, 0.4), 0.9, (1.0, 0.125)),
            },
            lost=(0.0005, 0.004),
        ),
    ),
    "fleets": World(
        Fleet(tied=trucks.WITH_AGE, load_shape=0.7, highest_m=1200.0),
        roads.swells,
        roads.hairpins_down,
        car_following.following,
        (
            Habits(
                ahead_s=(1.5, 3.5),
                band_mps=(0.1, 0.6),
                gain_per_s=(0.15, 0.30),
                integral=0.005,
                looks_per_s=(0.7, 2.2),
                mood=(0.035, 4.0),
                glides=0.5,
            ),
        ),
        Logger(
            {
                "acceleration": Sense(
                    (0.025, 0.07), 0.0, (0.01, 0.05, 0.1), lag_s=(0.0, 0.1), bias=0.004, walk=(0.0005, 0.0025)
                ),
                "grade": Sense((0.0005, 0.0016), 3.5, (0.0002,), (0.05, 0.4), 0.0004, every=(1, 2, 5, 10)),
                "engine_torque": Sense((0.2, 0.6), 0.0, (1.0, 0.5, 0.125)),
            },
            gaps=(0.0, 1.5),
            joined=True,
            pedal_steps=(0.4, 0.1),
        ),
    ),
    "hauliers": World(  # half of the people plan far ahead, half fidget; cruise controls plan too
        Fleet(shape=2.0, tied=trucks.WITH_SIZE, load_shape=0.5),
        roads.climbs,
        roads.viaducts_down,
        traffic.planned,
        (
            Habits((0.8, 1.6), (0.1, 0.6), (0.35, 0.55), 0.005, (2.5, 5.0), mood=(0.07, 0.7)),
            Habits((3.0, 5.0), (0.1, 0.6), (0.10, 0.20), 0.005, (0.5, 1.2), mood=(0.02, 8.0)),
        ),
        Logger(
            {
                "speed": Sense((0.004, 0.012), 0.0, (KMH / 256.0,), lag_s=(0.06, 0.2)),
                "acceleration": Sense(
                    (0.04, 0.09), 0.0, (0.02, 0.05), lag_s=(0.05, 0.2), bias=0.005, walk=(0.001, 0.003)
                ),
                "engine_torque": Sense((0.3, 0.8), 0.0, (1.0, 0.5), every=(1, 2, 3)),
            },
            gaps=(0.5, 2.5),
            spikes=(0.0, 3.0),
            runout=(0.0005, 0.002),
            joined=True,
        ),
        Machine(ahead_s=5.0, band_mps=0.5, gain_per_s=0.3, integral=0.01),
    ),
    "proving ground": World(  # test drivers: some by small steps of the pedal, some closely and early
        Fleet(shape=3.0, lines=trucks.CATALOGUE, loads=BALLAST, highest_m=300.0),
        roads.laps,
        roads.measured_down,
        procedures.procedures,
        (
            Habits(
                (0.8, 2.2), (0.3, 0.7), (0.2, 0.4), 0.006, (0.6, 1.5), notch=(0.02, 0.06), mood=(0.02, 3.0)
            ),
            Habits((0.8, 2.2), (0.0, 0.15), (0.2, 0.4), 0.006, (2.0, 4.0), mood=(0.02, 3.0)),
        ),
        Logger(
            {
                "acceleration": Sense(
                    (0.04, 0.10), 0.15, (0.01, 0.0125, 0.05), bias=0.005, walk=(0.0, 0.003)
                ),
                "grade": Sense((0.0005, 0.0016), 3.0, (0.0002, 0.0005, 0.001), bias=0.0005, every=(1, 2, 5)),
                "fuel_rate": Sense((0.005, 0.02), 0.0, (0.05 / 3.6,), every=(1, 2)),
            },
            late_s=(0.01, 0.06),
            lost=(0.0, 0.03),
        ),
    ),
    "trades": World(  # loads of two kinds of trade, roads of straight slopes, people who glide or hurry
        Fleet(shape=1.5, tied=trucks.WITH_SIZE, lines={"final_drive": (0.93, 1.02, 1.1)}, highest_m=900.0),
        roads.tangents,
        roads.viaducts_down,
        traffic.zones,
        (
            Habits((1.0, 2.0), (0.2, 0.5), (0.3, 0.5), 0.005, (1.5, 4.0), mood=(0.05, 1.2), glides=0.2),
            Habits((2.0, 4.0), (0.3, 0.9), (0.12, 0.22), 0.006, (0.5, 1.5), mood=(0.02, 6.0), glides=0.7),
        ),
        Logger(
            {
                "speed": Sense((0.006, 0.02), 0.15, (KMH / 256.0,), lag_s=(0.02, 0.15)),
                "acceleration": Sense((0.03, 0.09), 0.05, (0.01, 0.02), lag_s=(0.0, 0.15), bias=0.004),
                "grade": Sense((0.0006, 0.0015), 2.0, (0.0002, 0.001), (0.0, 0.3), 0.0004, every=(1, 2, 4)),
                "engine_torque": Sense((0.3, 0.7), 0.3, (1.0, 0.5), every=(1, 2)),
            },
            jitter_s=(0.002, 0.008),
            late_s=(0.0, 0.04),
            lost=(0.0, 0.01),
            gaps=(0.0, 1.0),
            runout=(0.0, 0.001),
            pedal_steps=(0.4, 1.0),
        ),
        Machine(ahead_s=2.5, band_mps=0.25, gain_per_s=0.4, integral=0.02),
    ),
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
}
OF_FAMILY = dict(zip(FAMILIES, ("plain", *WORLDS), strict=True))


def of(forms: str, simulator: str, seed: int = 0) -> World:
    """The world a case plays in: the family's own; of all families together, any by the seed."""
    if simulator != "physics":
        return WORLDS["plain"]
    if forms == SEALED:
        return SEALED_WORLD
    any_one = list(WORLDS)[np.random.default_rng([seed, 6]).integers(len(WORLDS))]
    return WORLDS[OF_FAMILY.get(forms, any_one)]
