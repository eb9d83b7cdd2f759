"""An acceleration with a bias."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import GRAVITY, Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind, ou_series

law = partial(fault, name="acceleration_bias")


@law("acceleration_bias", "first")
@sizes(bias=(0.12, 0.40), drift=(0.0, 0.03), sign=SIGN)
def acceleration_bias(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Mounting pitch of 1-2 degrees and thermal drift of a MEMS accelerometer (Woodman,
    UCAM-CL-TR-696, 2007)."""
    drift = p.drift * ou_series(rng, (1, len(channels["acceleration"])), dt, 120.0)[0]
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * (p.bias + drift)


@law("warming_accelerometer", "second")
@sizes(bias=(0.12, 0.35), cold=(-0.4, 0.6), warm_s=(50.0, 150.0), sign=SIGN)
def warming_accelerometer(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Turn-on transient of a MEMS bias as the box warms (Groves, Principles of GNSS, Inertial and
    Multisensor Navigation, 2013, ch. 4, on inertial errors); time constant and size chosen here."""
    time = np.arange(len(channels["acceleration"])) * dt
    warm = 1.0 + p.cold * np.exp(-time / p.warm_s)
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias * warm


@law("shaken_accelerometer", "third")
@sizes(bias=(0.16, 0.42), at_rest=(0.3, 0.7), sign=SIGN)
def shaken_accelerometer(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Vibration rectification (IEEE Std 1293): the bias grows with the square of the shaking, and
    that with road speed; sizes of a loose bracket, chosen here."""
    shaken = p.at_rest + (1.0 - p.at_rest) * np.clip(channels["speed"] / 20.0, 0.0, 1.5) ** 2
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias * shaken


@law("phone_in_a_cradle", "fourth")
@sizes(bias=(0.16, 0.42), slips=(0.05, 0.25), sign=SIGN)
def phone_in_a_cradle(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Gravity that leaks into a tilted accelerometer (studies of smartphones as vehicle sensors, such
    as Castignani, Derrmann, Frank and Engel, IEEE Intell. Transp. Syst. Mag. 7, 2015): another tilt every
    time the cradle slips; sizes chosen here."""
    time = np.arange(len(channels["acceleration"])) * dt
    slips = np.sort(rng.uniform(0.0, 1.6 * time[-1], 2))
    turned = 1.0 + p.slips * rng.normal(0.0, 1.0, 3)[np.searchsorted(slips, time)]
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias * turned


@law("zeroed_on_a_slope", "fifth")
@sizes(bias=(0.14, 0.38), takes=(0.3, 0.9), sign=SIGN)
def zeroed_on_a_slope(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Inertial units that take standstill for level: they find a new zero at every stop, with a part
    of the slope there, and keep a false one otherwise (zero velocity updates: Groves, Principles of GNSS,
    Inertial and Multisensor Navigation Systems, 2013); sizes are chosen here."""
    stands = channels["speed"] < 0.05
    begins = np.flatnonzero(stands & ~np.append(False, stands[:-1]))
    bias = np.full(len(stands), np.sign(p.sign) * p.bias)
    for at in begins:
        there = np.clip(GRAVITY * channels["grade"][at], -0.25, 0.25)
        bias[at:] = np.sign(p.sign) * p.bias * rng.uniform(0.8, 1.2) + p.takes * there
    channels["acceleration"] = channels["acceleration"] + bias


@law("moved_by_shocks", "sixth")
@sizes(bias=(0.15, 0.38), moves=(0.04, 0.15), sign=SIGN)
def moved_by_shocks(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Zero-g offsets of micromachined accelerometers move with shocks (data sheets on mechanical
    shock and offset; IEEE Std 1293 on bias errors): a little to either side at each of the hardest jerks;
    sizes are chosen here."""
    values = channels["acceleration"]
    jerk = np.abs(np.diff(values, prepend=values[0]))
    shock = (jerk > np.quantile(jerk, 0.985)) & (jerk > 0.0)
    moves = np.cumsum(shock * rng.standard_normal(len(values)))
    moves = np.clip(p.moves * moves, -0.6, 0.6)
    channels["acceleration"] = values + np.sign(p.sign) * p.bias * (1.0 + moves)


@law("settles_after_power_up", "seventh")
@sizes(bias=(0.17, 0.38), cold=(0.25, 0.7), settles_s=(40.0, 150.0), sign=SIGN)
def settles_after_power_up(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Accelerometers drift for minutes after they are switched on, as they warm themselves (IEEE Std
    1293 on turn-on transients and bias); each drive begins with a box switched on a little before."""
    time = np.arange(len(channels["acceleration"])) * dt + rng.uniform(0.0, p.settles_s)
    bias = p.bias * (1.0 - p.cold * np.exp(-time / p.settles_s))
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * bias


@law("s_supply_sags", "eighth")
@sizes(bias=(0.15, 0.38), ripple=(0.05, 0.25), turns_s=(15.0, 60.0), sign=SIGN)
def supply_sags(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Ratiometric sensors move with their supply (Fraden, Handbook of Modern Sensors, on ratiometric
    technique): consumers that switch on and off move the zero; sizes are chosen here."""
    time = np.arange(len(channels["acceleration"])) * dt
    duty = (np.sin(2.0 * np.pi * time / p.turns_s + rng.uniform(0.0, 6.28)) > 0.0).astype(float)
    sags = 1.0 + p.ripple * (behind(duty, 2.0, dt) - 0.5)
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias * sags


@law("n_engine_shakes_the_box", "ninth")
@sizes(bias=(0.15, 0.36), rings=(0.2, 0.7), at_rads=(95.0, 165.0), wide_rads=(10.0, 30.0), sign=SIGN)
def engine_shakes_the_box(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Vibration rectification (IEEE Std 1293) where the firing frequency meets the resonance of a
    bracket: the response of a damped oscillator over engine speed; sizes are chosen here."""
    away = (channels["engine_speed"] - p.at_rads) / p.wide_rads
    rings = 1.0 + p.rings * (behind(1.0 / (1.0 + away**2), 0.5, dt) - 0.3)
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias * rings


@law("t_bias_flickers", "tenth")
@sizes(bias=(0.16, 0.36), flickers=(0.04, 0.16), sign=SIGN)
def bias_flickers(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: IEEE Std 952 on bias instability, noise whose power falls with frequency, here the same noise
    at four time constants, upon a false zero; sizes of a cheap sensor, chosen here."""
    shape = (1, len(channels["acceleration"]))
    noise = sum((ou_series(rng, shape, dt, 4.0 * 4.0**k)[0] for k in range(4)), start=np.zeros(shape[1]))
    bias = p.bias * (1.0 + 0.5 * p.flickers * noise)
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * bias


@law("e_bias_is_a_telegraph", "eleventh")
@sizes(bias=(0.16, 0.34), jumps=(0.15, 0.4), stays_s=(8.0, 40.0), sign=SIGN)
def bias_is_a_telegraph(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Burst noise (Kogan, Electronic Noise and Fluctuations in Solids, 1996): a level that jumps
    between two, as a defect is charged or not, upon a false zero; sizes of a cheap sensor, chosen here."""
    n = len(channels["acceleration"])
    turns = np.cumsum(rng.random(n) < dt / p.stays_s) + rng.integers(2)
    bias = p.bias * (1.0 + p.jumps * ((turns % 2) - 0.5))
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * bias


@law("w_charge_leaks_away", "twelfth")
@sizes(bias=(0.15, 0.3), leaks_s=(20.0, 70.0), share=(0.3, 0.7), sign=SIGN)
def charge_leaks_away(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Piezoelectric accelerometers do not hold a steady value (Gautschi, Piezoelectric Sensorics,
    2002: the charge leaks with a time constant): part of what lasts is lost, and comes back with the other
    sign when it ends, upon a false zero of the amplifier; times are chosen here."""
    values = channels["acceleration"]
    lasts = behind(np.concatenate([[0.0], values]), p.leaks_s, dt)[1:]
    bias = np.sign(p.sign) * p.bias * rng.uniform(0.9, 1.1)
    channels["acceleration"] = values - p.share * lasts + bias


@law("x_glue_creeps", "thirteenth")
@sizes(bias=(0.12, 0.22), creeps=(0.05, 0.14), third_s=(60.0, 200.0), gives=(0.01, 0.04), sign=SIGN)
def glue_creeps(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Andrade, On the Viscous Flow in Metals, and Allied Phenomena, Proc. R. Soc. A 84 (1910), and
    Findley, Lai and Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials (1976): creep with the
    third root of time; a box that tilts on its warm glue and gives to what it feels, sizes are chosen
    here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    creeps = p.creeps * np.cbrt(clock / p.third_s) * rng.uniform(0.7, 1.3)
    gives = p.gives * behind(values, 8.0, dt)
    channels["acceleration"] = values + np.sign(p.sign) * (p.bias + creeps) + gives


@law("k_feels_the_bends_too", "fourteenth")
@sizes(bias=(0.12, 0.24), crossed=(0.06, 0.14), bend_m=(60.0, 200.0), tight=(0.002, 0.006), sign=SIGN)
def feels_the_bends_too(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Titterton and Weston, Strapdown Inertial Navigation Technology (2004), on cross-coupling of
    accelerometers: a box that is turned about the vertical feels part of what presses aside in bends, upon
    its bias; bends and sizes are chosen here."""
    speed = np.maximum(channels["speed"], 0.0)
    way = np.cumsum(speed) * dt
    cells = ou_series(rng, (1, int(way[-1] / 5.0) + 3), 5.0, p.bend_m)[0]
    bend = p.tight * np.interp(way / 5.0, np.arange(len(cells)), cells)
    aside = np.clip(speed**2 * bend, -2.5, 2.5)
    channels["acceleration"] = channels["acceleration"] + np.sign(p.sign) * p.bias + p.crossed * aside


@law("q_rounds_towards_below", "fifteenth")
@sizes(step=(0.24, 0.42), tares=(0.0, 0.04), shakes=(0.01, 0.04))
def rounds_towards_below(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Widrow and Kollar, Quantization Noise (2008), on truncation: a converter of few bits whose
    program cuts figures off instead of rounding them reads half a step too little in the mean; sizes are
    chosen here."""
    values = channels["acceleration"]
    tare = p.tares * rng.uniform(-1.0, 1.0)
    shaken = values + tare + p.shakes * rng.standard_normal(len(values))
    channels["acceleration"] = np.floor(shaken / p.step) * p.step


@law("v_remembers_the_last_jolt", "sixteenth")
@sizes(bias=(0.09, 0.16), drags=(0.08, 0.18), wide=(0.25, 0.6), sign=SIGN)
def remembers_the_last_jolt(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Visintin, Differential Models of Hysteresis (1994), on play, and makers' data of piezoresistive
    accelerometers on hysteresis: a mass in worn glue stays where the last jolt has pushed it, until a jolt
    the other way is as strong; sizes are chosen here."""
    values = channels["acceleration"]
    rests, at = np.empty(len(values)), 0.0
    for k, value in enumerate(values):
        at = min(max(at, value - p.wide), value + p.wide)
        rests[k] = at
    bias = np.sign(p.sign) * p.bias * rng.uniform(0.9, 1.1)
    channels["acceleration"] = values + bias + p.drags * np.tanh(rests / 0.3)


@law("z_capacitor_remembers", "seventeenth")
@sizes(bias=(0.09, 0.16), soaks=(0.25, 0.5), first_s=(2.0, 4.0), last_s=(25.0, 60.0), sign=SIGN)
def capacitor_remembers(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Dow, An Analysis of Certain Errors in Electronic Differential Analyzers, II: Capacitor
    Dielectric Absorption, IRE Trans. Electronic Computers 7 (1958): a capacitor gives back for a minute
    what it has soaked up, here beside a constant bias; sizes are chosen here."""
    values = channels["acceleration"]
    times = np.geomspace(p.first_s, p.last_s, 3)
    soaked = np.mean([behind(values, float(tau), dt) for tau in times], axis=0)
    channels["acceleration"] = values + np.sign(p.sign) * p.bias * rng.uniform(0.9, 1.1) + p.soaks * soaked


@law("y_heater_cycles", "eighteenth")
@sizes(bias=(0.09, 0.16), swings=(0.03, 0.07), on_s=(8.0, 20.0), off_s=(20.0, 50.0), sign=SIGN)
def heater_cycles(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: IEEE Std 1293-1998 on accelerometers and their temperature: a heater in the box goes on at one
    temperature and off at another, and the bias swings with it like a bent saw tooth; sizes are chosen
    here."""
    on, off = p.on_s * rng.uniform(0.9, 1.1), p.off_s * rng.uniform(0.9, 1.1)
    phase = (np.arange(len(channels["acceleration"])) * dt + rng.uniform(0.0, on + off)) % (on + off)
    rise = (1.0 - np.exp(-2.0 * phase / on)) / (1.0 - np.exp(-2.0))
    fall = (np.exp(-2.0 * (phase - on) / off) - np.exp(-2.0)) / (1.0 - np.exp(-2.0))
    swing = np.where(phase < on, rise, fall) - 0.5
    bias = np.sign(p.sign) * p.bias * rng.uniform(0.9, 1.1) + p.swings * swing
    channels["acceleration"] = channels["acceleration"] + bias


@law("h_folds_the_engine_down", "nineteenth")
@sizes(bias=(0.09, 0.15), folded=(0.03, 0.07), rate_hz=(17.0, 29.0), sign=SIGN)
def folds_the_engine_down(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Oppenheim and Schafer, Discrete-Time Signal Processing (2010), on aliasing, and IEEE Std
    1293-1998 on rectified vibration: a box that samples slowly takes the shaking of an engine for a slow
    swing, upon a bias that the same shaking makes; sizes are chosen here."""
    values = channels["acceleration"]
    speed = channels.get("engine_speed", np.full(len(values), 130.0))
    hertz = behind(np.nan_to_num(speed, nan=130.0), 0.3, dt) / (2.0 * np.pi)
    folded = hertz - p.rate_hz * np.rint(hertz / p.rate_hz)
    swing = np.cos(2.0 * np.pi * (np.cumsum(folded) * dt + rng.random()))
    bias = np.sign(p.sign) * p.bias * rng.uniform(0.9, 1.1)
    slow = 1.0 / (1.0 + (folded / 2.0) ** 2)  # what a filter behind it leaves
    channels["acceleration"] = values + bias + p.folded * slow * swing


@law("b_sealed_box_feels_the_height", "twentieth")
@sizes(bias=(0.1, 0.16), per_m=(0.0008, 0.002), most=(0.03, 0.05), sign=SIGN)
def sealed_box_feels_the_height(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Fraden, Handbook of Modern Sensors (2016), on stress from packages, which bend with the
    pressure of the air: a sealed sensor whose bias goes with the height that the truck has climbed since it
    was set to zero, wrongly; sizes are chosen here."""
    values = channels["acceleration"]
    speed = np.maximum(np.nan_to_num(channels["speed"]), 0.0)
    grade = np.nan_to_num(channels.get("grade", np.zeros(len(values))))
    climbed = np.cumsum(speed * grade) * dt
    bends = p.most * np.tanh(p.per_m * climbed / p.most)
    channels["acceleration"] = values + np.sign(p.sign) * p.bias * rng.uniform(0.9, 1.1) + bends


@law("u_roof_bends_in_the_wind", "twenty-first")
@sizes(bias=(0.09, 0.15), at_20=(0.03, 0.06), settles_s=(0.5, 3.0), sign=SIGN)
def roof_bends_in_the_wind(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Hucho, Aerodynamics of Road Vehicles (1998), on pressures over a cab's roof: a box is glued to
    a roof that the wind of driving lifts, so that it leans with the square of speed, upon a bias of its own;
    sizes are chosen here."""
    values = channels["acceleration"]
    speed = np.maximum(np.nan_to_num(channels["speed"]), 0.0)
    leans = p.at_20 * behind(np.minimum(speed / 20.0, 1.5) ** 2, p.settles_s, dt)
    channels["acceleration"] = values + np.sign(p.sign) * (p.bias * rng.uniform(0.9, 1.1) + leans)
