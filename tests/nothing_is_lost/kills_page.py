"""The page of `kills.py`: how many runs of each command were ended, by what, and what was wrong then."""

from __future__ import annotations

import re
import signal
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

LATE = 0.9  # part of the work behind which results are written
HEAD = """# Ended at random moments

`python tests/nothing_is_lost/kills.py --runs 200 | tee LOG` ends runs, `kills.py --page docs/results/kills.md LOG` writes this.

Each run was ended at a random moment of its work, a third of them in its last tenth, and then started again.
`kill -9` ends the process that was started alone; Ctrl-C reaches all of them. A run is wrong if it left a half
result under its final name, a process or shared memory. It is wrong too if, once started again, it gave another
result than an undisturbed one. Compared are the bytes of weights and verdict; of a bag, its messages by topic.
Shared memory is looked for on the whole machine, so that other programs that end meanwhile count too.

| command | `kill -9` | Ctrl-C | of these in the last tenth | only after its end | wrong |
| --- | ---: | ---: | ---: | ---: | ---: |
"""  # noqa: E501
LINE = re.compile(
    r"\d+: (?P<command>[a-z ]+), (?P<signal>SIG[A-Z]+) at (?P<part>[\d.]+)"
    r"(?P<end>, after its end)?: (?P<says>.*)"
)
WELL, ENDED = "well", ", after its end"


@dataclass(frozen=True)
class Disturbed:
    """One run that was ended: by which signal, at which part of its work, and what was wrong, if anything."""

    command: str
    number: signal.Signals
    part: float
    ended_before: bool
    wrong: tuple[str, ...]

    def __str__(self) -> str:
        end = ENDED if self.ended_before else ""
        return f"{self.command}, {self.number.name} at {self.part:.3f}{end}: {'; '.join(self.wrong) or WELL}"


def read(log: Path) -> list[Disturbed]:
    """The runs in what `kills.py` printed."""
    return [
        Disturbed(
            found["command"],
            signal.Signals[found["signal"]],
            float(found["part"]),
            bool(found["end"]),
            () if found["says"] == WELL else (found["says"],),
        )
        for line in log.read_text().splitlines()
        if (found := LINE.fullmatch(line))
    ]


def page(runs: Sequence[Disturbed]) -> str:
    """The page with a row for each command."""
    rows = [
        _row(name, [one for one in runs if one.command == name])
        for name in dict.fromkeys(one.command for one in runs)
    ]
    wrong = [one for one in runs if one.wrong]
    said = [f"- {one}" for one in wrong]
    return "\n".join([HEAD.rstrip(), *rows, "", f"{len(runs)} runs, {len(wrong)} wrong.", *said, ""])


def _row(name: str, runs: Sequence[Disturbed]) -> str:
    cells = (
        sum(one.number == signal.SIGKILL for one in runs),
        sum(one.number == signal.SIGINT for one in runs),
        sum(one.part >= LATE for one in runs),
        sum(one.ended_before for one in runs),
        sum(bool(one.wrong) for one in runs),
    )
    return f"| {name} | " + " | ".join(map(str, cells)) + " |"
