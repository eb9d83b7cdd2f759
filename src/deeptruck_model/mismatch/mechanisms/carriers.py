"""Forces of a physics truck that scale those of mechanisms: a headwind, for example, is a share of the drag.

Sizes are fitted at parameters that may differ much from those of the corrected truck; its forces then differ
by the same factors.
"""

from __future__ import annotations

from collections.abc import Mapping

CARRIERS = {
    "engine": "torque_gain",
    "brake": "brake_gain",
    "drag": "drag_area",
    "rolling": "rolling_resistance",
}


def factors(fitted_at: Mapping[str, float], moved: Mapping[str, float]) -> dict[str, float]:
    """Ratios of every force per mass at the parameters of the fit to that of a truck with `moved`; both are
    relative changes of the simulator's parameters."""

    def ratio(name: str) -> float:
        return (1.0 + fitted_at.get(name, 0.0)) / (1.0 + moved.get(name, 0.0))

    return {force: ratio(parameter) / ratio("mass") for force, parameter in CARRIERS.items()}
