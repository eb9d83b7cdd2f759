"""Output files of all commands: a result is complete or absent, and no file of the user is lost.

`results` writes folders, `ledger` records who wrote each file, `lock` holds a folder for one run, `places`
names unfinished work, `single` writes one file. Standard library only.
"""

from deeptruck_model.files.ledger import LEDGER, check_new, check_outside, is_as_written, renew, rewrite
from deeptruck_model.files.lock import ELSEWHERE, free, writing
from deeptruck_model.files.places import final, kept, left_beside, print_left_beside, unfinished
from deeptruck_model.files.results import OVERWRITE_HELP, Result
from deeptruck_model.files.single import advice, aside, new_file, removing, write

__all__ = [
    "ELSEWHERE",
    "LEDGER",
    "OVERWRITE_HELP",
    "Result",
    "advice",
    "aside",
    "check_new",
    "check_outside",
    "final",
    "free",
    "is_as_written",
    "kept",
    "left_beside",
    "new_file",
    "print_left_beside",
    "removing",
    "renew",
    "rewrite",
    "unfinished",
    "write",
    "writing",
]
