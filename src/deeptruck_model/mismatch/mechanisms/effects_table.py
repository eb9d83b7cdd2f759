"""The table of docs/mismatch_effects.md.

`python -m deeptruck_model.mismatch.mechanisms.effects_table` renews it.
"""

from __future__ import annotations

import sys
from pathlib import Path

from deeptruck_core.pages.marked import put_between_marks
from deeptruck_model.mismatch.mechanisms import LIBRARY, Mechanism
from deeptruck_model.mismatch.mechanisms.others import PARAMETER_ERRORS, SENSOR_ERRORS

HEAD = (
    "| effect | family | equation | varies with | needs | source | would be separated by |",
    "| --- | --- | --- | --- | --- | --- | --- |",
)


def table() -> str:
    """One row for every possible name of a finding: mechanisms, sensor faults, parameters, unknown."""
    rows = [_row(m) for m in LIBRARY.values()]
    for fault in SENSOR_ERRORS.values():
        cells = (f"`{fault.name}` (measurement)", fault.family, fault.equation, "speed, acceleration")
        rows.append(_line(*cells, fault.needs, "kinematics", "move the truck by a known distance"))
    for p in PARAMETER_ERRORS.values():
        cells = (f"`{p.name}` (parameter)", p.family, f"{p.says}; {p.unit}", "always")
        rows.append(_line(*cells, "engine, brake, speed", "definition", p.manoeuvre))
    rows.append(
        _line(
            "`unknown`",
            "",
            "F follows none of these",
            "",
            "any",
            "",
            "vary one signal alone",
        )
    )
    return "\n".join([*HEAD, *rows])


def _row(m: Mechanism) -> str:
    kind = " (measurement)" if m.kind == "measurement_fault" else ""
    return _line(
        f"`{m.effect}`{kind}",
        m.family,
        m.equation,
        ", ".join(m.depends_on),
        ", ".join(m.needs),
        m.source,
        m.manoeuvre,
    )


def _line(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def put_into(page: Path) -> bool:
    """Replace the table between the marks of `page`; returns whether the page changed."""
    return put_between_marks(page, "effects", table())


if __name__ == "__main__":
    put_into(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/mismatch_effects.md"))
