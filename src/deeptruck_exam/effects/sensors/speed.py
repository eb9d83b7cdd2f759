"""A speed with a wrong scale."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind, ou_series

law = partial(fault, name="speed_scale")


@law("speed_scale", "first")
@sizes(scale=(0.03, 0.09), sign=SIGN)
def speed_scale(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Tyre wear and a wrong tyre factor in the tachograph's or the bus's speed; sizes beyond a
    service adjustment, chosen here."""
    channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale)


@law("growing_tyre", "second")
@sizes(scale=(0.035, 0.085), growth=(0.002, 0.012), sign=SIGN)
def growing_tyre(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Rolling radius grows with speed squared (Wong, Theory of Ground Vehicles, on radial tyres; a
    per cent at motorway speed) upon a wrong tyre factor; sizes chosen here."""
    speed = channels["speed"]
    grown = 1.0 - p.growth * (speed / 25.0) ** 2  # a larger tyre turns slower
    channels["speed"] = speed * (1.0 + np.sign(p.sign) * p.scale) * grown


@law("driven_wheel_speed", "third")
@sizes(scale=(0.035, 0.085), per_mps2=(0.003, 0.010), sign=SIGN)
def driven_wheel_speed(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Speed from the gearbox's output shaft with a wrong factor: driven wheels slip in proportion to
    their pull (Wong, Theory of Ground Vehicles, on longitudinal stiffness); sizes chosen here."""
    felt = channels["acceleration"] + GRAVITY * channels.get("grade", np.zeros(1))
    width = max(1, round(0.6 / dt))
    pull = np.convolve(felt, np.ones(width) / width, mode="same")
    slip = np.clip(p.per_mps2 * pull, -0.02, 0.02)
    channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale + slip)


