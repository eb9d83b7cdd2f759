"""Command line of the ECU emulator."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated

import typer

from deeptruck_core.terminal import console
from truck_bridge.errors import InputError

if TYPE_CHECKING:
    from truck_bridge.emulator.ecus import EcuEmulator
    from truck_bridge.vehicles import Vehicle

EXAMPLES = """
Examples:\n
  python -m truck_bridge.emulator --vehicle trucksim --interface loopback --channel demo\n
  python -m truck_bridge.emulator --vehicle volvo --interface socketcan --channel vcan0 --grade 0.02\n
  python -m truck_bridge.emulator --vehicle trucksim --driver 10:brake_pedal=40,12:brake_pedal=0\n
  python -m truck_bridge.emulator --vehicle trucksim --driver engaged+5:brake_pedal=40\n
  python -m truck_bridge.emulator --vehicle trucksim --actuators engaged+10:brake.gain=0.5,20:engine.lost=1
"""
ENGAGED = "engaged+"  # before seconds that count from engagement


@dataclass(frozen=True)
class Action:
    """At time `at`, s, a field of `Driver`, or AXIS.FIELD of an `Actuator`, takes a new value.

    Time starts with the emulator, or with `engaged` at the first command of a controller that is obeyed.
    """

    at: float
    key: str
    value: float
    engaged: bool = False


def main_command(
    vehicle: Annotated[str, typer.Option(help="trucksim, freightliner, volvo or a YAML file.")],
    interface: Annotated[str, typer.Option(help="python-can interface.")] = "loopback",
    channel: Annotated[str, typer.Option(help="Channel of the interface.")] = "deeptruck",
    grade: Annotated[float, typer.Option(help="Slope of the road, rise/run.", min=-0.2, max=0.2)] = 0.0,
    speed: Annotated[float, typer.Option(help="Speed at the start, m/s.", min=0.0, max=50.0)] = 0.0,
    driver: Annotated[
        str, typer.Option(help="What the driver does: SECONDS:KEY=VALUE,... or engaged+SECONDS:KEY=VALUE,...")
    ] = "",
    actuators: Annotated[
        str, typer.Option(help="Faults of actuators: SECONDS:AXIS.KEY=VALUE,... or engaged+SECONDS:...")
    ] = "",
) -> None:
    """Emulate a truck's controllers around the simulator that its file names, on a CAN bus, until SIGINT,
    SIGTERM or SIGHUP."""
    from deeptruck_model.simulators import load
    from truck_bridge import vehicles
    from truck_bridge.bus import open_bus
    from truck_bridge.emulator.ecus import EcuEmulator

    driven = vehicles.load(vehicle)
    coming = [*driver_actions(driver), *actuator_faults(actuators, driven)]
    simulator = load(driven.truck)
    with open_bus(interface, channel) as bus:
        print(f"ECU emulator: {driven.name} on {interface} {channel}", flush=True)
        emulator = EcuEmulator(driven, bus, truck=simulator, grade=lambda distance: grade, speed=speed)
        _drive(emulator, sorted(coming, key=lambda action: action.at))


def driver_actions(text: str) -> list[Action]:
    """What the driver does. Raises InputError for an invalid action."""
    from truck_bridge.emulator.messages import Driver

    return _actions("--driver", text, [field.name for field in fields(Driver)])


def actuator_faults(text: str, vehicle: Vehicle) -> list[Action]:
    """Which actuator of the vehicle fails, when and how. Raises InputError for an invalid fault."""
    from truck_bridge.emulator.receiver import FAULTS

    return _actions(
        "--actuators", text, [f"{axis}.{name}" for axis in vehicle.transmitted for name in FAULTS]
    )


def _actions(option: str, text: str, known: Sequence[str]) -> list[Action]:
    found = []
    for item in filter(None, text.split(",")):
        when, _, action = item.partition(":")
        key, _, value = action.partition("=")
        seconds = when.removeprefix(ENGAGED)
        try:
            one = Action(float(seconds), key, float(value), engaged=seconds != when)
        except ValueError:
            one = None
        if one is None or key not in known or not (0.0 <= one.at < math.inf and 0.0 <= one.value <= 100.0):
            raise InputError(
                f"{option} '{item}' is not SECONDS:KEY=VALUE or engaged+SECONDS:KEY=VALUE; keys are "
                f"{', '.join(known)}, values 0 to 100"
            )
        found.append(one)
    return found


def _drive(emulator: EcuEmulator, coming: list[Action]) -> None:
    asked: list[int] = []  # signals: an Event whose lock is held by `wait` would never be set by a handler
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda n, _: asked.append(n))
    start, engaged = time.monotonic(), math.inf
    while not asked:
        now = time.monotonic()
        for action in list(coming):
            if now - (engaged if action.engaged else start) >= action.at:
                coming.remove(action)
                axis, _, key = action.key.rpartition(".")
                setattr(emulator.actuators[axis] if axis else emulator.driver, key, action.value)
        emulator.step(now)
        if engaged == math.inf and any(not math.isnan(emulator.demand(axis)) for axis in emulator.receivers):
            engaged = now
        time.sleep(0.002)


def main() -> None:
    """Entry point: bad input is one line and exit code 2."""
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command(epilog=EXAMPLES)(main_command)
    console.run(app, "emulator")
