"""Content of the messages of each emulated controller, in the units of the bus."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from truck_bridge.emulator.receiver import Receiver
from truck_bridge.vehicles import Vehicle


@dataclass
class Driver:
    """Present actions of the driver."""

    brake_pedal: float = 0.0  # percent
    accelerator: float = 0.0  # percent
    cancel: float = 0.0  # cruise pause switch
    set_switch: float = 0.0
    parking_brake: float = 0.0


class Truck(Protocol):
    """State of the truck as measured by the controllers' sensors."""

    vehicle: Vehicle
    driver: Driver
    receivers: dict[str, Receiver]
    parameters: Mapping[str, float]

    @property
    def speed(self) -> float: ...
    @property
    def specific_force(self) -> float: ...
    @property
    def slope(self) -> float: ...
    @property
    def fuel_rate(self) -> float: ...
    @property
    def command(self) -> tuple[float, float]: ...
    def demand(self, axis: str) -> float: ...
    def inside(self, key: str, otherwise: float = math.nan) -> float: ...
    def roughness(self) -> float: ...


Values = Mapping[str, float]


def _percent_torque(truck: Truck, key: str) -> float:
    """Percent of the reference torque; J1939 torque is indicated torque, friction included."""
    return 100 * truck.inside(key, 0.0) / truck.vehicle.reference_torque["engine"]


def _full_command(truck: Truck) -> float:
    newton_metres = truck.vehicle.interface["engine_unit"] == "N m"
    return truck.vehicle.reference_torque["engine"] if newton_metres else 100.0


def _torque_mode(truck: Truck, obeyed: int) -> int:
    """SPN 899: the source of the torque request; a brake's demand limits torque."""
    names = {address: who for who, address in truck.vehicle.addresses.items()}
    if obeyed == 0xFF:
        return 1 if truck.driver.accelerator > 0 else 0  # the driver, or nobody and the idle governor
    modes = {"transmission": 6, "brake": 8, "retarder": 10}
    return 2 if obeyed == truck.vehicle.address else modes.get(names.get(obeyed, ""), 14)


def _obeyed(truck: Truck, axis: str) -> int:
    """Source address of the controlling device; the controller's own without a demand."""
    receiver = truck.receivers.get(axis)
    obeyed = 0xFF if receiver is None else receiver.controlling
    return truck.vehicle.addresses[axis] if obeyed == 0xFF else obeyed


def _eec1(truck: Truck) -> Values:
    return {
        "EngineTorqueMode": _torque_mode(truck, truck.receivers["engine"].controlling),
        "DriversDemandPercentTorque": truck.driver.accelerator,
        "ActualPercentTorque": _percent_torque(truck, "indicated_torque"),
        "EngineSpeed": truck.inside("engine_speed", 0.0) * 30 / math.pi + truck.roughness(),
        "EngineControllingAddress": _obeyed(truck, "engine"),
        "EngineDemandPercentTorque": 100 * max(truck.command[0], 0.0) / _full_command(truck),
    }


def _eec2(truck: Truck) -> Values:
    low_idle = float(truck.driver.accelerator < 1.0)
    return {"AcceleratorPedalPosition": truck.driver.accelerator, "AcceleratorLowIdleSwitch": low_idle}


def _eec3(truck: Truck) -> Values:
    friction = _percent_torque(truck, "indicated_torque") - _percent_torque(truck, "engine_torque")
    return {"NominalFrictionPercentTorque": friction}


def _ccvs1(truck: Truck) -> Values:
    driver = truck.driver
    return {
        "ParkingBrakeSwitch": driver.parking_brake,
        "WheelBasedVehicleSpeed": 3.6 * truck.speed,
        "CruiseControlActive": float(truck.receivers["engine"].controlling != 0xFF),
        "CruiseEnableSwitch": 1.0,
        "BrakeSwitch": float(driver.brake_pedal > 0),
        "ClutchSwitch": 0.0,
        "CruisePauseSwitch": driver.cancel,
        "CruiseSetSwitch": driver.set_switch,
    }