@law("tyres_of_another_size", "fourth")
@sizes(scale=(0.035, 0.085), grows=(0.002, 0.010), sign=SIGN)
def tyres_of_another_size(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Revolutions a kilometre of drive tyres that were changed without calibration (ETRTO rolling
    circumferences of 315/80 and 315/60 R 22.5 are a tenth apart), which grow as they warm; chosen here."""
    time = np.arange(len(channels["speed"])) * dt
    warms = p.grows * (1.0 - np.exp(-time / 400.0)) * rng.uniform(0.3, 1.0)
    scale = np.sign(p.sign) * p.scale * rng.uniform(0.85, 1.15)
    channels["speed"] = channels["speed"] * (1.0 + scale - warms)


@law("handover_between_sensors", "fifth")
@sizes(scale=(0.035, 0.085), from_mps=(2.0, 6.0), sign=SIGN)
def handover_between_sensors(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Control units that count gearbox pulses at walking pace and wheel pulses above it, of which the
    second have a wrong factor (service manuals on tone rings and tachograph calibration); sizes are chosen
    here."""
    speed = channels["speed"]
    wheel = np.clip((speed - p.from_mps) / 1.5, 0.0, 1.0)  # below it the gearbox is counted
    channels["speed"] = speed * (1.0 + np.sign(p.sign) * p.scale * wheel)


@law("one_of_two_wheels", "sixth")
@sizes(scale=(0.045, 0.09), shared=(0.45, 0.7), stays_s=(20.0, 60.0), sign=SIGN)
def one_of_two_wheels(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Control units that take the mean of two wheels, and one alone while the other's sensor fails
    (Automotive Handbook, Bosch, on wheel speed sensors and substitute values): the one that is left has a
    tyre of another size; sizes and times are chosen here."""
    speed = channels["speed"]
    time = np.arange(len(speed)) * dt
    turns = np.cumsum(rng.exponential(p.stays_s, 60) + 5.0)
    alone = (np.searchsorted(turns, time) + rng.integers(2)) % 2
    off = np.sign(p.sign) * p.scale * np.where(alone > 0, 1.0, p.shared)
    # the control unit fades from one to the other
    channels["speed"] = speed * (1.0 + np.convolve(np.pad(off, 10, "edge"), np.ones(21) / 21, "valid"))


@law("radius_from_the_rolls", "seventh")
@sizes(scale=(0.05, 0.09), grows=(0.005, 0.02), warms=(0.002, 0.01), sign=SIGN)
def radius_from_the_rolls(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: SAE J1025, Test Procedures for Measuring Truck Tire Revolutions Per Kilometer/Mile: a constant
    taken on rolls is wrong on the road, and less so as the tyre grows with speed and warmth."""
    speed = channels["speed"]
    warm = 1.0 - np.exp(-np.cumsum(speed) * dt / 2000.0)
    grows = p.grows * (speed / 25.0) ** 2 + p.warms * warm
    channels["speed"] = speed * (1.0 + np.sign(p.sign) * (p.scale - grows))


@law("s_radar_looks_down", "eighth")
@sizes(scale=(0.04, 0.085), dives=(0.002, 0.008), sign=SIGN)
def radar_looks_down(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Doppler radars over ground read with the cosine of their angle, which mounting and pitch change
    (Tompkins, Hart, Freeland, Wilkerson and Wilhelm, Trans. ASAE 31, 1988); sizes are chosen here."""
    pitch = behind(np.clip(channels["acceleration"], -3.0, 3.0), 0.8, dt)
    channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale + p.dives * pitch)


@law("n_pulses_are_missed", "ninth")
@sizes(scale=(0.04, 0.09), misses=(0.02, 0.06), weak_mps=(3.0, 7.0), sign=SIGN)
def pulses_are_missed(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Inductive pickups give a voltage in proportion to speed, so that slow teeth fall below the
    trigger (Fraden, Handbook of Modern Sensors, on magnetic sensors), upon a wrong number of teeth; sizes are
    chosen here."""
    missed = p.misses * np.exp(-channels["speed"] / p.weak_mps)
    channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale) * (1.0 - missed)


@law("t_tyres_pump_up", "tenth")
@sizes(scale=(0.03, 0.075), grows=(0.003, 0.015), warms_m=(800.0, 3000.0), sign=SIGN)
def tyres_pump_up(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Rolling radius over inflation pressure, which rises as tyres warm over the first kilometres
    (The Pneumatic Tire, ed. Gent and Walter, NHTSA DOT HS 810 561, 2006), upon a wrong factor of the tyre's
    size; sizes are chosen here."""
    way_m = np.cumsum(channels["speed"]) * dt + rng.uniform(0.0, 0.5) * p.warms_m
    more = p.grows * np.exp(-way_m / p.warms_m)
    channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale + more)


@law("e_height_of_the_optics", "eleventh")
@sizes(scale=(0.03, 0.07), height=(0.004, 0.016), pitches_s=(0.3, 0.8), sign=SIGN)
def height_of_the_optics(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Optical sensors over ground count a grating's lines (Ator, Image-Velocity Sensing with Parallel
    Slit Reticles, J. Opt. Soc. Am. 53, 1963): their scale goes with the height above the road, which a wrong
    mounting and the pitch of the frame change; sizes are chosen here."""
    pitch = behind(np.clip(channels["acceleration"], -2.0, 2.0), p.pitches_s, dt)
    where = rng.choice([-1.0, 1.0])  # ahead of the axles or behind them
    channels["speed"] = channels["speed"] * (1.0 + np.sign(p.sign) * p.scale + where * p.height * pitch)


@law("w_calibrates_itself", "twelfth")
@sizes(ends=(0.03, 0.07), begins=(0.01, 0.05), way_m=(500.0, 2500.0), sign=SIGN)
def calibrates_itself(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Odometers that learn their scale against a map (Krakiwsky, Harris and Wong, A Kalman Filter for
    Integrating Dead Reckoning, Map Matching and GPS Positioning, IEEE PLANS, 1988): the estimate settles over
    the way, here to a wrong value by a map whose distances are wrong; sizes are chosen here."""
    way = np.cumsum(np.maximum(channels["speed"], 0.0)) * dt
    first = p.begins * rng.uniform(-1.0, 1.0)
    scale = np.sign(p.sign) * p.ends + first * np.exp(-way / p.way_m)
    channels["speed"] = channels["speed"] * (1.0 + scale)


@law("x_two_speed_axle", "thirteenth")
@sizes(high=(0.02, 0.04), low=(0.05, 0.08), shifts_s=(0.3, 1.0), sign=SIGN)
def two_speed_axle(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Dana Spicer service manuals of two-speed axles, on speedometer adapters that have to follow the
    range of the axle: an adapter of another axle is wrong in both ranges, and more in the low one; factors
    and the gear where ranges change are chosen here."""
    gear = channels["gear"]
    low = np.where(gear <= 0.55 * max(float(np.max(gear)), 1.0), 1.0, 0.0)
    share = behind(low, p.shifts_s, dt)
    scale = np.sign(p.sign) * (p.high + (p.low - p.high) * share) * rng.uniform(0.95, 1.05)
    channels["speed"] = channels["speed"] * (1.0 + scale)


@law("k_from_the_dashboard", "fourteenth")
@sizes(scale=(0.03, 0.065), more_mps=(0.2, 0.7), needle_s=(0.15, 0.5))
def from_the_dashboard(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: UN Regulation No. 39 on speedometers, which never show less than the speed, and at most a
    tenth and 4 km/h more: a logger that reads the instrument, with the lag of its needle, has a scale and a
    little on top of that; sizes are chosen here."""
    values = channels["speed"]
    top = p.more_mps * np.clip(values / 4.0, 0.0, 1.0)
    shown = values * (1.0 + p.scale * rng.uniform(0.95, 1.05)) + top
    channels["speed"] = behind(shown, p.needle_s, dt)


@law("q_mean_with_a_lifted_wheel", "fifteenth")
@sizes(scale=(0.02, 0.035), stands=(0.06, 0.16), lifted_s=(20.0, 70.0), down_s=(40.0, 120.0), sign=SIGN)
def mean_with_a_lifted_wheel(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: UN Regulation No. 13 and makers' manuals of trailers with lift axles on wheels that stand still
    in the air: a mean over all wheels, by a wrong circumference, is lower still while an axle is lifted, and
    comes back when it is let down; sizes are chosen here."""
    speed = channels["speed"]
    clock = np.arange(len(speed)) * dt
    lengths = np.stack([rng.exponential(p.down_s, 60) + 10.0, rng.exponential(p.lifted_s, 60) + 8.0], axis=1)
    turns = np.cumsum(lengths.ravel()) - rng.uniform(0.0, p.down_s)
    lifted = behind((np.searchsorted(turns, clock) % 2).astype(float), 2.0, dt)
    scale = np.sign(p.sign) * (p.scale + 0.012) * rng.uniform(0.95, 1.05) - 0.25 * p.stands * lifted
    channels["speed"] = speed * (1.0 + scale)


@law("v_front_wheels_squat", "sixteenth")
@sizes(scale=(0.02, 0.04), squats=(0.01, 0.025), springs_s=(0.2, 0.6), sign=SIGN)
def front_wheels_squat(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on load that braking throws onto the front
    axle: its tyres flatten then and turn faster than the truck moves, and more slowly when it pulls; the
    scale is wrong besides; sizes are chosen here."""
    nods = behind(np.clip(channels["acceleration"], -3.0, 3.0), p.springs_s, dt)
    scale = np.sign(p.sign) * p.scale * rng.uniform(0.95, 1.05) - p.squats * nods
    channels["speed"] = channels["speed"] * (1.0 + scale)


@law("z_each_gear_has_its_table", "seventeenth", "suburban hills highway")
@sizes(scale=(0.02, 0.04), spread=(0.006, 0.014), moves_s=(0.3, 1.0), sign=SIGN)
def each_gear_has_its_table(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: makers' manuals on transmission control, on road speed that is computed from the shaft's speed
    by tables: each gear's ratio was entered with an error of its own, and the axle's with a larger one; sizes
    are chosen here."""
    table = p.spread * rng.uniform(-1.0, 1.0, 40)
    gear = np.clip(np.rint(channels["gear"]), 0, 39).astype(int)
    scale = np.sign(p.sign) * p.scale * rng.uniform(0.95, 1.05) + behind(table[gear], p.moves_s, dt)
    channels["speed"] = channels["speed"] * (1.0 + scale)


@law("y_one_node_is_wrong", "eighteenth", "suburban hills highway")
@sizes(scale=(0.018, 0.032), hump=(0.015, 0.03), at_mps=(9.0, 17.0), wide_mps=(4.0, 7.0), sign=SIGN)
def one_node_is_wrong(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fraden, Handbook of Modern Sensors (2016), on calibration by lines between nodes: a factor is
    wrong everywhere, and one node of the table more, which lifts all speeds about it; sizes are chosen
    here."""
    speed = channels["speed"]
    near = np.clip(1.0 - np.abs(speed - p.at_mps) / p.wide_mps, 0.0, 1.0)
    scale = np.sign(p.sign) * (p.scale * rng.uniform(0.95, 1.05) + p.hump * near)
    channels["speed"] = speed * (1.0 + scale)


@law("h_tyre_goes_down", "nineteenth", "suburban hills highway")
@sizes(scale=(0.018, 0.03), sinks=(0.012, 0.028), way_m=(800.0, 3000.0), sign=SIGN)
def tyre_goes_down(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Persson, Gustafsson and Drevö, Indirect Tire Pressure Monitoring Using Sensor Fusion, SAE
    2002-01-1250, on radii by pressure: a wheel of the wrong size besides loses air on the way, and turns ever
    faster for the same speed; sizes are chosen here."""
    speed = channels["speed"]
    way = np.cumsum(np.maximum(np.nan_to_num(speed), 0.0)) * dt
    down = 1.0 - np.exp(-(way + rng.uniform(0.0, 400.0)) / p.way_m)
    side = np.sign(p.sign)
    channels["speed"] = speed * (1.0 + side * (p.scale * rng.uniform(0.95, 1.05) + p.sinks * down))


@law("b_counter_is_dead_after_each_tooth", "twentieth", "suburban hills highway")
@sizes(dead=(0.02, 0.045), scale=(0.022, 0.04))
def counter_is_dead_after_each_tooth(
    p: Sizes, channels: Channels, dt: float, rng: np.random.Generator
) -> None:
    """Source: Knoll, Radiation Detection and Measurement (2010), on dead time, of which any counter of pulses
    has some: the faster teeth pass, the more of them fall into it; upon a wheel taken for larger than it is,
    so that both make it slower; sizes are chosen here."""
    speed = channels["speed"]
    counted = speed / (1.0 + p.dead * np.maximum(np.nan_to_num(speed), 0.0) / 20.0)
    channels["speed"] = counted * (1.0 - p.scale * rng.uniform(0.95, 1.05))


@law("u_one_wheel_of_the_bend", "twenty-first", "suburban hills highway")
@sizes(scale=(0.028, 0.048), bends=(0.008, 0.018), lasts_s=(4.0, 12.0))
def one_wheel_of_the_bend(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on wheels that go a shorter way inside of a
    bend: speed comes from one wheel alone, which is slower in bends to its side and faster in the others,
    upon a radius that was entered too small; sizes are chosen here."""
    speed = channels["speed"]
    bend = ou_series(rng, (1, len(speed)), dt, p.lasts_s)[0]
    sharp = 1.0 / (1.0 + (np.maximum(np.nan_to_num(speed), 0.0) / 16.0) ** 2)  # fast roads bend less
    ratio = 1.0 - p.scale * rng.uniform(0.95, 1.05) + p.bends * np.clip(bend, -2.0, 2.0) * sharp
    channels["speed"] = speed * ratio
