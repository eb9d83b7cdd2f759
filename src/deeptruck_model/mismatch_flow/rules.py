"""Every number by which the verdict is decided, with its unit and where it comes from.

`python -m deeptruck_model.mismatch_flow.rules` renews the table of docs/mismatch_budget.md.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TypeVar

SENSORS = "ordinary sensors"
TRUCKS = "what trucks do"
STATISTICS = "convention"
CHOSEN = "chosen on development cases"

T = TypeVar("T")


def _rule(default: T, unit: str, means: str, source: str) -> T:
    return field(default=default, metadata={"unit": unit, "means": means, "source": source})


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Thresholds of the verdict. Forces per mass in m/s^2, gains of log evidence in nats."""

    # detection
    least_gain: float = _rule(
        12.0,
        "nats",
        "gain of the best kernel, beside free parameters, below which nothing is detected",
        CHOSEN,
    )
    parameter_gain: float = _rule(
        20.0, "nats", "gain of a parameter that is set free, below which it is not reported", CHOSEN
    )
    discrepancy: float = _rule(
        2.0,
        "1",
        "times the gain on a learned simulator's own recordings that a kernel must exceed on others",
        CHOSEN,
    )
    nearly_right: float = _rule(
        0.015,
        "1",
        "relative error that any simulator's parameter may have; its interval stays beyond",
        CHOSEN,
    )
    hidden_gain: float = _rule(
        20.0, "nats", "gain of two hidden states over one, below which no unrecorded braking is found", CHOSEN
    )

    # names
    stated: float = _rule(0.9, "1", "probability of the deepest node of the tree that is stated", STATISTICS)
    credible: float = _rule(
        0.8, "1", "probability that a credible set of names holds the right one", STATISTICS
    )
    nothing_more: float = _rule(
        0.5,
        "1",
        "probability that nothing more is missing, above which no further name is sought",
        STATISTICS,
    )
    most_findings: int = _rule(4, "1", "names of one verdict", CHOSEN)

    # budget
    acts: float = _rule(0.02, "m/s^2", "force above which a part of the budget acts", SENSORS)
    witness: float = _rule(
        0.1, "1", "share of the variance, on drives left out, above which a channel is a witness", CHOSEN
    )

    # 'nothing missing'
    visible: float = _rule(
        0.3, "m/s", "speed error of free runs below which nothing that matters is left", CHOSEN
    )
    largest: float = _rule(
        1.0,
        "m/s",
        "speed error of free runs above which something is missing, whatever simulators may do",
        CHOSEN,
    )
    visible_slow: float = _rule(
        0.5,
        "1",
        "share of the squared speed error that a part has which is not left over, and matters",
        CHOSEN,
    )
    differs: float = _rule(
        1.33, "of its own error", "beyond which a learned simulator differs from these recordings", CHOSEN
    )

    # the correction
    better: float = _rule(
        0.97, "of the error as given", "above which a correction is no better on drives left out", CHOSEN
    )


BEGIN, END = "<!-- rules: begin -->", "<!-- rules: end -->"


def table() -> str:
    """One row for each rule: name, value, unit, what it means and where it comes from."""
    rows = [
        f"| `{f.name}` | {f.default:g} | {f.metadata['unit']} | {f.metadata['means']} "
        f"| {f.metadata['source']} |"
        for f in fields(Rules)
    ]
    return "\n".join(["| rule | value | unit | means | source |", "| --- | --- | --- | --- | --- |", *rows])


def put_into(page: Path) -> None:
    """Replace the table between the marks of a page."""
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    page.write_text(f"{before}{BEGIN}\n{table()}\n{END}{rest.partition(END)[2]}", encoding="utf-8")


if __name__ == "__main__":
    put_into(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/mismatch_budget.md"))
