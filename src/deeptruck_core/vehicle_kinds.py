"""Typical properties of a kind of vehicle, for those that neither a recording nor a simulator gives.

Properties that no log shows are inferred from the kind: the air drag of a simulator without parameters, the
range of possible masses, and how much a load can change the mass. Otherwise a 1.3 t car, judged as a 20 t
truck, would be assigned impossible forces.
"""

from __future__ import annotations

from dataclasses import dataclass

from deeptruck_core.errors import InputError

# What no road vehicle does, and what all do.
IMPOSSIBLE_ACCELERATION = 12.0  # m/s^2: a speed signal that changes faster is faulty there
SURELY_BRAKING = -1.2  # m/s^2: a mean over a second below it is braking
NO_COASTING = -0.5  # m/s^2: what slows harder than this brakes, where no brake is recorded
LEAST_SPEED = 1.5  # m/s: slower, standstill logic and wheel sensors rule what is recorded
CLUTCH_CLOSED = 2.5  # m/s: slower, clutches slip and engines idle
GEARS_APART = 0.18  # log: engine speeds farther apart are of two gears; neighbours are 0.2 to 0.4 apart
STEEPEST = 0.07  # rise over run: the largest rms that a road can have
STRONGEST_WIND = 9.0  # m/s: the largest rms that wind can have
LARGEST_DERATE = 0.25  # the largest rms of a change of the engine's force, relative


@dataclass(frozen=True)
class VehicleKind:
    """Typical values. `mass_change` is the range of relative changes of mass by unloading and loading."""

    mass_kg: float
    least_mass_kg: float
    most_mass_kg: float
    drag_area: float  # drag coefficient times frontal area, m^2
    rolling_resistance: float  # coefficient
    mass_change: tuple[float, float]

    def possible(self, parameter: str) -> tuple[float, float]:
        """Smallest and largest relative change of a simulator's parameter that such a vehicle can have."""
        return self.mass_change if parameter == "mass" else POSSIBLE[parameter]


POSSIBLE = {
    "drag_area": (-0.6, 2.0),
    "rolling_resistance": (-0.85, 3.0),
    "torque_gain": (-0.35, 2.0),
    "brake_gain": (-0.5, 2.0),
}
"""Of any vehicle: its body, its tyres, and its engine and brakes for a command."""

VEHICLE_KINDS = {
    # tractor-trailers to unaided boxes: NACFE, drag area 5 to 7; SAE J1269-class tyres 0.005 to 0.008;
    # timber trucks of the Nordic countries have up to 76 t, Australian road trains 200 t
    "truck": VehicleKind(20000.0, 3500.0, 250000.0, 6.0, 0.006, (-0.8, 3.0)),
    # M2 and M3; HBEFA's standard city bus has 11 t empty and 18 t full; drag coefficient 0.5 to 0.7 on 7 m^2
    "bus": VehicleKind(13000.0, 3000.0, 32000.0, 4.5, 0.007, (-0.5, 1.0)),
    # N1: up to 3.5 t in law, 4.25 t electric; drag coefficient 0.31 to 0.37 on 5 m^2
    "van": VehicleKind(2500.0, 1100.0, 6000.0, 1.7, 0.008, (-0.5, 1.0)),
    # M1: type approvals of the EEA have 0.9 to 2.6 t; drag area 0.5 to 0.9; a trailer may double the mass
    "car": VehicleKind(1500.0, 500.0, 4500.0, 0.65, 0.010, (-0.4, 1.0)),
}
UNSTATED = VehicleKind(20000.0, 500.0, 250000.0, 6.0, 0.006, (-0.8, 3.0))
"""Of a recording that does not say what drove: a truck's, with the masses of cars allowed."""


def check_vehicle(vehicle: object, mass_kg: object) -> None:
    """Raises InputError for a kind not in VEHICLE_KINDS, and a mass that such a vehicle cannot have."""
    if vehicle is not None and vehicle not in VEHICLE_KINDS:
        raise InputError(f"vehicle '{vehicle}' is not one of {', '.join(VEHICLE_KINDS)}")
    kind = UNSTATED if vehicle is None else VEHICLE_KINDS[str(vehicle)]
    low, high = kind.least_mass_kg, kind.most_mass_kg
    number = isinstance(mass_kg, int | float) and not isinstance(mass_kg, bool)
    if mass_kg is not None and not (number and low <= float(str(mass_kg)) <= high):
        of = vehicle or "vehicle"
        raise InputError(f"mass_kg of a {of} is a number from {low:g} to {high:g}, not {mass_kg!r}")


def vehicle_kind(name: str | None) -> VehicleKind:
    """The kind called `name`, one of VEHICLE_KINDS; UNSTATED for None."""
    return UNSTATED if name is None else VEHICLE_KINDS[name]
