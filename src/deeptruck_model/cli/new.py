"""`deeptruck-model new`: a user's physics truck from a data sheet, typed in or read from a file."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from deeptruck_core import files, reading
from deeptruck_core.errors import InputError
from deeptruck_core.signals import BRAKE_UNITS, ENGINE_UNITS, TruckInterface
from deeptruck_model import results
from deeptruck_model.cli.inputs import ClockOption, MessageFiles, TopicMap
from deeptruck_model.recordings.compatibility import Taken

if TYPE_CHECKING:
    from deeptruck_model.recordings import Recording

_HELP = """Make a physics truck of your own from its data sheet: a file that 'truck:FILE' loads.

Asks mass, gears, axle ratio, tyres, torque, frontal area and brakes, or reads them from a file:

  mass_kg: 24000

  gear_ratios: [12.69, 9.29, 6.75, 4.9, 3.62, 2.59, 1.9, 1.38, 1.0, 0.74]

  axle_ratio: 3.7

  tyres: 295/80R22.5

  rated_torque_nm: 1750

  frontal_area_m2: 10

  full_braking_m_s2: 6

They are checked against each other, and with --recordings against the ratio of engine speed to speed.

Examples:

  deeptruck-model new mytruck.yaml

  deeptruck-model new mytruck.yaml --from sheet.yaml --recordings drives/monday
"""


def register(app: typer.Typer) -> None:
    """Add the command to the console script."""
    app.command("new", help=_HELP)(new)


def new(
    truck: Annotated[Path, typer.Argument(metavar="TRUCK.yaml", help="Truck file to write, a new file.")],
    source: Annotated[
        Path | None,
        typer.Option("--from", help="YAML file with the data sheet; else it is asked.", metavar="FILE"),
    ] = None,
    recordings: Annotated[
        list[Path] | None,
        typer.Option(
            help="Bags of this truck: its gears are checked, the units of its commands taken.", metavar="BAG"
        ),
    ] = None,
    topic_map: TopicMap = None,
    clock: ClockOption = None,
    msg: MessageFiles = None,
) -> None:
    """Write the truck file."""
    bags = recordings or []
    if truck.suffix not in (".yaml", ".yml"):
        raise InputError(f"{truck} must end in .yaml, as truck:FILE.yaml is how a truck file is named")
    files.check_new(truck)
    results.apart(truck, *bags, *([source] if source else []))
    if source is None and not sys.stdin.isatty():
        raise InputError("there is no terminal to ask at; give the data sheet by --from FILE.yaml")
    from deeptruck_model.recordings import read_all
    from deeptruck_model.recordings.consistency.sensors import steady_ratios
    from deeptruck_model.recordings.several import check_fit
    from deeptruck_model.trucks import gears, own_truck

    drives = read_all(bags, topic_map=topic_map, clock=clock, msg=msg or ()) if bags else []
    data = {} if source is None else dict(reading.yaml_mapping(source, "give a data sheet"))
    units = _units(data, drives)
    interface = TruckInterface(truck.stem, **units, grade=False)
    check_fit(drives, Taken(f"the truck {truck.name}", interface, drives[0].dt if drives else 0.1))
    data = {**(data or _asked(drives, units)), **units}
    sheet = own_truck.sheet(data, str(source) if source else "the answers")
    slope = not drives or any("grade" in r.channels for r in drives)
    made = own_truck.specification(sheet, truck.stem, grade=slope)
    if off := gears.misfit(sheet.overall_ratios, drives):
        raise InputError(f"the data sheet is not that of the recorded truck: {off}")
    with files.new_file(truck) as draft:
        draft.write_text(own_truck.text(sheet, made, truck.name), encoding="utf-8")
    rpm = own_truck.CRUISE * sheet.overall_ratios[-1] / own_truck.RPM
    typer.echo(f"{truck}: {sheet.mass_kg:g} kg, {len(sheet.gear_ratios)} gears, {rpm:.0f} rpm at 80 km/h")
    if bags and not len(steady_ratios(drives)):
        typer.echo("note: no engine speed was recorded, so the gears were not checked", err=True)
    elif bags:
        typer.echo("the gears are those of the recordings")
    if not slope:
        typer.echo("no slope was recorded, so that the truck takes none: it drives on a level road")
    typer.echo(f"load it as truck:{truck}; 'deeptruck-model calibrate-truck' fits it to recordings")


def _units(data: dict[str, Any], drives: list[Recording]) -> dict[str, Any]:
    """Units of the commands: those of the sheet, else of the recordings if a physics truck has them."""
    known = {"engine_unit": ENGINE_UNITS[:2], "brake_unit": BRAKE_UNITS[:2]}
    recorded = drives[0].interface.to_dict() if drives else {}
    found = {name: recorded[name] for name, units in known.items() if recorded.get(name) in units}
    return {**found, **{name: data[name] for name in known if name in data}}


def _unit(known: tuple[str, ...], value: str) -> None:
    """Raises InputError for a unit that a physics truck does not have."""
    if value not in known:
        raise InputError(f"give {' or '.join(known)}, not {value!r}")


def _asked(drives: list[Recording], units: dict[str, Any]) -> dict[str, Any]:
    """The data sheet from questions on the terminal, and the units of the commands if no recording has them.

    An unusable answer is asked again.
    """
    from deeptruck_model.trucks import gears, own_truck
    from deeptruck_model.trucks.specification import from_pool

    entries = {entry.name: entry for entry in own_truck.NUMBERS}
    answers: dict[str, Any] = {}

    def ask(name: str, default: Any, read: Callable[[Any], Any], asks: str) -> None:
        while name not in answers:
            given = typer.prompt(asks, default=default)
            try:
                read(given)
            except InputError as error:
                typer.echo(str(error), err=True)
            else:
                answers[name] = given

    def ask_number(name: str, default: str) -> None:
        entry = entries[name]
        unit = f" in {entry.unit}" if entry.unit else ""
        ask(name, default, lambda value: own_truck.number(entry, value), f"{entry.asks}{unit}")

    ask_number("mass_kg", "20000")
    ask_number("axle_ratio", "3.7")
    ask("tyres", "295/80R22.5", own_truck.radius, "Tyres, a size or the rolling radius in m")
    scale = own_truck.radius(answers["tyres"]) / float(answers["axle_ratio"])
    seen = [round(x * scale, 3) for x in gears.from_gears(drives)]
    usual = ", ".join(f"{x:g}" for x in seen or from_pool(own_truck.CLUTCH).ratios)
    ask(
        "gear_ratios",
        usual,
        own_truck.ratios,
        "Gear ratios, first gear first" + (", here as driven" if seen else ""),
    )
    ask_number("rated_torque_nm", "1750")
    ask_number("frontal_area_m2", "10")
    ask_number("full_braking_m_s2", "6")
    for key, asks, known in (
        (
            "engine_unit",
            "Engine command: a torque, or % of reference torque or pedal",
            ENGINE_UNITS[:2],
        ),
        (
            "brake_unit",
            "Brake command: % of pedal or pressure, or a deceleration",
            BRAKE_UNITS[:2],
        ),
    ):
        if key not in units:
            ask(key, known[0], partial(_unit, known), f"{asks} ({' or '.join(known)})")
    answers["converter"] = typer.confirm("Has it a torque converter?", default=False)
    return answers
