"""The third forms: laws under the names of effects_*.py and without a name, unlike both older families, and
a world (world.py) of other trucks, roads, drivers and sensors.

Written from the literature by people who had not read the tool. Whoever works on the tool should leave
these files unread. Importing the package registers them.
"""

from __future__ import annotations

from deeptruck_exam.other_makers import (  # noqa: F401  importing registers the effects
    air,
    brakes,
    commands,
    data,
    driveline,
    engine,
    load,
    tyres,
    unnamed_machine,
    unnamed_road,
)
