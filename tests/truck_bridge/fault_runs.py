"""Fault injection: the bridge and the ECU emulator on one bus, and a world that misbehaves at random.

`python tests/truck_bridge/fault_runs.py --runs 1000` runs in lock-step (time is an argument, so a run takes
a fraction of its length) and judges, on what left the bridge, the invariants in `judge`. Every run is drawn
from its seed: `--first N --runs 1` repeats one. `fault_processes.py` does the same to real processes.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import can
import numpy as np

from truck_bridge import vehicles
from truck_bridge.bridge import Bridge
from truck_bridge.ecu_emulator import EcuEmulator
from truck_bridge.j1939.address_claim import name
from truck_bridge.vehicles import Vehicle

STEP = 0.005
ENGAGED_AT, FAULT_AT, LENGTH = 0.8, 1.6, 5.0
CYCLE = 0.020
CONTROLLER_S = 0.2


class Wire(can.BusABC):
    """An in-memory bus whose arriving frames may be lost, held, repeated, swapped or bent."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._can_protocol = can.CanProtocol.CAN_20
        self.channel_info = "wire"
        self.rng = rng
        self.peer: Wire | None = None
        self.inbox: deque[tuple[float, can.Message]] = deque()
        self.sent: list[tuple[float, int, bytes]] = []
        self.now = 0.0
        self.fault = ""
        self.down = False
        super().__init__(channel="wire")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.down:
            raise can.CanOperationError("unplugged")
        self.sent.append((self.now, msg.arbitration_id, bytes(msg.data)))
        assert self.peer is not None
        self.peer.put(msg)

    def put(self, message: can.Message) -> None:
        """A frame arrives, with this side's fault."""
        late = 0.0
        if self.fault and self.rng.random() < 0.5:
            if self.fault == "drop":
                return
            if self.fault == "repeat":
                self.inbox.append((self.now, message))
            if self.fault == "delay":
                late = float(self.rng.uniform(0.0, 0.6))
            if self.fault == "corrupt":
                data = bytes(message.data)
                bent = (int.from_bytes(data, "little") ^ 1 << int(self.rng.integers(64))).to_bytes(
                    8, "little"
                )
                message = can.Message(arbitration_id=message.arbitration_id, data=bent, is_extended_id=True)
            if self.fault == "reorder" and self.inbox:
                self.inbox.insert(int(self.rng.integers(len(self.inbox))), (self.now, message))
                return
        self.inbox.append((self.now + late, message))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self.down:
            raise can.CanOperationError("unplugged")
        for number, (due, message) in enumerate(self.inbox):
            if due <= self.now + 1e-9:
                del self.inbox[number]
                return message, False
        return None, False


@dataclass
class Run:
    """One world: what there is, what happened, what left."""

    vehicle: Vehicle
    rng: np.random.Generator
    bridge_side: Wire
    truck_side: Wire
    bridge: Bridge
    truck: EcuEmulator
    now: float = 0.0
    commanding: bool = True
    engine: float = 30.0
    brake: float = 0.0
    engaged_bit: bool | None = None
    paused_until: float = -1.0
    offset: float = 0.0  # of the bridge's clock
    flood: bool = False
    driver_heard: float | None = None  # when the bridge was given the driver's act
    states: list[tuple[float, str]] = field(default_factory=list)

    def frame(self, can_id: int, data: bytes) -> None:
        """A third node sends to both."""
        message = can.Message(arbitration_id=can_id, data=data, is_extended_id=True)
        self.bridge_side.inbox.append((self.now, message))
        self.truck_side.inbox.append((self.now, message))

    def step(self) -> None:
        self.now += STEP
        self.bridge_side.now = self.truck_side.now = self.now
        self.truck.step(self.now)
        if self.flood:
            for _ in range(20):
                can_id = int(self.rng.integers(1 << 29)) & ~0xFF | 0xF9
                self.frame(can_id, self.rng.bytes(8))
        if self.now < self.paused_until:
            return
        mine = self.now + self.offset
        if self.commanding and round(self.now / STEP) % 4 == 0:
            bit = self.bridge.status.engaged if self.engaged_bit is None else self.engaged_bit
            self.bridge.command(self.engine, self.brake, mine, engaged=bit)
        self.bridge.poll(mine)
        state = self.bridge.safety.state.value
        if not self.states or self.states[-1][1] != state:
            self.states.append((self.now, state))


def build(seed: int) -> Run:
    """A world of one vehicle, armed and driving; the vehicle and the demands come from the seed."""
    rng = np.random.default_rng(seed)
    vehicle = LOADED[seed % len(vehicles.NAMES)]
    a, b = Wire(rng), Wire(rng)
    a.peer, b.peer = b, a
    run = Run(
        vehicle, rng, a, b, Bridge(vehicle, a), EcuEmulator(vehicle, b, speed=float(rng.uniform(5, 25)))
    )
    newton_metres = vehicle.interface["engine_unit"] == "N m"
    run.engine = float(rng.uniform(5, 70)) * (19.5 if newton_metres else 1.0)
    if rng.random() < 0.3:
        top = 3.0 if vehicle.interface["brake_unit"] == "m/s^2" else 30.0
        run.engine, run.brake = 0.0, float(rng.uniform(0.2, 1.0)) * top
    run.bridge.arm(0.0)
    return run