def _lfe1(truck: Truck) -> Values:
    return {"EngineFuelRate": truck.fuel_rate * 3.6}


def _ebc1(truck: Truck) -> Values:
    return {
        "BrakePedalPosition": truck.driver.brake_pedal,
        "EBSBrakeSwitch": float(truck.driver.brake_pedal > 0),
        "ABSActive": 0.0,
        "ABSFullyOperational": 1.0,
        "EBSRedWarning": 0.0,
    }


def _ebc2(truck: Truck) -> Values:
    return {
        "FrontAxleSpeed": 3.6 * truck.speed,
        "RelativeSpeedFrontLeft": 0.0,
        "RelativeSpeedFrontRight": 0.0,
    }


def _ebc5(truck: Truck) -> Values:
    braking = not math.isnan(truck.demand("brake"))
    return {
        "XBRSystemState": 0.0,
        "XBRActiveControlMode": 3.0 if braking else 0.0,
        "XBRAccelerationLimit": -10.0,
    }


def _vdc2(truck: Truck) -> Values:
    return {"LongitudinalAcceleration": truck.specific_force, "LateralAcceleration": 0.0, "YawRate": 0.0}


def _etc1(truck: Truck) -> Values:
    shifting, locked = float(truck.inside("shifting", 0.0) > 0), truck.inside("clutch", 2.0) == 2.0
    wheels = truck.speed / truck.parameters["wheel_radius"] * 30 / math.pi
    return {
        "DrivelineEngaged": float(locked and not shifting),
        "ConverterLockupEngaged": float(locked),
        "ShiftInProcess": shifting,
        "OutputShaftSpeed": wheels * truck.parameters["final_drive"],
        "InputShaftSpeed": wheels * truck.inside("ratio", 0.0),
    }


def _etc2(truck: Truck) -> Values:
    gear = truck.inside("gear", 0.0)
    ratio = truck.inside("ratio", 0.0) / truck.parameters["final_drive"]
    return {"CurrentGear": gear, "SelectedGear": gear, "ActualGearRatio": ratio}


def _erc1(truck: Truck) -> Values:
    torque = -100 * truck.inside("retarder_torque", 0.0) / truck.vehicle.reference_torque["retarder"]
    return {
        "RetarderTorqueMode": 0.0 if math.isnan(truck.demand("retarder")) else 7.0,
        "ActualRetarderPercentTorque": torque,
        "RetarderControllingAddress": _obeyed(truck, "retarder"),
        "RetarderRequestingBrakeLight": 0.0,
    }


def _amb(truck: Truck) -> Values:
    temperature = truck.parameters.get("ambient_temperature", 20.0)
    return {"AmbientAirTemperature": temperature, "BarometricPressure": 101.5}


def _cvw(truck: Truck) -> Values:
    return {"GrossCombinationWeight": truck.parameters["mass"]}


def _vds(truck: Truck) -> Values:
    return {"Pitch": math.degrees(math.atan(truck.slope)), "Altitude": truck.inside("elevation", 0.0)}


# message: (who says it where the vehicle file names nobody, what it says)
SAYS: dict[str, tuple[str, Callable[[Truck], Values]]] = {
    "ETC1": ("transmission", _etc1),
    "VDC2": ("brake", _vdc2),
    "EEC1": ("engine", _eec1),
    "EEC2": ("engine", _eec2),
    "CCVS1": ("engine", _ccvs1),
    "LFE1": ("engine", _lfe1),
    "EBC1": ("brake", _ebc1),
    "EBC2": ("brake", _ebc2),
    "EBC5": ("brake", _ebc5),
    "ETC2": ("transmission", _etc2),
    "EEC3": ("engine", _eec3),
    "AMB": ("engine", _amb),
    "ERC1": ("retarder", _erc1),
    "CVW": ("brake", _cvw),
    "VDS": ("brake", _vds),
}
