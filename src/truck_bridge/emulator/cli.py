"""Command line of the ECU emulator."""

from __future__ import annotations

import argparse
import csv
import math
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import NoReturn

import numpy as np

from deeptruck_model.errors import InputError as ModelInputError
from truck_bridge import vehicles
from truck_bridge.bus import open_bus
from truck_bridge.emulator.ecus import Driver, EcuEmulator
from truck_bridge.errors import InputError

EXAMPLES = """examples:
  python -m truck_bridge.emulator --vehicle trucksim --interface loopback --channel demo
  python -m truck_bridge.emulator --vehicle volvo --interface socketcan --channel vcan0 --grade road.csv
  python -m truck_bridge.emulator --vehicle trucksim --driver 10:brake_pedal=40,12:brake_pedal=0
"""


FASTEST, STEEPEST = 50.0, 0.5  # m/s; rise/run


class _Parser(argparse.ArgumentParser):
    """Raises InputError instead of printing its usage."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; --help shows what it takes")


def parser() -> argparse.ArgumentParser:
    """The options."""
    p = _Parser(
        prog="python -m truck_bridge.emulator",
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
    p.add_argument("--duration", type=float, default=math.inf, help="stop after so many seconds")
    return p


def road(text: str) -> Callable[[float], float]:
    """Slope over distance, from a number or a CSV file. Raises InputError where it is neither."""
    try:
        slope = float(text)
    except ValueError:
        return _road_of_file(text)
    _within(f"--grade {text}", slope, -STEEPEST, STEEPEST)
    return lambda distance: slope


def _road_of_file(text: str) -> Callable[[float], float]:
    try:
        with Path(text).open(newline="") as file:
            rows = [(float(row["distance"]), float(row["grade"])) for row in csv.DictReader(file)]
    except OSError as error:
        raise InputError(f"--grade {text}: {error.strerror}; give a number or a CSV file") from None
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{text}: needs numeric columns distance and grade ({error})") from None
    if not rows:
        raise InputError(f"{text} holds no rows")
    for _, slope in rows:
        _within(f"{text}: grade", slope, -STEEPEST, STEEPEST)
    distance, grade = np.array(rows).T
    if not np.all(np.diff(distance) > 0):
        raise InputError(f"{text}: distance must be numbers that grow from row to row")
    return lambda at: float(np.interp(at, distance, grade))


def _within(what: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise InputError(f"{what} must be a number from {low:g} to {high:g}, not {value:g}")


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
    _within("--speed", arguments.speed, 0.0, FASTEST)
    _within("--duration", arguments.duration, 0.0, math.inf)
    truck = load(arguments.truck or vehicle.truck)
    bus = open_bus(arguments.interface, arguments.channel)
    with bus:
        _drive(arguments, EcuEmulator(vehicle, bus, truck=truck, grade=slope, speed=arguments.speed), actions)


def _drive(
    arguments: argparse.Namespace, emulator: EcuEmulator, actions: list[tuple[float, str, float]]
) -> None:
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    print(f"ECU emulator: {emulator.vehicle.name} on {arguments.interface} {arguments.channel}", flush=True)
    start = time.monotonic()
    while not stop.is_set() and (now := time.monotonic()) - start <= arguments.duration:
        while actions and now - start >= actions[0][0]:
            _, key, value = actions.pop(0)
            setattr(emulator.driver, key, value)
        emulator.step(now)
        stop.wait(0.002)


def main() -> None:
    """Entry point: bad input is one line and exit code 2."""
    try:
        run(parser().parse_args())
    except (InputError, ModelInputError) as error:
        print(f"emulator: {error}", file=sys.stderr)
        sys.exit(2)
