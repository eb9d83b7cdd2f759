"""The J1939 signals for deeptruck's channels, in order of preference, and their conversion to SI.

Names and units are those of deeptruck_core.signals; this package does not import it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from truck_bridge.j1939.codec import Codec
from truck_bridge.units import to_si


@dataclass(frozen=True)
class Carrier:
    """One signal that carries a channel. `of_reference` marks percent of a reference torque; `less` names the
    message and signal to subtract (indicated torque minus friction is torque at the flywheel)."""

    channel: str
    message: str
    signal: str
    of_reference: str = ""
    less: tuple[str, str] | None = None
    convert: Callable[[float], float] | None = None


CARRIERS: tuple[Carrier, ...] = (
    Carrier("speed", "CCVS1", "WheelBasedVehicleSpeed"),
    Carrier("speed", "EBC2", "FrontAxleSpeed"),
    Carrier("speed", "TCO1", "TachographVehicleSpeed"),
    Carrier("specific_force", "VDC2", "LongitudinalAcceleration"),
    Carrier("engine_speed", "EEC1", "EngineSpeed"),
    Carrier(
        "engine_torque",
        "EEC1",
        "ActualPercentTorque",
        of_reference="engine",
        less=("EEC3", "NominalFrictionPercentTorque"),
    ),
    Carrier("fuel_rate", "LFE1", "EngineFuelRate"),
    Carrier("gear", "ETC2", "CurrentGear"),
    Carrier("brake_switch", "CCVS1", "BrakeSwitch"),
    Carrier("grade", "VDS", "Pitch", convert=lambda pitch_deg: math.tan(math.radians(pitch_deg))),
    Carrier("elevation", "VDS", "Altitude"),
    Carrier("ambient_temperature", "AMB", "AmbientAirTemperature"),
    Carrier("latitude", "VP", "Latitude"),
    Carrier("longitude", "VP", "Longitude"),
)


SPEED = (0.0, 45.0)
RANGES: dict[tuple[str, str], tuple[float, float]] = {  # what a truck on a road can produce, in SI
    ("CCVS1", "WheelBasedVehicleSpeed"): SPEED,
    ("EBC2", "FrontAxleSpeed"): SPEED,
    ("TCO1", "TachographVehicleSpeed"): SPEED,
    ("VDS", "NavigationSpeed"): SPEED,
    ("EEC1", "EngineSpeed"): (0.0, 420.0),  # 4,010 rpm
    ("ETC2", "ActualGearRatio"): (0.0, 30.0),
    ("ETC2", "CurrentGear"): (-10.0, 30.0),
    ("LFE1", "EngineFuelRate"): (0.0, 60.0),  # 216 l/h
    ("VDS", "Pitch"): (-26.6, 26.6),  # slopes of 0.5; the steepest public road has 0.38
    ("VDS", "Altitude"): (-450.0, 6000.0),
    ("AMB", "AmbientAirTemperature"): (-60.0, 70.0),
    ("VP", "Latitude"): (-90.0, 90.0),
    ("VP", "Longitude"): (-180.0, 180.0),
}


def physical_range(message: str, signal: str) -> tuple[float, float] | None:
    """Smallest and largest value, SI, that a truck can produce; None if the field's range needs no
    restriction."""
    return RANGES.get((message, signal))


DEMANDS: tuple[Carrier, ...] = (  # what the driver asks for, in percent
    Carrier("driver_demand_torque", "EEC1", "DriversDemandPercentTorque"),
    Carrier("accelerator_pedal", "EEC2", "AcceleratorPedalPosition"),
    Carrier("brake_pedal", "EBC1", "BrakePedalPosition"),
)


def converter(carrier: Carrier, codec: Codec, reference_torque: float = math.nan) -> Callable[[float], float]:
    """Function from the decoded value to SI; NaN for values that a truck cannot produce.

    Torque is NaN if no reference torque is known.
    """
    factor, _ = to_si(codec[carrier.message].signals[carrier.signal].unit)
    if carrier.of_reference:
        factor = reference_torque / 100
    low, high = physical_range(carrier.message, carrier.signal) or (-math.inf, math.inf)
    convert = carrier.convert or (lambda value: value)
    return lambda value: convert(value * factor) if low <= value * factor <= high else math.nan
