"""`deeptruck-model fleet`: many trucks at once, here or on a Ray cluster."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from deeptruck_core.errors import InputError
from deeptruck_core.files import lock
from deeptruck_core.signals import speed_unit
from deeptruck_model.cli.inputs import SIMULATOR, Units

if TYPE_CHECKING:
    from deeptruck_model.fleet.run import Fleet, Workers
    from deeptruck_model.fleet.storage import Place

STAGES = ("extract", "compare", "pool", "roads", "show")
SHOWN = 10  # quarantined files or trucks that the terminal lists
_HELP = """Compare a fleet's recordings with a simulator, truck by truck, and say which trucks differ.

All stages in order: extract (read each file once), compare (the mismatch tool on each truck), pool (which
trucks differ from their siblings, at a controlled false discovery rate), roads (slopes of roads that several
trucks drove) and show (the page). Each is a command of its own, too: 'fleet extract SOURCE', and 'fleet
compare', 'fleet pool', 'fleet roads' or 'fleet show' with the folder that was written. The same command goes
on where it was stopped. Folders may be file://, s3:// and gs:// addresses.

Examples:

  deeptruck-model fleet drives --layout '{truck}/{date}/*.mcap' --simulator truck:trucksim --out fleet

  deeptruck-model fleet pool fleet --trucks trucks.csv --level 0.1

  deeptruck-model fleet show fleet
