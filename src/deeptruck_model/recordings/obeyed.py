"""Replaces commands that were not obeyed, because control was not engaged, by the driver's demand.

The bridge reports on /truck/engaged whether it passes commands on (1), the driver drives (0), or it brakes,
holds or fades by itself (-1), where no command is known. Each command carries the state known to the
controller. In a run with --no-load, which /diagnostics reports, no command is passed on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import islice

import numpy as np

from deeptruck_core.account import Account, moment
from deeptruck_model.recordings.bag_source import BagSource
from deeptruck_model.recordings.interpolate import GAP_S, Series, held
from deeptruck_model.recordings.layout import Walker
from deeptruck_model.recordings.topic_map import Source

COMMAND, DIAGNOSTICS = "/truck/command", "/diagnostics"
ENGAGED = "engaged"
_OF_THE_BRIDGE, _OF_THE_COMMAND = "engaged", "engaged_by_command"  # no channels: see HELPERS
DRIVER = {"engine_command": "driver_engine_demand", "brake_command": "driver_brake_demand"}
_SOURCES = {
    _OF_THE_BRIDGE: Source("/truck/engaged", f"position[name={ENGAGED}]"),
    _OF_THE_COMMAND: Source(COMMAND, f"position[name={ENGAGED}]"),
}
HELPERS = (*_SOURCES, *DRIVER.values())  # read with the commands, and no channels of a recording
_LOOKED_AT = 200  # messages of /diagnostics in which the bridge must have spoken
_NOTHING = Series(np.zeros(0), np.zeros(0))


def with_engaged(sources: Mapping[str, Source]) -> dict[str, Source]:
    """The sources; commands among them also with their engaged bits and the driver's demands in their
    units."""
    commands = [c for c in DRIVER if c in sources and sources[c].topic == COMMAND]
    demands = {
        DRIVER[c]: replace(sources[c], topic="/truck/status", field=f"position[name={DRIVER[c]}]")
        for c in commands
    }
    return {**sources, **demands, **(_SOURCES if commands else {})}


def no_load(bag: BagSource) -> bool:
    """Whether the bridge reported that it sends nothing."""
    kind, walker = bag.topics.get(DIAGNOSTICS, ""), Walker(bag.definitions, ros1=bag.ros1, bag=str(bag.path))
    if COMMAND not in bag.topics or kind not in walker.definitions:
        return False
    for _, _, message in islice(bag.messages({DIAGNOSTICS}), _LOOKED_AT):
        texts = walker.walk(kind, message).texts
        for path, found in texts.items():
            if path.endswith(".key") and found == ["no_load"]:
                return texts.get(f"{path.removesuffix('key')}value") == ["True"]
    return False


class Obedience:
    """Replaces samples of commands that were not obeyed by the driver's demand."""

    def __init__(self, sources: Mapping[str, Source], account: Account, *, no_load: bool) -> None:
        self.known = False  # whether it was recorded which commands were obeyed
        self._commands = [c for c in DRIVER if c in sources and sources[c].topic == COMMAND]
        self._account, self._no_load = account, no_load
        self._taken = dict.fromkeys(self._commands, 0)  # its samples that took a command's place

    def resolved(self, series: dict[str, Series]) -> dict[str, Series]:
        """The channels: a command has its own samples while control was engaged and the driver's demand
        otherwise; NaN follows a command if no demand was recorded."""
        channels = {name: one for name, one in series.items() if name not in HELPERS}
        bits = self._engaged(series)
        if self.known:
            for command in self._commands:
                driver = series.get(DRIVER[command], _NOTHING)
                channels[command] = self._merged(command, series.get(command, _NOTHING), driver, bits)
        return channels

    def _engaged(self, series: dict[str, Series]) -> Series:
        """The engaged bits: those of the bridge if recorded."""
        bridge, command = (series.get(name, _NOTHING).valid for name in (_OF_THE_BRIDGE, _OF_THE_COMMAND))
        bits = bridge if len(bridge.time) else command
        self.known = bool(len(bits.time))
        return Series(bits.time, np.zeros(len(bits.time))) if self._no_load else bits

    def _merged(self, command: str, given: Series, driver: Series, bits: Series) -> Series:
        engaged = held(bits.time, bits.values, given.time, GAP_S)[0]
        obeyed = engaged == 1.0
        driving = held(bits.time, bits.values, driver.time, GAP_S)[0] == 0.0
        ends = (bits.values[:-1] == 1.0) & (bits.values[1:] != 1.0)
        if not np.isnan(driver.values).all():
            ends &= bits.values[1:] != 0.0  # the driver's next sample ends the command
        ends = bits.time[1:][ends]
        time = np.concatenate([given.time[obeyed], driver.time[driving], ends])
        values = np.concatenate([given.values[obeyed], driver.values[driving], np.full(len(ends), np.nan)])
        order = np.argsort(time, kind="stable")
        self._taken[command] = int((~np.isnan(driver.values[driving])).sum())
        tally = self._account.channel(command)
        tally.read += int((~np.isnan(values)).sum())
        for reason, these in (
            ("given while control was not engaged, so that they drove nothing", ~obeyed & ~np.isnan(engaged)),
            ("given while it was not recorded whether control was engaged", np.isnan(engaged)),
        ):
            aside = these & ~np.isnan(given.values)
            if aside.any():
                tally.read += int(aside.sum())
                tally.set_aside(reason, f"at {moment(given.time[int(np.argmax(aside))])}", int(aside.sum()))
        return Series(time[order], values[order])

    def remarks(self) -> list[str]:
        """One line for each command, on its replacement while it was not obeyed."""
        lines = ["the bridge sent nothing (--no-load): no command was obeyed"] if self._no_load else []
        for command, taken in self._taken.items():
            if taken:
                lines.append(f"{command}: the driver's demand while control was not engaged, {taken} samples")
            elif self._account.channel(command).aside:
                lines.append(
                    f"{command}: no driver's demand is recorded ({DRIVER[command]} on /truck/status) to take "
                    "the place of commands that drove nothing"
                )
        return lines
