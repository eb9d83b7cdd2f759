"""Imports numba safely if the working directory has a folder named `coverage`.

numba looks for the tracer of the library `coverage`, if that can be imported. If the library is not
installed, Python takes a folder of that name for it, such as `deeptruck-model coverage --out coverage`
writes, and numba fails.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def _no_folder_as(library: str) -> Iterator[None]:
    """Within the block, a library of which only a folder of that name is found counts as absent."""
    found = importlib.util.find_spec(library)
    if found is None or found.origin is not None:
        yield
        return
    sys.modules[library] = None  # type: ignore[assignment]  # how Python notes what cannot be imported
    try:
        yield
    finally:
        del sys.modules[library]


with _no_folder_as("coverage"):
    import numba

__all__ = ["numba"]