"""


def fleet(
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="[STAGE] PLACE",
            help="Folder or address of the recordings; of the result, for a later STAGE.",
        ),
    ],
    out: Annotated[str | None, typer.Option(help="Folder or address of the result.")] = None,
    layout: Annotated[
        str | None,
        typer.Option(help="How files are named below the place: '{truck}/{date}/*.mcap'.", metavar="PATTERN"),
    ] = None,
    simulator: Annotated[
        str | None, typer.Option(help=f"{SIMULATOR} Or a YAML file: class to simulator.")
    ] = None,
    topic_map: Annotated[Path | None, typer.Option(help="For bags of other topics.", metavar="FILE")] = None,
    columns: Annotated[
        Path | None, typer.Option(help="COLUMNS.yaml, for tables and CAN logs.", metavar="FILE")
    ] = None,
    trucks: Annotated[
        Path | None,
        typer.Option(
            help="CSV: truck, and class, sound (yes or no), build, load and the like.", metavar="FILE"
        ),
    ] = None,
    hours_per_truck: Annotated[
        float | None,
        typer.Option(help="Most hours compared of each truck; all where absent.", min=0.01),
    ] = None,
    units: Units = "m/s",
    level: Annotated[
        float,
        typer.Option(
            help="False discovery rate: expected share of false ones among the trucks found.",
            min=0.001,
            max=0.5,
        ),
    ] = 0.05,
    engine: Annotated[
        Literal["local", "ray"], typer.Option(help="Processes of this machine, or Ray.")
    ] = "local",
    workers: Annotated[int, typer.Option(help="Processes at a time.", min=1)] = 1,
    address: Annotated[
        str | None, typer.Option(help="Of a Ray cluster: ray://HOST:10001. Without one Ray is started here.")
    ] = None,
    endpoint: Annotated[
        str | None, typer.Option(help="Of an S3 server other than Amazon's: http://127.0.0.1:9000.")
    ] = None,
) -> None:
    stage, place = _stage(words)
    speed_unit(units)
    if address is not None and engine != "ray":
        raise InputError("--address is that of a Ray cluster; add --engine ray")
    if endpoint is not None and not any(name and name.startswith("s3://") for name in (place, out)):
        raise InputError("--endpoint is that of an S3 server, and neither place is an s3:// address")
    from deeptruck_model.fleet.run import Workers
    from deeptruck_model.fleet.storage import place as at

    who = Workers(engine, workers, address)
    described = None
    if stage in ("", "extract"):
        source, target = at(place, endpoint), at(_needed(out, "--out"), endpoint)
        given = {"trucks": trucks, "topic_map": topic_map, "columns": columns}
        described = _described(
            source, target, _needed(layout, "--layout"), _needed(simulator, "--simulator"), given
        )
    elif out is not None:
        raise InputError(f"'fleet {stage}' writes into {place}; leave --out out")
    else:
        target = at(place, endpoint)
        if "://" not in place and not Path(place).exists():
            raise InputError(f"{place} does not exist; give what --out named when 'fleet' was run")
    with lock.reserved(Path("/", target.path)):
        if stage in ("", "extract", "compare"):
            with who.ready():
                if described is not None:
                    _extract(described, who)
                if stage != "extract":
                    _compare(target, who, hours_per_truck, units)
        if stage in ("", "pool"):
            _pool(target, trucks, level)
        if stage in ("", "roads"):
            from deeptruck_model.fleet.roads import roads, said

            print(said(roads(target)))
        if stage in ("", "show"):
            from deeptruck_model.fleet.page import show

            print(f"see {show(target)}")


fleet.__doc__ = _HELP


def _stage(words: list[str]) -> tuple[str, str]:
    if len(words) == 1 and words[0] not in STAGES:
        return "", words[0]
    if len(words) == 2 and words[0] in STAGES:
        return words[0], words[1]
    written = f"'fleet {' '.join(words)}' has no such stage; " if len(words) == 2 else ""
    raise InputError(f"{written}write 'fleet PLACE', or 'fleet STAGE PLACE' with one of {', '.join(STAGES)}")


def _needed(value: str | None, option: str) -> str:
    if value is None:
        raise InputError(f"{option} is missing; --help shows an example")
    return value


def _described(
    source: Place, target: Place, layout: str, simulator: str, given: dict[str, Path | None]
) -> Fleet:
    from deeptruck_model.fleet.run import Fleet

    if target.path == source.path or target.path.startswith(f"{source.path}/"):
        raise InputError(f"--out {target.name} is inside {source.name}, which is read here; choose another")
    return Fleet.of(source, target, layout, simulator, **given)


def _extract(fleet: Fleet, who: Workers) -> None:
    from deeptruck_model.fleet.run import extract

    index = extract(fleet, who)
    total, out = index["total"], index["quarantined"] | index["failed"]
    print(
        f"{total['files']} files, {total['bytes'] / 1e6:.1f} MB: {total['hours']:.2f} h of "
        f"{len(index['trucks'])} trucks; {len(out)} files left out"
    )
    for items, account in index["account"].items():
        aside = sum(account["set_aside"].values())
        print(f"  {account['read']} {items} read, {account['used']} used, {aside} set aside")
    for path, why in list(out.items())[:SHOWN]:
        print(f"  left out: {path}: {why}")
    if len(out) > SHOWN:
        print(f"  and {len(out) - SHOWN} more: see {fleet.target.name}/recordings.json")


def _compare(target: Place, who: Workers, hours: float | None, units: str) -> None:
    from deeptruck_model.fleet.run import compare

    receipts = compare(target, who, hours, units)
    out = {r["truck"]: r.get("quarantined") or r["failed"] for r in receipts if "nats_fitted" not in r}
    print(f"{len(receipts) - len(out)} trucks compared, {len(out)} left out")
    for truck, why in list(out.items())[:SHOWN]:
        print(f"  left out: {truck}: {why}")


def _pool(target: Place, trucks: Path | None, level: float) -> None:
    from deeptruck_model.fleet.plan import trucks as table
    from deeptruck_model.fleet.pool import headline, pool
    from deeptruck_model.mismatch.verdict.wording import opened, spoken

    found = pool(target, table(trucks), level)
    print(*(f"{opened(line)}." for line in headline(found)), sep="\n")
    for kind, c in found["classes"].items():
        print(
            f"class {kind}: {c['tested']} tested by {c['references']} references, {c['differ']} established "
            f"at a false discovery rate of {level:g}; the smallest possible p is {c['smallest_p']:.2g}"
        )
        if c["tested"] and not c["differ"]:
            needed = c["references_needed"][str(c["tested"])]
            print(f"  all {c['tested']} together could be discoveries with {needed} references or more")
        if c["common"]:
            print(f"  found in most trucks, so of the simulator: {', '.join(map(spoken, c['common']))}")
    if missing := found["without_drives"]:
        print(f"{trucks} names trucks without recordings: {', '.join(missing)}")
    if len(found["series"]) > 1:
        last, every = found["series"][-1], [t for b in found["series"] for t in b["discovered"]]
        print(
            f"over {len(found['series'])} runs with new drives: {', '.join(every) or 'no truck'} discovered, "
            f"in the last {', '.join(last['discovered']) or 'none'}, at its level of {last['level']:.2g}"
        )


def register(app: typer.Typer) -> None:
    """Add the command to the console script."""
    app.command("fleet", help=_HELP)(fleet)
