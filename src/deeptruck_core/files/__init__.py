"""Output files of all commands: a result is complete or absent, and no file of the user is lost.

`results` writes folders, `single` writes one file, `lock` holds a folder for one run. Standard library only.
"""

from deeptruck_core.files.lock import ELSEWHERE, writing
from deeptruck_core.files.results import (
    MARKER,
    OVERWRITE_HELP,
    Result,
    check_new,
    check_outside,
    is_finished,
    kept,
    unfinished,
)
from deeptruck_core.files.single import advice, aside, new_file, removing, write

__all__ = [
    "ELSEWHERE",
    "MARKER",
    "OVERWRITE_HELP",
    "Result",
    "advice",
    "aside",
    "check_new",
    "check_outside",
    "is_finished",
    "kept",
    "new_file",
    "removing",
    "unfinished",
    "write",
    "writing",
]
