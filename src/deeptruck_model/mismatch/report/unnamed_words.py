"""What a finding says of a force that has no name, or whose name its size alone gave."""

from __future__ import annotations

from typing import Any

import numpy as np

from deeptruck_model.mismatch.mechanisms import LIBRARY, UNNAMED
from deeptruck_model.mismatch.posterior.causes import Cause, Explanation
from deeptruck_model.mismatch.posterior.road_lock import RoadLock
from deeptruck_model.mismatch.residual.evidence import Evidence

MOSTLY = 0.6  # of the time, beyond which a force is no event
ONE_WAY = 0.5  # of its rms that the mean of a force must have, to tell its size
AT_ITS_MOMENTS = "record more signals, and look what else happens at the moments listed under segments"


def strength(cause: Cause, e: Evidence) -> str:
    """How strong a force is where it acts, in N, and for how much of the time."""
    large = np.abs(cause.force[e.valid])
    acting = large > 0.3 * float(np.quantile(large, 0.995)) + 1e-9
    newtons = e.newtons(cause.force)[e.valid][acting] if acting.any() else np.zeros(1)
    mean, rms = float(np.mean(newtons)), float(np.sqrt(np.mean(newtons**2)))
    size = f"{mean:+.0f} N on average" if abs(mean) > ONE_WAY * rms else f"{rms:.0f} N rms, forward and back,"
    share = float(np.mean(acting))
    if share > MOSTLY:
        return size.rstrip(",")
    return f"{size} while it acts, {100.0 * share:.0f} % of the time"


def slow(cause: Cause) -> dict[str, Any]:
    """A slow force, and what size it would need under each name: sizes decide here, not the fit."""
    needed = cause.needed or {}
    rms = float(np.sqrt(np.mean(cause.force**2)))
    sizes = (
        f"as a slope {100 * needed['road_grade']:.1f} %, as wind {needed['headwind']:.0f} m/s, "
        f"as a change of engine force {100 * needed['torque_derate']:.0f} %"
    )
    m = LIBRARY.get(cause.effect)
    what = m.says if m else "a slow force that no signal predicts"
    return {
        "says": f"{what}: {rms:.3f} m/s^2 rms. It would be {sizes}{_again(cause.road)}",
        "equation": m.equation if m else "F = f(t)",
        "parameters": {
            f"rms_as_{n}": {"value": v, "unit": u, "ci95": None}
            for (n, v), u in zip(needed.items(), ("ratio", "m/s", "1"), strict=True)
        },
        "would_be_told_by": m.told_by if m else "drive the same stretch in both directions",
        "depends_on": list(m.depends_on) if m else ["time"],
        **_decided(cause),
    }


def _decided(cause: Cause) -> dict[str, Any]:
    """What gave a slow force its name: that it came again with the road, or its size alone."""
    road = cause.road
    if road is None:
        return {"decided_by": "physically possible size, not the fit"}
    numbers = {name: round(value, 3) for name, value in vars(road).items()}
    return {"decided_by": "it comes again where the same road is driven again", "road": numbers}


def _again(road: RoadLock | None) -> str:
    """On how much road a force came again, where it did."""
    if road is None:
        return ""
    ways = [f"on {road.same_way_km:.0f} km driven again the same way"] if road.same_way_km > 0 else []
    if road.other_way_km > 0:
        ways.append(f"on {road.other_way_km:.0f} km driven the other way with its sign turned")
    return (
        f". It comes again {' and '.join(ways)}. Its agreement is {road.agreement:.2f}, "
        f"by chance less than {road.by_chance:.2f} in 99 % of windows"
    )


def comes_and_goes(cause: Cause, e: Evidence) -> dict[str, Any]:
    """An unknown force that no signal predicts and that acts like none of the known ones."""
    near = f". The nearest name, {cause.nearest}, does not explain how it acts" if cause.nearest else ""
    now_and_then = bool(np.mean(cause.force[e.valid] == 0.0) > 0.5)
    return {
        "says": f"{UNNAMED.says}: {strength(cause, e)}{near}",
        "equation": UNNAMED.equation,
        "parameters": {},
        "would_be_told_by": AT_ITS_MOMENTS if now_and_then else UNNAMED.told_by,
        "depends_on": ["time"] if now_and_then else list(UNNAMED.depends_on),
        **({"nearest": cause.nearest} if cause.nearest else {}),
    }


def unknown(cause: Cause, e: Evidence, explanation: Explanation) -> dict[str, Any]:
    left = explanation.left_over
    drivers = [name for name, share in left.importance.items() if share > 0.1][:4]
    near = f". The nearest name, {cause.nearest}, does not explain it" if cause.nearest else ""
    return {
        "says": f"a force that no mechanism of the library explains: {strength(cause, e)}. It varies with "
        f"{', '.join(drivers) or 'nothing recorded'}{near}",
        "equation": "F = f(" + ", ".join(drivers) + ")",
        "parameters": {"held_out_r2": {"value": left.r2, "unit": "1", "ci95": None}},
        "would_be_told_by": "drive so that "
        + (drivers[0] if drivers else "one signal")
        + " changes while the others change little",
        "depends_on": drivers,
        **({"nearest": cause.nearest} if cause.nearest else {}),
    }
