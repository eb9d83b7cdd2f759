"""Physical constants that more than one module needs; SI."""

from __future__ import annotations

GRAVITY = 9.80665  # m/s^2, standard (CGPM 1901): what measurements and recordings are judged by
ROUNDED_GRAVITY = (
    9.81  # m/s^2, of controllers, trained policies and hidden effects: another value changes their results
)
AIR_DENSITY = 1.2  # kg/m^3 at 20 degC and sea level
DIESEL_J_PER_CM3 = 35.8e3  # lower heating value
