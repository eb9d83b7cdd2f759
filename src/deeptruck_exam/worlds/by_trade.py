"""Worlds that differ by whose trucks drive there, and by who drives them."""

from __future__ import annotations

from deeptruck_exam.worlds import car_following, procedures, roads, traffic, trucks
from deeptruck_exam.worlds.drivers import Habits, Machine
from deeptruck_exam.worlds.loggers import KMH, Logger, Sense
from deeptruck_exam.worlds.trucks import Fleet
from deeptruck_exam.worlds.world import World

HALVES = {"freightliner": (0.85, 1.1, 1.4), "trucksim": (0.7, 1.0, 1.5), "volvo": (0.6, 0.9, 1.3)}
BALLAST = {  # mass over the reference: unladen, part, reference and full load of a test
    "freightliner": (0.82, 1.15, 1.5, 1.85),
    "trucksim": (0.6, 0.95, 1.35, 1.75),
    "volvo": (0.48, 0.75, 1.1, 1.45),
}
BY_TRADE = {
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
}
