"""What the truck says, as deeptruck's channels in SI."""

from __future__ import annotations

import math
from collections.abc import Callable

from truck_bridge.channels import CARRIERS, DEMANDS, Carrier, converter
from truck_bridge.vehicles import Vehicle

FRESH_S = 0.5  # a signal not received for so long is NaN (slow ones: three of their periods)


class ReceivedSignals:
    """Latest valid value of each channel, in SI, and of the driver's demands, in percent."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._codec = vehicle.codec
        torque = vehicle.reference_torque["engine"]
        self._carriers: dict[str, list[tuple[Carrier, Callable[[float], float]]]] = {}
        taken: set[str] = set() if vehicle.interface["grade"] else {"grade"}
        taken.add("acceleration")  # VDC2 counts in 0.1 m/s^2; the wheel speed's difference is finer
        for carrier in (*CARRIERS, *DEMANDS):
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
        """Take the channels a frame of the truck carries."""
        if can_id & 0xFF not in self._sources:
            return
        decoded = self._codec.decode(can_id, data)
        if decoded is None:
            return
        for message, signal in self._less:
            if message == decoded.name and not math.isnan(decoded.values[signal]):
                self._less[message, signal] = decoded.values[signal]
        for carrier, convert in self._carriers.get(decoded.name, ()):
            less = self._less[carrier.less] if carrier.less else 0.0
            value = convert(decoded.values[carrier.signal] - less)
            if self._is_idle_talk(carrier.channel, value, decoded.source):
                continue
            period = self._codec[carrier.message].period_s or 0.0
            self._values[carrier.channel] = (value, now, max(FRESH_S, 3 * period))
            if carrier.channel == "speed":
                self._differentiate(value, now, period)

    def _is_idle_talk(self, channel: str, value: float, source: int) -> bool:
        """Several controllers send the same message, each with its own signals: who has never said a channel
        validly does not make it invalid.
        """
        if not math.isnan(value):
            return self._speakers.setdefault(channel, source) != source
        return self._speakers.get(channel, source) != source

    def _differentiate(self, speed: float, now: float, period: float) -> None:
        """Acceleration as the mean over one message period, which is the definition behind y."""
        if self._speeds is not None:
            elapsed = now - self._speeds[1]
            if abs(elapsed - period) < 0.5 * period:
                elapsed = period  # arrival jitters, sending does not
            if elapsed > 0:
                self._values["acceleration"] = ((speed - self._speeds[0]) / elapsed, now, FRESH_S)
        self._speeds = (speed, now)

    def received_at(self, channel: str) -> float:
        """When the newest value of a channel came."""
        return self._values.get(channel, (math.nan, -math.inf, 0.0))[1]

    def at(self, now: float) -> dict[str, float]:
        """All channels; what is too old is NaN."""
        return {
            channel: value if now - received <= lifetime else math.nan
            for channel, (value, received, lifetime) in self._values.items()
        }
