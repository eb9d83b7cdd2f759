"""Converts commands to CAN frames and CAN frames to signals, through the safety core. Time is an argument.

Use by a node:

    vehicle = vehicles.load("trucksim")
    bus = can.Bus(interface="loopback", channel="demo")
    bridge = Bridge(vehicle, bus)             # silent
    bridge.arm(now)                           # lifecycle 'active': claims the address, hears, sends no demand
    bridge.command(engine, brake, now, engaged=bridge.engaged)     # each control step; the heartbeat
    why_not = bridge.engage(now, person=True, lead_vehicle=True)      # () when granted
    signals = bridge.poll(now)                # every 5 ms or faster, or let `run` do it in a thread
    bridge.release(now); bridge.disarm(now)   # hand back in order; lifecycle 'inactive': silent
"""

from __future__ import annotations

import contextlib
import math
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import can

from truck_bridge.bus_connection import BusConnection
from truck_bridge.fault_watch import FaultWatch
from truck_bridge.j1939 import diagnostics
from truck_bridge.j1939.address_claim import AddressClaim, name
from truck_bridge.received_signals import ReceivedSignals
from truck_bridge.safety import Safety, State
from truck_bridge.vehicles import Transmitted, Vehicle

TAKE_OVER = (0x7F000, 31)  # SPN that a maker may give a meaning, "condition exists": of the DM1 that we send
WARNS_M_S2 = 3.0  # needed braking from which the driver is warned of a collision
WARNS_S = 1.0  # for which a warning stays, at least: the period of a DM1
COLLISION = "Collision warning: brake"


@dataclass(frozen=True)
class Status:
    """State that the node publishes in /diagnostics."""

    state: str
    engaged: bool
    acts_alone: bool  # brakes, holds or fades by itself: neither controller nor driver commands
    address_claimed: bool
    reason: str
    warning: str
    refusals: dict[str, int]
    losses: dict[str, int]
    frames_sent: int
    frames_received: int
    no_load: bool
    would_send: dict[int, bytes] = field(default_factory=dict)  # no-load mode: last frame by identifier
    faults: tuple[str, ...] = ()  # that the truck's controllers report, active now


