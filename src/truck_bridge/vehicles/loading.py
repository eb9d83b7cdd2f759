"""Loads a vehicle file, checks it, and converts it to a Vehicle with the safety core's tables."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

from deeptruck_core.reading import of, package_yaml, yaml_mapping
from deeptruck_core.schema import check
from truck_bridge import channels, j1939
from truck_bridge.errors import InputError
from truck_bridge.j1939 import checksums, ids
from truck_bridge.j1939.codec import Codec, Layout, Signal
from truck_bridge.j1939.diagnostics import DM1
from truck_bridge.safety import tables
from truck_bridge.units import to_si
from truck_bridge.vehicles.schema import VEHICLE
from truck_bridge.vehicles.vehicle import Blocking, Transmitted, Vehicle

NAMES = ("trucksim", "freightliner", "volvo")
COASTS_M_S2 = 1.5  # up a slope of 10 % with drag and a dragging engine; 40 % of the pedal slow by 1.6 to 3.6
SET_SPEED = 25.0  # m/s, 90 km/h: to what Directive 92/6/EEC limits heavy vehicles
HOLDS_BEYOND = {"m/s^2": 1.5, "percent": 20.0}  # 1.5 m/s^2 of the strongest brakes, 7.5 m/s^2
# From hard braking for a hazard an accelerator takes over at (percent), for (s: two frames); ours.
FIRM = {"AcceleratorPedalPosition": (24.0, 0.04)}
MOTION = ("fastest", "still", "rises")  # columns of a received message, as `Measured` has them


def load(name: str | Path) -> Vehicle:
    """A vehicle of the package by name, or a YAML file of the user.

    Raises InputError naming the file, the key and the error.
    """
    if name in NAMES:
        data, where = package_yaml(__package__, f"{name}.yaml"), f"{name}.yaml"
    elif not Path(name).is_file():  # nor a pipe, which would never answer
        raise InputError(f"no vehicle '{name}'; known: {', '.join(NAMES)}, or the path of a YAML file")
    else:
        data, where = yaml_mapping(Path(name), "give a YAML file in UTF-8"), str(name)
    check(data, VEHICLE, where)
    extra = tuple((Path(where).parent / dbc).resolve() for dbc in data.get("dbc", []))
    with of(where):
        return _build(data, j1939.load(*extra))


def _build(data: dict[str, Any], codec: Codec) -> Vehicle:
    own = data["bridge"]["address"]
    sent = {key: _transmitted(key, value, data, codec, own) for key, value in data["transmit"].items()}
    received = tuple(_received(key, value, data, codec) for key, value in data["receive"].items())
    _distinct("receive: message and sender", [f"0x{message.key:X}" for message in received])
    known = _distinct("receive: signal", [signal.name for message in received for signal in message.signals])
    follows = data.get("follows", {})
    needed = {key: set(data.get(key, ())) for key in ("driver", "forbidden", "obeys")}
    for key, names in (needed | {"follows": {spec["signal"] for spec in follows.values()}}).items():
        for signal in sorted(names - known):
            raise InputError(f"{key}: signal '{signal}' is not received; known: {', '.join(sorted(known))}")
    table = tables.Table(
        address=own,
        axes=tuple(message.axis for message in sent.values()),
        heard=received,
        always=_always(own),
        allowed=tuple(_allowed(data, sent)),
        override=tuple(_overrides(data)),
        forbidden=tuple((name, float(value)) for name, value in data["forbidden"].items()),
        driveline=_driveline(data.get("driveline")),
        coasts_m_s2=data.get("coasts", COASTS_M_S2),
        timing=_timing(data),
        engage_speed=_pair("engage.speed", data["engage"]["speed"]),
        needs_lead=data["engage"]["needs_lead"],
        obeyed=tuple(_obeyed(data, sent)),
        followed=tuple(_followed(axis, spec, sent) for axis, spec in follows.items()),
    )
    return Vehicle(
        name=data["name"],
        truck=data.get("truck", f"truck:{data['name']}"),
        interface={"name": data["name"], **data["interface"]},
        codec=codec,
        addresses=data["addresses"],
        address=own,
        identity=data["bridge"]["identity"],
        reference_torque={"engine": 1.0, "retarder": 1.0, **data["reference_torque"]},
        envelope={command: _pair(f"command.{command}", pair) for command, pair in data["command"].items()},
        transmitted=sent,
        table=table,
        blocking=_blocking(data["faults"]) if "faults" in data else Blocking(),
        named=_named(data),
        set_speed=data.get("set_speed", SET_SPEED),
    )


def _named(data: dict[str, Any]) -> dict[str, list[tuple[int, dict[str, str]]]]:
    """Senders of each message of `receive`, with the core's name of each of its signals."""
    found: dict[str, list[tuple[int, dict[str, str]]]] = {}
    for key, spec in data["receive"].items():
        names = {source: name for name, source in spec["signals"].items()}
        found.setdefault(spec.get("message", key), []).append((_address(data, spec["from"]), names))
    return found


