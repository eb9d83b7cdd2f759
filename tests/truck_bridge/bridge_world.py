"""Bridge and ECU emulator in lock-step on a virtual bus, with a third node that listens."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import can

from truck_bridge import vehicles
from truck_bridge.bridge import Bridge
from truck_bridge.emulator.ecus import EcuEmulator

STEP = 0.005
SIGNED = str(Path(__file__).with_name("signed_truck.yaml"))  # counts and signs two of its messages
RESEARCH = str(Path(__file__).with_name("research_truck.yaml"))


class World:
    def __init__(self, name, speed=15.0, grade=0.0, **options):
        self.vehicle = vehicles.load(name)
        self.channel = object()  # a virtual channel of its own
        self.ours, self.trucks, self.ear = (self.open() for _ in range(3))
        self.bridge = Bridge(self.vehicle, self.ours, **options)
        self.truck = EcuEmulator(self.vehicle, self.trucks, speed=speed, grade=lambda distance: grade)
        self.now = 0.0
        self.signals = {}
        self.received = []

    def open(self):
        return can.Bus(interface="virtual", channel=self.channel)

    def close(self):
        for bus in (self.ours, self.trucks, self.ear):
            bus.shutdown()

    def run(self, seconds, engine=None, brake=0.0):
        for _ in range(round(seconds / STEP)):
            self.now += STEP
            self.truck.step(self.now)
            if engine is not None and round(self.now / STEP) % 4 == 0:
                self.bridge.command(engine, brake, self.now, engaged=self.bridge.engaged)
            self.signals = self.bridge.poll(self.now)
            while (message := self.ear.recv(0)) is not None:
                self.received.append((self.now, message))
        return self

    def engage(self, engine, brake=0.0):
        self.bridge.arm(self.now)
        self.run(1.0, engine, brake)
        assert self.bridge.engage(self.now, person=True, lead_vehicle=True) == ()
        return self

    def ours_on_the_bus(self):
        return [(t, m) for t, m in self.received if m.arbitration_id & 0xFF == self.vehicle.address]

    def demands(self, axis):
        message = self.vehicle.transmitted[axis]
        return [
            (t, message.layout.decode(bytes(m.data)).values[message.demand])
            for t, m in self.ours_on_the_bus()
            if m.arbitration_id == message.axis.can_id
        ]


@cache
def interface(name):
    return vehicles.load(name).interface


def in_units(name, percent):
    return percent * (19.5 if interface(name)["engine_unit"] == "N m" else 1.0)


def braking(name, deceleration):
    return deceleration * (1.0 if interface(name)["brake_unit"] == "m/s^2" else 12.0)


def pressed(w, message):
    if message.arbitration_id & 0x03FFFFFF not in (0xFEF100, 0xF0010B):  # CCVS1, EBC1
        return False
    decoded = w.vehicle.codec.decode(message.arbitration_id, bytes(message.data))
    return decoded.values.get("BrakePedalPosition", 0.0) > 3 or decoded.values.get("BrakeSwitch", 0.0) == 1
