"""What the engine's own recorded torque says of a force: does the engine give less, or is it lost beyond it?

An engine's controller reports the torque that it gives (SAE J1939-71, SPN 513), a physics truck tells the
torque that it would have given. Where they differ by what a force takes from the truck, that force is the
engine's; where they agree, it lies beyond the engine, or the controller does not know of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deeptruck_model.mismatch.mechanisms.symbols import OMEGA
from deeptruck_model.mismatch.residual.evidence import Evidence
from deeptruck_model.mismatch.residual.noise import TAIL, Prior, Rows, Series, fit, whiten

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

DRIVELINE = 0.95  # of the torque that arrives at the wheels, of a truck's driveline in gear
AFTER_SHIFT_S = 2.0  # after which two engines are in step again
LEAST_BRAKING = 0.05  # m/s^2: beyond, a late command acts on the brakes
LEAST_ROWS = 300
SHARE, SHARE_SD = 1.0, 0.25  # of a force of the engine that is reported: torque is told to some 5 to 10 %
# Of what the report itself is off by (m/s^2, m/s^2, share, s): a zero, one that grows with engine speed, its
# scale, and its delay.
OFF_BY = np.array([0.05, 0.05, 0.05, 0.3])


@dataclass(frozen=True)
class RecordedTorque:
    """Reported less simulated torque as an acceleration, in units of its own noise, (m,) of some rows of the
    evidence; and what its errors make of it, (m, 4), with their posterior covariance."""

    rows: Rows
    left: Array
    off: Array
    covariance: Array
    ar: Array
    weight: Array
    temper: float

    def gain(self, force: Array, shows: float) -> float:
        """Nats that a force of the engine (n,), m/s^2, gains by what was reported: positive where this shows
        it. `shows` is the probability that a controller knows of such a force."""
        told = self._log_odds(force) / self.temper
        return self.temper * float(np.logaddexp(np.log(shows) + told, np.log1p(-shows)))

    def shows(self, force: Array, sure: float) -> bool | None:
        """Whether a force (n,) was reported; None where that is not `sure`, in nats."""
        told = self._log_odds(force)
        return None if abs(told) < sure else told > 0.0

    def _log_odds(self, force: Array) -> float:
        """Of the force being reported against nothing being reported, in nats."""
        f = whiten(force, self.ar, self.rows, self.weight)
        across = self.off.T @ f
        size = float(f @ f - across @ self.covariance @ across)
        with_it = float(f @ self.left - across @ self.covariance @ (self.off.T @ self.left))
        inverse = 1.0 / SHARE_SD**2
        exponent = (with_it + SHARE * inverse) ** 2 / (size + inverse) - SHARE**2 * inverse
        return float(0.5 * (exponent - np.log1p(size / inverse)))


def recorded_torque(e: Evidence, only: Mask | None = None) -> RecordedTorque | None:
    """None where it was not recorded, or the simulator does not tell its own."""
    if not e.has("engine_torque", "modelled_torque", "lever", "engine_speed"):
        return None
    at_wheels = DRIVELINE * e["lever"] / e.mass * e.signals.get("effective_mass_gain", np.ones(len(e)))
    y = (e["engine_torque"] - e["modelled_torque"]) * at_wheels
    off = _off_by(e, at_wheels)
    coasts = np.nan_to_num(e.signals.get("brake", np.zeros(len(e)))) < LEAST_BRAKING
    valid = e.valid & coasts & np.isfinite(y) & np.isfinite(off).all(axis=1) & ~_shifts(e)
    valid = valid if only is None else valid & only
    if valid.sum() < LEAST_ROWS:
        return None
    series = Series(np.where(valid, y, 0.0), valid, e.starts, np.ones(len(e)), 0.0, e.rules)
    off = np.where(valid[:, None], off, 0.0)
    prior = Prior(np.zeros(4), OFF_BY, np.zeros(4))
    found = fit(series, off, prior)
    rows = np.flatnonzero(series.usable())
    z = found.innovations[rows]
    weight = np.sqrt((TAIL + 1) / (TAIL + z**2)) / found.sigma
    left = whiten(series.y, found.ar, rows, weight)
    columns = whiten(off, found.ar, rows, weight)
    covariance: Array = np.linalg.inv(columns.T @ columns + np.diag(1.0 / OFF_BY**2)).astype(np.float64)
    return RecordedTorque(rows, left, columns, covariance, found.ar, weight, e.rules.temper)


def _off_by(e: Evidence, at_wheels: Array) -> Array:
    """What the report's own errors look like, (n, 4), m/s^2 for one of each."""
    reference = max(float(np.nanmedian(e["lever"][e.valid])), 1e-3)
    lever = e["lever"] / reference
    asked = e["modelled_torque"] * at_wheels
    return np.stack([lever, lever * e["engine_speed"] / OMEGA, asked, -e.difference(asked)], axis=1)


def _shifts(e: Evidence) -> Mask:
    """Samples near a shift, where two engines are not in step."""
    if "gear" not in e.signals:
        return np.zeros(len(e), dtype=bool)
    gear = np.round(np.nan_to_num(e["gear"]))
    changes = np.zeros(len(e), dtype=bool)
    changes[1:] = np.diff(gear) != 0
    return (e.since(changes) < AFTER_SHIFT_S) | changes
