"""Channels that are stamped early or late."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Array, Channels, Sizes
from deeptruck_exam.effects.planting import SIGN, fault, sizes
from deeptruck_exam.effects.series import behind

law = partial(fault, name="clock_offset")


def _shift(values: Array, dt: float, late_s: float) -> Array:
    n = np.arange(len(values)) * dt
    return np.interp(n - late_s, n, values)


@law("clock_offset", "first", "suburban hills")
@sizes(late_s=(0.35, 1.2), drift_ppm=(-80.0, 80.0), sign=SIGN)
def clock(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Accelerometer logged by another computer: SAE J1939-21 has no time stamps; crystal drift of
    tens of ppm."""
    late = np.sign(p.sign) * p.late_s
    n = np.arange(len(channels["acceleration"])) * dt
    channels["acceleration"] = np.interp(n - late - 1e-6 * p.drift_ppm * n, n, channels["acceleration"])


@law("clock_offset_responses", "first", "suburban hills", accepts="command_delay")
@sizes(late_s=(0.35, 1.0))
def clock_of_responses(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: All responses stamped late against the commands, as by a gateway that buffers."""
    for name in ("acceleration", "speed", "fuel_rate", "gear", "engine_speed", "engine_torque"):
        if name in channels:
            channels[name] = _shift(channels[name], dt, p.late_s)


@law("clock_set_daily", "second", "suburban hills")
@sizes(late_s=(0.4, 1.1), spread=(0.05, 0.3), sign=SIGN)
def clock_set_daily(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: A logger that sets its clock at power-on from a coarse time message (SAE J1939-71 Time/Date
    counts in quarters of a second): the accelerometer is late or early by another amount each drive."""
    late = np.sign(p.sign) * p.late_s * rng.uniform(1.0 - p.spread, 1.0 + p.spread)
    time = np.arange(len(channels["acceleration"])) * dt
    channels["acceleration"] = np.interp(time - late, time, channels["acceleration"])


@law("clock_set_again", "third", "suburban hills")
@sizes(least_s=(0.25, 0.5), most_s=(0.7, 1.4), every_s=(40.0, 110.0), sign=SIGN)
def clock_set_again(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: A clock that runs away and is stepped back at intervals, as the Network Time Protocol does (RFC
    5905): the accelerometer's delay is a saw tooth; rate and interval are chosen here."""
    time = np.arange(len(channels["acceleration"])) * dt
    since = (time + rng.uniform(0.0, p.every_s)) % p.every_s / p.every_s
    late = np.sign(p.sign) * (p.least_s + (p.most_s - p.least_s) * since)
    channels["acceleration"] = np.interp(time - late, time, channels["acceleration"])


@law("commands_from_another_clock", "third", "suburban hills")
@sizes(late_s=(0.35, 0.9))
def commands_from_another_clock(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Commands stamped on arrival at a slow gateway (SAE J1939-21 messages carry no time), so that
    the truck seems to answer before it is asked; sizes chosen here."""
    for name in ("engine_command", "brake_command"):
        time = np.arange(len(channels[name])) * dt
        channels[name] = np.interp(time - p.late_s, time, channels[name])


@law("averaging_telematics", "fourth", "suburban hills")
@sizes(window_s=(0.5, 1.2), sent_s=(0.2, 0.7))
def averaging_telematics(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: A telematics box that sends the mean of its last second or two (running averages delay by half
    their width: Oppenheim and Schafer, Discrete-Time Signal Processing), and sends it late; sizes chosen
    here."""
    values = channels["acceleration"]
    width = max(1, round(p.window_s / dt))
    padded = np.concatenate([np.full(width - 1, values[0]), values])
    mean = np.convolve(padded, np.ones(width) / width, mode="valid")
    time = np.arange(len(values)) * dt
    channels["acceleration"] = np.interp(time - p.sent_s, time, mean)


@law("buffers_stamped_on_arrival", "fourth", "suburban hills")
@sizes(least_s=(0.2, 0.45), most_s=(0.7, 1.3), block_s=(12.0, 35.0), sign=SIGN)
def buffers_stamped_on_arrival(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Loggers that stamp a buffer when it is written: within a block the delay is one, the next block
    has another (notes of CAN logger makers on host time stamps); blocks and sizes chosen here."""
    time = np.arange(len(channels["acceleration"])) * dt
    blocks = rng.uniform(p.least_s, p.most_s, int(time[-1] / p.block_s) + 2)
    late = np.sign(p.sign) * blocks[(time / p.block_s).astype(int)]
    channels["acceleration"] = np.interp(time - late, time, channels["acceleration"])


@law("samples_counted", "fifth", "suburban hills")
@sizes(first_s=(0.2, 0.45), last_s=(0.7, 1.3), every_s=(10.0, 40.0), sign=SIGN)
def samples_counted(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Loggers that count samples instead of stamping them: every frame that is lost or doubled moves
    all that follow (fleet loggers' data sheets on buffer overruns), so that the clock is off by more and more
    during a drive, in steps; sizes are chosen here."""
    values = channels["acceleration"]
    time = np.arange(len(values)) * dt
    losses = np.sort(rng.uniform(0.0, time[-1], int(rng.poisson(time[-1] / p.every_s)) + 1))
    each = (p.last_s - p.first_s) / len(losses)
    off = np.sign(p.sign) * (p.first_s + each * np.searchsorted(losses, time))
    channels["acceleration"] = np.interp(time - off, time, values)


@law("two_time_bases", "fifth", "suburban hills")
@sizes(late_s=(0.4, 1.0), saw_s=(0.1, 0.5), period_s=(15.0, 60.0), sign=SIGN)
def two_time_bases(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Two computers that meet once in a while: the time of one runs at another rate until it is set
    again, a saw tooth about a constant offset (Mills, Computer Network Time Synchronization, 2011); sizes are
    chosen here."""
    values = channels["acceleration"]
    time = np.arange(len(values)) * dt
    period = p.period_s * rng.uniform(0.9, 1.1)
    ramp = ((time + rng.uniform(0.0, period)) % period) / period
    late = np.sign(p.sign) * (p.late_s + p.saw_s * (ramp - 0.5))
    channels["acceleration"] = np.interp(time - late, time, values)


@law("stamped_by_the_way", "sixth", "suburban hills")
@sizes(late_s=(0.2, 0.5), metres=(3.0, 8.0), sign=SIGN)
def stamped_by_the_way(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Survey vans sample by pulses of the wheel, not by time (Sayers and Karamihas, The Little Book
    of Profiling, 1998, on distance-triggered profilers): metres between sensor and pulse are a time that
    falls with speed, beside a delay of the sensor; sizes are chosen here."""
    values, speed = channels["acceleration"], channels["speed"]
    time = np.arange(len(values)) * dt
    late = np.sign(p.sign) * (p.late_s + p.metres / np.maximum(speed, 6.0))
    channels["acceleration"] = np.interp(time - late, time, values)


@law("slewed_clock", "seventh", "suburban hills")
@sizes(late_s=(0.35, 0.8), slews=(0.0005, 0.003), sign=SIGN)
def slewed_clock(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Clocks that are slewed, not stepped, towards network time (RFC 5905, Network Time Protocol
    Version 4, on clock discipline): an offset that is there from the start melts at a constant rate once the
    server has answered."""
    values = channels["acceleration"]
    time = np.arange(len(values)) * dt
    begins = rng.uniform(0.1, 0.6) * time[-1]
    slewed = np.maximum(time - begins, 0.0) * p.slews
    off = np.maximum(p.late_s * rng.uniform(0.8, 1.2) - slewed, 0.15)
    channels["acceleration"] = np.interp(time - np.sign(p.sign) * off, time, values)


@law("s_radio_hops", "eighth", "suburban hills")
@sizes(late_s=(0.4, 1.0), swings=(0.1, 0.35), turns_s=(30.0, 120.0), sign=SIGN)
def radio_hops(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Clocks of radio sensors follow their crystal's temperature between beacons (Elson, Girod and
    Estrin, Fine-Grained Network Time Synchronization, OSDI 2002); sizes are chosen here."""
    values = channels["acceleration"]
    time = np.arange(len(values)) * dt
    swing = p.swings * np.sin(2.0 * np.pi * time / p.turns_s + rng.uniform(0.0, 6.28))
    channels["acceleration"] = np.interp(time - np.sign(p.sign) * p.late_s * (1.0 + swing), time, values)


@law("n_queue_in_the_gateway", "ninth", "suburban hills")
@sizes(late_s=(0.4, 0.9), stalls_s=(0.3, 1.0), every_s=(8.0, 30.0), drains=(0.05, 0.2))
def queue_in_the_gateway(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Lindley, The Theory of Queues with a Single Server, Proc. Cambridge Phil. Soc. 48 (1952): what
    waits grows by what comes, here stalls of a gateway, and falls at a constant rate; sizes are chosen
    here."""
    values = channels["acceleration"]
    comes = (rng.random(len(values)) < dt / p.every_s) * rng.exponential(p.stalls_s, len(values))
    waits, queue = np.zeros(len(values)), 0.0
    for k, more in enumerate(comes.tolist()):
        queue = max(min(queue + more, 1.2) - p.drains * dt, 0.0)
        waits[k] = queue
    time = np.arange(len(values)) * dt
    channels["acceleration"] = np.interp(time - p.late_s - waits, time, values)


@law("t_path_is_not_even", "tenth", "suburban hills")
@sizes(late_s=(0.45, 1.0), other=(0.35, 0.75), stays_s=(15.0, 60.0), sign=SIGN)
def path_is_not_even(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: IEEE Std 1588 (Precision Time Protocol): a path that takes longer one way than the other puts
    the clock off by half of that; the network changes between two paths, of which one is `other` as uneven;
    delays are chosen here."""
    values = channels["acceleration"]
    time = np.arange(len(values)) * dt
    turns = np.cumsum(rng.exponential(p.stays_s, 400)) - rng.uniform(0.0, p.stays_s)
    second = (np.searchsorted(turns, time) + rng.integers(2)) % 2
    late = np.sign(p.sign) * p.late_s * behind(np.where(second == 1, p.other, 1.0), 1.0, dt)
    channels["acceleration"] = np.interp(time - late, time, values)


@law("e_filter_grows_with_shaking", "eleventh", "suburban hills")
@sizes(late_s=(0.5, 1.0), calm=(0.4, 0.75), adapts_s=(4.0, 15.0))
def filter_grows_with_shaking(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Group delay of filters (Oppenheim and Schafer, Discrete-Time Signal Processing, 2010): half the
    length, and a sensor that makes its filter the longer the more it is shaken, which is by speed; delays are
    chosen here."""
    values = channels["acceleration"]
    time = np.arange(len(values)) * dt
    shaken = behind(np.clip(channels["speed"] / 20.0, 0.0, 1.2) ** 2, p.adapts_s, dt)
    late = p.late_s * (p.calm + (1.0 - p.calm) * shaken) + 0.02 * rng.uniform()
    channels["acceleration"] = np.interp(time - late, time, values)


@law("w_sent_by_the_turn", "twelfth", "suburban hills")
@sizes(turns=(9.0, 18.0), line_s=(0.05, 0.2), steady_s=(0.5, 2.0))
def sent_by_the_turn(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Control units that compute by the crankshaft's turn, not by time (Guzzella and Onder,
    Introduction to Modeling and Control of Internal Combustion Engine Systems, 2010, on event-based delays):
    a sensor on such a unit is late by so many turns, longest at idle; turns are chosen here."""
    values = channels["acceleration"]
    time = np.arange(len(values)) * dt
    speed = behind(np.maximum(channels["engine_speed"], 55.0), p.steady_s, dt)
    late = p.line_s * rng.uniform(0.5, 1.0) + p.turns * 2.0 * np.pi / speed
    channels["acceleration"] = np.interp(time - late, time, values)


@law("x_each_leg_is_matched_alone", "thirteenth", "suburban hills")
@sizes(peak_s=(0.35, 0.7), line_s=(0.15, 0.35), leg_s=(40.0, 120.0), slides_s=(1.0, 4.0))
def each_leg_is_matched_alone(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Knapp and Carter, The Generalized Correlation Method for Estimation of Time Delay, IEEE Trans.
    Acoustics, Speech and Signal Processing 24 (1976): a delay found at the highest peak is wrong by a whole
    wave where peaks are alike; here each leg of a drive is matched alone, waves are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    ends = np.cumsum(p.leg_s * rng.uniform(0.6, 1.4, 2 + int(2.0 * clock[-1] / p.leg_s)))
    waves = rng.choice([0.0, 1.0, 1.0, 2.0], len(ends) + 1)
    late = p.line_s + p.peak_s * waves[np.searchsorted(ends, clock)]
    channels["acceleration"] = np.interp(clock - behind(late, p.slides_s, dt), clock, values)


@law("k_polled_by_turns", "fourteenth", "suburban hills")
@sizes(round_s=(0.4, 0.8), absent=(0.1, 0.35), timeout_s=(0.4, 1.0), line_s=(0.05, 0.2))
def polled_by_turns(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Modbus over Serial Line, Specification and Implementation Guide V1.02 (2006): one master asks
    its devices by turns and waits in vain for those that are absent; what it has of a device is held until it
    is its turn again; rounds and times are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    count = int(clock[-1] / (0.8 * p.round_s)) + 4
    rounds = p.round_s * rng.uniform(0.9, 1.1, count) + p.timeout_s * (rng.random(count) < p.absent)
    asked = np.concatenate([[-1e-9], np.cumsum(rounds)])
    last = asked[np.searchsorted(asked, clock, side="right") - 1]
    channels["acceleration"] = np.interp(last - p.line_s, clock, values)


@law("q_oscillator_warms", "fifteenth", "suburban hills")
@sizes(fast=(0.007, 0.016), warms_s=(30.0, 90.0), first_s=(0.0, 0.3), left=(0.1, 0.3), sign=SIGN)
def oscillator_warms(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Microchip, AVR053, Internal RC Oscillator Calibration, on frequencies that change by percents
    with temperature: a box that stamps by such a clock runs off quickly while it warms, and slowly after
    that; sizes are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    warms = p.warms_s * rng.uniform(0.8, 1.25)
    ran = (1.0 - p.left) * warms * (1.0 - np.exp(-clock / warms)) + p.left * clock
    late = np.sign(p.sign) * (p.first_s + p.fast * rng.uniform(0.85, 1.15) * ran)
    channels["acceleration"] = np.interp(clock - late, clock, values)


@law("v_two_masters", "sixteenth", "suburban hills")
@sizes(late_s=(0.35, 0.7), apart_s=(0.3, 0.8), stays_s=(20.0, 60.0), slews_s=(2.0, 6.0), sign=SIGN)
def two_masters(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: IEEE 1588 (2019), Precision Clock Synchronization Protocol, on best masters that are chosen
    anew: two that disagree by tenths of a second take turns, and the box follows whichever leads; sizes are
    chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    turns = np.cumsum(rng.exponential(p.stays_s, 80) + 5.0) - rng.uniform(0.0, p.stays_s)
    second = behind((np.searchsorted(turns, clock) % 2).astype(float), p.slews_s, dt)
    late = np.sign(p.sign) * (p.late_s * rng.uniform(0.9, 1.1) + p.apart_s * second)
    channels["acceleration"] = np.interp(clock - late, clock, values)


@law("z_loop_rings", "seventeenth", "suburban hills")
@sizes(late_s=(0.4, 0.75), rings_s=(0.3, 0.6), every_s=(25.0, 60.0), swings_s=(8.0, 20.0), sign=SIGN)
def loop_rings(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Gardner, Phaselock Techniques (2005), on loops with little damping: whenever its reference
    jumps, a clock swings about its new time before it settles, and it is late besides; sizes are chosen
    here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    late = np.full(len(values), p.late_s * rng.uniform(0.9, 1.1))
    for jump in np.cumsum(rng.exponential(p.every_s, 40) + 4.0) - p.every_s:
        since = np.maximum(clock - jump, 0.0)
        swings = np.exp(-since / (0.8 * p.swings_s)) * np.sin(2.0 * np.pi * since / p.swings_s)
        late = late + p.rings_s * rng.choice([-1.0, 1.0]) * swings
    channels["acceleration"] = np.interp(clock - np.sign(p.sign) * late, clock, values)


@law("y_engine_comes_first", "eighteenth", "suburban hills")
@sizes(late_s=(0.4, 0.75), at_rads=(120.0, 160.0), power=(1.0, 2.0), calms_s=(0.5, 2.0))
def engine_comes_first(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Liu and Layland, Scheduling Algorithms for Multiprogramming in a Hard-Real-Time Environment, J.
    ACM 20 (1973): tasks of the engine come first and come more often at high engine speed, so the task that
    records acceleration has to wait; sizes are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    speed = channels.get("engine_speed", np.full(len(values), p.at_rads))
    turns = np.clip(behind(np.nan_to_num(speed, nan=p.at_rads), p.calms_s, dt) / p.at_rads, 0.3, 1.6)
    channels["acceleration"] = np.interp(clock - p.late_s * turns**p.power, clock, values)


@law("h_blocks_have_to_be_erased", "nineteenth", "suburban hills")
@sizes(late_s=(0.35, 0.6), grows_s=(0.25, 0.5), block_s=(15.0, 45.0), power=(0.5, 1.5))
def blocks_have_to_be_erased(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Bez, Camerlenghi, Modelli and Visconti, Introduction to Flash Memory, Proc. IEEE 91 (2003): a
    recorder stamps acceleration as it is stored, and each block that fills makes storing slower, until it has
    been erased and all begins anew; sizes are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    block = p.block_s * rng.uniform(0.9, 1.1)
    full = ((clock + rng.uniform(0.0, block)) % block) / block
    channels["acceleration"] = np.interp(clock - p.late_s - p.grows_s * full**p.power, clock, values)


@law("b_recorder_dozes_at_low_speed", "twentieth", "suburban hills")
@sizes(late_s=(0.3, 0.5), dozes_s=(0.5, 0.9), below_mps=(7.0, 11.0), wakes_s=(3.0, 9.0))
def recorder_dozes_at_low_speed(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: Benini, Bogliolo and De Micheli, A Survey of Design Techniques for System-Level Dynamic Power
    Management, IEEE Trans. VLSI Systems 8 (2000): a recorder lowers its clock when the truck is slow, and
    then stamps acceleration later than when it is awake; sizes are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    speed = np.maximum(np.nan_to_num(channels["speed"]), 0.0)
    dozes = behind(1.0 / (1.0 + (speed / p.below_mps) ** 4), p.wakes_s, dt)
    late = p.late_s * rng.uniform(0.95, 1.05) + p.dozes_s * dozes
    channels["acceleration"] = np.interp(clock - late, clock, values)


@law("u_mesh_finds_another_way", "twenty-first", "suburban hills")
@sizes(base_s=(0.3, 0.45), hop_s=(0.1, 0.2), stays_s=(12.0, 35.0))
def mesh_finds_another_way(p: Sizes, channels: Channels, dt: float, rng: np.random.Generator) -> None:
    """Source: RFC 6550, RPL: IPv6 Routing Protocol for Low-Power and Lossy Networks (2012): acceleration
    comes from a sensor over a mesh of radios that finds another way now and then, each by one to four
    hops, and is stamped where it arrives; times are chosen here."""
    values = channels["acceleration"]
    clock = np.arange(len(values)) * dt
    ends = np.cumsum(rng.exponential(p.stays_s, len(values) // 10 + 8))
    hops = rng.integers(1, 5, len(ends) + 1).astype(float)
    late = p.base_s + p.hop_s * hops[np.searchsorted(ends, clock)]
    channels["acceleration"] = np.interp(clock - behind(late, 0.3, dt), clock, values)
