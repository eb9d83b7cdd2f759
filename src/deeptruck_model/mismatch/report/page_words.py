"""How the page writes numbers, names and a finding's own words."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from deeptruck_model.mismatch.report.drawing import remembered, words

IDENTIFIER = re.compile(r"\b[a-z][a-z0-9]*(?:_[a-z0-9]+)+\b")
QUOTED = re.compile(r"((?<!\w)'[^']+'(?!\w))")
SIGNALS = re.compile(r"(?<=It varies with )[^.;:]+|(?<=rive so that )[^;:]+?(?= changes while)")
CONDITION = re.compile(r"(?P<name>.+?) (?:(?P<side>[<>]) (?P<at>.+)|(?P<low>-?[\d.e+-]+) \.\. (?P<high>.+))")
SPOKEN = {  # names that are no words of their own once the underscores are gone
    "rolling_resistance_speed": "rolling resistance that grows with speed",
    "rolling_resistance_warmup": "rolling resistance of cold tyres",
    "torque_derate": "derated torque",
    "command_rate_limit": "limited rate of the commands",
    "load_slosh": "sloshing load",
    "speed_scale": "scale of the speed sensor",
    "unknown": "unknown force",
}


def number(x: float, step: float | None = None) -> str:
    """Plain digits: three significant ones without idle zeros, or rounded to `step`."""
    if not math.isfinite(x):
        return "unknown"
    if step is None:
        short = number(x, 10.0 ** (math.floor(math.log10(abs(x))) - 2)) if x else "0"
        return short.rstrip("0").rstrip(".") if "." in short else short
    if not 1e-6 < step < 1e9:
        return f"{x:.3g}"
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    return f"{round(x / step) * step:.{decimals}f}"


def counted(count: int, what: str) -> str:
    """'1 recording', '2 recordings'."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def measured(value: float, unit: str, ci: Sequence[float] | None) -> str:
    """A size with its 95 % interval, in as many digits as the interval is worth."""
    unit = "" if unit in ("", "1") else f" {prose(unit)}"
    if ci is None or not all(math.isfinite(c) for c in ci) or ci[1] <= ci[0]:
        return f"{number(value)}{unit}"
    step = 10.0 ** (math.floor(math.log10((ci[1] - ci[0]) / 2)) - 1)
    return f"{number(value, step)}{unit} (95 %: {number(ci[0], step)} to {number(ci[1], step)})"


def percent(x: float) -> str:
    """A share or probability; never rounded to certainty."""
    if not math.isfinite(x):
        return "unknown"
    if x > 0.99:
        return "above 99 %"
    return "below 1 %" if x < 0.01 else f"{100 * x:.0f} %"


def spoken(name: str) -> str:
    """An effect's or signal's name within a sentence."""
    return SPOKEN.get(name, words(name))


def prose(text: str) -> str:
    """A finding's own words without identifiers, and with signs as they are printed; what is quoted, such as
    the name of a recording, stays as it is."""
    parts = QUOTED.split(text)
    return "".join(part if k % 2 else _unquoted(part) for k, part in enumerate(parts))


def _unquoted(text: str) -> str:
    text = SIGNALS.sub(lambda found: ", ".join(spoken(n) for n in found[0].split(", ")), remembered(text))
    text = IDENTIFIER.sub(lambda found: spoken(found[0]), text)
    text = re.sub(r"\bsimulated\b(?! acceleration| on)", "simulated acceleration", text)
    text = re.sub(r"\b\d+(\.\d+)?e[+-]\d+\b", lambda found: number(float(found[0])), text)
    return text.replace("+-", "±").replace("^2", "²").replace("^3", "³")


def condition(where: str) -> str:
    """A regime of verdict.json as people say it: 'engine 0.2 .. 0.4 m/s² and brake < 0.1 m/s²'."""
    return " and ".join(_one_condition(part) for part in where.split(" and "))


def _one_condition(text: str) -> str:
    found = CONDITION.fullmatch(text)
    if not found:
        return prose(text)
    if found["side"]:
        border = f"{'above' if found['side'] == '>' else 'below'} {found['at']}"
    else:
        border = f"from {found['low']} to {found['high']}"
    return f"{spoken(found['name'])} {prose(border)}"


def opened(text: str) -> str:
    """The text with a capital first letter."""
    return text[:1].upper() + text[1:]
