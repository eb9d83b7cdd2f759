"""The one rule of every command that writes: whole or not there, and nothing of the user's is lost.

In comes a place that the user named; out goes a result that stands there whole, or nothing. `results` is the
rule for folders, `owned` says whose one is, `ledger` tells a command's own files, `single` writes one file,
`places` names what is unfinished, `drafts` removes it where the process ends at once. Standard library only.
"""

from deeptruck_model.files.again import rewrite
from deeptruck_model.files.drafts import removing
from deeptruck_model.files.ledger import LEDGER, is_as_written, renew
from deeptruck_model.files.places import (
    begun,
    final,
    free,
    left_beside,
    tell_left_beside,
    unfinished,
    writing,
)
from deeptruck_model.files.results import OVERWRITE_HELP, Result
from deeptruck_model.files.single import (
    ADVICE,
    ELSEWHERE,
    RENAME,
    advice,
    aside,
    check_new,
    check_outside,
    check_writable,
    new_file,
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