def _obeyed(data: dict[str, Any], sent: dict[str, Transmitted]) -> Iterator[tables.Obeyed]:
    """Who is obeyed by which controller: of an axis that we command, where the signal is an address."""
    names = {name: source for spec in data["receive"].values() for name, source in spec["signals"].items()}
    for signal, explained in data.get("obeys", {}).items():
        axis = names[signal].removesuffix("ControllingAddress").lower()
        yield tables.Obeyed(signal, tuple(map(float, explained)), axis if axis in sent else "")


def _overrides(data: dict[str, Any]) -> Iterator[tables.Override]:
    """By which signals the driver takes over; by the message's name of it, what the driver does."""
    names = {name: source for spec in data["receive"].values() for name, source in spec["signals"].items()}
    for name, least in data["driver"].items():
        firm, held_s = FIRM.get(names[name], (least, tables.Override.held_s))
        brakes = names[name] in ("BrakePedalPosition", "BrakeSwitch")
        yield tables.Override(name, float(least), float(max(least, firm)), held_s, brakes)


def _followed(axis: str, spec: dict[str, Any], sent: dict[str, Transmitted]) -> tables.Followed:
    if axis not in sent:
        raise InputError(f"follows: nothing commands '{axis}'; known: {', '.join(sent)}")
    if spec["beyond"] == 0:
        raise InputError(f"follows.{axis}.beyond is 0; give how far the signal may be from the demand")
    return tables.Followed(axis, spec["signal"], float(spec["beyond"]))


def _blocking(spec: dict[str, Any]) -> Blocking:
    codes = tuple((code["spn"], code.get("fmi")) for code in spec.get("codes", []))
    return Blocking(frozenset(spec.get("lamps", [])), codes, spec.get("listen", Blocking.listen_s))


def _always(own: int) -> tuple[int, ...]:
    """Address claimed, address not claimed, and DM1."""
    groups = ((ids.ADDRESS_CLAIMED, own), (ids.ADDRESS_CLAIMED, ids.NULL), (DM1, own))
    return tuple(ids.Identifier(6, group, ids.GLOBAL, source).can_id for group, source in groups)


def _transmitted(key: str, spec: dict[str, Any], data: dict[str, Any], codec: Codec, own: int) -> Transmitted:
    layout = codec[spec["message"]]
    for name in (spec["demand"], *spec["active"], *spec["release"]):
        _signal(layout, name)
    signal = layout.signals[spec["demand"]]
    try:
        word = int.from_bytes(layout.encode(spec["active"]), "little") & ~(signal.mask << signal.start)
        release = int.from_bytes(layout.encode(spec["release"]), "little")
    except ValueError as error:
        raise InputError(f"transmit.{key}: {error}") from None
    axis = tables.Axis(
        key,
        layout.can_id(own, _address(data, spec["to"])),
        spec["period"],
        _field(signal, 1.0),
        word & (1 << 56) - 1,
        release & (1 << 56) - 1,
        spec["check"],
        _limits(key, spec["limits"], _timing(data)),
        idle_at_rest=spec.get("idle_at_rest", False),
        start_from=spec.get("start_from", ""),
        holds_beyond=_holds_beyond(key, spec, data["interface"]["brake_unit"]),
    )
    return Transmitted(axis, layout, spec["demand"], spec["active"], spec["release"], spec["phase"])


def _holds_beyond(key: str, spec: dict[str, Any], brake_unit: str) -> float:
    """The demand from which a loss of control goes on braking; of a brake that states none, a low one."""
    if key == "engine" and "holds_beyond" in spec:
        raise InputError("transmit.engine.holds_beyond: engine torque does not brake")
    lowest, highest = min(spec["limits"]["low"]), max(spec["limits"]["high"])
    edge = lowest if highest <= 0 else highest
    usual = HOLDS_BEYOND[brake_unit] if key == "brake" else math.inf
    beyond = float(spec.get("holds_beyond", math.copysign(usual, edge)))
    if "holds_beyond" in spec and not 0 < beyond / edge < 1:
        raise InputError(f"transmit.{key}.holds_beyond is {beyond:g}; give a demand between 0 and {edge:g}")
    return beyond


def _allowed(data: dict[str, Any], sent: dict[str, Transmitted]) -> Iterator[tables.Allowed]:
    """The permitted TSC1 demands of each controller; TSC1 is the only message whose modes the core knows."""
    for who, axes in data["demands"].items():
        for axis, spec in axes.items():
            place = f"demands.{who}.{axis}"
            if axis not in sent or sent[axis].layout.name != "TSC1":
                known = [name for name, message in sent.items() if message.layout.name == "TSC1"]
                raise InputError(f"{place}: only what TSC1 commands can be allowed: {', '.join(known)}")
            key = sent[axis].axis.can_id & 0x03FF_FF00 | _address(data, who)
            period = _pair(f"{place}.period", spec["period"])
            yield tables.Allowed(f"{who} to {axis}", key, tuple(spec["modes"]), spec["longest"], period)


