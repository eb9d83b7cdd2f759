"""Radar, controller, bridge and truck in lock-step: the cores of the nodes, driven in one process."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple, Protocol

import can
import numpy as np
from fault_wire import Wire

from deeptruck_cacc import load_policy
from deeptruck_cacc.safety.assumptions import Assumptions
from deeptruck_cacc.safety.guard import Guard, guard
from deeptruck_model.simulators import Simulator
from deeptruck_model.simulators import load as load_truck
from deeptruck_nodes.following import Following
from deeptruck_nodes.leaders import Leader
from deeptruck_nodes.observation import SECOND, Alignment
from deeptruck_nodes.radar import Radar, RadarErrors
from truck_bridge import vehicles
from truck_bridge.bridge import Bridge
from truck_bridge.emulator.ecus import EcuEmulator
from truck_bridge.vehicles import Vehicle

STEP = 0.01
RADAR_S, REPEAT_S, STALE_S, LEAD_S, LOST_S = 0.1, 0.05, 0.3, 0.5, 3.0  # as the nodes have them
TIME_GAP_S, REACH_M = 2.0, 200.0
AGE_M_S = 0.5  # between a speed on the bus and the truck's own: 0.1 s at 5 m/s^2
RADAR = RadarErrors(range_noise=0.1, speed_noise=0.05)

SIGNED = str(Path(__file__).with_name("signed_truck.yaml"))  # counts and signs two of its messages
NAMES = (*vehicles.NAMES, SIGNED)
load = cache(vehicles.load)
_truck = cache(load_truck)


def controller(vehicle: Vehicle, policy: str, limits: Assumptions | None = None) -> Guard:
    """What the controller node loads for a vehicle."""
    interface = _truck(vehicle.truck).interface
    passes = {"brake_limit": vehicle.brake_limit, "brake_rate": vehicle.brake_rate}
    loaded = guard(load_policy(policy, interface), limits, **passes)
    loaded.set_speed = vehicle.set_speed
    return loaded


@dataclass(frozen=True)
class Object:
    """Something that the radar sees: `gap` m ahead (0: the time gap) at `comes` s, until `leaves` s."""

    motion: Leader
    gap: float = 0.0
    comes: float = 0.0
    leaves: float = math.inf
    solid: bool = True  # a ghost, or what stands beside the lane, cannot be hit


class Lane:
    """Gaps to all that is ahead. `seen` is the nearest of all, range and speed, `ahead` of what is solid."""

    def __init__(self, objects: Sequence[Object]) -> None:
        self.objects, self._gaps = tuple(objects), [math.nan] * len(objects)
        self._last: tuple[float, float, list[float]] | None = None  # time, own speed, speeds of objects
        self.seen = self.ahead = (math.inf, math.nan)

    def update(self, t: float, speed: float) -> None:
        """At t s, the truck at `speed` (m/s); by the trapezoidal rule."""
        speeds = [one.motion.speed_at(t) for one in self.objects]
        then, own, before = self._last or (t, speed, speeds)
        self.seen = self.ahead = (math.inf, math.nan)
        for n, (one, theirs) in enumerate(zip(self.objects, speeds, strict=True)):
            if t < one.comes or t >= one.leaves:
                continue
            opening = (theirs - speed + before[n] - own) / 2
            new = math.isnan(self._gaps[n])
            first = one.gap or max(TIME_GAP_S * speed, 5.0)
            self._gaps[n] = first if new else self._gaps[n] + opening * (t - then)
            self.seen = min(self.seen, (self._gaps[n], theirs))
            self.ahead = min(self.ahead, (self._gaps[n], theirs)) if one.solid else self.ahead
        self._last = (t, speed, speeds)


Forger = Callable[[Vehicle, float], Iterator[tuple[int, bytes]]]  # the frames that leave now
Command = Callable[
    [float, float, bool], tuple[float, float, bool] | None
]  # what a controller sends of its own
DRIVELINE = {"engine_speed", "gear_ratio", "driveline", "shifting", "lockup"}  # the witness of a speed
Reading = tuple[float, float, float]  # range, the object's speed, age of the stamp


class RadarFault(Protocol):
    """What comes in place of a reading."""

    def readings(self, now: float, gap: float, speed: float) -> list[Reading]: ...


class Stop(NamedTuple):
    """What a truck reaches that only brakes."""

    least_gap: float  # m
    hit_speed: float  # m/s, by which it is faster than what it hits; 0 where it stops


class Chain:
    """A truck that follows a leader over the bus; `lies` and `forged` are faults of radar and bus.

    `policy` is a text as of the start scripts. The truck begins at the speed of the leader or first object,
    on a slope that is drawn unless `grade` is given by distance. `limits` of the truck: else those stored
    for its name.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        rng: np.random.Generator,
        ahead: Leader | Sequence[Object],
        policy: str,
        grade: Callable[[float], float] | None = None,
        errors: RadarErrors = RADAR,
        truck: Simulator | None = None,
        limits: Assumptions | None = None,
    ) -> None:
        objects = tuple(ahead) if isinstance(ahead, Sequence) else (Object(ahead),)
        self.vehicle, self.now, speed = vehicle, 0.0, objects[0].motion.speed_at(0.0)
        self.ours, self.trucks = Wire(rng), Wire(rng)
        self.ours.peer, self.trucks.peer = self.trucks, self.ours
        self.bridge = Bridge(vehicle, self.ours)
        slope = float(rng.uniform(-0.01, 0.02))
        self.truck = EcuEmulator(
            vehicle, self.trucks, truck=truck, speed=speed, grade=grade or (lambda distance: slope)
        )
        self.lane = Lane(objects)
        self.radar, self.lies = Radar(errors, int(rng.integers(1 << 31))), list[RadarFault]()
        self.guard = controller(vehicle, policy, limits)
        self.following = Following(self.guard, TIME_GAP_S, LOST_S)
        self.readings: list[Reading] = []  # of this step
        self.forged: list[Forger] = []
        self.command: Command = lambda engine, brake, engaged: (engine, brake, engaged)
        self.offset = 0.0  # s, of the bridge's clock
        self.paused_until = -math.inf  # of bridge and controller
        self.states: list[tuple[float, str]] = []  # when the core's state changed, to which
        self.speeds: list[tuple[float, float, float]] = []  # time, the truck's, as received
        self._samples = Alignment(False, vehicle.interface["grade"], STALE_S)
        self._heard = self._published = self._sent = self._observed = self._lead = -math.inf
        self._engaged = False
        self.bridge.arm(0.0)

    def engage(self) -> tuple[str, ...]:
        """A person asks for control; returns why not."""
        fresh = self.now - self._lead < LEAD_S
        return self.bridge.engage(self.now + self.offset, person=True, lead_vehicle=fresh)

    @property
    def state(self) -> str:
        """Of the core."""
        return self.bridge.safety.state.value

    def step(self) -> None:
        """10 ms."""
        self.now = round(self.now + STEP, 6)
        self.ours.now = self.trucks.now = self.now
        self.truck.step(self.now)
        self.lane.update(self.now, self.truck.speed)
        for can_id, data in (frame for one in self.forged for frame in one(self.vehicle, self.now)):
            for side in (self.ours, self.trucks):
                message = can.Message(arbitration_id=can_id, data=data, is_extended_id=True)
                side.inbox.append((self.now, message))
        self.readings = []
        if self.now < self.paused_until:
            return
        signals = self.bridge.poll(self.now + self.offset)
        self.speeds.append((self.now, self.truck.speed, self.bridge.safety.hearing.value("speed")))
        if not self.states or self.states[-1][1] != self.state:
            self.states.append((self.now, self.state))
        silent = self.now - self._published > STALE_S
        heard = self.bridge.received_at("speed")
        if heard != self._heard or silent:
            self._heard, self._published = heard, self.now
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
        gap, speed = self.radar.sense(self.now, *self.lane.seen)
        readings = [(gap, speed, 0.0)]
        for lie in self.lies:
            told = ((age, lie.readings(self.now, *bent)) for *bent, age in readings)
            readings = [(g, v, older + age) for age, found in told for g, v, older in found]
        self.readings = readings
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
            unseen = self._samples.unseen(round(self.now * SECOND))
            if not self.following.leads or unseen is None or self.now - self._published > STALE_S:
                return
            self._observed = self.now
            self.following.take(unseen, obeyed=self._engaged)
        self._sent = self.now
        if command := self.command(*self.following.held, self._engaged):
            room, needed = self.following.room
            gap = room + needed, needed
            self.bridge.command(
                *command[:2],
                self.now + self.offset,
                engaged=command[2],
                gap=gap,
                hold_brake=self.following.hold_brake,
                hold_s=self.following.hold_s,
                needed_braking=self.following.needed_braking,
            )

    def braking_fully(self, fails: Callable[[float], dict[str, float]] | None = None) -> Stop:
        """What the truck as it is now reaches by the brake that the bridge lets pass and rise, within 30 s.

        `fails`: fields of the brake's `Actuator` at a time, s, where they change after now.
        """
        truck, (lane, actuators), now = self.truck, deepcopy((self.lane, self.truck.actuators)), self.now
        limits, begun = self.vehicle.transmitted["brake"].axis.limits, abs(truck.actuators["brake"].given)
        state, speed, distance, least = truck._state, truck.speed, truck.distance, lane.ahead[0]
        while now < self.now + 30.0:
            now += truck._truck.dt
            for key, value in (fails(now) if fails else {}).items():
                setattr(actuators["brake"], key, value)
            for axis, actuator in actuators.items():
                full = float(np.interp(speed, limits.speed, limits.low if actuator.full < 0 else limits.high))
                full = math.copysign(min(abs(full), begun + limits.rate * (now - self.now)), full)
                actuator.act(full if axis == "brake" and not actuator.lost else 0.0, now)
            command = self.vehicle.commands({axis: actuator.given for axis, actuator in actuators.items()})
            w = np.array([[truck._grade(distance)][: len(truck._truck.interface.w)]])
            state, y = truck._truck.step(state, np.array([[*command][: len(truck._truck.interface.u)]]), w)
            speed = float(y[0, 1])
            distance += speed * truck._truck.dt
            lane.update(now, speed)
            least = min(least, lane.ahead[0])
            if lane.ahead[0] <= 0.0:
                return Stop(least, speed - lane.ahead[1])
            if speed < 0.05:
                break
        return Stop(least, 0.0)

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
        by_engine = coupled and not lied & DRIVELINE and most > line.above_m_s and away > tolerance
        return by_engine or ("second_speed" not in lied and away > self.vehicle.table.speed_gap_m_s + AGE_M_S)

    def close(self) -> None:
        """Of both wires."""
        for side in (self.ours, self.trucks):
            side.shutdown()
