"""Checks before a run starts, from names, manifests and parameters; all errors are reported together."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_core.terminal import console
from deeptruck_model import checks
from deeptruck_nodes import parameters

T = TypeVar("T")
Sections = dict[str, dict[str, Any]]


@dataclass
class Misfits:
    """Collects the errors of a run before anything is started or written."""

    found: list[str] = field(default_factory=list)

    def of(self, look: Callable[[], T]) -> T | None:
        """The result of `look`; None if it raises InputError, which is collected."""
        try:
            return look()
        except InputError as error:
            self.found.append(str(error))
            return None

    def of_node(self, sections: Sections, name: str, look: Callable[[dict[str, Any]], object]) -> None:
        """Check a node's parameters with `look`, if the node is present and its parameters are within their
        ranges."""
        if name in sections and not parameters.misfits(name, sections[name]):
            self.of(lambda: look(parameters.checked(name, sections[name])))


def ros_is_installed() -> None:
    """Raises InputError if the ROS client library is missing, as in an installation without the extra
    `ros`."""
    if importlib.util.find_spec("rclpy") is None:
        missing = console.MISSING.format(name="rclpy", extra="ros")
        raise InputError(f"{missing}, or source a ROS 2 Jazzy")


def policy_fits(policy: str, truck: TruckInterface | None) -> None:
    """Raises InputError if the policy does not exist or commands another truck."""
    from deeptruck_cacc import load_policy

    load_policy(policy, truck)


def leader_is_known(profile: str) -> None:
    """Raises InputError if the text describes no leader."""
    from deeptruck_nodes import leaders

    leaders.parse(profile)


def road_is_known(text: str) -> None:
    """Raises InputError if the text describes no road."""
    from deeptruck_nodes import roads

    roads.parse(text)


def rate_fits(rate: float, dt: float) -> None:
    """Raises InputError if a publishing rate, Hz, is no multiple of the simulator's, 1 / `dt`."""
    from deeptruck_nodes.plant import ticks_a_step

    ticks_a_step(rate, dt)


def bus_opens(interface: str, channel: str) -> None:
    """Raises InputError if a CAN bus cannot be opened."""
    from truck_bridge.bus import open_bus

    open_bus(interface, channel).shutdown()


def bag_is_playable(bag: Path, topics: list[str]) -> None:
    """Raises InputError if there is no bag, or it lacks these topics; an unfinished bag is repaired."""
    if bag.is_dir() and any(bag.glob("*.mcap")) and not (bag / checks.METADATA).exists():
        return
    held = checks.bag(bag).messages
    if held is None:
        return
    for name in topics:
        if name not in held:
            raise InputError(f"{bag} has no topic {name}; it has: {', '.join(sorted(held))}")


def leader_stays(profile: str, record: Path | None) -> None:
    """Raises InputError if the recording would overwrite the bag that the leader follows."""
    kind, _, rest = profile.partition(":")
    given = dict(part.partition("=")[::2] for part in rest.split(","))
    if (
        kind == "recorded"
        and record is not None
        and record.resolve() == Path(given.get("path", "")).resolve()
    ):
        raise InputError(f"{record} is the drive of the leader; choose another --record")


def elsewhere(bag: Path, record: Path | None) -> None:
    """Raises InputError if the recording would overwrite the bag that is played, or lie in it."""
    if record is not None and record.resolve() == bag.resolve():
        raise InputError(f"{record} is the bag that is played; choose another --record")
    if record is not None and bag.resolve() in record.resolve().parents:
        raise InputError(f"{record} lies in the bag that is played; choose another --record")