def _timing(data: dict[str, Any]) -> tables.Timing:
    return tables.Timing(**data.get("timing", {}))


def _limits(key: str, spec: dict[str, Any], timing: tables.Timing) -> tables.Limits:
    speed, low, high = (tuple(map(float, spec[name])) for name in ("speed", "low", "high"))
    if not len(speed) == len(low) == len(high) > 1:
        raise InputError(
            f"transmit.{key}.limits: speed, low and high need the same number of points, two or more"
        )
    if any(b <= a for a, b in pairwise(speed)):
        raise InputError(f"transmit.{key}.limits.speed must grow from point to point")
    if max(low) > 0 or min(high) < 0:
        raise InputError(f"transmit.{key}.limits: the envelope must hold 0, the demand that asks for nothing")
    steepest = max(
        abs(y1 - y0) / (x1 - x0)
        for values in (low, high)
        for x0, x1, y0, y1 in zip(speed, speed[1:], values, values[1:], strict=False)
    )
    slowest = min(spec["rate"] * timing.handover_scale, spec["fade"])
    if steepest * 12.0 > slowest:
        raise InputError(
            f"transmit.{key}.limits: at 12 m/s^2 the envelope moves {steepest * 12:g} a second, faster"
            f" than the {slowest:g} a demand may follow; make it flatter or rate and fade larger"
        )
    return tables.Limits(speed, low, high, spec["rate"], spec["fade"], spec["jerk"])


def _pair(key: str, values: list[float]) -> tuple[float, float]:
    if len(values) != 2 or values[0] > values[1]:
        raise InputError(f"{key} needs two numbers, the lower first, not {values}")
    return values[0], values[1]


def _received(key: str, spec: dict[str, Any], data: dict[str, Any], codec: Codec) -> tables.Heard:
    """One entry of `receive`: its name is that of the message, unless it has a `message` key because two
    controllers send the same one."""
    layout = codec[spec.get("message", key)]
    if spec.get("check", checksums.NONE) != checksums.NONE:
        _room_to_sign(key, layout)
    for column in ("range", *MOTION):
        for name in spec.get(column, {}):
            if name not in spec["signals"]:
                raise InputError(f"receive.{key}.{column}: no signal '{name}' in this message")
    measured = []
    for name, source in spec["signals"].items():
        signal = _signal(layout, source)
        factor, _ = to_si(signal.unit)
        field = _field(signal, factor)
        own = field.offset, field.offset + field.scale * field.last
        low, high = spec.get("range", {}).get(name) or channels.physical_range(layout.name, source) or own
        fastest, still, rises = (spec.get(column, {}).get(name, math.inf) for column in MOTION)
        measured.append(tables.Measured(name, field, low, high, fastest, still, rises))
    sender = layout.pgn << 8 | _address(data, spec["from"])
    return tables.Heard(
        key, sender, spec["period"], spec["timeout"], tuple(measured), spec.get("check", "none")
    )


def _room_to_sign(key: str, layout: Layout) -> None:
    """Raises InputError if the DBC has other signals in byte 8, which holds counter and checksum."""
    for signal in layout.signals.values():
        if signal.start + signal.bits > 56 and not signal.name.endswith(("Counter", "Checksum")):
            raise InputError(
                f"receive.{key}.check: byte 8 of {layout.name} holds {signal.name}, no counter and checksum; "
                f"name a DBC of your truck's under dbc"
            )


def _distinct(what: str, names: list[str]) -> set[str]:
    """The names as a set. Raises InputError for a duplicate, which would silently replace the earlier one."""
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{what} '{name}' is named twice")
    return set(names)


def _signal(layout: Layout, name: str) -> Signal:
    if name not in layout.signals:
        raise InputError(f"{layout.name} has no signal '{name}'; known: {', '.join(layout.signals)}")
    return layout.signals[name]


def _field(signal: Signal, factor: float) -> tables.Field:
    return tables.Field(signal.start, signal.bits, signal.scale * factor, signal.offset * factor, signal.last)


def _address(data: dict[str, Any], who: str) -> int:
    try:
        address: int = data["addresses"][who]
        return address
    except KeyError:
        raise InputError(f"no address for '{who}'; known: {', '.join(data['addresses'])}") from None


def _driveline(spec: dict[str, Any] | None) -> tables.Driveline | None:
    if spec is None:
        return None
    return tables.Driveline(spec["rolling_radius"] / spec["final_drive"], spec["tolerance"])
