"""Which J1939 signals carry deeptruck's channels, in order of preference, and how they become SI.

Names and units are those of deeptruck_model.signals; this package does not import it.
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
    message and signal that is taken off first (indicated torque less friction is torque at the flywheel).
    """

    channel: str
    message: str
    signal: str
    of_reference: str = ""
    less: tuple[str, str] | None = None
    convert: Callable[[float], float] | None = None


def _grade(pitch_deg: float) -> float:
    return math.tan(math.radians(pitch_deg))


CARRIERS: tuple[Carrier, ...] = (
    Carrier("speed", "CCVS1", "WheelBasedVehicleSpeed"),
    Carrier("speed", "EBC2", "FrontAxleSpeed"),
    Carrier("acceleration", "VDC2", "LongitudinalAcceleration"),
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
    Carrier("grade", "VDS", "Pitch", convert=_grade),
    Carrier("elevation", "VDS", "Altitude"),
    Carrier("ambient_temperature", "AMB", "AmbientAirTemperature"),
    Carrier("latitude", "VP", "Latitude"),
    Carrier("longitude", "VP", "Longitude"),
)


DEMANDS: tuple[Carrier, ...] = (  # what the driver asks for, in percent
    Carrier("driver_demand_torque", "EEC1", "DriversDemandPercentTorque"),
    Carrier("accelerator_pedal", "EEC2", "AcceleratorPedalPosition"),
    Carrier("brake_pedal", "EBC1", "BrakePedalPosition"),
)


def converter(carrier: Carrier, codec: Codec, reference_torque: float = math.nan) -> Callable[[float], float]:
    """Function from the decoded value to SI. Torque is NaN where no reference torque is known."""
    if carrier.convert is not None:
        return carrier.convert
    factor, _ = to_si(codec[carrier.message].signals[carrier.signal].unit)
    if carrier.of_reference:
        factor = reference_torque / 100
    return lambda value: value * factor
