"""Names that can be left out of the library; apart, as a wrong one is refused before the tool loads."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from deeptruck_model.errors import InputError
from deeptruck_model.mismatch.mechanisms import LIBRARY
from deeptruck_model.mismatch.mechanisms.others import PARAMETERS, SENSOR_ERRORS
from deeptruck_model.mismatch.tree import UNKNOWN

NAMED = (*LIBRARY, *PARAMETERS, *SENSOR_ERRORS, UNKNOWN)


def check_excluded(names: Sequence[str]) -> None:
    """Raises InputError for what is no effect: an examination would believe that it had been left out."""
    for name in names:
        if name not in NAMED:
            near = difflib.get_close_matches(name, NAMED, 1)
            hint = f"; did you mean {near[0]}?" if near else "; docs/mismatch_effects.md lists them"
            raise InputError(f"there is no effect '{name}' to leave out{hint}")
