"""Checks names excluded from the library; a separate module, so that the command line refuses a wrong name
before the tool loads.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from deeptruck_core.errors import InputError
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.others import PARAMETER_ERRORS, SENSOR_ERRORS
from deeptruck_model.mismatch.tree import UNKNOWN

NAMED = (*LIBRARY, *PARAMETER_ERRORS, *SENSOR_ERRORS, UNKNOWN)


def check_excluded(names: Sequence[str]) -> None:
    """Raises InputError for a name that is no effect, which an examination would otherwise believe
    excluded."""
    for name in names:
        if name not in NAMED:
            near = difflib.get_close_matches(name, NAMED, 1)
            hint = f"; did you mean {near[0]}?" if near else "; docs/mismatch_effects.md lists them"
            raise InputError(f"there is no effect '{name}' to leave out{hint}")
