"""The table of docs/mismatch_effects.md.

`python -m deeptruck_model.mismatch.effects_table` renews it.
"""

from __future__ import annotations

import sys
from pathlib import Path

from deeptruck_model.mismatch.mechanisms import LIBRARY, Mechanism
from deeptruck_model.mismatch.report.wording import PARAMETER_MANOEUVRE, PARAMETER_NAMES, PARAMETER_UNITS
from deeptruck_model.mismatch.tree import FAMILY

BEGIN, END = "<!-- effects: begin -->", "<!-- effects: end -->"
HEAD = (
    "| effect | family | equation | varies with | needs | source | would be separated by |",
    "| --- | --- | --- | --- | --- | --- | --- |",
)
BETWEEN_SENSORS = {  # equation, and what must be recorded
    "acceleration_bias": ("accelerometer(t) = dv/dt + b", "acceleration, speed"),
    "speed_scale": ("speed = k * true speed", "speed, and acceleration or engine_speed"),
}


def table() -> str:
    """Every name a finding can have, one row each: library, sensor faults, parameters, unknown."""
    rows = [_row(m) for m in LIBRARY.values()]
    for name, (equation, needs) in BETWEEN_SENSORS.items():
        cells = (f"`{name}` (measurement)", FAMILY[name], equation, "speed, acceleration", needs)
        rows.append(_line(*cells, "kinematics", "move the truck by a known distance"))
    for name, says in PARAMETER_NAMES.items():
        unit = PARAMETER_UNITS.get(name, "1")
        cells = (f"`{name}` (parameter)", FAMILY[name], f"{says}; {unit}", "always", "engine, brake, speed")
        rows.append(_line(*cells, "definition", PARAMETER_MANOEUVRE[name]))
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
    """Replace the table between the marks of a page; returns whether it was another one."""
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    new = f"{before}{BEGIN}\n{table()}\n{END}{rest.partition(END)[2]}"
    page.write_text(new, encoding="utf-8")
    return new != text


if __name__ == "__main__":
    put_into(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/mismatch_effects.md"))