class Bridge:
    """One truck on one bus; the module's docstring shows its use. With `no_load` it sends nothing and only
    shows what it would send."""

    def __init__(
        self,
        vehicle: Vehicle,
        bus: can.BusABC,
        *,
        no_load: bool = False,
        reopen: Callable[[], can.BusABC] | None = None,
    ) -> None:
        self.vehicle = vehicle
        self.safety = Safety((vehicle.without_actuators() if no_load else vehicle).table)
        self._connection = BusConnection(bus, AddressClaim(name(vehicle.identity), vehicle.address), reopen)
        self._no_load = no_load
        self._lock = threading.RLock()
        self._signals = ReceivedSignals(vehicle)
        self._faults = FaultWatch(vehicle)
        self._dm1 = vehicle.table.always[-1]
        self._due: dict[str, float] = {}
        self._counts = dict.fromkeys(vehicle.transmitted, 0)
        self._now = -math.inf
        self._would_send: dict[int, bytes] = {}
        self._warned, self._warn_at = "", -math.inf  # the lamp that our DM1 lit last, and when it is due
        self._needed_at = -math.inf  # when a command needed more than WARNS_M_S2 last

    # -- the controller's side

    def arm(self, now: float) -> None:
        """Claim the address and start to listen; no demand leaves before `engage`."""
        with self._lock:
            self.safety.arm(now)
            self._connection.start(now)
            self._due = {axis: now + message.phase_s for axis, message in self.vehicle.transmitted.items()}

    def disarm(self, now: float) -> None:
        """Silent at once. `release` first and poll for 0.2 s to hand back in order."""
        with self._lock:
            self.safety.disarm()
            self._connection.stop()

    def command(
        self,
        engine: float,
        brake: float,
        now: float,
        *,
        engaged: bool,
        gap: tuple[float, float] = (math.nan, math.nan),
        hold_brake: float = math.nan,
        hold_s: float = math.inf,
        needed_braking: float = math.nan,
    ) -> bool:
        """Engine and brake command in the truck interface's units; also the controller's heartbeat.

        `gap`: m to the vehicle ahead, and needed behind it, for engaging. `hold_brake`: the brake command
        that the hazard ahead needs, NaN for none, assumed for `hold_s` from now: it goes on if control is
        lost meanwhile. `needed_braking`: m/s^2; beyond WARNS_M_S2 the driver is warned.

        `engaged` is the bridge's engaged bit as the controller received it last. If it is still False a
        controller's time-out after control was engaged, the controller counts as lost and control fades.
        Returns False for a command that is refused because it is NaN or outside the envelope; control then
        fades too.
        """
        with self._lock:
            if needed_braking > WARNS_M_S2:
                self._needed_at = now
            demands, needs = self.vehicle.demands(engine, brake), self.vehicle.demands(0.0, hold_brake)
            return self.safety.command(demands, engaged, now, gap, needs, hold_s)

    def engage(self, now: float, *, person: bool, lead_vehicle: bool) -> tuple[str, ...]:
        """Take control at a person's request. Returns the reasons why not; empty when engaged."""
        with self._lock:
            faults = self._faults.obstacles(now)
            if faults:
                self.safety.refusals["engagement"] += 1
                return (*self.safety.obstacles(now, lead_vehicle), *faults)
            return self.safety.engage(now, person, lead_vehicle)

    def obstacles(self, now: float, *, lead_vehicle: bool) -> tuple[str, ...]:
        """Reasons why control cannot be given now, for display only: nothing is requested or counted."""
        with self._lock:
            return (*self.safety.obstacles(now, lead_vehicle), *self._faults.obstacles(now))

    def release(self, now: float, reason: str = "released") -> None:
        """Hand back at once, in order."""
        with self._lock:
            self.safety.release(now, reason)

    @property
    def engaged(self) -> bool:
        """Whether control is engaged; the controller gets this bit and returns it with each command."""
        with self._lock:
            return self.safety.state is State.ENGAGED

    @property
    def _warns_of_collision(self) -> bool:
        """Whether what is ahead needs hard braking while control is engaged."""
        return self.safety.state is State.ENGAGED and 0 <= self._now - self._needed_at <= WARNS_S

    @property
    def status(self) -> Status:
        """State, warnings and counters."""
        with self._lock:
            safety = self.safety
            return Status(
                safety.state.value,
                safety.state is State.ENGAGED,
                safety.controls_allowed and safety.state is not State.ENGAGED,
                self._connection.up(self._now),
                safety.reason,
                safety.warning or (COLLISION if self._warns_of_collision else ""),
                dict(safety.refusals),
                dict(safety.losses),
                self._connection.sent,
                self._connection.received,
                self._no_load,
                dict(self._would_send),
                tuple(self._faults.active(self._now)),
            )

    # -- the bus's side

    def poll(self, now: float) -> dict[str, float]:
        """Process received frames and send frames that are due. Returns channels in SI by name; NaN if
        invalid or not fresh."""
        with self._lock:
            if now < self._now:
                self._rewind(self._now - now)
            self._now = now
            self._faults.listen(now)
            self._hear(now)
            self.safety.tick(now)
            self._keep_link(now)
            self._warn(now)
            for axis, message in self.vehicle.transmitted.items():
                if now >= self._due.get(axis, math.inf):
                    self._transmit(axis, message, now)
            return self._signals.at(now) | self._faults.channels(now)

    def received_at(self, channel: str) -> float:
        """When the newest value of a channel was received, monotonic s; -inf before the first."""
        with self._lock:
            return self._signals.received_at(channel)

    def run(
        self,
        stop: threading.Event,
        on_signals: Callable[[dict[str, float], float], None] | None = None,
        *,
        priority: int = 0,
    ) -> None:
        """Poll in real time until stopped, then hand back in order and stop sending.

        `priority` above 0 requests SCHED_FIFO for this thread, if the user has the right (see the docs).
        """
        if priority > 0:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        while not stop.is_set():
            now = time.monotonic()
            signals = self.poll(now)
            if on_signals is not None:
                on_signals(signals, now)
            self._connection.wait(min(min(self._due.values()) - time.monotonic(), 0.02))
        while self.safety.controls_allowed or self.safety.state is State.RELEASING:
            self.release(time.monotonic(), "stopped")  # braking for a hazard goes on, until the truck stands
            self.poll(time.monotonic())
            self._connection.wait(0.005)
        self.disarm(time.monotonic())

    def _rewind(self, back: float) -> None:
        """Correct for a clock that went back: shift the pending times back too, and forget all received
        signals."""
        self._due = {axis: due - back for axis, due in self._due.items()}
        self._warn_at, self._needed_at = self._warn_at - back, self._needed_at - back
        self._connection.rewind(back)
        self._signals, self._faults = ReceivedSignals(self.vehicle), FaultWatch(self.vehicle)

    def _hear(self, now: float) -> None:
        for can_id, data in self._connection.hear(now):
            self.safety.rx_hook(can_id, data, now)
            self._signals.hear(can_id, data, now)
            if self._faults.hear(can_id, data, now):
                for fault in self._faults.blocking(now):
                    self.safety.fade(now, fault)
        if self._connection.lost:
            self.safety.link(False)

    def _keep_link(self, now: float) -> None:
        """Retry a lost bus; after its return the address is claimed again and control stays off."""
        if self.safety.state is State.SILENT:
            return
        for can_id, data in self._connection.claims(now):
            if self.safety.tx_hook(can_id, data, now):
                self._send(can_id, data, now)
        on_any_address = self.safety.state is State.STOPPING  # whose braking matters more than the address
        self.safety.link(self._connection.up(now) or (on_any_address and not self._connection.lost))

    def _warn(self, now: float) -> None:
        """Say by DM1 that the driver must act: each second, at once on a change, and its end."""
        urgent = self.safety.state is State.STOPPING or self._warns_of_collision
        lamp = "red_stop_lamp" if urgent else "amber_warning_lamp" if self.safety.warning else ""
        due = lamp != self._warned or (lamp and now >= self._warn_at)
        data = diagnostics.frame(*TAKE_OVER, lamp)
        speaks = self.safety.linked and self.safety.state is not State.SILENT
        if due and speaks and self.safety.tx_hook(self._dm1, data, now):
            self._warned, self._warn_at = lamp, now + 1.0
            self._send(self._dm1, data, now)

    def _transmit(self, axis: str, message: Transmitted, now: float) -> None:
        period = message.axis.period_s
        self._due[axis] = max(self._due[axis] + period, now + 0.5 * period)
        demand = self.safety.plan(message.axis, now)
        if demand is None:
            return
        data = message.frame(demand, self._counts[axis])
        if self.safety.tx_hook(message.axis.can_id, data, now):
            self._counts[axis] += 1
            self._send(message.axis.can_id, data, now)

    def _send(self, can_id: int, data: bytes, now: float) -> None:
        if self._no_load:
            self._would_send[can_id] = data
        elif not self._connection.send(can_id, data, now):
            self.safety.link(False)
