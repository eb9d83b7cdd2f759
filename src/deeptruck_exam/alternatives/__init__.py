"""The second forms: other laws under the names of effects_*.py, and other effects without a name.

Written from other sources, by people who had not read the tool, for a tool whose authors had read the first
forms. Whoever works on the tool should leave these files unread, or write a third family. Importing the
package registers them.
"""

from __future__ import annotations

from deeptruck_exam.alternatives import (  # noqa: F401  importing registers the effects
    air,
    brakes,
    commands,
    data,
    driveline,
    engine,
    load,
    tyres,
    unnamed,
)