LOADED = [vehicles.load(vehicle) for vehicle in vehicles.NAMES]


# What may go wrong. Each is called once, when its time has come; `undo` is called a while later.


def _wire(fault: str) -> Callable[[Run], Callable[[], None]]:
    def begin(run: Run) -> Callable[[], None]:
        sides = [run.bridge_side, run.truck_side] if run.rng.random() < 0.5 else [run.bridge_side]
        for side in sides:
            side.fault = fault

        def undo() -> None:
            for side in sides:
                side.fault = ""

        return undo

    return begin


def _set(key: str, value: object, after: object) -> Callable[[Run], Callable[[], None]]:
    def begin(run: Run) -> Callable[[], None]:
        setattr(run, key, value)
        return lambda: setattr(run, key, after)

    return begin


def _driver(key: str, value: float) -> Callable[[Run], Callable[[], None]]:
    def begin(run: Run) -> Callable[[], None]:
        setattr(run.truck.driver, key, value)
        return lambda: setattr(run.truck.driver, key, 0.0)

    return begin


def _pause(run: Run) -> Callable[[], None]:
    run.paused_until = run.now + float(run.rng.uniform(0.02, 1.5))
    return lambda: None


def _clock(run: Run) -> Callable[[], None]:
    run.offset = float(run.rng.choice([-30.0, -0.05, 0.3, 30.0]))
    return lambda: None


def _unplug(run: Run) -> Callable[[], None]:
    run.bridge_side.down = True
    return lambda: setattr(run.bridge_side, "down", False)


def _bus_off(run: Run) -> Callable[[], None]:
    message = can.Message(arbitration_id=0x40, data=bytes(8), is_error_frame=True)
    run.bridge_side.inbox.append((run.now, message))
    return lambda: None


def _spoof(run: Run) -> Callable[[], None]:
    engine = run.vehicle.transmitted["engine"]
    run.frame(engine.axis.can_id & ~0xFF | 0x77, engine.frame(90.0, 0))
    return lambda: None


def _impostor(run: Run) -> Callable[[], None]:
    engine = run.vehicle.transmitted["engine"]
    run.frame(engine.axis.can_id, engine.frame(97.0, 3))
    return lambda: None


def _address_war(run: Run) -> Callable[[], None]:
    run.frame(0x18EEFF00 | run.vehicle.address, name(0))
    return lambda: None


def _silence(run: Run) -> Callable[[], None]:
    """One of the truck's controllers falls silent."""
    senders = run.truck._senders
    who = str(run.rng.choice(["engine", "brake", "transmission"]))
    gone = [s for s in senders if s.source == who]
    kept = [s for s in senders if s not in gone]
    run.truck._senders = kept
    return lambda: setattr(run.truck, "_senders", kept + gone)


