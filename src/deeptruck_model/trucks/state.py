"""What a truck remembers between two instants, one record for each truck of the batch."""

from __future__ import annotations

import numpy as np

OPEN, SLIPPING, LOCKED = 0.0, 1.0, 2.0  # clutch; for a converter truck its lock-up clutch

INSIDE = (  # what Simulator.inside shows; first in the record, so that one copy takes them
    "gear",
    "engine_speed",
    "engine_torque",  # at the flywheel
    "indicated_torque",
    "retarder_torque",
    "boost",
    "clutch",
    "ratio",  # engine to wheel
    "shifting",
    "traction_force",
    "external_force",
    "brake_force",
    "drag_force",
    "rolling_force",
    "grade_force",
    "front_pressure",
    "rear_pressure",
    "brake_temperature",
    "mass",
    "effective_mass",
    "fuel_rate",  # mean of the last step
    "distance",
    "elevation",
)

_HIDDEN = (
    "time",
    "speed",
    "acceleration",  # of the last substep
    "demand",  # commanded share of full torque, or of the engine brake when negative
    "target_gear",
    "asked_gear",  # the recorded gear, where the truck follows it; below 0.5 or NaN it chooses
    "shift_timer",
    "since_shift",
    "synchronising",
    "torque_factor",
    "pedal",  # demand as the gearbox sees it, filtered
    "load",  # resistance as the gearbox reckons it, N
    "clutch_torque",  # taken from the engine
    "input_torque",  # given to the gearbox
    "brake_controller",
)

WORK = (  # J since the reset; engine_work + external_work = losses + the others + kinetic energy
    "engine_work",
    "external_work",
    "slip_loss",
    "driveline_loss",
    "brake_work",
    "drag_work",
    "rolling_work",
    "grade_work",
)

STATE = np.dtype([(name, "f8") for name in (*INSIDE, *WORK, *_HIDDEN)])
