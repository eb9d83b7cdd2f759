"""Constants that more than one module needs; SI."""

from __future__ import annotations

GRAVITY = 9.80665  # m/s^2, standard (CGPM 1901): what measurements and recordings are judged by
ROUNDED_GRAVITY = (
    9.81  # m/s^2, of controllers, trained policies and hidden effects: another value changes their results
)
AIR_DENSITY = 1.2  # kg/m^3 at 20 degC and sea level
DIESEL_J_PER_CM3 = 35.8e3  # lower heating value

# the clock of a log, of rows or of frames
DAY_S, HOUR_S = 86400.0, 3600.0
BACK_S = (
    1.0  # rows and frames may overtake one another by this much, as in bags; further back a clock was set
)
RETURN_S = 5.0  # time is back in its place where it is within this of where it was left
TRUSTED = 20  # rows or frames behind a jump that make it a new piece
APART_S = 60.0  # between pieces that are put one behind the other
