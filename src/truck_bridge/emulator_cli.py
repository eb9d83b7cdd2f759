"""Command line of the ECU emulator."""

from __future__ import annotations

import argparse
import csv
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np

from deeptruck_model.errors import InputError as ModelInputError
from truck_bridge import vehicles
from truck_bridge.bus import open_bus
from truck_bridge.ecu_emulator import Driver, EcuEmulator
from truck_bridge.errors import InputError

EXAMPLES = """examples:
  python -m truck_bridge.ecu_emulator --vehicle trucksim --interface loopback --channel demo
  python -m truck_bridge.ecu_emulator --vehicle volvo --interface socketcan --channel vcan0 --grade road.csv
  python -m truck_bridge.ecu_emulator --vehicle trucksim --driver 10:brake_pedal=40,12:brake_pedal=0
"""


def parser() -> argparse.ArgumentParser:
    """The options."""
    p = argparse.ArgumentParser(
        prog="python -m truck_bridge.ecu_emulator",
        description="A truck's controllers around a physics truck, on a CAN bus.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("--vehicle", required=True, help="trucksim, freightliner, volvo or a YAML file")
    p.add_argument("--interface", default="loopback", help="python-can interface (default: loopback)")
    p.add_argument("--channel", default="deeptruck", help="channel of the interface")
    p.add_argument("--truck", help="what drives: truck:NAME[:overrides.yaml] or a simulator directory")
    p.add_argument("--grade", default="0", help="slope (rise/run), or a CSV with columns distance,grade")
    p.add_argument("--speed", type=float, default=0.0, help="speed at the start, m/s")
    p.add_argument("--driver", default="", help="what the driver does: SECONDS:KEY=VALUE,...")
    p.add_argument("--duration", type=float, help="stop after so many seconds")
    return p


def road(text: str) -> Callable[[float], float]:
    """Slope over distance, from a number or a CSV file. Raises InputError where it is neither."""
    try:
        slope = float(text)
        return lambda distance: slope
    except ValueError:
        pass
    try:
        with Path(text).open(newline="") as file:
            rows = [(float(row["distance"]), float(row["grade"])) for row in csv.DictReader(file)]
    except OSError as error:
        raise InputError(f"--grade {text}: {error.strerror}; give a number or a CSV file") from None
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{text}: needs numeric columns distance and grade ({error})") from None
    if not rows:
        raise InputError(f"{text} holds no rows")
    distance, grade = np.array(rows).T
    return lambda at: float(np.interp(at, distance, grade))


def script(text: str) -> list[tuple[float, str, float]]:
    """Driver actions as (time, key, value), in order. Raises InputError on a bad one."""
    known = [field.name for field in fields(Driver)]
    actions = []
    for item in filter(None, text.split(",")):
        try:
            when, action = item.split(":")
            key, value = action.split("=")
            if key not in known:
                raise ValueError(f"keys are {', '.join(known)}")
            actions.append((float(when), key, float(value)))
        except ValueError as error:
            raise InputError(f"--driver '{item}' is not SECONDS:KEY=VALUE ({error})") from None
    return sorted(actions)


def run(arguments: argparse.Namespace) -> None:
    """Run until the duration, SIGINT or SIGTERM."""
    from deeptruck_model.simulators import load

    vehicle = vehicles.load(arguments.vehicle)
    actions, slope = script(arguments.driver), road(arguments.grade)
    truck = load(arguments.truck or vehicle.truck)
    bus = open_bus(arguments.interface, arguments.channel)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    emulator = EcuEmulator(vehicle, bus, truck=truck, grade=slope, speed=arguments.speed)
    print(f"ECU emulator: {vehicle.name} on {arguments.interface} {arguments.channel}", flush=True)
    start = time.monotonic()
    try:
        while not stop.is_set():
            now = time.monotonic()
            while actions and now - start >= actions[0][0]:
                _, key, value = actions.pop(0)
                setattr(emulator.driver, key, value)
            emulator.step(now)
            if arguments.duration is not None and now - start >= arguments.duration:
                break
            stop.wait(0.002)
    finally:
        bus.shutdown()


def main() -> None:
    """Entry point: bad input is one line and exit code 2."""
    try:
        run(parser().parse_args())
    except (InputError, ModelInputError) as error:
        print(f"ecu_emulator: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
