"""The fourth forms: laws as service bulletins, supplier data, standards and track tests report them, and a
world (world.py) of other trucks, roads, drivers and sensors.

Other forms, signals and time scales than in the three older families. Written by people who had not read
the tool; whoever works on the tool should leave these files unread. Importing the package registers them.
"""

from __future__ import annotations

from deeptruck_exam.field_reports import (  # noqa: F401  importing registers the effects
    air,
    brakes,
    commands,
    data,
    driveline,
    engine,
    engine_aids,
    engine_brakes,
    engine_friction,
    load,
    road,
    tyres,
    unnamed_aids,
    unnamed_machine,
    unnamed_road,
)
