"""Radar, controller, bridge and truck in lock-step: the cores of the nodes, driven in one process."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import can
import numpy as np
from fault_lies import RadarLie
from fault_table import DRIVELINE, Forger
from fault_wire import Wire

from deeptruck_cacc import load_policy
from deeptruck_cacc.safety.guard import Guard, guard
from deeptruck_model.simulators import load as load_truck
from deeptruck_nodes.following import Following
from deeptruck_nodes.leaders import Leader
from deeptruck_nodes.observation import SECOND, Alignment
from deeptruck_nodes.radar import Gap, Radar, RadarErrors
from truck_bridge.bridge import Bridge
from truck_bridge.emulator.ecus import EcuEmulator
from truck_bridge.vehicles import Vehicle

STEP = 0.01
RADAR_S, REPEAT_S, STALE_S, LEAD_S, LOST_S = 0.1, 0.05, 0.3, 0.5, 3.0  # as the nodes have them
TIME_GAP_S, REACH_M = 2.0, 200.0
AGE_M_S = 0.5  # between a speed on the bus and the truck's own: 0.1 s at 5 m/s^2
RADAR = RadarErrors(range_noise=0.1, speed_noise=0.05)

_truck = cache(load_truck)


def controller(vehicle: Vehicle, policy: str) -> Guard:
    """What the controller node loads for a vehicle."""
    return guard(load_policy(policy, _truck(vehicle.truck).interface))


class Chain:
    """A truck that follows a leader over the bus, everything sound until `lie`, `bus_lie` or `forged` is set.

    `policy` is a text as of the start scripts. The truck begins at the leader's speed, on a slope that is
    drawn unless `grade` is given by distance.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        rng: np.random.Generator,
        leader: Leader,
        policy: str,
        grade: Callable[[float], float] | None = None,
        errors: RadarErrors = RADAR,
    ) -> None:
        self.vehicle, self.now, speed = vehicle, 0.0, leader.speed_at(0.0)
        self.ours, self.trucks = Wire(rng), Wire(rng)
        self.ours.peer, self.trucks.peer = self.trucks, self.ours
        self.bridge = Bridge(vehicle, self.ours)
        slope = float(rng.uniform(-0.01, 0.02))
        self.truck = EcuEmulator(vehicle, self.trucks, speed=speed, grade=grade or (lambda distance: slope))
        self.gap = Gap(leader, 0.0, TIME_GAP_S)
        self.radar, self.lie = Radar(errors, int(rng.integers(1 << 31))), None
        self.guard = controller(vehicle, policy)
        self.following = Following(self.guard, TIME_GAP_S, LOST_S)
        self.forged: Forger | None = None
        self._samples = Alignment(False, vehicle.interface["grade"], STALE_S)
        self._published = self._sent = self._observed = self._lead = self._lied = -math.inf
        self._engaged = False
        self.bridge.arm(0.0)

    lie: RadarLie | None

    def engage(self) -> tuple[str, ...]:
        """A person asks for control; returns why not."""
        fresh = self.now - self._lead < LEAD_S
        return self.bridge.engage(self.now, person=True, lead_vehicle=fresh)

    @property
    def state(self) -> str:
        """Of the core."""
        return self.bridge.safety.state.value

    def step(self) -> None:
        """10 ms."""
        self.now = round(self.now + STEP, 6)
        self.ours.now = self.trucks.now = self.now
        self.truck.step(self.now)
        self.gap.update(self.now, self.truck.speed)
        for can_id, data in self.forged(self.vehicle, self.now) if self.forged else ():
            for side in (self.ours, self.trucks):
                message = can.Message(arbitration_id=can_id, data=data, is_extended_id=True)
                side.inbox.append((self.now, message))
        signals = self.bridge.poll(self.now)
        silent = self.now - self._published > STALE_S
        if self.bridge.received_at("speed") > self._published or silent:
            self._published = self.now
            self._take("grade", self.now, signals.get("grade", math.nan))
            self._take("speed", self.now, signals.get("speed", math.nan))
        if round(self.now / STEP) % round(RADAR_S / STEP) == 0:
            self._sense()
        if self.bridge.engaged != self._engaged:
            self._engaged = self.bridge.engaged
            if self._engaged:
                self.following.forget()
            self._send()
        elif self.now - self._sent > REPEAT_S - 1e-9:
            self._send()

    def _sense(self) -> None:
        gap, speed = self.radar.sense(self.now, self.gap.gap, self.gap.leader_speed)
        readings = [(gap, speed, 0.0)]
        if self.lie is not None:
            self._lied = self.now if math.isinf(self._lied) else self._lied
            readings = self.lie.readings(self.now - self._lied, gap, speed)
        for number, (seen, its_speed, age) in enumerate(readings):
            stamp = self.now - age + 1e-3 * number
            seen = seen if 0.5 <= seen <= REACH_M else math.nan
            self._lead = self.now if math.isfinite(seen) else self._lead
            self._take("gap", stamp, seen)
            self._take("leader_speed", stamp, its_speed)

    def _take(self, name: str, at: float, value: float) -> None:
        if name == "speed" and not math.isfinite(value):
            return
        seen = self._samples.put(name, round(at * SECOND), value, round(self.now * SECOND))
        if seen is not None and self.now - self._published <= STALE_S:
            self._observed = self.now
            self.following.take(seen, obeyed=self._engaged)
            self._send()

    def _send(self) -> None:
        """The newest command again, while it may be obeyed."""
        if self.now - self._observed > STALE_S:
            return
        self._sent = self.now
        self.bridge.command(*self.following.held, self.now, engaged=self._engaged)

    def contradicted(self, lied: frozenset[str]) -> bool:
        """Whether a signal that nobody lies about contradicts the core's speed beyond the tolerances."""
        line, true, hearing = self.vehicle.table.driveline, self.truck.speed, self.bridge.safety.hearing
        away = abs(hearing.value("speed") - true)
        assert line is not None
        coupled = self.truck.inside("shifting", 0.0) == 0 and self.truck.inside("clutch", 2.0) == 2.0
        if "lockup" in {s.name for heard in self.vehicle.table.heard for s in heard.signals}:
            coupled = coupled and hearing.value("lockup") == 1
        most = max(true, hearing.value("speed"))
        tolerance = line.tolerance * most + line.slack_m_s + AGE_M_S
        by_engine = coupled and not lied & set(DRIVELINE) and most > line.above_m_s and away > tolerance
        return by_engine or ("second_speed" not in lied and away > self.vehicle.table.speed_gap_m_s + AGE_M_S)

    def close(self) -> None:
        """Of both wires."""
        for side in (self.ours, self.trucks):
            side.shutdown()
