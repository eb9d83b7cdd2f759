"""Engine, transmission, brake and retarder controllers around a physics truck: the truck as its bus shows it.

Each controller has its own source address, speaks at the rates and resolutions of J1939-71 and obeys TSC1,
XBR and proprietary brake demands with time-outs, priorities, driver overrides and fault hysteresis. Time is
an argument; the same object runs in lock-step in a test and in real time behind `python -m
truck_bridge.ecu_emulator`.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import can
import numpy as np
from numpy.typing import NDArray

from deeptruck_model.simulators import Simulator
from deeptruck_model.simulators import load as load_truck
from truck_bridge.ecu_receiver import Receiver
from truck_bridge.j1939.address_claim import AddressClaim, name
from truck_bridge.vehicles import Vehicle

STANDARD_GRAVITY = 9.80665


@dataclass
class Driver:
    """What the person in the cab does."""

    brake_pedal: float = 0.0  # percent
    accelerator: float = 0.0  # percent
    cancel: float = 0.0  # cruise pause switch
    set_switch: float = 0.0
    parking_brake: float = 0.0


@dataclass
class _Sender:
    """One broadcast message: from whom, how often, with which values."""

    message: str
    source: str
    period_s: float
    due: float
    values: Callable[[], Mapping[str, float]] = field(repr=False)


class EcuEmulator:
    """A truck on a bus. `grade` maps distance along the road, m, to its slope (rise over run)."""

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
        self._bus = bus
        self._truck = _as_driven(truck if truck is not None else load_truck(vehicle.truck))
        self._parameters = self._truck.parameters()
        self._grade = grade
        y0 = np.zeros((1, len(self._truck.interface.y)))
        y0[0, 1] = speed
        self._state = self._truck.reset(y0)
        self._y: NDArray[np.float64] = y0
        self._seen = self._truck.inside(self._state)
        self.distance = 0.0
        self._time: float | None = None
        self._receivers = {axis: Receiver(message) for axis, message in vehicle.transmitted.items()}
        self._claims = {
            who: AddressClaim(name(100 + address), address) for who, address in vehicle.addresses.items()
        }
        self._senders: list[_Sender] = []

    # -- the truck

    @property
    def speed(self) -> float:
        """m/s."""
        return float(self._y[0, 1])

    @property
    def acceleration(self) -> float:
        """m/s^2, mean of the last step."""
        return float(self._y[0, 0])

    @property
    def command(self) -> tuple[float, float]:
        """Engine and brake command that reach the truck now, after arbitration with the driver."""
        return self._commands(self._time or 0.0)

    def _commands(self, now: float) -> tuple[float, float]:
        demands = {axis: receiver.demand(now) for axis, receiver in self._receivers.items()}
        external = {axis: 0.0 if math.isnan(value) else value for axis, value in demands.items()}
        external["engine"] = max(external["engine"], self.driver.accelerator)
        engine, brake = self.vehicle.commands(external)
        pedal = self.driver.brake_pedal
        driver_brake = pedal if self.vehicle.interface["brake_unit"] == "percent" else 0.08 * pedal
        return engine, max(brake, driver_brake)

    def step(self, now: float) -> None:
        """Hear, drive the truck up to `now`, speak. Call it at least every 10 ms of its time."""
        self._hear(now)
        if self._time is None:
            self._start(now)
        assert self._time is not None
        while self._time + self._truck.dt <= now + 1e-9:
            self._time += self._truck.dt
            self._drive()
        self._speak(now)

    def _drive(self) -> None:
        engine, brake = self._commands(self._time or 0.0)
        interface = self._truck.interface
        slope = self._grade(self.distance)
        u = np.array([[engine, brake][: len(interface.u)]])
        w = np.array([[slope][: len(interface.w)]])
        self._state, self._y = self._truck.step(self._state, u, w)
        self._seen = self._truck.inside(self._state)
        self.distance += self.speed * self._truck.dt

    def _inside(self, key: str, otherwise: float = math.nan) -> float:
        return float(self._seen[key][0]) if key in self._seen else otherwise

    # -- the bus

    def _start(self, now: float) -> None:
        self._time = now
        for claim in self._claims.values():
            claim.start(now)
        builders = {
            "ETC1": ("transmission", self._etc1),
            "VDC2": ("brake", self._vdc2),
            "EEC1": ("engine", self._eec1),
            "EEC2": ("engine", self._eec2),
            "CCVS1": ("engine", self._ccvs1),
            "LFE1": ("engine", self._lfe1),
            "EBC1": ("brake", self._ebc1),
            "EBC2": ("brake", self._ebc2),
            "EBC5": ("brake", self._ebc5),
            "ETC2": ("transmission", self._etc2),
            "EEC3": ("engine", self._eec3),
            "AMB": ("engine", self._amb),
            "ERC1": ("retarder", self._erc1),
            "CVW": ("brake", self._cvw),
            "VDS": ("brake", self._vds),
        }
        for number, (message, (source, values)) in enumerate(builders.items()):
            if source in self.vehicle.addresses and (message != "VDS" or self.vehicle.interface["grade"]):
                period = self.vehicle.codec[message].period_s or (0.1 if message == "VDS" else 1.0)
                phase = (0.0017 * number) % period  # spread, so that no two leave together
                self._senders.append(_Sender(message, source, period, now + phase, values))

    def _hear(self, now: float) -> None:
        while (message := self._bus.recv(0)) is not None:
            if message.is_error_frame or not message.is_extended_id:
                continue
            data = bytes(message.data)
            for receiver in self._receivers.values():
                receiver.hear(message.arbitration_id, data, now)
            for claim in self._claims.values():
                claim.hear(message.arbitration_id, data)

    def _speak(self, now: float) -> None:
        for claim in self._claims.values():
            for can_id, data in claim.due():
                self._send(can_id, data)
        for sender in self._senders:
            if now < sender.due:
                continue
            sender.due = max(sender.due + sender.period_s, now - sender.period_s)
            if not self._claims[sender.source].lost:
                layout = self.vehicle.codec[sender.message]
                can_id = layout.can_id(self.vehicle.addresses[sender.source])
                self._send(can_id, layout.encode(_clipped(layout.signals, sender.values())))

    def _send(self, can_id: int, data: bytes) -> None:
        self._bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=True))

    # -- what each controller says

    def _percent_torque(self, key: str) -> float:
        """Percent of the reference torque; J1939 torque is indicated torque, friction included."""
        return 100 * self._inside(key, 0.0) / self.vehicle.reference_torque["engine"]

    def _rpm(self, key: str = "engine_speed") -> float:
        return self._inside(key, 0.0) * 30 / math.pi

    def _eec1(self) -> Mapping[str, float]:
        controlled = self._receivers["engine"].controlling
        return {
            "EngineTorqueMode": 0 if controlled == 0xFF else 7,  # 7: another node's TSC1
            "DriversDemandPercentTorque": self.driver.accelerator,
            "ActualPercentTorque": self._percent_torque("indicated_torque"),
            "EngineSpeed": self._rpm(),
            "EngineControllingAddress": self.vehicle.addresses["engine"]
            if controlled == 0xFF
            else controlled,
            "EngineDemandPercentTorque": 100 * max(self.command[0], 0.0) / self._full_command(),
        }

    def _full_command(self) -> float:
        return (
            self.vehicle.reference_torque["engine"]
            if self.vehicle.interface["engine_unit"] == "N m"
            else 100.0
        )

    def _eec2(self) -> Mapping[str, float]:
        low_idle = float(self.driver.accelerator < 1.0)
        return {"AcceleratorPedalPosition": self.driver.accelerator, "AcceleratorLowIdleSwitch": low_idle}

    def _eec3(self) -> Mapping[str, float]:
        friction = self._percent_torque("indicated_torque") - self._percent_torque("engine_torque")
        return {"NominalFrictionPercentTorque": friction}

    def _ccvs1(self) -> Mapping[str, float]:
        return {
            "ParkingBrakeSwitch": self.driver.parking_brake,
            "WheelBasedVehicleSpeed": 3.6 * self.speed,
            "CruiseControlActive": float(self._receivers["engine"].controlling != 0xFF),
            "CruiseEnableSwitch": 1.0,
            "BrakeSwitch": float(self.driver.brake_pedal > 0),
            "ClutchSwitch": 0.0,
            "CruisePauseSwitch": self.driver.cancel,
            "CruiseSetSwitch": self.driver.set_switch,
        }

    def _lfe1(self) -> Mapping[str, float]:
        fuel = self._y[0, 2] if self._truck.interface.fuel else self._inside("fuel_rate")
        return {"EngineFuelRate": float(fuel) * 3.6}

    def _ebc1(self) -> Mapping[str, float]:
        return {
            "BrakePedalPosition": self.driver.brake_pedal,
            "EBSBrakeSwitch": float(self.driver.brake_pedal > 0),
            "ABSActive": 0.0,
            "ABSFullyOperational": 1.0,
            "EBSRedWarning": 0.0,
        }

    def _ebc2(self) -> Mapping[str, float]:
        return {
            "FrontAxleSpeed": 3.6 * self.speed,
            "RelativeSpeedFrontLeft": 0.0,
            "RelativeSpeedFrontRight": 0.0,
        }

    def _ebc5(self) -> Mapping[str, float]:
        braking = not math.isnan(self._receivers["brake"].demand(self._time or 0.0))
        return {
            "XBRSystemState": 0.0,
            "XBRActiveControlMode": 3.0 if braking else 0.0,
            "XBRAccelerationLimit": -10.0,
        }

    def _vdc2(self) -> Mapping[str, float]:
        slope = self._grade(self.distance)
        felt = self.acceleration + STANDARD_GRAVITY * slope / math.hypot(
            1.0, slope
        )  # an accelerometer feels the slope
        return {"LongitudinalAcceleration": felt, "LateralAcceleration": 0.0, "YawRate": 0.0}

    def _etc1(self) -> Mapping[str, float]:
        ratio, shifting = self._inside("ratio", 0.0), float(self._inside("shifting", 0.0) > 0)
        locked = self._inside("clutch", 2.0) == 2.0
        return {
            "DrivelineEngaged": float(locked and not shifting),
            "ConverterLockupEngaged": float(locked),
            "ShiftInProcess": shifting,
            "OutputShaftSpeed": self.speed / self._radius() * self._final() * 30 / math.pi,
            "InputShaftSpeed": self.speed / self._radius() * ratio * 30 / math.pi,
        }

    def _radius(self) -> float:
        return self._parameters["wheel_radius"]

    def _final(self) -> float:
        return self._parameters["final_drive"]

    def _etc2(self) -> Mapping[str, float]:
        gear = self._inside("gear", 0.0)
        return {
            "CurrentGear": gear,
            "SelectedGear": gear,
            "ActualGearRatio": self._inside("ratio", 0.0) / self._final(),
        }

    def _erc1(self) -> Mapping[str, float]:
        demand = (
            self._receivers["retarder"].demand(self._time or 0.0)
            if "retarder" in self._receivers
            else math.nan
        )
        torque = -100 * self._inside("retarder_torque", 0.0) / self.vehicle.reference_torque["retarder"]
        return {
            "RetarderTorqueMode": 0.0 if math.isnan(demand) else 7.0,
            "ActualRetarderPercentTorque": torque,
            "RetarderRequestingBrakeLight": 0.0,
        }

    def _amb(self) -> Mapping[str, float]:
        return {
            "AmbientAirTemperature": self._parameters.get("ambient_temperature", 20.0),
            "BarometricPressure": 101.5,
        }

    def _cvw(self) -> Mapping[str, float]:
        return {"GrossCombinationWeight": self._parameters["mass"]}

    def _vds(self) -> Mapping[str, float]:
        pitch = math.degrees(math.atan(self._grade(self.distance)))
        return {"Pitch": pitch, "Altitude": self._inside("elevation", 0.0)}

    def run(self, stop: threading.Event) -> None:
        """Real time, until stopped."""
        while not stop.is_set():
            self.step(time.monotonic())
            time.sleep(0.002)


def _as_driven(truck: Simulator) -> Simulator:
    """A physics truck steps by 10 ms and feels the road even where it has no grade sensor."""
    for method, arguments in (("with_grade_input", ()), ("with_dt", (0.01,))):
        if hasattr(truck, method):
            truck = getattr(truck, method)(*arguments)
    return truck


def _clipped(signals: Mapping[str, object], values: Mapping[str, float]) -> dict[str, float]:
    """A sensor saturates; it does not stop talking."""
    found = {}
    for key, value in values.items():
        signal = signals[key]
        low, high = signal.offset, signal.offset + signal.scale * signal.last  # type: ignore[attr-defined]
        found[key] = min(max(value, low), high)
    return found


def main() -> None:
    """`python -m truck_bridge.ecu_emulator`."""
    from truck_bridge.emulator_cli import main as run

    run()


if __name__ == "__main__":
    main()
