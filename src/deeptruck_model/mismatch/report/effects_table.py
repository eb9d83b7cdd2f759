"""The table of docs/mismatch_effects.md.

`python -m deeptruck_model.mismatch.report.effects_table` renews it.
"""

from __future__ import annotations

import sys
from pathlib import Path

from deeptruck_model.mismatch.mechanisms import LIBRARY, Mechanism
from deeptruck_model.mismatch.report.findings import NAMES, TOLD_BY

BEGIN, END = "<!-- effects: begin -->", "<!-- effects: end -->"
HEAD = (
    "| effect | equation | varies with | needs | source | would be told by |",
    "| --- | --- | --- | --- | --- | --- |",
)
BETWEEN_SENSORS = {  # equation, and what must be recorded
    "acceleration_bias": ("accelerometer(t) = dv/dt + b", "acceleration, speed"),
    "speed_scale": ("speed = k * true speed", "speed, and acceleration or engine_speed"),
}


def table() -> str:
    """Every name a finding can have, one row each: library, sensor faults, parameters, unknown."""
    rows = [_row(m) for m in LIBRARY.values()]
    for name, (equation, needs) in BETWEEN_SENSORS.items():
        cells = (f"`{name}` (measurement)", equation, "speed, acceleration", needs)
        rows.append(_line(*cells, "kinematics", "move the truck by a known distance"))
    for name, (unit, says) in NAMES.items():
        cells = (f"`{name}` (parameter)", f"{says}; {unit}", "always", "engine, brake, speed")
        rows.append(_line(*cells, "definition", TOLD_BY[name]))
    rows.append(
        _line(
            "`unknown`",
            "F = f(what it leans on)",
            "what the free model finds",
            "any",
            "",
            "vary one signal alone",
        )
    )
    return "\n".join([*HEAD, *rows])


def _row(m: Mechanism) -> str:
    kind = " (measurement)" if m.kind == "measurement_fault" else ""
    return _line(
        f"`{m.effect}`{kind}", m.equation, ", ".join(m.depends_on), ", ".join(m.needs), m.source, m.told_by
    )


def _line(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def put_into(page: Path) -> bool:
    """Replace the table between the marks of a page; returns whether it was another one."""
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    new = f"{before}{BEGIN}\n{table()}\n{END}{rest.partition(END)[2]}"
    page.write_text(new, encoding="utf-8")
    return new != text


if __name__ == "__main__":
    put_into(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/mismatch_effects.md"))
