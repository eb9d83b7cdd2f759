"""Sentences of the verdict, as templates."""

from __future__ import annotations

from collections.abc import Sequence

from deeptruck_core.signals import Said, Speed
from deeptruck_model.mismatch import folders

SENSOR_MANOEUVRE = "drive a known distance and compare each sensor with it"
UNKNOWN_FORCE = "a force that follows no mechanism of the library"
RECORD_MORE = "record the channels on which the force may depend, and drive where it is largest"
RECORD_ROAD = "record elevation or position"
RECORD_WIND = "record wind and load, and check the recorded slope"
RECORD_FAST = "see under 'Where it is off' what happens where it is largest, and record that at 10 Hz or more"
FELT_SLOPE = "the road's slope, which your log has in its accelerometer"
FELT_STEP = "import again with it, and train on its slope"
DRIFT = {
    "slow": "a slow force that no recorded channel explains, as a slope or wind is",
    "place": "a force that depends on the road position and that no recorded channel explains, as a slope is",
    "left_over": "an error that changes within seconds and that no recorded channel explains",
    "unknown": UNKNOWN_FORCE,
    "each_drive": "a constant force that differs between drives, as load, tyres, wind or a slope sensor do",
}


def to_record(part: str, *, grade: bool) -> str:
    """The signal to record for finding the cause of a budget part, with or without recorded slopes."""
    if part == "unknown":
        return RECORD_MORE
    if part == "left_over":
        return RECORD_FAST
    return RECORD_WIND if grade else RECORD_ROAD


COUNTS_AS_LEARNED = (
    "the simulator has neither parameters() nor inside(): it is treated as a learned one, beside which fewer "
    "names are accepted (docs/simulators.md)"
)
WITHOUT_MASS = "forces are given per kilogram (m/s^2), as no mass is known; state it by --mass-kg"
TOO_SHORT = "too few unbroken windows for a budget: record drives without gaps"
FAULTY = "a sensor or clock is wrong: it was corrected here, but repair it before you record more"
MAYBE_FAULTY = "a sensor or clock may be wrong, which these drives do not show: check it"
SETTLE = "settle the doubtful input"
ENOUGH = "every input that matters was recorded or stated"
NOT_DRIVEN = "no held-out recording is long enough for a free run"
NOT_SIGNIFICANT = f"{folders.NOT_SIGNIFICANT}; record more drives to hold out"
NOTHING_CORRECTED = "nothing was corrected"
AS_IT_IS = "the simulator as given is good enough for such drives"
NOT_BETTER = "the held-out error does not fall"


BESIDE_MISSING = {
    "gear": "or the truck only changes gear otherwise: gear was not recorded",
    "brake": "or the truck only brakes: the brake was not recorded",
}


def of_parameter(says: str, change: float) -> str:
    """A parameter of the simulator, `says` in words, is wrong, and by how much."""
    side = "larger" if change > 0 else "smaller"
    return f"the {says} is {abs(100 * change):.1f} % {side} than the simulator's"


def not_recorded(inputs: Sequence[str]) -> str:
    """Some inputs are missing."""
    return f"not recorded: {', '.join(map(spoken, inputs))}"


def good(error: float, horizon_s: float) -> str:
    """The simulator agrees with the truck."""
    return Said(off(error, horizon_s), ", and nothing that matters is left")


def good_enough(error: float, horizon_s: float) -> str:
    """The effects found have little influence on the motion."""
    return Said(off(error, horizon_s), ": what is missing hardly matters")


def too_far(error: float, fitted: float, horizon_s: float, least: float, own: float | None = None) -> str:
    """The speed errors, m/s, along held-out drives and to which the residual along the `fitted` drives adds
    up, one of which is above `least`, as a clause."""
    if error > least:
        return Said(off(error, horizon_s, own), "; good enough is ", Speed(least))
    return Said(
        off(error, horizon_s), ", but along the fitted drives by ", Speed(fitted), "; good enough is ",
        Speed(least), " on both",
    )  # fmt: skip


def without_faults(error: float, horizon_s: float) -> str:
    """The error with corrected sensors."""
    return Said("with the sensor corrected ", off(error, horizon_s))


def off(error: float, horizon_s: float, own: float | None = None) -> str:
    """The speed error of free runs of `horizon_s` on held-out drives, and of a learned simulator on its `own`
    held-out recordings, both in m/s, as a clause."""
    there = "" if own is None else Said(", on the simulator's own recordings by ", Speed(own))
    return Said(f"free runs of {horizon_s:.0f} s on held-out drives are off by ", Speed(error), there)


def better(before: float, after: float, *, refit: bool) -> str:
    """The offered simulator reduces the error."""
    by = " with parameters refitted alone" if refit else ""
    return Said(
        "the held-out speed error falls from ", Speed(before, with_unit=False), " to ", Speed(after), by
    )


def worse_bare(before: float, after: float, bare: float) -> str:
    """The correction is better only along drives with signals that others lack."""
    only = " only with signals that others lack: without them it is "
    return Said(better(before, after, refit=False), only, Speed(bare))


def after_repair(better: str, *, sure: bool) -> str:
    """The benefit of a correction that was fitted with a corrected sensor, which is `sure` to be wrong or
    may be."""
    return Said(better, f", with the sensor corrected: {'repair' if sure else 'check'} it first")


def doubtful(doubts: Sequence[str]) -> str:
    """What contradicts an input."""
    return "; ".join(doubts)


def after_settling(better: str) -> str:
    """The benefit of a correction that was fitted to doubtful input."""
    return Said(better, f": first {SETTLE}, and compare again")


PARTS = {
    "sensors": "sensors",
    "timing": "timing of commands",
    "brakes": "brakes",
    "engine_driveline": "engine and driveline",
    "air_tyres_road": "air, tyres and road",
    "load": "load",
    "place": "road position",
    "each_drive": "constant per drive",
    "slow": "slow drift",
    "left_over": "unexplained",
    "unknown": "no known mechanism",
    "commands obeyed": "whether commands were obeyed",
}


def spoken(name: str) -> str:
    """A name, a family or a part of the budget in plain words."""
    if name.startswith("unrecorded:"):
        return f"unrecorded {name.partition(':')[2]}"
    return PARTS.get(name, name.replace("_", " "))


def percent(share: float) -> str:
    """A share from 0 to 1."""
    return "under 1 %" if 0.0 < share < 0.005 else f"{100.0 * share:.0f} %"


def digits(x: float, *, sign: bool = False) -> str:
    """Three significant digits, or whole numbers from 100 on; with `sign` a plus before positive ones."""
    plus = "+" if sign and x > 0.0 else ""
    return f"{x:{plus},.0f}" if abs(x) >= 100.0 else f"{x:{plus}.3g}"


def opened(sentence: str) -> str:
    """The text beginning with a capital letter."""
    if isinstance(sentence, Said):
        first, *rest = sentence.parts
        return Said(opened(first), *rest) if isinstance(first, str) else sentence
    return sentence[:1].upper() + sentence[1:]
