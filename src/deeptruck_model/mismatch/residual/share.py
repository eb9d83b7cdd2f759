"""What engine and brake contribute inside a deep truck, as small maps that can be read at every step.

A deep truck answers questions about its commands only through counterfactual runs, which are too slow for a
running simulation. So the answers gathered along the recordings are summed up: engine and brake share over
speed and lagged command, and the overall gear ratio over speed.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.residual.evidence import Evidence

Array = NDArray[np.float64]

KNOTS = 7


@dataclass(frozen=True)
class Shares:
    """Maps over speed knots (m/s): force = command * gain(speed); engine turns per metre; drag; rolling."""

    speed: list[float]
    engine_gain: list[float]
    brake_gain: list[float]
    ratio: list[float] | None
    drag_per_square: float
    rolling: float
    mass: float

    @classmethod
    def of(cls, e: Evidence) -> Shares:
        """Fit the maps to the evidence by least squares on linear splines of speed."""
        speed = e["speed"]
        knots = np.linspace(0.0, max(float(np.quantile(speed[e.valid], 0.99)), 5.0), KNOTS)
        basis = np.maximum(1.0 - np.abs(speed[:, None] - knots) / (knots[1] - knots[0]), 0.0)

        def gain(command: str, share: Array) -> list[float]:
            if not e.has(command):
                return [0.0] * KNOTS
            X = (basis * np.nan_to_num(e.lag(e[command], 0.4))[:, None])[e.valid]
            H = X.T @ X + np.eye(KNOTS) * 1e-3 * max(np.trace(X.T @ X) / KNOTS, 1e-9)
            return np.linalg.solve(H, X.T @ np.nan_to_num(share[e.valid])).tolist()

        ratio = None
        if e.has("ratio"):
            near = basis * np.isfinite(e["ratio"])[:, None] * e.valid[:, None]
            ratio = (
                (near * np.nan_to_num(e["ratio"])[:, None]).sum(0) / np.maximum(near.sum(0), 1e-9)
            ).tolist()
        square = float(np.median(e["drag"][e.valid] / np.maximum(speed[e.valid], 1.0) ** 2))
        rolling = float(np.median(e["rolling"][e.valid]))
        return cls(
            knots.tolist(),
            gain("engine_command", e["engine"]),
            gain("brake_command", e["brake"]),
            ratio,
            square,
            rolling,
            e.mass,
        )

    def now(self, speed: Array, u: Array) -> dict[str, Array]:
        """The signals mechanisms ask for, at this speed (batch,) and these commands (batch, n_u)."""
        out = {
            "engine": np.interp(speed, self.speed, self.engine_gain) * u[:, 0],
            "brake": np.interp(speed, self.speed, self.brake_gain) * u[:, 1]
            if u.shape[1] > 1
            else np.zeros(len(speed)),
            "drag": self.drag_per_square * speed**2,
            "rolling": np.full(len(speed), self.rolling),
        }
        if self.ratio is not None:
            out["engine_speed"] = np.interp(speed, self.speed, self.ratio) * speed
        return out

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Shares:
        return cls(**data)