FAULTS: dict[str, Callable[[Run], Callable[[], None]]] = {
    "nothing": lambda run: lambda: None,
    **{fault: _wire(fault) for fault in ("drop", "delay", "repeat", "reorder", "corrupt")},
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


@dataclass(frozen=True)
class Verdict:
    """Broken invariants, and the reaction to the fault: seconds, and the state it led to."""

    seed: int
    vehicle: str
    fault: str
    broken: tuple[str, ...]
    engaged: bool
    reaction_s: float
    release_s: float


def play(seed: int) -> Verdict:
    """One run."""
    run = build(seed)
    fault = str(run.rng.choice(list(FAULTS)))
    at = FAULT_AT + float(run.rng.uniform(0.0, 0.1))
    until = at + float(run.rng.uniform(1.1, 2.0))
    undo: Callable[[], None] | None = None
    begun = engaged = False
    while run.now < LENGTH:
        if not engaged and run.now >= ENGAGED_AT:
            engaged = run.bridge.engage(run.now, person=True, lead_vehicle=True) == ()
            if not engaged and run.now > ENGAGED_AT + 0.3:
                break
        if not begun and run.now >= at:
            undo, begun = FAULTS[fault](run), True
        if undo is not None and run.now >= until:
            undo()
            undo = None
        run.step()
    run.bridge_side.shutdown()
    run.truck_side.shutdown()
    broken = tuple(judge(run, fault, at)) if engaged else ("did not engage",)
    return Verdict(seed, run.vehicle.name, fault, broken, engaged, *reactions(run, fault, at))


def demands(run: Run) -> dict[str, list[tuple[float, float]]]:
    """What left the bridge by axis: time and demand, NaN for a release."""
    found: dict[str, list[tuple[float, float]]] = {}
    for axis, message in run.vehicle.transmitted.items():
        entries = []
        for time, can_id, data in run.bridge_side.sent:
            if can_id == message.axis.can_id:
                word = int.from_bytes(data, "little")
                released = word & ((1 << 56) - 1) == message.axis.release
                value = message.axis.demand.read(word)
                entries.append((time, math.nan if released or value is None else value))
        found[axis] = entries
    return found


def judge(run: Run, fault: str, at: float) -> list[str]:
    """The invariants, on the bus."""
    table, broken = run.vehicle.table, []
    listed = {axis.can_id for axis in table.axes} | set(table.always)
    if any(can_id not in listed for _, can_id, _ in run.bridge_side.sent):
        broken.append("an unlisted frame left")
    engine = demands(run)["engine"]
    if any(time < ENGAGED_AT and can_id not in table.always for time, can_id, _ in run.bridge_side.sent):
        broken.append("a demand left before engagement")
    for axis in table.axes:
        broken += _limits(axis, demands(run)[axis.name])
    lost = [time for time, state in run.states if state in ("fading", "releasing", "standby", "silent")]
    lost = [time for time in lost if time > ENGAGED_AT + STEP]
    if any(state == "engaged" for time, state in run.states if lost and time > lost[0]):
        broken.append("engaged again without a person")
    if fault in MUST_END and not lost:
        broken.append("control was not given up")
    if fault == "nothing" and lost:
        broken.append("control was given up for nothing")
    if fault in OVERRIDES and lost:
        told = lost[0]
        first = next((time for time, demand in engine if time >= told - 1e-9), math.inf)
        if first - told > CYCLE + 1e-6 or any(not math.isnan(d) for t, d in engine if t > told + 1e-6):
            broken.append("no release within one cycle of the driver")
    if fault == "controller gone" and lost and lost[0] - at > CONTROLLER_S:
        broken.append("controller lost for over 200 ms")
    if lost and engine and engine[-1][0] > lost[0] + 6.0:
        broken.append("no silence after the release")
    return broken


def _limits(axis, entries: list[tuple[float, float]]) -> list[str]:
    """Value, rate and step, with one bit of rounding on either side."""
    quantum = axis.demand.scale
    low, high = min(axis.limits.low) - quantum, max(axis.limits.high) + quantum
    broken = [
        f"{axis.name} out of limits"
        for _, demand in entries
        if not (math.isnan(demand) or low <= demand <= high)
    ]
    fastest = max(axis.limits.rate, axis.limits.fade)
    for (t0, d0), (t1, d1) in pairwise(entries):
        if math.isnan(d0) or math.isnan(d1):
            continue
        allowed = fastest * min(t1 - t0 + STEP, 2 * axis.period_s) + 2 * quantum
        if abs(d1 - d0) > allowed:
            broken.append(f"{axis.name} stepped by {d1 - d0:g}")
    return broken[:1]


def reactions(run: Run, fault: str, at: float) -> tuple[float, float]:
    """Seconds from the fault to the first state that is not engaged, and to the first release frame."""
    lost = [time - at for time, state in run.states if time > at - STEP and state != "engaged"]
    engine = [time - at for time, demand in demands(run)["engine"] if time > at - STEP and math.isnan(demand)]
    return (lost[0] if lost else math.nan), (engine[0] if engine else math.nan)


def report(verdicts: list[Verdict]) -> list[str]:
    """A table by fault."""
    lines = [f"{'fault':<24}{'runs':>6}{'ended':>7}{'reaction p50':>14}{'max':>8}{'release max':>13}  broken"]
    for fault in FAULTS:
        mine = [v for v in verdicts if v.fault == fault]
        ended = [v.reaction_s for v in mine if not math.isnan(v.reaction_s)]
        released = [v.release_s for v in mine if not math.isnan(v.release_s)]
        broken = Counter(b for v in mine for b in v.broken)
        times = (
            f"{1e3 * np.median(ended):>11.0f} ms{1e3 * max(ended):>5.0f} ms"
            if ended
            else f"{'-':>14}{'-':>8}"
        )
        last = f"{1e3 * max(released):>10.0f} ms" if released else f"{'-':>13}"
        lines.append(f"{fault:<24}{len(mine):>6}{len(ended):>7}{times}{last}  {dict(broken) or 'none'}")
    return lines


def main() -> int:
    """Run many and say what broke."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    options = parser.parse_args()
    verdicts = [play(seed) for seed in range(options.first, options.first + options.runs)]
    for line in report(verdicts):
        print(line)
    broken = [v for v in verdicts if v.broken]
    for verdict in broken[:20]:
        print(f"seed {verdict.seed} ({verdict.vehicle}, {verdict.fault}): {'; '.join(verdict.broken)}")
    print(f"{len(verdicts)} runs, {len(broken)} with a broken invariant")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
