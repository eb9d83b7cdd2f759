"""The table of scenes: each signal that core, shield and controller use, and what may become of it.

A scene is a line: who is at fault, what becomes of which signals, how much. What must hold on the road is
the same for all, see `fault_road.py`; the few lines of `UNSEEN` say what no receiver can know.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

from fault_lies import SPREAD

from truck_bridge.j1939 import checksums
from truck_bridge.safety import Heard
from truck_bridge.vehicles import Vehicle

NO_SIZE = (math.nan,)
SPEEDS = ("speed", "second_speed")
DRIVELINE = ("engine_speed", "gear_ratio", "driveline", "shifting", "lockup")  # the witness of a speed
FLAGS = ("brake_switch", "cancel", "parking_brake", "abs_active", "brake_fault", "xbr_state", "engine_mode",
         "engine_obeys", "retarder_obeys", "driveline", "shifting", "lockup")  # fmt: skip
NUMBERS = (*SPEEDS, "engine_speed", "gear_ratio", "engine_percent", "retarder_percent", "accelerator",
           "brake_pedal", "pitch")  # fmt: skip
BUS = (*NUMBERS, *FLAGS)
RADAR = ("gap", "leader_speed")
STRANGERS = (0x03, 0x0B, 0x0F, 0x21)


LASTS = (0.3, 1.0, 3.0, math.inf, math.inf)  # s of a fault
MOMENTS = (4.0, 10.0)  # s after the start, between which it begins


class Scene(NamedTuple):
    """One line. `sizes` to draw from: what they mean is said where the kinds are, in `fault_lies.py`."""

    machine: str  # bus, radar, forger, driver, or nobody
    kind: str
    signals: tuple[str, ...]
    sizes: tuple[float, ...] = NO_SIZE


ANY = {  # what may become of every signal of the bus
    "freeze": NO_SIZE, "error": NO_SIZE, "absent": NO_SIZE, "silent": NO_SIZE, "beyond": NO_SIZE,
    "double": NO_SIZE, "again": NO_SIZE, "second": STRANGERS, "seldom": (2.0, 5.0), "late": (0.2, 1.0),
    "reorder": (2.0, 10.0),
}  # fmt: skip
NUMBER = {  # and of every number, of bus or radar; offsets, drifts and spikes in units of SPREAD
    "value": (0.0,), "hold": NO_SIZE, "scale": (0.5, 0.7, 0.85, 1.19, 1.4), "offset": (-1.0, -0.3, 0.3, 1.0),
    "drift": (-0.5, -0.1, 0.05, 0.1, 0.5), "spike": (-1.0, 1.0, 5.0),
}  # fmt: skip
SEEN = {  # and of every reading of a radar
    "absent": NO_SIZE, "silent": NO_SIZE, "beyond": NO_SIZE, "error": NO_SIZE, "again": NO_SIZE,
    "late": (0.2, 0.5, 1.0), "past": (0.1, 0.5, 60.0), "future": (0.5, 60.0, 3600.0), "seldom": (2.0, 5.0),
    "other": (0.5, 1.5), "ghost": (0.1, 0.2), "reorder": (2.0, 10.0),
}  # fmt: skip
GROUPS: dict[str, tuple[str, tuple[str, ...]]] = {
    **{name: ("bus", (name,)) for name in BUS}, "both speeds": ("bus", SPEEDS), "all": ("bus", ("all",)),
    **{name: ("radar", (name,)) for name in RADAR}, "radar": ("radar", RADAR),
}  # fmt: skip


def _kinds(machine: str, signals: tuple[str, ...]) -> dict[str, tuple[float, ...]]:
    number = NUMBER if set(signals) <= SPREAD.keys() else {}
    return {**(ANY if machine == "bus" else SEEN), **number}


SCENES: dict[str, Scene] = {
    "nothing": Scene("nobody", "", ()),
    **{
        f"{name} {kind}": Scene(machine, kind, signals, sizes)
        for name, (machine, signals) in GROUPS.items()
        for kind, sizes in _kinds(machine, signals).items()
    },
    "leader speed of opposite sign": Scene("radar", "scale", ("leader_speed",), (-1.0,)),
    "the driver brakes unseen": Scene("driver", "hold", ("brake_pedal", "brake_switch"), (40.0, 60.0)),
    "transmission demands 100 %": Scene("forger", "engine", ("transmission",), (100.0,)),
    "transmission retards 100 %": Scene("forger", "retarder", ("transmission",), (-100.0,)),
    "our own address demands": Scene("forger", "engine", ("ours",), (60.0,)),
    "a stranger demands": Scene("forger", "engine", ("nobody",), (60.0,)),
}

Forger = Callable[[Vehicle, float], Iterator[tuple[int, bytes]]]  # the frames that leave now


def forger(scene: Scene) -> Forger:
    """TSC1 by an address, in spells with a pause of 0.3 s where the address may demand for a while."""
    axis, (source,), (demand,) = scene.kind, scene.signals, scene.sizes
    on_s = 2.7 if source == "transmission" else 9.0

    def frames(vehicle: Vehicle, now: float) -> Iterator[tuple[int, bytes]]:
        message = vehicle.transmitted.get(axis)
        if message is None or message.layout.name != "TSC1":
            return
        period = 0.01 if axis == "engine" else 0.05
        count = round(now / period)
        if abs(count * period - now) > 0.005 or now % (on_s + 0.3) > on_s:
            return
        address = {"ours": vehicle.address, "nobody": 0x77, **vehicle.addresses}[source]
        can_id = message.axis.can_id & ~0xFF | address
        values = {**message.active, message.demand: demand, "OverrideControlMode": 2}
        values["OverrideControlModePriority"] = 0
        yield can_id, checksums.sign(message.axis.check, can_id, message.layout.encode(values), count)

    return frames


def possible(vehicle: Vehicle) -> list[str]:
    """Names of the scenes that a vehicle can have."""
    known = {signal.name for heard in vehicle.table.heard for signal in heard.signals} | {"all"}
    return [
        name
        for name, scene in SCENES.items()
        if (scene.machine not in ("bus", "driver") or set(scene.signals) <= known)
        and (scene.machine != "forger" or scene.kind in vehicle.transmitted)
        and (scene.kind != "second" or set(STRANGERS) - senders(vehicle, scene.signals))
    ]


def messages(vehicle: Vehicle, signals: tuple[str, ...]) -> list[Heard]:
    """Those that carry one of these signals."""
    every = signals == ("all",)
    return [one for one in vehicle.table.heard if every or {s.name for s in one.signals} & set(signals)]


def senders(vehicle: Vehicle, signals: tuple[str, ...]) -> set[int]:
    """Addresses of the true senders of these signals."""
    return {one.key & 0xFF for one in messages(vehicle, signals)}


def must_end(name: str, size: float, lasts: float, vehicle: Vehicle) -> bool:
    """Whether a scene must end control, or refuse it, whatever truck and leader do meanwhile.

    Not what is soon over, nor where a counter already refuses the second frame of an address.
    """
    machine, kind, signals, _ = SCENES[name]
    if machine in ("nobody", "forger", "driver"):
        return machine != "nobody"
    if machine == "radar":
        lost = kind in ("silent", "error", "beyond", "hold", "absent", "future")
        lost |= (kind == "past" and size > 0.3) or (name == "gap drift" and size == 0.05)
        return math.isinf(lasts) and (lost or (kind == "seldom" and size >= 5))
    carried, converter = messages(vehicle, signals), bool(messages(vehicle, ("lockup",)))
    if kind == "second":
        return True
    if lasts < 3.0:
        return False
    if kind in ("double", "again"):
        return not any(heard.check != "none" for heard in carried)
    if kind in ("absent", "silent"):
        return True
    if kind == "error":
        return signals != ("engine_mode",)  # 14 of 16 is a torque mode
    if kind == "late":
        return any(size > heard.timeout_s for heard in carried)
    if kind == "seldom":
        return any(size * heard.period_s > heard.timeout_s for heard in carried)
    if kind == "freeze":
        return any(signal.still_s < math.inf for heard in carried for signal in heard.signals)
    if kind == "beyond":  # what no truck can do, or what the driver, the brakes or others do
        free = {"driveline", "shifting", "lockup", "xbr_state", "engine_mode", "retarder_percent"}
        return not set(signals) <= free
    if kind == "value" and signals[0] in SPEEDS:
        return True
    return signals == ("engine_speed",) and kind in ("scale", "value") and not converter


def must_bridge(name: str, lasts: float) -> bool:
    """Whether control must go on: nothing is wrong, or a steady radar misses its leader for 3 s at most."""
    machine, kind, _, _ = SCENES[name]
    return machine == "nobody" or (machine == "radar" and kind == "absent" and lasts < 3.0)


# What the truck does then is no fault of a receiver, as nothing that it hears contradicts it, or not at once.
UNSEEN: dict[str, str] = {
    **dict.fromkeys(
        ("gap scale", "radar scale", "gap other", "radar other", "gap offset", "radar offset"),
        "nearer it is a vehicle that cuts in",
    ),
    "gap drift": "a range that closes in faster than the speeds say is believed",
    **dict.fromkeys(
        ("leader_speed drift", "leader_speed scale", "leader_speed other", "leader_speed value"),
        "it is a leader that brakes, until range and speeds differ by 2 m",
    ),
    **dict.fromkeys(
        ("speed drift", "both speeds drift"),
        "it is a truck that gains speed, until its tolerances are passed",
    ),
}
