"""One truck as used by bridge and ECU emulator: the messages it sends and obeys, and the core's tables."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from truck_bridge.j1939 import checksums
from truck_bridge.j1939.codec import Codec, Layout
from truck_bridge.j1939.diagnostics import Code
from truck_bridge.safety import Axis, Table


@dataclass(frozen=True)
class Transmitted:
    """One command message: the format of its frame, and its timing."""

    axis: Axis
    layout: Layout
    demand: str
    active: dict[str, float]
    release: dict[str, float]
    phase_s: float

    def frame(self, demand: float, count: int) -> bytes:
        """Eight bytes for a demand; for NaN, the frame that hands control back."""
        if math.isnan(demand):
            data = self.layout.encode(self.release)
        else:
            data = self.layout.encode({**self.active, self.demand: demand})
        return checksums.sign(self.axis.check, self.axis.can_id, data, count)


@dataclass(frozen=True)
class Blocking:
    """Faults that forbid control, whichever controller reports them by DM1."""

    lamps: frozenset[str] = frozenset({"red_stop_lamp"})
    codes: tuple[tuple[int, int | None], ...] = ()  # SPN, and FMI where only that one counts
    listen_s: float = 0.0  # how long a bus must have been listened to before silence means that there is none

    def holds(self, what: Code | str) -> bool:
        """Whether a lamp or a code, in any of its readings, forbids control."""
        if isinstance(what, str):
            return what in self.lamps
        return any(spn in what.readings and fmi in (None, what.fmi) for spn, fmi in self.codes)


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """One truck as used by bridge and ECU emulator."""

    name: str
    truck: str  # what the emulator drives, for deeptruck_model.simulators.load
    interface: dict[str, Any]  # name, engine_unit, brake_unit, grade, fuel
    codec: Codec
    addresses: dict[str, int]
    address: int  # of the bridge
    identity: int
    reference_torque: dict[str, float]
    envelope: dict[str, tuple[float, float]]  # engine and brake commands, interface units, that are sane
    transmitted: dict[str, Transmitted]  # by axis: engine, retarder, brake
    table: Table
    blocking: Blocking
    set_speed: float  # m/s, faster than which nobody is followed
    # by message of the table: who sends it, and the table's name of each of its signals
    named: dict[str, list[tuple[int, dict[str, str]]]]

    def demands(self, engine: float, brake: float) -> dict[str, float]:
        """Demands by axis from the truck interface's engine and brake command.

        A negative engine command goes to the retarder if there is one. Inside the permitted envelope a demand
        is limited to the actuator's range; a command outside it, or NaN, becomes NaN, which the core refuses.
        """
        found = {"engine": engine * self._percent, "brake": self._brake_sign * brake}
        if "retarder" in self.transmitted:
            found["engine"] = max(engine, 0.0) * self._percent
            found["retarder"] = min(engine, 0.0) * self._percent * self._retarder_gain
        for axis, message in self.transmitted.items():
            limits = message.axis.limits
            found[axis] = min(max(found[axis], min(limits.low)), max(limits.high))
        sane = self._sane("engine", engine), self._sane("brake", brake)
        return found if all(sane) else dict.fromkeys(found, math.nan)

    def driving_off(self) -> Vehicle:
        """The vehicle that drives off after a leader, however long it stood, without asking its driver."""
        timing = replace(self.table.timing, stands=math.inf)
        return replace(self, table=replace(self.table, timing=timing))

    def without_actuators(self) -> Vehicle:
        """The vehicle whose actuators get nothing of ours, so that what they do is nothing against us."""
        table = self.table
        axes = tuple(replace(axis, holds_beyond=math.inf) for axis in table.axes)
        obeyed = tuple(replace(one, axis="") for one in table.obeyed)
        return replace(self, table=replace(table, axes=axes, obeyed=obeyed, followed=()))

    @property
    def brake_limit(self) -> float:
        """The largest brake command, interface unit, that the envelope lets pass at every speed."""
        limits = self.transmitted["brake"].axis.limits
        most = (max(abs(low), abs(high)) for low, high in zip(limits.low, limits.high, strict=True))
        return min(most)

    @property
    def brake_rate(self) -> float:
        """How fast the brake command that leaves may rise, interface unit/s."""
        return self.transmitted["brake"].axis.limits.rate

    def commands(self, demands: dict[str, float]) -> tuple[float, float]:
        """Inverse of `demands`: engine and brake command in the truck's interface."""
        engine = demands["engine"] + demands.get("retarder", 0.0) / self._retarder_gain
        return engine / self._percent, self._brake_sign * demands["brake"]

    def driver_demands(self, signals: Mapping[str, float]) -> dict[str, float]:
        """The driver's demands as engine and brake command, for recordings of the commands that drove the
        truck.

        The engine command is the demanded torque, or the accelerator pedal if no torque is sent and commands
        are in percent; the brake command is the pedal. A pressed brake pedal gives NaN if brake commands are
        not in percent, because the corresponding deceleration or pressure is not on the bus.
        """
        found: dict[str, float] = {}
        unit = self.interface["engine_unit"]
        torque = signals.get("driver_demand_torque", math.nan)
        if unit in ("percent", "N m") and not math.isnan(torque):
            found["driver_engine_demand"] = torque / self._percent
        elif unit == "percent" and "accelerator_pedal" in signals:
            found["driver_engine_demand"] = signals["accelerator_pedal"]
        if "brake_pedal" in signals:
            pedal = signals["brake_pedal"]
            known = self.interface["brake_unit"] == "percent" or pedal == 0.0
            found["driver_brake_demand"] = pedal if known else math.nan
        return found

    @property
    def _percent(self) -> float:
        """Percent of the reference torque for one unit of engine command."""
        return 100 / self.reference_torque["engine"] if self.interface["engine_unit"] == "N m" else 1.0

    @property
    def _retarder_gain(self) -> float:
        return self.reference_torque["engine"] / self.reference_torque["retarder"]

    @property
    def _brake_sign(self) -> float:
        """-1 where the demand that brakes is an acceleration, as XBR's, below 0."""
        return -1.0 if max(self.transmitted["brake"].axis.limits.high) <= 0.0 else 1.0

    def _sane(self, command: str, value: float) -> bool:
        low, high = self.envelope[command]
        return low <= value <= high
