"""Tensors out of a safetensors file. The format checks its sizes; its checksum is in the manifest beside."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from safetensors import SafetensorError

from deeptruck_model import reading
from deeptruck_model.errors import InputError


def tensors(path: Path, load: Callable[[Path], Any]) -> Any:
    """What `load` of safetensors gives. Raises InputError where the file is missing, damaged or no file.

    A bit that changed inside a weight is another weight, which `reading.check_saved` sees.
    """
    try:
        reading.check_file(path, reading.SAVE_AGAIN)
        return load(path)
    except InputError as error:
        raise InputError(f"{path} is missing or damaged ({error})") from None
    except (OSError, SafetensorError, ValueError, KeyError, TypeError, IndexError, RecursionError) as error:
        said = reading.plain(str(error)) or type(error).__name__
        raise InputError(f"{path} is missing or damaged ({said}); {reading.SAVE_AGAIN}") from None
