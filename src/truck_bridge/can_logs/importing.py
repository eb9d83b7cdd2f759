"""A CAN log as deeptruck's channels: the importer of entry point group 'deeptruck.importers'."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from truck_bridge import j1939, vehicles
from truck_bridge.can_logs import faults
from truck_bridge.can_logs.decoding import Decoding, decode
from truck_bridge.channels import CARRIERS, DEMANDS, Carrier, converter
from truck_bridge.errors import InputError
from truck_bridge.j1939.codec import Codec
from truck_bridge.units import COMMANDS, of_command, to_si

Series = tuple[Array, Array]

NO_TORQUE = -125.0  # percent of a byte of zero, which a controller sends that starts or ends
TORQUES = {(one.message, one.signal) for one in CARRIERS if one.of_reference}


def import_can_log(log_path: Path, columns: Mapping[str, Any]) -> tuple[dict[str, Series], dict[str, Any]]:
    """Channels of deeptruck from a J1939 log: name -> (times (n,) in s, values (n,)), and the truck
    interface.

    Without further columns the channels come from the signals of `truck_bridge.channels`; the engine command
    is the driver's demand torque (SPN 512, percent) and the brake command the pedal position (SPN 521,
    percent) if the log has it. `columns` may hold: `vehicle` (whose DBC files and reference torque apply),
    `name`, `reference_torque` (N m), `channel` (the bus, if the log has several), and `channels: {speed:
    {signal: EBC2.FrontAxleSpeed, source: 0x0B}, ...}` to take a channel from another signal; a command then
    has that signal's unit. Torque in N m is omitted if no reference torque is known (SPN 544 in the log, the
    vehicle or `reference_torque`). Active faults (DM1) are separate channels; `interface["notes"]` names them
    and the VIN, if received, and `interface["account"]` is the Account of the log's frames. Raises InputError
    on a bad log or bad columns.
    """
    codec, torque = _meaning(columns)
    bus = columns.get("channel")
    found = decode(
        log_path, codec, channel=None if bus is None else str(bus), ascending=True, only=_wanted(columns)
    )
    torque = found.reference_torque if math.isnan(torque) else torque
    channels: dict[str, Series] = {}
    units = dict.fromkeys(COMMANDS, "percent")
    for channel, spec in (columns.get("channels") or {}).items():
        if channel in COMMANDS:
            channels[channel], units[channel] = _command(found, channel, spec)
        else:
            channels[channel] = _chosen(found, channel, spec, torque)
    for channel, keys in _defaults(found, torque).items():
        if channel not in channels and keys:
            channels[channel] = keys
    channels = {**faults.channels(found.faults), **channels}
    if "speed" not in channels:
        raise InputError(
            f"{log_path} holds no vehicle speed (CCVS1, EBC2 or TCO1); is it a J1939 log of a truck?"
        )
    interface: dict[str, Any] = {
        "name": str(columns.get("name", columns.get("vehicle", log_path.stem))),
        "engine_unit": units["engine_command"],
        "brake_unit": units["brake_command"] if "brake_command" in channels else None,
        "grade": "grade" in channels,
        "fuel": "fuel_rate" in channels,
    }
    if "engine_command" not in channels:
        pedal = _best(found, "EEC2", "AcceleratorPedalPosition") is not None
        other = "; its pedal can be one: channels: {engine_command: {signal: EEC2.AcceleratorPedalPosition}}"
        raise InputError(
            f"{log_path} holds no engine command (EEC1 driver's demand torque)" + (other if pedal else "")
        )
    notes = faults.notes(found.faults, found.numbers, found.unreadable)
    return channels, {**interface, "account": found.account, **({"notes": notes} if notes else {})}


_KEYS = {"vehicle", "name", "reference_torque", "channel", "channels"}


def _meaning(columns: Mapping[str, Any]) -> tuple[Codec, float]:
    unknown = sorted(set(columns) - _KEYS)
    if unknown:
        raise InputError(
            f"columns for a CAN log: unknown key '{unknown[0]}'; known: {', '.join(sorted(_KEYS))}"
        )
    torque = math.nan
    codec = j1939.load()
    if "vehicle" in columns:
        vehicle = vehicles.load(columns["vehicle"])
        codec, torque = vehicle.codec, vehicle.reference_torque["engine"]
    stated = columns.get("reference_torque")
    if stated is not None and not (isinstance(stated, int | float) and stated > 0):
        raise InputError(f"columns: reference_torque is {stated!r}; it must be a number above 0, in N m")
    return codec, float(stated) if stated is not None else torque


def _wanted(columns: Mapping[str, Any]) -> frozenset[tuple[str, str]]:
    """Messages and signals from which channels may come."""
    usual = [(one.message, one.signal) for one in (*CARRIERS, *DEMANDS)]
    less = [one.less for one in CARRIERS if one.less is not None]
    chosen = [spec for spec in (columns.get("channels") or {}).values() if isinstance(spec, Mapping)]
    stated = [str(spec["signal"]).partition(".") for spec in chosen if "signal" in spec]
    return frozenset([*usual, *less, *((message, name) for message, _, name in stated)])


def _defaults(found: Decoding, torque: float) -> dict[str, Series]:
    channels: dict[str, Series] = {}
    for carrier in sorted(CARRIERS, key=lambda one: _is_still(found, one)):
        if carrier.of_reference and math.isnan(torque):
            continue
        series = _best(found, carrier.message, carrier.signal)
        if series is None or carrier.channel in channels:
            continue
        times, values = series
        if carrier.less is not None:
            less = _best(found, *carrier.less)
            values = values - np.interp(times, *less) if less is not None else values
        convert = converter(carrier, found.codec, torque)
        channels[carrier.channel] = (times, np.array([convert(value) for value in values]))
    for channel, message, signal in (
        ("engine_command", "EEC1", "DriversDemandPercentTorque"),
        ("brake_command", "EBC1", "BrakePedalPosition"),
    ):
        series = _best(found, message, signal)
        if series is not None:
            channels[channel] = series
    return channels


def _is_still(found: Decoding, carrier: Carrier) -> bool:
    """Whether every sender of a speed says 0 all along, so that another message may know better."""
    if carrier.channel != "speed":
        return False
    keys = [key for key in found.series if key[:2] == (carrier.message, carrier.signal)]
    return not any(any(found.series[key][1]) for key in keys)


def _best(found: Decoding, message: str, signal: str) -> Series | None:
    """The source with most valid samples among those that do not say 0 all along; if two have as many, the
    one with the lower address. A remark names the others."""
    keys = [key for key in found.series if key[:2] == (message, signal)]
    if not keys:
        return None
    zero = {key for key in keys if not any(found.series[key][1])}
    best, *others = sorted(keys, key=lambda key: (key in zero, -len(found.series[key][0]), key[2]))
    if others:
        rest = ", ".join(
            f"0x{key[2]:02X} ({len(found.series[key][0])} samples{', all 0' * (key in zero)})"
            for key in others
        )
        count = len(found.series[best][0])
        remark = (
            f"{message}.{signal} is taken from 0x{best[2]:02X} ({count} samples), and is sent by {rest} too; "
            "'source' in the columns chooses"
        )
        found.account.remarks += [remark] if remark not in found.account.remarks else []
    return _arrays(found, best)


def _arrays(found: Decoding, key: tuple[str, str, int]) -> Series:
    """Samples in the order of their stamps; the last one of equal stamps counts, and a torque that no engine
    has does not."""
    times, values = (np.array(part) for part in found.series[key])
    order = np.argsort(times, kind="stable")
    times, values = times[order], values[order]
    last = np.append(np.diff(times) > 0, True)
    none = last & (values <= NO_TORQUE) & (key[:2] in TORQUES)
    for out, what in ((~last, "with a repeated stamp"), (none, f"of {NO_TORQUE:g} %, a byte of zero,")):
        remark = f"{out.sum()} samples of {key[0]}.{key[1]} {what} left out"
        found.account.remarks += [remark] if out.any() and remark not in found.account.remarks else []
    return times[last & ~none], values[last & ~none]


def _chosen(found: Decoding, channel: str, spec: Any, torque: float) -> Series:
    message, name, (times, values) = _raw(found, channel, spec)
    same = [c for c in CARRIERS if (c.channel, c.message, c.signal) == (channel, message, name)]
    factor = to_si(found.codec[message].signals[name].unit)[0]
    convert = converter(same[0], found.codec, torque) if same else (lambda value: value * factor)
    return times, np.array([convert(value) for value in values])


def _command(found: Decoding, channel: str, spec: Any) -> tuple[Series, str]:
    """A command in a unit of truck interfaces, and that unit. Values that do not brake become a brake command
    of 0."""
    message, name, (times, values) = _raw(found, channel, spec)
    factor, unit = of_command(channel, found.codec[message].signals[name].unit)
    values = factor * values
    return (times, np.maximum(values, 0.0) if channel == "brake_command" else values), unit


def _raw(found: Decoding, channel: str, spec: Any) -> tuple[str, str, Series]:
    """Message and signal of a channel, and its samples in the unit of the bus."""
    if not isinstance(spec, Mapping) or "signal" not in spec or set(spec) - {"signal", "source"}:
        raise InputError(
            f"columns: channel {channel} needs {{signal: MESSAGE.SIGNAL, source: ADDRESS (optional)}}"
        )
    message, _, name = str(spec["signal"]).partition(".")
    if name not in found.codec[message].signals:
        raise InputError(
            f"columns: {message} has no signal '{name}'; known: {', '.join(found.codec[message].signals)}"
        )
    if "source" in spec:
        key = (message, name, int(spec["source"]))
        series = _arrays(found, key) if key in found.series else None
    else:
        series = _best(found, message, name)
    if series is None:
        raise InputError(f"columns: the log holds no valid sample of {spec['signal']} for channel {channel}")
    return message, name, series
