"""numba, which compiles what must be fast; also where a folder `coverage` lies beside.

numba asks the library `coverage` for its tracer, if it can be imported. Where that is not installed, Python
takes a folder of that name for it, such as `deeptruck-model coverage --out coverage` writes, and numba fails.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def _no_folder_as(library: str) -> Iterator[None]:
    """Within the block a library is absent if only a folder of its name is found."""
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
