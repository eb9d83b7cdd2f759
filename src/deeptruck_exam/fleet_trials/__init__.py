"""The fifth forms: laws as instrumented trucks of fleets and of winter, building and breakdown service show
them, and a world (world.py) of other trucks, roads, traffic, drivers and sensors.

Other state variables and couplings than in the four older families. Written by people who had not read the
tool; whoever works on the tool should leave these files unread. Importing the package registers them.
"""

from __future__ import annotations

from deeptruck_exam.fleet_trials import (  # noqa: F401  importing registers the effects
    air,
    brakes,
    commands,
    data,
    driveline,
    engine,
    load,
    road,
    tyres,
    unnamed_machine,
    unnamed_road,
)
