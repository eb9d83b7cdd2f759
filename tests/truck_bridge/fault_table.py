"""The tables of scenes: what is ahead, and what may become of each signal, actuator, node and wire.

A fault is a line: who is at fault, what becomes of which signals, how much. What must hold on the road is
the same for all, see `fault_road.py`; the few lines of `UNSEEN` say what no receiver can know.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import can
import numpy as np
from fault_chain import Chain, Command, Forger, Object
from fault_lies import SPREAD, Lie, RadarLie
from fault_wire import FAULTS as WIRE

from deeptruck_nodes.leaders import Constant, Leader, Steps
from truck_bridge.j1939 import checksums
from truck_bridge.j1939.address_claim import name as j1939_name
from truck_bridge.safety import Heard
from truck_bridge.vehicles import Vehicle

NO_SIZE = (math.nan,)
SPEEDS = ("speed", "second_speed")
FLAGS = ("brake_switch", "cancel", "parking_brake", "abs_active", "brake_fault", "xbr_state", "engine_mode",
         "engine_obeys", "retarder_obeys", "driveline", "shifting", "lockup")  # fmt: skip
NUMBERS = (*SPEEDS, "engine_speed", "gear_ratio", "engine_percent", "retarder_percent", "accelerator",
           "brake_pedal", "pitch")  # fmt: skip
BUS = (*NUMBERS, *FLAGS)
RADAR = ("gap", "leader_speed")
STRANGERS = (0x03, 0x0B, 0x0F, 0x21)


ACTUATOR = {"gain": (0.0, 0.5), "late_s": (0.5,), "stuck": (1.0,), "drags": (0.3,), "lost": (1.0,)}
SHARES = {"bus": 4.0, "radar": 4.0, "actuator": 2.0, "nobody": 0.2}  # of the machines at fault, others 1
LASTS = (0.3, 1.0, 3.0, math.inf, math.inf)  # s of a fault
MOMENTS = (4.0, 10.0)  # s after the start, between which it begins
GRADES = (0.0, 0.0, 0.02, -0.02, 0.06, -0.06)
LOADS = (0.75, 1.0, 1.0, 2.0)  # of the truck's mass: 15 to 40 t of trucksim's 20 t


def _to(speed: float, at: float, change: float, pull: float) -> Leader:
    return Steps((speed, max(speed + change, 0.0)), at, pull)


def _slows(rng: np.random.Generator, v: float, at: float) -> list[Object]:
    return [Object(_to(v, at, -v * rng.choice([0.3, 0.6, 1.0]), float(rng.choice([1.0, 2.0, 4.0, 6.0]))))]


def _cut_in(rng: np.random.Generator, v: float, at: float) -> list[Object]:
    speed = v + float(rng.uniform(-3.0, 1.0))
    return [Object(Constant(v)), Object(Constant(speed), 2 * v * float(rng.uniform(0.3, 0.8)), at)]


def _cut_in_slows(rng: np.random.Generator, v: float, at: float) -> list[Object]:
    first, second = _cut_in(rng, v, at - 3.0)
    return [first, Object(_to(v, at, -v * 0.6, float(rng.choice([2.0, 4.0]))), second.gap, at - 3.0)]


def _cut_out(rng: np.random.Generator, v: float, at: float, share: float = 0.0) -> list[Object]:
    behind = Constant(v * share)
    return [Object(Constant(v), leaves=at), Object(behind, 2 * v + float(rng.uniform(10.0, 90.0)), at)]


def _cut_in_out(rng: np.random.Generator, v: float, at: float) -> list[Object]:
    """A vehicle cuts in, and leaves again before a slow one."""
    _, nearer = _cut_in(rng, v, at - 4.0)
    leader, slow = _cut_out(rng, v, at, float(rng.choice([0.0, 0.5])))
    return [Object(leader.motion, leaves=at - 4.0), Object(Constant(v), nearer.gap, at - 4.0, at), slow]


def _seen(rng: np.random.Generator, v: float, at: float, seconds: float, share: float) -> list[Object]:
    """What is no obstacle is seen for a moment."""
    beside = Object(Constant(v * share), v * float(rng.uniform(0.5, 1.5)), at, at + seconds - 0.05, False)
    return [Object(Constant(v)), beside]


TRAFFIC: dict[str, Callable[[np.random.Generator, float, float], list[Object]]] = {
    "steady": lambda rng, v, at: [Object(Constant(v))],
    "leader slows down": _slows,
    "leader pulls away": lambda rng, v, at: [Object(_to(v, at, 3.0, 0.6))],
    "cut-in": _cut_in,
    "cut-in, then slows down": _cut_in_slows,
    "cut-out onto a standing vehicle": _cut_out,
    "cut-out onto a slow vehicle": lambda rng, v, at: _cut_out(rng, v, at, float(rng.choice([0.3, 0.6]))),
    "cut-in, then cut-out": _cut_in_out,
    "ghost": lambda rng, v, at: _seen(rng, v, at, 0.1, float(rng.choice([0.0, 1.0]))),
    "adjacent lane": lambda rng, v, at: _seen(rng, v, at, float(rng.choice([0.3, 0.6])), 1.2),
}  # by name, of a speed and the time at which it happens
HARMLESS = ("steady", "leader pulls away", "ghost", "adjacent lane")


class Fault(NamedTuple):
    """One line. `sizes` to draw from: what they mean is said where the kinds are, in `fault_lies.py`."""

    machine: str  # bus, radar, actuator, forger, driver, wire, node, once, person, or nobody
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


FAULTS: dict[str, Fault] = {
    "nothing": Fault("nobody", "", ()),
    **{
        f"{name} {kind}": Fault(machine, kind, signals, sizes)
        for name, (machine, signals) in GROUPS.items()
        for kind, sizes in _kinds(machine, signals).items()
    },
    **{
        f"{axis} {kind}": Fault("actuator", kind, (axis,), sizes)
        for axis in ("brake", "engine")
        for kind, sizes in ACTUATOR.items()
    },
    **{f"wire {kind}": Fault("wire", kind, ()) for kind in WIRE},
    **{f"controller {kind}": Fault("node", kind, ()) for kind in ("gone", "NaN", "outside", "disengaged")},
    "bridge paused": Fault("node", "paused", (), (0.05, 0.3, 1.5)),
    "clock jump": Fault("node", "clock", (), (-30.0, -0.05, 0.3, 30.0)),
    "unplugged": Fault("node", "unplugged", ()),
    "truck silent": Fault("node", "silent", ("engine", "brake", "transmission"), (0.0, 1.0, 2.0)),
    "flood": Fault("node", "flood", ()),
    **{
        name: Fault("once", name, ())
        for name in ("spoofed TSC1", "our address used", "address lost", "bus off")
    },
    "brake pedal": Fault("person", "brake_pedal", (), (40.0,)),
    "accelerator": Fault("person", "accelerator", (), (30.0,)),
    "cancel": Fault("person", "cancel", (), (1.0,)),
    "parking brake": Fault("person", "parking_brake", (), (1.0,)),
    "leader speed of opposite sign": Fault("radar", "scale", ("leader_speed",), (-1.0,)),
    "the driver brakes unseen": Fault("driver", "hold", ("brake_pedal", "brake_switch"), (100.0,)),
    "transmission demands 100 %": Fault("forger", "engine", ("transmission",), (100.0,)),
    "transmission retards 100 %": Fault("forger", "retarder", ("transmission",), (-100.0,)),
    "our own address demands": Fault("forger", "engine", ("ours",), (60.0,)),
    "a stranger demands": Fault("forger", "engine", ("nobody",), (60.0,)),
}


def _set(owner: object, key: str, value: object) -> Callable[[], None]:
    """Set an attribute; what is returned sets it back."""
    before = getattr(owner, key)
    setattr(owner, key, value)
    return lambda: setattr(owner, key, before)


def _added(faults: list[Any], fault: object) -> Callable[[], None]:
    faults.append(fault)
    return lambda: faults.remove(fault)


def begin(chain: Chain, name: str, size: float) -> Callable[[], None]:
    """Let a fault begin; what is returned ends it."""
    machine, kind, signals, _ = fault = FAULTS[name]
    match machine:
        case "bus" | "driver":
            return _added(chain.ours.lies, Lie(chain.vehicle, kind, signals, size))
        case "radar":
            return _added(chain.lies, RadarLie(kind, signals, size))
        case "forger":
            return _added(chain.forged, forger(fault))
        case "actuator":
            return _set(chain.truck.actuators[signals[0]], kind, size)
        case "person":
            return _set(chain.truck.driver, kind, size)
        case "wire":
            return _set(chain.ours, "fault", kind)
        case "once":
            _arrive(chain, kind)
        case "node":
            return _node(chain, kind, signals, size)
    return lambda: None


def _node(chain: Chain, kind: str, signals: tuple[str, ...], size: float) -> Callable[[], None]:
    """A process, its clock or its plug."""
    commands: dict[str, Command] = {
        "gone": lambda engine, brake, engaged: None,
        "NaN": lambda engine, brake, engaged: (math.nan, brake, engaged),
        "outside": lambda engine, brake, engaged: (engine, 1e4, engaged),
        "disengaged": lambda engine, brake, engaged: (engine, brake, False),
    }
    match kind:
        case "paused":
            chain.paused_until = chain.now + size
        case "clock":
            chain.offset = size
        case "unplugged":
            return _set(chain.ours, "down", True)
        case "silent":
            kept = [s for s in chain.truck._senders if s.source != signals[int(size)]]
            return _set(chain.truck, "_senders", kept)
        case "flood":
            return _added(chain.forged, _flood)
        case _:
            return _set(chain, "command", commands[kind])
    return lambda: None


def _flood(vehicle: Vehicle, now: float) -> Iterator[tuple[int, bytes]]:
    rng = np.random.default_rng(round(now * 100))
    for _ in range(40):
        yield int(rng.integers(1 << 29)) & ~0xFF | 0xF9, rng.bytes(8)


def _arrive(chain: Chain, kind: str) -> None:
    """One frame on which the bridge hands back."""
    engine = chain.vehicle.transmitted["engine"]
    frames = {
        "spoofed TSC1": (engine.axis.can_id & ~0xFF | 0x77, engine.frame(90.0, 0)),
        "our address used": (engine.axis.can_id, engine.frame(97.0, 3)),
        "address lost": (0x18EEFF00 | chain.vehicle.address, j1939_name(0)),
        "bus off": (0x40, bytes(8)),
    }
    can_id, data = frames[kind]
    error = kind == "bus off"
    message = can.Message(arbitration_id=can_id, data=data, is_extended_id=not error, is_error_frame=error)
    chain.ours.inbox.append((chain.now, message))


def forger(scene: Fault) -> Forger:
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


def draw(vehicle: Vehicle, rng: np.random.Generator, names: list[str]) -> tuple[str, float, float]:
    """A fault of these, its size, and for how long it lasts (s)."""
    machines = [FAULTS[name].machine for name in names]
    weights = np.array([SHARES.get(machine, 1.0) / machines.count(machine) for machine in machines])
    name = str(rng.choice(names, p=weights / weights.sum()))
    machine, kind, signals, sizes = FAULTS[name]
    taken = senders(vehicle, signals) if kind == "second" else set()
    for_good = machine in ("forger", "driver", "once") or kind in ("second", "clock", "paused")
    lasts = float(rng.choice(LASTS))
    return (
        name,
        float(rng.choice([one for one in sizes if one not in taken])),
        math.inf if for_good else lasts,
    )


def possible(vehicle: Vehicle) -> list[str]:
    """Names of the faults that a vehicle can have."""
    known = {signal.name for heard in vehicle.table.heard for signal in heard.signals} | {"all"}
    return [
        name
        for name, scene in FAULTS.items()
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
    """Whether a scene must hand back, or refuse it, whatever truck and leader do meanwhile.

    Not what is soon over, nor where a counter already refuses the second frame of an address.
    """
    machine, kind, signals, _ = FAULTS[name]
    if machine in ("nobody", "forger", "driver", "once", "person"):
        return machine != "nobody" and (machine != "person" or lasts > 0.301)
    if machine == "node":  # a pause counts by its own length
        long = size > 0.3 if kind == "paused" else lasts >= 1.0 or kind in ("NaN", "outside")
        return kind != "flood" and long
    if machine == "wire":
        return False
    if machine == "actuator":
        return name == "brake drags" and math.isinf(lasts)
    if machine == "radar":
        lost = kind in ("silent", "error", "beyond", "hold", "absent", "future")
        lost |= (kind == "past" and size > 0.3) or (name == "gap drift" and size == 0.05)
        return math.isinf(lasts) and lost  # a reading in half a second is bridged, as silence of 3 s is
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
    machine, kind, _, _ = FAULTS[name]
    return machine == "nobody" or (machine == "radar" and kind == "absent" and lasts < 3.0)


# What the truck does then is no fault of a receiver, as nothing that it hears contradicts it, or not at once.
UNSEEN: dict[str, str] = {
    **dict.fromkeys(
        ("gap scale", "radar scale", "gap offset", "radar offset"),
        "nearer it is a vehicle that cuts in",
    ),
    "gap drift": "a range that closes in faster than the speeds say is assumed",
    **dict.fromkeys(
        ("leader_speed drift", "leader_speed scale", "leader_speed value"),
        "it is a leader that brakes, until range and speeds differ by 2 m",
    ),
    **dict.fromkeys(
        ("speed drift", "both speeds drift"),
        "it is a truck that gains speed, until its tolerances are passed",
    ),
}
