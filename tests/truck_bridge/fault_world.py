"""One bridge, one emulated truck and a wire between them, in lock-step: time is an argument."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import can
import numpy as np
from fault_wire import Wire

from truck_bridge import vehicles
from truck_bridge.bridge import Bridge
from truck_bridge.emulator.ecus import EcuEmulator
from truck_bridge.vehicles import Vehicle

STEP = 0.005
SIGNED = str(Path(__file__).with_name("signed_truck.yaml"))
NAMES = (*vehicles.NAMES, SIGNED)
load = cache(vehicles.load)


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
    states: list[tuple[float, str]] = field(default_factory=list)
    speeds: list[tuple[float, float, float]] = field(default_factory=list)  # time, the truck's, as received

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
            bit = self.bridge.engaged if self.engaged_bit is None else self.engaged_bit
            self.bridge.command(self.engine, self.brake, mine, engaged=bit)
        self.bridge.poll(mine)
        self.speeds.append((self.now, self.truck.speed, self.bridge.safety.hearing.value("speed")))
        state = self.bridge.safety.state.value
        if not self.states or self.states[-1][1] != state:
            self.states.append((self.now, state))


def build(seed: int, names: Sequence[str] = NAMES) -> Run:
    """A world of one vehicle, armed and driving; the vehicle and the demands come from the seed."""
    rng = np.random.default_rng(seed)
    vehicle = load(names[seed % len(names)])
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
