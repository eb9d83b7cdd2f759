"""The truck's signals as deeptruck's channels in SI."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable

from truck_bridge.channels import CARRIERS, DEMANDS, Carrier, converter
from truck_bridge.safety import Hearing
from truck_bridge.vehicles import Vehicle

FRESH_S = 0.5  # a signal not received for so long is NaN (slow ones: three of their periods)


class ReceivedSignals:
    """Latest valid value of each channel, in SI, and of the driver's demands, in percent.

    The vehicle's table and the safety core's own class decide which frame carries a channel and whether its
    value is valid, so that controller and core always use the same frame.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._codec, self._named = vehicle.codec, vehicle.named
        self._hearing = Hearing(vehicle.table, Counter())
        torque = vehicle.reference_torque["engine"]
        self._carriers: dict[str, list[tuple[Carrier, Callable[[float], float]]]] = {}
        taken: set[str] = set() if vehicle.interface["grade"] else {"grade"}
        for carrier in sorted((*CARRIERS, *DEMANDS), key=self._preference):
            if carrier.channel in taken:
                continue  # a second wheel speed is for the safety core
            taken.add(carrier.channel)
            entry = (carrier, converter(carrier, vehicle.codec, torque))
            self._carriers.setdefault(carrier.message, []).append(entry)
        self._sources = set(vehicle.addresses.values())
        self._values: dict[str, tuple[float, float, float]] = {}  # value, time, lifetime
        self._speakers: dict[str, int] = {}  # who said a channel's last valid value
        self._less = {carrier.less: 0.0 for carrier in CARRIERS if carrier.less}
        self._speeds: tuple[float, float] | None = None

    def hear(self, can_id: int, data: bytes, now: float) -> None:
        """Process a frame of the truck that may carry channels."""
        if can_id & 0xFF not in self._sources:
            return
        self._hearing.take(can_id, data, now)
        decoded = self._codec.decode(can_id, data)
        if decoded is None:
            return
        named = self._named.get(decoded.name)
        for message, signal in self._less:
            if message == decoded.name and not math.isnan(decoded.values[signal]):
                self._less[message, signal] = decoded.values[signal]
        for carrier, convert in self._carriers.get(decoded.name, ()):
            less = self._less[carrier.less] if carrier.less else 0.0
            value = convert(decoded.values[carrier.signal] - less)
            if named is not None:
                source, names = min(named, key=lambda one: self._rank(carrier, one[1]))
                if source != decoded.source:
                    continue
                if carrier.signal in names and names[carrier.signal] not in self._hearing.accepted:
                    value = math.nan
            elif self._is_idle_talk(carrier.channel, value, decoded.source):
                continue
            period = self._codec[carrier.message].period_s or 0.0
            self._values[carrier.channel] = (value, now, max(FRESH_S, 3 * period))
            if carrier.channel == "speed":
                self._differentiate(value, now, period)

    def _preference(self, carrier: Carrier) -> int:
        """Sort key that prefers the message from which the core takes the channel."""
        named = self._named.get(carrier.message, ())
        return min((self._rank(carrier, names) for _, names in named), default=2) > 0

    @staticmethod
    def _rank(carrier: Carrier, names: dict[str, str]) -> int:
        """Rank of the nodes that send a message: first those whose signal the core uses for the channel, then
        those with the signal under another name."""
        return 2 - (carrier.signal in names) - (names.get(carrier.signal) == carrier.channel)

    def _is_idle_talk(self, channel: str, value: float, source: int) -> bool:
        """Whether an invalid value is irrelevant: several controllers send the same message, each with its
        own signals, and one that has never sent a channel validly does not make it invalid."""
        if not math.isnan(value):
            return self._speakers.setdefault(channel, source) != source
        return self._speakers.get(channel, source) != source

    def _differentiate(self, speed: float, now: float, period: float) -> None:
        """Acceleration as the mean over one message period, as y is defined."""
        if self._speeds is not None:
            elapsed = now - self._speeds[1]
            if abs(elapsed - period) < 0.5 * period:
                elapsed = period  # arrival jitters, sending does not
            if elapsed > 0:
                self._values["acceleration"] = ((speed - self._speeds[0]) / elapsed, now, FRESH_S)
        self._speeds = (speed, now)

    def received_at(self, channel: str) -> float:
        """When the newest value of a channel was received."""
        return self._values.get(channel, (math.nan, -math.inf, 0.0))[1]

    def at(self, now: float) -> dict[str, float]:
        """All channels; outdated ones are NaN."""
        return {
            channel: value if now - received <= lifetime else math.nan
            for channel, (value, received, lifetime) in self._values.items()
        }
