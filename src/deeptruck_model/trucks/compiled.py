"""How the scalar parts are compiled: cached on disk, and recompiled when any part's source changes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from deeptruck_core.imports.compiler import numba

Function = TypeVar("Function", bound=Callable[..., Any])

part: Any = numba.njit(error_model="numpy")


def _stamp(folder: Path, *extra: Path) -> str:
    digest = hashlib.sha256()
    for file in [*sorted(folder.glob("*.py")), *extra]:
        digest.update(file.read_bytes())
    return digest.hexdigest()


def entry(function: Function) -> Function:
    """Compile a function that Python calls, with an on-disk cache so that later processes start fast.

    numba's own cache checks only the function's file and would miss a change in a part that it calls; the
    stamp is therefore a hash of all parts. If no cache folder is writable, the function is compiled in every
    process.
    """
    if numba.config.DISABLE_JIT:
        return function
    try:
        dispatcher = numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError:
        return part(function)
    source = Path(function.__code__.co_filename)
    dispatcher._cache._cache_file._source_stamp = _stamp(Path(__file__).parent, source)
    return dispatcher
