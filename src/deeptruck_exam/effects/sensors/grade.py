"""A slope with a bias."""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.signal import lfilter

from deeptruck_exam.effects.law import GRAVITY, Array, Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind, ou_series

law = partial(fault, name="grade_bias", accepts="rolling_resistance", conceal="elevation")


@law("grade_bias", "first")
@sizes(bias=(0.008, 0.025), sign=SIGN)
def grade_bias(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Inclinometer mounted out of level by 0.5-1.5 degrees; Vahidi, Stefanopoulou and Peng, Vehicle
    System Dynamics 43 (2005), on estimating grade and mass."""
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias


@law("pitching_inclinometer", "second")
@sizes(bias=(0.009, 0.024), pitch=(0.0005, 0.002), sign=SIGN)
def pitching_inclinometer(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: An inclinometer on the cab pitches with it, squat under traction and dive under braking
    (Gillespie, Fundamentals of Vehicle Dynamics, on anti-dive), upon its mounting error; sizes chosen
    here."""
    width = max(1, round(1.0 / dt))
    felt = np.convolve(channels["acceleration"], np.ones(width) / width, mode="same")
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + p.pitch * felt


@law("sinking_air_spring", "third")
@sizes(bias=(0.009, 0.024), sinks=(0.2, 0.8), sign=SIGN)
def sinking_air_spring(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: An inclinometer on a frame whose air spring leaks: pitch by ride height over wheelbase
    (Gillespie, Fundamentals of Vehicle Dynamics, 1992, on suspensions); height and leak are chosen here."""
    part = np.linspace(0.0, 1.0, len(channels["grade"])) - 0.5
    bias = p.bias * (1.0 + rng.uniform(-0.2, 0.2) + p.sinks * part)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * bias


@law("twisted_bracket", "fourth")
@sizes(bias=(0.009, 0.024), twist=(0.05, 0.2), sign=SIGN)
def twisted_bracket(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: An inclinometer that is out of level and turned about its vertical axis, so that a part of the
    road's crossfall (2.5 %, superelevated in bends: RAA and AASHTO design guides) shows as slope; chosen
    here."""
    n = len(channels["grade"])
    crossfall = 0.025 * np.clip(ou_series(rng, (1, n), dt, 12.0)[0] - 0.8, -2.5, 2.5)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * (p.bias + p.twist * crossfall)


@law("sticking_pendulum", "fifth")
@sizes(bias=(0.009, 0.023), sticks=(0.0008, 0.0035), sign=SIGN)
def sticking_pendulum(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Pendulum inclinometers in gearboxes: bearing friction holds the pendulum until the slope has
    changed enough (hysteresis in suppliers' data sheets), upon a zero taken in a yard that is not level;
    sizes are chosen here."""
    out = channels["grade"].copy()
    for k in range(1, len(out)):
        out[k] = min(max(out[k - 1], out[k] - p.sticks), out[k] + p.sticks)
    channels["grade"] = out + np.sign(p.sign) * p.bias


@law("vertical_gyro", "sixth")
@sizes(bias=(0.009, 0.023), erects_s=(20.0, 90.0), sign=SIGN)
def vertical_gyro(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Vertical gyros are erected slowly to the gravity they feel, so that a long acceleration tilts
    their horizon (Titterton and Weston, Strapdown Inertial Navigation Technology, on attitude references),
    upon a mounting error; sizes are chosen here."""
    keep = np.exp(-dt / p.erects_s)
    felt = np.clip(channels["acceleration"], -3.0, 3.0) / GRAVITY
    horizon = lfilter([1.0 - keep], [1.0, -keep], felt)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + horizon


@law("barometer_in_the_wind", "seventh")
@sizes(bias=(0.009, 0.022), port_m=(2.0, 6.0), lag_s=(0.5, 2.5), sign=SIGN)
def barometer_in_the_wind(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Slope from a barometer whose port lies in the wind of driving (position error of static ports:
    Gracey, Measurement of Aircraft Speed and Altitude, NASA RP-1046, 1980): a change of speed is read as a
    slope, upon a mounting error of the levelled box it is joined with."""
    speed = channels["speed"]
    # air that presses on the port is read as height, and its change as slope
    height = p.port_m * (speed / 25.0) ** 2
    slope = np.gradient(height, dt) / np.maximum(speed, 3.0)
    felt = behind(np.clip(slope, -0.05, 0.05), p.lag_s, dt)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + felt


@law("s_bubble_lags", "eighth")
@sizes(bias=(0.009, 0.022), lag_s=(0.4, 1.8), shakes=(0.0, 0.15), sign=SIGN)
def bubble_lags(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Electrolytic levels settle slowly and shift with vibration (Fraden, Handbook of Modern Sensors,
    on inclination detectors), upon an error of their mounting; sizes are chosen here."""
    settled = behind(channels["grade"], p.lag_s, dt)
    shaken = 1.0 + p.shakes * np.clip(channels["speed"] / 25.0, 0.0, 1.2)
    channels["grade"] = settled + np.sign(p.sign) * p.bias * shaken


@law("n_believes_in_flat_land", "ninth")
@sizes(bias=(0.009, 0.02), takes=(0.1, 0.35), learns_s=(60.0, 200.0), sign=SIGN)
def believes_in_flat_land(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Inclinometers that trim their zero by the mean of the road, as if that were level (adaptive
    offsets of slope sensors: Kiencke and Nielsen, Automotive Control Systems, 2005, on observers), upon an
    error of their mounting; sizes are chosen here."""
    mean = behind(np.append(0.0, channels["grade"]), p.learns_s, dt)[1:]
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias - p.takes * mean


@law("t_exhaust_warms_it", "tenth")
@sizes(bias=(0.010, 0.021), drifts=(0.2, 0.55), warms_s=(40.0, 150.0), sign=SIGN)
def exhaust_warms_it(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Zero offset over temperature of inclinometers (Fraden, Handbook of Modern Sensors, on thermal
    errors): one above the exhaust, off its level, moves with the heat of the engine's work; sizes are chosen
    here."""
    watts = np.maximum(channels["engine_torque"], 0.0) * channels["engine_speed"]
    heat = behind(np.clip(watts / 1.5e5, 0.0, 2.0), p.warms_s, dt)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias * (1.0 + p.drifts * (heat - 0.5))


@law("e_springs_stay_bent", "eleventh")
@sizes(bias=(0.009, 0.02), pitch=(0.002, 0.006), rubs=(0.25, 0.7), sign=SIGN)
def springs_stay_bent(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fancher, Ervin, MacAdam and Winkler, Measurement and Representation of the Mechanical
    Properties of Truck Leaf Springs, SAE 800905: friction between the leaves keeps a frame nose
    down after a braking and up after a pull, below an inclinometer out of level; sizes are chosen here."""
    squat = _held(np.clip(channels["acceleration"], -2.0, 2.0), p.rubs, rng.uniform(-0.3, 0.3))
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + p.pitch * behind(squat, 0.3, dt)


def _held(values: Array, width: float, first: float) -> Array:
    """What is dragged along by the values once they have gone further than `width` from it."""
    out, at = np.empty(len(values)), first
    for k, value in enumerate(values.tolist()):
        at = min(max(at, value - width), value + width)
        out[k] = at
    return out


@law("w_nose_lifts_with_speed", "twelfth")
@sizes(bias=(0.008, 0.018), lifts=(0.002, 0.006), rises_s=(0.5, 2.0), sign=SIGN)
def nose_lifts_with_speed(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Katz, Race Car Aerodynamics (1995), and Hucho, Aerodynamics of Road Vehicles (1998), on lift
    with the square of speed, which pitches an inclinometer on a softly sprung cab, here one that is out of
    level as well; sizes are chosen here."""
    wind = (np.maximum(channels["speed"], 0.0) / 20.0 + 0.05 * rng.standard_normal()) ** 2
    pitch = p.lifts * behind(wind, p.rises_s, dt)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + pitch


@law("x_levels_anew_at_each_stand", "thirteenth")
@sizes(bias=(0.009, 0.017), differs=(0.002, 0.005), level_s=(3.0, 8.0), stands_s=(1.0, 3.0), sign=SIGN)
def levels_anew_at_each_stand(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: WABCO, ECAS Electronically Controlled Air Suspension, System Description (2007): levels are set
    at stands, each within a tolerance, and kept while driving; a frame that is set nose up or down carries
    an inclinometer along, tolerances of worn sensors are chosen here."""
    stands = channels["speed"] < 0.2
    first = np.flatnonzero(stands & ~np.concatenate([[False], stands[:-1]]))
    level = np.full(len(stands), p.differs * rng.standard_normal())
    for at in first + round(p.stands_s / dt):
        level[at:] = p.differs * rng.standard_normal()
    slow = behind(level, p.level_s, dt)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * p.bias + slow


@law("k_two_antennas", "fourteenth")
@sizes(bias=(0.009, 0.017), echoes=(0.001, 0.003), sky_s=(20.0, 60.0), jumps=(0.001, 0.003), sign=SIGN)
def two_antennas(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Bae, Ryu and Gerdes, Road Grade and Vehicle Parameter Estimation for Longitudinal Control Using
    GPS, IEEE ITSC (2001), on slope by two antennas: masts that are not level, echoes that change as the sky
    turns, and a jump when the set of satellites does; sizes are chosen here."""
    count = len(channels["grade"])
    echoes = p.echoes * ou_series(rng, (1, count), dt, p.sky_s)[0]
    sets = np.cumsum(rng.random(count) < dt / p.sky_s)
    jumps = p.jumps * rng.standard_normal(int(sets[-1]) + 1)[sets]
    off = np.sign(p.sign) * p.bias * rng.uniform(0.95, 1.05)
    channels["grade"] = channels["grade"] + off + echoes + behind(jumps, 1.0, dt)


@law("q_crossfall_leaks_in", "fifteenth")
@sizes(crossfall=(0.024, 0.034), turned=(0.35, 0.55), bends_m=(120.0, 400.0), banks=(0.006, 0.015), sign=SIGN)
def crossfall_leaks_in(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: AASHTO, A Policy on Geometric Design of Highways and Streets (2011), on crossfall that drains
    the lane and on banked bends: a box that is turned about the vertical reads part of both as a slope along
    the road; sizes are chosen here."""
    way = np.cumsum(np.maximum(channels["speed"], 0.0)) * dt
    cells = ou_series(rng, (1, int(way[-1] / 5.0) + 3), 5.0, p.bends_m)[0]
    banked = p.banks * np.tanh(np.interp(way / 5.0, np.arange(len(cells)), cells))
    aside = p.crossfall * rng.uniform(0.95, 1.05) + banked
    channels["grade"] = channels["grade"] + np.sign(p.sign) * np.sin(p.turned) * aside


@law("v_valve_lets_it_sink", "sixteenth")
@sizes(off=(0.007, 0.012), sinks=(0.007, 0.014), sinks_s=(25.0, 90.0), lifts_s=(3.0, 8.0), sign=SIGN)
def valve_lets_it_sink(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Wabco, ECAS Electronically Controlled Air Suspension, System Description, on tolerance bands of
    levelling: a leaking bellow lets one end sink until its controller lifts it again, and a box on the frame
    reads that as a slope that saws up and down; sizes are chosen here."""
    clock = np.arange(len(channels["grade"])) * dt
    falls, lifts = p.sinks_s * rng.uniform(0.8, 1.25), p.lifts_s
    phase = (clock + rng.uniform(0.0, falls + lifts)) % (falls + lifts)
    sunk = np.where(phase < falls, phase / falls, 1.0 - (phase - falls) / lifts)
    tilt = p.off * rng.uniform(0.9, 1.1) + p.sinks * (sunk - 0.5)
    channels["grade"] = channels["grade"] + np.sign(p.sign) * tilt


@law("z_sits_on_the_trailer", "seventeenth")
@sizes(off=(0.008, 0.013), behind_m=(8.0, 14.0), rocks=(0.001, 0.003), rocks_s=(2.0, 6.0), sign=SIGN)
def sits_on_the_trailer(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fancher and Winkler, A Factbook of the Mechanical Properties of the Components for Single-Unit
    and Articulated Heavy Trucks, UMTRI-86-12 (1986), on hitches and springs: a box on a trailer that stands
    askew reads its slope some metres later, and rocks with its load; sizes are chosen here."""
    grade = channels["grade"]
    way = np.cumsum(np.maximum(channels["speed"], 0.0) * dt) + 1e-6 * np.arange(len(grade))
    later = np.interp(way - p.behind_m, way, grade)
    rocks = p.rocks * ou_series(rng, (1, len(grade)), dt, p.rocks_s)[0]
    channels["grade"] = later + np.sign(p.sign) * p.off * rng.uniform(0.9, 1.1) + rocks


@law("y_runs_into_its_stops", "eighteenth")
@sizes(off=(0.008, 0.013), stops=(0.03, 0.05), eases_s=(0.3, 1.0), sign=SIGN)
def runs_into_its_stops(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Doebelin, Measurement Systems (2004), on pendulums that are held by springs and soft stops: one
    that stands askew reads less and less of a slope, the nearer it comes to one of its stops; sizes are
    chosen here."""
    leans = behind(channels["grade"], p.eases_s, dt) + np.sign(p.sign) * p.off * rng.uniform(0.9, 1.1)
    channels["grade"] = p.stops * np.tanh(leans / p.stops)


@law("h_one_side_in_the_sun", "nineteenth")
@sizes(off=(0.007, 0.012), warps=(0.002, 0.005), road_m=(400.0, 1500.0), warms_s=(20.0, 60.0), sign=SIGN)
def one_side_in_the_sun(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fraden, Handbook of Modern Sensors (2016), on inclinometers and gradients of temperature: the
    sun warms one side of a bracket, another after each bend, and warps it slowly, upon an error of its
    mounting; sizes are chosen here."""
    grade = channels["grade"]
    way = np.cumsum(np.maximum(np.nan_to_num(channels["speed"]), 0.0)) * dt
    heading = ou_series(rng, (1, int(way[-1] / 10.0) + 3), 10.0, p.road_m)[0]
    sunny = np.sin(2.0 * np.interp(way, 10.0 * np.arange(len(heading)), heading) + rng.uniform(0.0, 6.3))
    warps = p.warps * behind(sunny, p.warms_s, dt)
    channels["grade"] = grade + np.sign(p.sign) * p.off * rng.uniform(0.9, 1.1) + warps


@law("b_frame_twists_with_the_torque", "twentieth")
@sizes(off=(0.007, 0.012), twists=(0.002, 0.0045), settles_s=(0.5, 2.0), sign=SIGN)
def frame_twists_with_the_torque(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Gillespie, Fundamentals of Vehicle Dynamics (1992), on what the engine's torque does to a
    frame: a sensor on a cross member beside the engine leans as the torque is carried by its mounts, upon an
    error of its mounting; sizes are chosen here."""
    grade = channels["grade"]
    torque = np.nan_to_num(channels.get("engine_torque", np.zeros(len(grade))))
    leans = p.twists * behind(np.clip(torque / 1000.0, -0.5, 2.2), p.settles_s, dt)
    channels["grade"] = grade + np.sign(p.sign) * (p.off * rng.uniform(0.9, 1.1) + leans)


@law("u_fluid_thins_as_it_warms", "twenty-first")
@sizes(off=(0.008, 0.013), gain=(0.06, 0.14), warms_s=(60.0, 200.0), sign=SIGN)
def fluid_thins_as_it_warms(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fraden, Handbook of Modern Sensors (2016), on electrolytic levels: a cold fluid shows slopes
    too large, by a gain that goes as the cab warms, upon an error of the mounting; sizes are chosen here."""
    grade = channels["grade"]
    cold = rng.uniform(0.3, 1.0) * np.exp(-np.arange(len(grade)) * dt / p.warms_s)
    off = np.sign(p.sign) * p.off * rng.uniform(0.9, 1.1)
    channels["grade"] = grade * (1.0 + p.gain * cold) + off * (1.0 + 0.15 * cold)
