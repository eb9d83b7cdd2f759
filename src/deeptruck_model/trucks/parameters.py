"""Every scalar a physics truck has, with unit and range, and the record layouts the compiled parts read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from deeptruck_core.errors import InputError
from deeptruck_core.reading import near

GEARS = 18  # room for the largest gearbox
TABLE = 64  # points of the full-load curve, uniform in engine speed
PEDAL = 21  # points of the pedal curve, every 5 %

_ROWS = """
body | mass | kg | 1000 | 250000 | gross mass
body | drag_area | m^2 | 0 | 20 | drag coefficient times frontal area
body | rolling_resistance | 1 | 0 | 0.2 | rolling force over weight
body | rolling_resistance_speed | s/m | 0 | 0.01 | its growth with speed, per m/s
body | air_density | kg/m^3 | 0 | 2 | density of the air
body | gravity | m/s^2 | 1 | 20 | acceleration of free fall
body | wheel_radius | m | 0.2 | 1 | loaded radius of the tyres
body | wheel_inertia | kg m^2 | 0 | 2000 | all wheels, hubs and drums together
body | tyre_friction | 1 | 0.01 | 1.5 | largest friction of tyre on road
body | drive_axle_share | 1 | 0.05 | 1 | share of the weight on the driven axles
body | hill_hold | 1 | 0 | 1 | 1: a standing truck is held against rolling back; 0: it may roll
engine | engine_inertia | kg m^2 | 0.1 | 20 | crankshaft, flywheel, clutch or converter pump
engine | reference_torque | N m | 100 | 10000 | torque that 100 % of a percentage command means
engine | full_load_gain | 1 | 0 | 3 | scale of the full-load curve (1: none)
engine | torque_gain | 1 | 0 | 3 | delivered over commanded combustion torque (1: none)
engine | idle_speed | rad/s | 30 | 150 | speed the idle governor holds
engine | governed_speed | rad/s | 100 | 500 | full torque ends here
engine | high_idle_speed | rad/s | 100 | 500 | no torque beyond this speed
engine | engine_friction | 1 | 0 | 5 | scale of the motoring friction (1: none)
engine | friction_constant | N m | 0 | 500 | motoring friction at zero speed
engine | friction_linear | N m s | 0 | 5 | its growth with engine speed
engine | friction_quadratic | N m s^2 | 0 | 0.05 | its growth with engine speed squared
engine | accessory_power | W | 0 | 60000 | fan, alternator, compressors
engine | aspirated_fraction | 1 | 0 | 1 | share of the full-load torque there without boost
engine | boost_lag | s | 0 | 10 | time constant of the boost at boost_speed (0: no lag)
engine | boost_speed | rad/s | 50 | 400 | engine speed at which boost_lag holds; it goes as 1/speed
engine | fuelling_lag | s | 0 | 2 | time constant of injection and combustion
engine | engine_brake_torque | N m | 0 | 5000 | engine brake at governed speed (0: none)
engine | engine_brake_speed | rad/s | 0 | 200 | engine speed at which the engine brake cuts in
engine | engine_brake_lag | s | 0 | 3 | time constant of the engine brake
engine | indicated_efficiency | 1 | 0.1 | 0.7 | best combustion efficiency
engine | efficiency_speed_loss | 1 | 0 | 1 | loss with the squared relative distance from best_speed
engine | efficiency_load_loss | 1 | 0 | 1 | loss with the squared distance from full load
engine | best_speed | rad/s | 50 | 400 | engine speed of the best efficiency
engine | fuel_energy | J/cm^3 | 10000 | 60000 | lower heating value by volume
engine | fuel_gain | 1 | 0.1 | 3 | burnt over computed fuel (1: none)
transmission | converter | 1 | 0 | 1 | 1: torque converter and power shifts; 0: clutch and torque interruption
transmission | final_drive | 1 | 1 | 12 | axle ratio
transmission | driveline_efficiency | 1 | 0.5 | 1 | gearbox to wheels, both directions
transmission | shift_time | s | 0 | 5 | length of a gear change (0: instantaneous)
transmission | shift_ramp | s | 0 | 2 | torque ramp before and after a change
transmission | shift_torque | 1 | 0 | 1 | share of torque kept during a power shift
transmission | time_in_gear | s | 0 | 20 | least time between changes
transmission | upshift_low | rad/s | 50 | 500 | upshift speed at no demand
transmission | upshift_high | rad/s | 50 | 500 | upshift speed at full demand
transmission | downshift_low | rad/s | 30 | 400 | downshift speed at no demand
transmission | downshift_high | rad/s | 30 | 400 | downshift speed at full demand
transmission | engage_speed | rad/s | 30 | 400 | gear choice after neutral keeps the engine above this
transmission | start_gear | 1 | 1 | 18 | launch gear at small demand; full demand launches in first
transmission | clutch_capacity | N m | 100 | 20000 | largest clutch torque
transmission | clutch_gain | N m s | 1 | 100 | clutch torque for each rad/s of slip error
transmission | launch_speed | rad/s | 60 | 250 | engine speed of a launch at full demand
transmission | declutch_speed | rad/s | 20 | 120 | the clutch opens below this gearbox input speed
transmission | stall_capacity | N m s^2 | 0.001 | 1 | converter pump torque over engine speed squared
transmission | stall_torque_ratio | 1 | 1 | 4 | converter torque ratio at stall
transmission | coupling_ratio | 1 | 0.5 | 0.98 | speed ratio at which the torque ratio reaches 1
transmission | lockup_gear | 1 | 1 | 18 | lowest gear with lock-up
transmission | lockup_speed | rad/s | 50 | 400 | turbine speed at which the lock-up closes
transmission | lockup_release_speed | rad/s | 30 | 400 | turbine speed at which it opens
brakes | front_brake_torque | N m | 0 | 50000 | capacity of one front wheel brake
brakes | rear_brake_torque | N m | 0 | 50000 | capacity of one rear wheel brake
brakes | front_wheels | 1 | 0 | 8 | braked wheel ends in front
brakes | rear_wheels | 1 | 0 | 24 | braked wheel ends behind
brakes | brake_gain | 1 | 0 | 3 | scale of the brake torque (1: none)
brakes | brake_pushout | 1 | 0 | 0.5 | share of full pressure before the linings touch
brakes | brake_lag | s | 0 | 3 | time constant of the front circuit when applied
brakes | brake_lag_rear | s | 0 | 3 | time constant of the rear circuit when applied
brakes | brake_release_lag | s | 0 | 3 | time constant of both when released
brakes | brake_heat_capacity | J/K | 1000 | 10000000 | drums and linings together
brakes | brake_cooling | W/K | 0 | 10000 | cooling at rest
brakes | brake_cooling_speed | W s/(K m) | 0 | 1000 | its growth with speed
brakes | ambient_temperature | degC | -60 | 70 | outside air
brakes | fade_temperature | degC | -60 | 1000 | fade starts here
brakes | brake_fade | 1/K | 0 | 0.02 | loss of brake torque for each degree above (0: no fade)
brakes | fade_floor | 1 | 0 | 1 | share of brake torque that always remains
brakes | brake_gate | m/s^2 | 0 | 2 | smallest deceleration request that closes the brake switch
brakes | brake_controller_mass | kg | 1000 | 100000 | mass that a controller with a gain reckons with
brakes | brake_controller_gain | 1/s | 0 | 20 | its integral gain (0: the request is what the brakes add)
"""


@dataclass(frozen=True)
class Parameter:
    """One scalar of a truck; values outside low..high are refused."""

    part: str
    name: str
    unit: str
    low: float
    high: float
    meaning: str


_CELLS = ([cell.strip() for cell in row.split("|")] for row in _ROWS.strip().splitlines())
PARAMETERS: dict[str, Parameter] = {
    name: Parameter(part, name, unit, float(low), float(high), meaning)
    for part, name, unit, low, high, meaning in _CELLS
}
PARTS = tuple(dict.fromkeys(p.part for p in PARAMETERS.values()))

RECORD = np.dtype(
    [(name, "f8") for name in PARAMETERS]
    + [
        ("command_scale", "f8"),  # N m for one unit of engine command
        ("brake_scale", "f8"),  # share of full pressure, or m/s^2, for one unit of brake command
        ("by_deceleration", "f8"),  # 1: the brake command is a deceleration
        ("by_pedal", "f8"),  # 1: the engine command is a pedal, whose curve `pedal` is
        ("gears", "f8"),
        ("table_step", "f8"),  # rad/s between points of full_load
        ("ratios", "f8", (GEARS,)),
        ("full_load", "f8", (TABLE,)),  # N m at the flywheel
        ("pedal", "f8", (PEDAL,)),  # share of the torque there is
    ]
)


def check_value(name: str, value: Any) -> float:
    """The value as a float. Raises InputError for an unknown name or a value that is no number in range."""
    if name not in PARAMETERS:
        raise InputError(f"a physics truck has no parameter '{name}'; {near(name, list(PARAMETERS))}")
    parameter = PARAMETERS[name]
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        unit = "" if parameter.unit == "1" else f" in {parameter.unit}"
        raise InputError(f"parameter '{name}' must be a number{unit}, not {value!r}")
    if not parameter.low <= value <= parameter.high:
        unit = "" if parameter.unit == "1" else f" {parameter.unit}"
        raise InputError(
            f"parameter '{name}' is {value:g}{unit}, not {parameter.low:g} to {parameter.high:g}"
        )
    return float(value)


def check_values(values: Mapping[str, Any]) -> dict[str, float]:
    """check_value for every entry."""
    return {name: check_value(name, value) for name, value in values.items()}
