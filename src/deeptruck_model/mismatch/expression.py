"""Formulas for mechanisms of your own: arithmetic on signals, as the library is written with."""

from deeptruck_model.mismatch.residual.expression import *  # noqa: F403 - all of it
from deeptruck_model.mismatch.residual.expression import __all__ as __all__
