"""The seventh forms: laws as certification laboratories, proving grounds, fuel consumption tests and
suppliers' benches report them, and a world of its own (world.py).

Other state variables and couplings than in the six older families. Sizes, times and places are chosen
here, larger than the sources' where those would drown in noise. Written by people who had not read the
tool; whoever works on the tool should leave these files unread. Importing the package registers them.
"""

from __future__ import annotations

from deeptruck_exam.proving_ground import (  # noqa: F401  importing registers the effects
    air,
    brakes,
    commands,
    data,
    driveline,
    engine,
    load,
    road,
    unnamed_aids,
    unnamed_track,
)
