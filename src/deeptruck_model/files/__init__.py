"""The one rule of every command that writes: whole or not there, and nothing of the user's is lost.

In comes a place that the user named; out goes a result that stands there whole, or nothing. `results` is the
rule for folders, `ledger` says whose each file is, `lock` holds a folder for one run, `places` names what is
unfinished, `single` writes one file and removes drafts where the process ends at once. Standard library only.
"""

from deeptruck_model.files.ledger import LEDGER, is_as_written, renew
from deeptruck_model.files.lock import ELSEWHERE, free, writing
from deeptruck_model.files.places import begun, final, kept, left_beside, tell_left_beside, unfinished
from deeptruck_model.files.results import OVERWRITE_HELP, Result
from deeptruck_model.files.single import (
    ADVICE,
    RENAME,
    advice,
    aside,
    check_new,
    check_outside,
    check_writable,
    new_file,
    removing,
    rewrite,
    write,
)

__all__ = [
    "ADVICE",
    "ELSEWHERE",
    "LEDGER",
    "OVERWRITE_HELP",
    "RENAME",
    "Result",
    "advice",
    "aside",
    "begun",
    "check_new",
    "check_outside",
    "check_writable",
    "final",
    "free",
    "is_as_written",
    "kept",
    "left_beside",
    "new_file",
    "removing",
    "renew",
    "rewrite",
    "tell_left_beside",
    "unfinished",
    "write",
    "writing",
]
