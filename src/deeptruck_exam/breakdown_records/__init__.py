"""The sixth forms: laws as breakdown, recall and roadside service records and regional hauliers' work show
them, and a world (world.py) of other trucks, roads, traffic, drivers and loggers.

Other state variables and couplings than in the five older families. Written by people who had not read the
tool; whoever works on the tool should leave these files unread. Importing the package registers them.
"""

from __future__ import annotations

from deeptruck_exam.breakdown_records import (  # noqa: F401  importing registers the effects
    air,
    brakes,
    commands,
    data,
    driveline,
    engine,
    load,
    road,
    tyres,
    unnamed_aids,
    unnamed_machine,
)
