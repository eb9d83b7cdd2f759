"""Engine, transmission, brake and retarder controllers around a physics truck, which emulate a truck's bus.

Each controller has its own source address, sends at the rates and resolutions of J1939-71 and obeys TSC1, XBR
and proprietary brake demands with time-outs, priorities, driver overrides and fault hysteresis. Time is an
argument; the same object runs in lock-step in a test and in real time in `python -m truck_bridge.emulator`.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping

import can
import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_model.simulators import Simulator
from deeptruck_model.simulators import load as load_truck
from deeptruck_model.trucks.accelerometer import Accelerometer
from truck_bridge.emulator.messages import Driver
from truck_bridge.emulator.receiver import Actuator, Receiver
from truck_bridge.emulator.sender import voices
from truck_bridge.j1939.address_claim import AddressClaim, name
from truck_bridge.vehicles import Transmitted, Vehicle

__all__ = ["Actuator", "Driver", "EcuEmulator"]

ROUGH_RPM = 1.0  # unevenness of the engine speed in EEC1


class EcuEmulator:
    """A truck on a bus. `grade` maps distance along the road, m, to its slope (rise over run).

    `driver` (what the driver does) and `actuators` (by axis: which one fails) may be changed while it drives.

    Raises InputError if the vehicle file expects a message that no controller here sends.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        bus: can.BusABC,
        *,
        truck: Simulator | None = None,
        grade: Callable[[float], float] = lambda distance: 0.0,
        speed: float = 0.0,
    ) -> None:
        self.vehicle = vehicle
        self.driver = Driver()
        self._rng = np.random.default_rng(0)
        self._bus = bus
        self._truck = _as_driven(truck if truck is not None else load_truck(vehicle.truck))
        # what the truck does not report is on the bus as 'not available'
        self.parameters: Mapping[str, float] = defaultdict(lambda: math.nan, self._truck.parameters())
        self._grade = grade
        self._accelerometer = Accelerometer(seed=0)
        y0 = np.zeros((1, len(self._truck.interface.y)))
        y0[0, 1] = speed
        self._state = self._truck.reset(y0)
        self._y: Array = y0
        self._seen = self._truck.inside(self._state)
        self.distance = 0.0
        self._time: float | None = None
        self.receivers = {axis: Receiver(message) for axis, message in vehicle.transmitted.items()}
        self.actuators = {axis: Actuator(_full(message)) for axis, message in vehicle.transmitted.items()}
        self._claims = {
            who: AddressClaim(name(100 + address), address) for who, address in vehicle.addresses.items()
        }
        self._senders = list(voices(self))

    # -- the truck

    @property
    def speed(self) -> float:
        """Speed, m/s."""
        return float(self._y[0, 1])

    @property
    def acceleration(self) -> float:
        """Mean acceleration of the last step, m/s^2."""
        return float(self._y[0, 0])

    @property
    def specific_force(self) -> float:
        """What its accelerometer reads now, m/s^2."""
        return self._accelerometer.reads(self.acceleration, self.slope)

    @property
    def slope(self) -> float:
        """Road slope at the truck, rise over run."""
        return self._grade(self.distance)

    @property
    def fuel_rate(self) -> float:
        """Fuel rate, cm^3/s."""
        return float(self._y[0, 2]) if self._truck.interface.fuel else self.inside("fuel_rate")

    @property
    def command(self) -> tuple[float, float]:
        """Engine and brake command at the truck, after the actuators and arbitration with the driver."""
        external = {axis: actuator.given for axis, actuator in self.actuators.items()}
        external["engine"] = max(external["engine"], self.driver.accelerator)
        engine, brake = self.vehicle.commands(external)
        pedal = self.driver.brake_pedal
        driver_brake = pedal if self.vehicle.interface["brake_unit"] == "percent" else 0.08 * pedal
        return engine, max(brake, driver_brake)

    def demand(self, axis: str) -> float:
        """The demand of other controllers on this axis; NaN if there is none."""
        receiver = self.receivers.get(axis)
        return math.nan if receiver is None else receiver.demand(self._time or 0.0)

    def inside(self, key: str, otherwise: float = math.nan) -> float:
        """An internal signal of the physics truck, in SI; `otherwise` if it is absent."""
        return float(self._seen[key][0]) if key in self._seen else otherwise

    def roughness(self) -> float:
        """Random variation of the engine speed, rpm, so that consecutive messages differ as on a real
        engine."""
        return float(self._rng.uniform(-ROUGH_RPM, ROUGH_RPM))

    def step(self, now: float) -> None:
        """Receive frames, simulate the truck up to `now`, send frames. Call it at least every 10 ms
        of `now`."""
        self._hear(now)
        if self._time is None:
            self._start(now)
        assert self._time is not None
        while self._time + self._truck.dt <= now + 1e-9:
            self._time += self._truck.dt
            self._drive()
        self._speak(now)

    def _drive(self) -> None:
        for axis, actuator in self.actuators.items():
            actuator.act(self.demand(axis), self._time or 0.0)
        interface = self._truck.interface
        u = np.array([[*self.command][: len(interface.u)]])
        w = np.array([[self.slope][: len(interface.w)]])
        self._state, self._y = self._truck.step(self._state, u, w)
        self._seen = self._truck.inside(self._state)
        self.distance += self.speed * self._truck.dt

    # -- the bus

    def _start(self, now: float) -> None:
        self._time = now
        for claim in self._claims.values():
            claim.start(now)
        for number, sender in enumerate(self._senders):
            sender.due = now + (0.0017 * number) % sender.period_s  # spread, so that no two leave together

    def _hear(self, now: float) -> None:
        while (message := self._bus.recv(0)) is not None:
            if message.is_error_frame or not message.is_extended_id:
                continue
            data = bytes(message.data)
            for axis, receiver in self.receivers.items():
                if not self.actuators[axis].lost:
                    receiver.hear(message.arbitration_id, data, now)
            for claim in self._claims.values():
                claim.hear(message.arbitration_id, data, now)

    def _speak(self, now: float) -> None:
        for claim in self._claims.values():
            for can_id, data in claim.due(now):
                self._send(can_id, data)
        for sender in self._senders:
            if now < sender.due:
                continue
            sender.due = max(sender.due + sender.period_s, now - sender.period_s)
            if not self._claims[sender.source].lost:
                self._send(*sender.frame())

    def _send(self, can_id: int, data: bytes) -> None:
        self._bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=True))


def _full(message: Transmitted) -> float:
    """Greatest demand of an axis, with its sign."""
    limits = message.axis.limits
    return min(limits.low) if max(limits.high) <= 0 else max(limits.high)


def _as_driven(truck: Simulator) -> Simulator:
    """A physics truck with steps of 10 ms, on whose motion the road acts even without a grade sensor."""
    for method, arguments in (("with_grade_input", ()), ("with_dt", (0.01,))):
        if hasattr(truck, method):
            truck = getattr(truck, method)(*arguments)
    return truck
