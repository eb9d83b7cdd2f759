"""`truck-bridge`: look into CAN logs, check them, record a bus, play a log back."""

from __future__ import annotations

import deeptruck_core.terminal.script_start  # noqa: F401 - Ctrl-C during the imports that follow

# isort: split
import sys
from pathlib import Path
from typing import Annotated

import typer

from deeptruck_core.account import Account
from deeptruck_core.terminal import console

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    help="J1939 logs and buses of a truck: decode, check, record, replay, convert.",
)

Interface = Annotated[
    str, typer.Option(help="python-can interface: socketcan, udp_multicast, loopback, slcan ...")
]
Channel = Annotated[str, typer.Option(help="channel of the interface, such as can0")]
LogChannel = Annotated[
    str | None, typer.Option("--channel", help="the bus, where the log has several", metavar="NAME")
]

_DECODE = """List what a CAN log holds, signal by signal; with --out, write the values as CSV.

Examples:

  truck-bridge decode drive.log --vehicle trucksim

  truck-bridge decode drive.blf --vehicle my_truck.yaml --out signals.csv
"""
_CHECK = """Would the bridge accept what this truck sends? A recorded drive through the safety core's
checks of what it hears, as if control had been engaged all the time. Exit code 1 where anything was refused
or lost.

Example:

  truck-bridge check drive.log --vehicle my_truck.yaml
"""
_RECORD = """Write a bus to a new log (.log, .asc, .blf, .trc; .mcap is a rosbag; .mf4 with asammdf) until
Ctrl-C or --duration.

Examples:

  truck-bridge record drive.log --interface socketcan --channel can0

  truck-bridge record drive.mcap --interface socketcan --channel can0
"""
_CONVERT = """Convert a log to another format, by the suffix of the new name.

Example:

  truck-bridge convert drive.log drive.mcap
"""
_REPLAY = """Play a log onto a bus with its own timing. Commands (TSC1, XBR, proprietary) stay off unless
--commands.

Example:

  truck-bridge replay drive.log --interface loopback --channel bench
"""


@app.command(help=_DECODE)
def decode(
    log: Path,
    vehicle: Annotated[str, typer.Option(help="trucksim, freightliner, volvo or a YAML file")],
    out: Annotated[
        Path | None, typer.Option(help="New CSV file of every valid sample: time,source,signal,value,unit")
    ] = None,
    channel: LogChannel = None,
) -> None:
    """See _DECODE."""
    from deeptruck_core import files
    from truck_bridge import can_logs, vehicles

    if out is not None:
        files.check_new(out)
    decoded = can_logs.decode(log, vehicles.load(vehicle).codec, channel=channel)
    if out is not None:
        can_logs.write_csv(decoded, out)
    for line in can_logs.table(decoded):
        print(line)


@app.command(help=_CHECK)
def check(
    log: Path,
    vehicle: Annotated[str, typer.Option(help="trucksim, freightliner, volvo or a YAML file")],
    channel: LogChannel = None,
) -> None:
    """See _CHECK."""
    from truck_bridge import vehicles
    from truck_bridge.can_logs import checking

    found = checking.check(log, vehicles.load(vehicle), channel=channel)
    for line in checking.lines(found):
        print(line)
    raise typer.Exit(0 if found.clean else 1)


@app.command(help=_CONVERT)
def convert(log: Path, out: Path, channel: LogChannel = None) -> None:
    """See _CONVERT."""
    from truck_bridge import can_logs

    account = can_logs.convert(log, out, channel=channel)
    print(f"{account.total.used} frames in {out}")
    _show(account)


@app.command(help=_RECORD)
def record(
    log: Path,
    interface: Interface,
    channel: Channel,
    duration: Annotated[float | None, typer.Option(help="stop after so many seconds", min=0.0)] = None,
) -> None:
    """See _RECORD."""
    from truck_bridge import can_logs

    print(f"{can_logs.record(log, interface, channel, duration)} frames in {log}")


@app.command(help=_REPLAY)
def replay(
    log: Path,
    interface: Interface,
    channel: Channel,
    commands: Annotated[bool, typer.Option(help="send command messages too; never on a truck")] = False,
    speed: Annotated[float, typer.Option(help="times faster than recorded", min=0.01, max=1000.0)] = 1.0,
    log_channel: Annotated[
        str | None, typer.Option(help="the bus of the log, where it has several", metavar="NAME")
    ] = None,
) -> None:
    """See _REPLAY."""
    from truck_bridge import can_logs

    account = Account(str(log), "frames")
    sent = can_logs.replay(
        log, interface, channel, commands=commands, speed=speed, of=log_channel, account=account
    )
    print(f"{sent} frames sent")
    _show(account)


def _show(account: Account) -> None:
    """Print the account of a log, if it contains more than the number of its frames."""
    if account.total.aside or account.remarks or len(account.sources) > 1:
        print("\n".join(account.lines()), file=sys.stderr)


def main() -> None:
    """Entry point: bad input is one line on stderr and exit code 2, never a traceback."""
    console.run(app, "truck-bridge")
