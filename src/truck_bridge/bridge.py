"""Commands to CAN frames and CAN frames to signals, with the safety core between. Time is an argument.

For the node that wraps it:

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

from truck_bridge.j1939.address_claim import AddressClaim, name
from truck_bridge.safety import Safety, State
from truck_bridge.signals_in import Signals
from truck_bridge.vehicles import Transmitted, Vehicle

RETRY_S = 1.0  # between attempts to bring a lost bus back
BURST = 2000  # frames taken in one poll, so that a flood cannot starve the sender
_BUS_OFF, _RESTARTED = 0x40, 0x100  # SocketCAN error classes


@dataclass(frozen=True)
class Status:
    """What the node publishes in /diagnostics."""

    state: str
    engaged: bool
    armed: bool
    address_claimed: bool
    reason: str
    warning: str
    refusals: dict[str, int]
    losses: dict[str, int]
    frames_sent: int
    frames_received: int
    no_load: bool
    would_send: dict[int, bytes] = field(default_factory=dict)  # no-load mode: last frame by identifier


class Bridge:
    """One truck on one bus. See the module for its use; `no_load` shows what it would send and sends
    nothing.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        bus: can.BusABC,
        *,
        no_load: bool = False,
        reopen: Callable[[], can.BusABC] | None = None,
    ) -> None:
        self.vehicle = vehicle
        self.safety = Safety(vehicle.table)
        self._bus: can.BusABC | None = bus
        self._no_load = no_load
        self._reopen = reopen
        self._claim = AddressClaim(name(vehicle.identity), vehicle.address)
        self._lock = threading.RLock()
        self._inbox: list[can.Message] = []
        self._signals = Signals(vehicle)
        self._due: dict[str, float] = {}
        self._counts = dict.fromkeys(vehicle.transmitted, 0)
        self._retry_at: float | None = None  # when to try a lost bus again
        self._sent = self._received = 0
        self._now = -math.inf
        self._would_send: dict[int, bytes] = {}

    # -- the controller's side

    def arm(self, now: float) -> None:
        """Claim the address and start to listen; no demand leaves before `engage`."""
        with self._lock:
            self.safety.arm(now)
            self._claim.start(now)
            self._due = {axis: now + message.phase_s for axis, message in self.vehicle.transmitted.items()}

    def disarm(self, now: float) -> None:
        """Silent at once. `release` first and poll for 0.2 s to hand back in order."""
        with self._lock:
            self.safety.disarm()
            self._claim.stop()

    def command(self, engine: float, brake: float, now: float, *, engaged: bool) -> bool:
        """Engine and brake command in the truck interface's units; also the controller's heartbeat.

        `engaged` is the bit the controller was told last; one that does not know it for long is lost, and
        control fades. False when the command was refused, NaN or outside the envelope; control then fades.
        """
        with self._lock:
            return self.safety.command(self.vehicle.demands(engine, brake), engaged, now)

    def engage(self, now: float, *, person: bool, lead_vehicle: bool) -> tuple[str, ...]:
        """Take control for a person who asked. Returns the reasons why not; empty when engaged."""
        with self._lock:
            return self.safety.engage(now, person, lead_vehicle)

    def release(self, now: float, reason: str = "released") -> None:
        """Hand back at once, in order."""
        with self._lock:
            self.safety.release(now, reason)

    def fade(self, now: float, reason: str) -> None:
        """Hand back gradually: something outside the bridge was lost."""
        with self._lock:
            self.safety.fade(now, reason)

    @property
    def engaged(self) -> bool:
        """The bit that goes back to the controller, which returns it with each command."""
        with self._lock:
            return self.safety.state is State.ENGAGED

    @property
    def status(self) -> Status:
        """State, warning, counters."""
        with self._lock:
            safety = self.safety
            return Status(
                safety.state.value,
                safety.state is State.ENGAGED,
                safety.state is not State.SILENT,
                safety.linked,
                safety.reason,
                safety.warning,
                dict(safety.refusals),
                dict(safety.losses),
                self._sent,
                self._received,
                self._no_load,
                dict(self._would_send),
            )

    # -- the bus's side

    def poll(self, now: float) -> dict[str, float]:
        """Hear what came, send what is due. Returns channels in SI by name; NaN where invalid or not
        fresh.
        """
        with self._lock:
            if now < self._now:
                self._rewind(self._now - now)
            self._now = now
            self._hear(now)
            self.safety.tick(now)
            self._keep_link(now)
            for axis, message in self.vehicle.transmitted.items():
                if now >= self._due.get(axis, math.inf):
                    self._transmit(axis, message, now)
            return self._signals.at(now)

    def heard_at(self, channel: str) -> float:
        """When the newest value of a channel came, monotonic s; -inf where none came yet."""
        with self._lock:
            return self._signals.heard_at(channel)

    def next_due(self, now: float) -> float:
        """When the next frame wants to leave."""
        return min(self._due.values(), default=now + 0.02)

    def listen(self, timeout: float) -> None:
        """Wait for a frame or for the timeout, s; the frame is taken by the next poll."""
        if self._bus is None:
            time.sleep(max(timeout, 0.0))
            return
        try:
            message = self._bus.recv(max(timeout, 0.0))
        except (can.CanError, OSError, ValueError):
            time.sleep(max(timeout, 0.0))
            return
        if message is not None:
            self._inbox.append(message)

    def run(
        self,
        stop: threading.Event,
        on_signals: Callable[[dict[str, float], float], None] | None = None,
        *,
        priority: int = 0,
    ) -> None:
        """Poll in real time until stopped, then hand back in order and go silent.

        `priority` above 0 asks for SCHED_FIFO for this thread, where the user may have it (see the docs).
        """
        if priority > 0:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        while not stop.is_set():
            now = time.monotonic()
            signals = self.poll(now)
            if on_signals is not None:
                on_signals(signals, now)
            self.listen(min(self.next_due(now) - time.monotonic(), 0.02))
        self.release(time.monotonic(), "stopped")
        while self.safety.state is State.RELEASING:
            self.poll(time.monotonic())
            self.listen(0.005)
        self.disarm(time.monotonic())

    def _rewind(self, back: float) -> None:
        """The clock went back: what waits for a time waits no longer for it, and no signal has an age."""
        self._due = {axis: due - back for axis, due in self._due.items()}
        self._retry_at = None if self._retry_at is None else self._retry_at - back
        self._signals = Signals(self.vehicle)

    def _hear(self, now: float) -> None:
        messages, self._inbox = self._inbox, []
        try:
            while self._bus is not None and self._retry_at is None and len(messages) < BURST:
                message = self._bus.recv(0)
                if message is None:
                    break
                messages.append(message)
        except (can.CanError, OSError, ValueError):
            self._drop_bus(now)
        for message in messages:
            if message.is_error_frame:
                if message.arbitration_id & _BUS_OFF:
                    self._drop_bus(now)
            elif message.is_extended_id and not message.is_remote_frame:
                self._received += 1
                data = bytes(message.data)
                self.safety.rx_hook(message.arbitration_id, data, now)
                self._claim.hear(message.arbitration_id, data, now)
                self._signals.hear(message.arbitration_id, data, now)

    def _keep_link(self, now: float) -> None:
        """The link is the bus and the address; a bus that comes back claims anew and re-engages nothing."""
        if self.safety.state is State.SILENT:
            return
        if self._retry_at is not None and now >= self._retry_at:
            self._retry(now)
        for can_id, data in self._claim.due(now):
            if self.safety.tx_hook(can_id, data, now):
                self._send(can_id, data, now)
        self.safety.link(self._claim.claimed(now))

    def _retry(self, now: float) -> None:
        self._retry_at = now + RETRY_S
        if self._reopen is not None:
            try:
                if self._bus is not None:
                    self._bus.shutdown()
                self._bus = self._reopen()
            except (can.CanError, OSError, ValueError):
                self._bus = None
                return
        self._retry_at = None
        self._claim.start(now)

    def _drop_bus(self, now: float) -> None:
        """Nothing is heard or sent until the next try."""
        self._claim.stop()
        self.safety.link(False)
        self._retry_at = now + RETRY_S

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
            return
        if self._bus is None:
            return
        try:
            self._bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=True))
            self._sent += 1
        except (can.CanError, OSError, ValueError):
            self._drop_bus(now)
