"""What may go wrong in a lock-step run."""

from __future__ import annotations

import math
from collections.abc import Callable

import can
from fault_wire import FAULTS as WIRE_FAULTS
from fault_world import Run

from truck_bridge.j1939.address_claim import name

Undo = Callable[[], None]

# Each is called once, when its time has come; `undo` is called a while later.


def _wire(fault: str) -> Callable[[Run], Undo]:
    def begin(run: Run) -> Undo:
        sides = [run.bridge_side, run.truck_side] if run.rng.random() < 0.5 else [run.bridge_side]
        for side in sides:
            side.fault = fault

        def undo() -> None:
            for side in sides:
                side.fault = ""

        return undo

    return begin


def _set(key: str, value: object, after: object) -> Callable[[Run], Undo]:
    def begin(run: Run) -> Undo:
        setattr(run, key, value)
        return lambda: setattr(run, key, after)

    return begin


def _driver(key: str, value: float) -> Callable[[Run], Undo]:
    def begin(run: Run) -> Undo:
        setattr(run.truck.driver, key, value)
        return lambda: setattr(run.truck.driver, key, 0.0)

    return begin


def _pause(run: Run) -> Undo:
    run.paused_until = run.now + float(run.rng.uniform(0.02, 1.5))
    return lambda: None


def _clock(run: Run) -> Undo:
    run.offset = float(run.rng.choice([-30.0, -0.05, 0.3, 30.0]))
    return lambda: None


def _unplug(run: Run) -> Undo:
    run.bridge_side.down = True
    return lambda: setattr(run.bridge_side, "down", False)


def _bus_off(run: Run) -> Undo:
    message = can.Message(arbitration_id=0x40, data=bytes(8), is_error_frame=True)
    run.bridge_side.inbox.append((run.now, message))
    return lambda: None


def _spoof(run: Run) -> Undo:
    engine = run.vehicle.transmitted["engine"]
    run.frame(engine.axis.can_id & ~0xFF | 0x77, engine.frame(90.0, 0))
    return lambda: None


def _impostor(run: Run) -> Undo:
    engine = run.vehicle.transmitted["engine"]
    run.frame(engine.axis.can_id, engine.frame(97.0, 3))
    return lambda: None


def _address_war(run: Run) -> Undo:
    run.frame(0x18EEFF00 | run.vehicle.address, name(0))
    return lambda: None


def _silence(run: Run) -> Undo:
    """One of the truck's controllers falls silent."""
    senders = run.truck._senders
    who = str(run.rng.choice(["engine", "brake", "transmission"]))
    gone = [s for s in senders if s.source == who]
    kept = [s for s in senders if s not in gone]
    run.truck._senders = kept
    return lambda: setattr(run.truck, "_senders", kept + gone)


FAULTS: dict[str, Callable[[Run], Undo]] = {
    "nothing": lambda run: lambda: None,
    **{fault: _wire(fault) for fault in WIRE_FAULTS},
    "spoofed TSC1": _spoof,
    "our address used": _impostor,
    "address lost": _address_war,
    "flood": _set("flood", True, False),
    "controller gone": _set("commanding", False, True),
    "controller NaN": _set("engine", math.nan, 0.0),
    "controller outside": _set("brake", 1e4, 0.0),
    "controller disengaged": _set("engaged_bit", False, None),
    "paused": _pause,
    "clock jump": _clock,
    "unplugged": _unplug,
    "bus off": _bus_off,
    "truck silent": _silence,
    "brake pedal": _driver("brake_pedal", 40.0),
    "accelerator": _driver("accelerator", 30.0),
    "cancel": _driver("cancel", 1.0),
    "parking brake": _driver("parking_brake", 1.0),
}
OVERRIDES = ("brake pedal", "accelerator", "cancel")
MUST_END = {  # faults that must end control when they happen for more than a second
    *OVERRIDES, "spoofed TSC1", "our address used", "address lost", "controller gone", "controller NaN",
    "controller outside", "controller disengaged", "unplugged", "bus off", "truck silent", "parking brake",
}  # fmt: skip
