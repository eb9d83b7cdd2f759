"""A test bench for the safety core: a truck that sends what the test sets, and a sender that follows the
core's plan.

Frames are built from the tables alone, and their checksums are restated from the standard, so that the code
under test does not judge itself.
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from truck_bridge import vehicles
from truck_bridge.safety import Axis, Heard, Safety, State, Table

CYCLE = 0.005
HARD = 1.6  # times `holds_beyond`: a demand that only a hazard asks for
BRAKES_M_S2 = 3.0
SANE = {
    "speed": 15.0,
    "second_speed": 15.0,
    "engine_percent": 20.0,
    "gear_ratio": 1.0,
    "driveline": 1.0,
    "engine_obeys": float(0x2A),  # us
    "retarder_obeys": float(0x2A),
}


def nibbles(kind: str, can_id: int, payload: bytes, counter: int) -> int:
    """Byte 8: counter low, checksum high (J1939-71; PACCAR PEC017 for TSC1, SPN 3188 for XBR)."""
    if kind == "none":
        return 0xFF
    total = sum(payload) + counter + sum((can_id >> shift) & 0xFF for shift in (0, 8, 16, 24))
    folded = (
        (((total >> 6) & 3) + (total >> 3) + total) % 8 if kind == "tsc1" else ((total >> 4) + total) % 16
    )
    return counter | folded << 4


@dataclass
class Bench:
    table: Table
    safety: Safety
    now: float = 100.0
    signals: dict[str, float] = field(default_factory=dict)
    silent: set[str] = field(default_factory=set)  # messages the truck does not send
    frozen: set[str] = field(default_factory=set)  # signals that repeat their value exactly
    rough: int = 0
    counters: dict[str, int] = field(default_factory=dict)
    due: dict[str, float] = field(default_factory=dict)
    demands: dict[str, float] = field(default_factory=dict)
    needs: dict[str, float] = field(default_factory=dict)  # demands that the hazard ahead needs
    assumed_s: float = math.inf
    engaged_bit: bool | None = None  # None: what the core says
    commanding: bool = True
    left: list[tuple[float, str, float]] = field(default_factory=list)  # time, axis, demand (NaN: released)

    def axis(self, name: str) -> Axis:
        return next(axis for axis in self.table.axes if axis.name == name)

    def that_may_jump(self) -> Bench:
        """Another bench, with a truck whose signals may jump."""
        table = jumping(self.table)
        return Bench(table, Safety(table))

    def value(self, name: str) -> float:
        """The value that the truck sends; engine speed follows from wheel speed and gear ratio, torque from
        our demand.
        """
        if name == "engine_percent" and name not in self.signals:
            left = (demand for _, axis, demand in reversed(self.left) if axis == "engine")
            return round(next((demand for demand in left if not math.isnan(demand)), SANE[name]))
        if name == "engine_speed" and name not in self.signals and self.table.driveline is not None:
            return self.value("speed") * self.value("gear_ratio") / self.table.driveline.metres_per_radian
        if name == "second_speed" and name not in self.signals:
            return self.value("speed")
        return self.signals.get(name, SANE.get(name, 0.0))

    def said(self, heard: Heard, **raw: int) -> bytes:
        """A frame of the truck; `raw` overrides single signals bit by bit."""
        word = (1 << 64) - 1
        for signal in heard.signals:
            f = signal.field
            number = round((self.value(signal.name) - f.offset) / f.scale)
            if signal.still_s < math.inf and signal.name not in self.frozen:
                number += self.rough  # no engine turns evenly
            number = raw.get(signal.name, number)
            word = word & ~(((1 << f.bits) - 1) << f.start) | number << f.start
        return word.to_bytes(8, "little")

    def hear(self, only: str | None = None) -> None:
        """Receive all messages of the truck, or one, now."""
        self.rough = 1 - self.rough
        for heard in self.table.heard:
            if heard.name not in self.silent and only in (None, heard.name):
                self.safety.rx_hook(heard.key | 3 << 26, self.said(heard), self.now)

    def frame(self, name: str, demand: float, counter: int | None = None) -> bytes:
        """A commanding frame, or for NaN the frame that hands back; rounded as on the wire, with the next
        counter."""
        axis = self.axis(name)
        raw = 0 if math.isnan(demand) else round((demand - axis.demand.offset) / axis.demand.scale)
        return self.raw_frame(name, None if math.isnan(demand) else raw, counter)

    def raw_frame(self, name: str, raw: int | None, counter: int | None = None) -> bytes:
        axis = self.axis(name)
        word = axis.release if raw is None else axis.active | raw << axis.demand.start
        payload = word.to_bytes(8, "little")[:7]
        modulo = {"none": 1, "tsc1": 8, "xbr": 16}[axis.check]
        counter = self.counters.get(name, 0) % modulo if counter is None else counter
        return payload + bytes([nibbles(axis.check, axis.can_id, payload, counter)])

    def send(self, name: str, data: bytes) -> bool:
        """Offer a frame to the core; if it may leave, the counter advances."""
        allowed = self.safety.tx_hook(self.axis(name).can_id, data, self.now)
        if allowed:
            self.counters[name] = self.counters.get(name, 0) + 1
        return allowed

    def command(self) -> bool:
        demands = {axis.name: self.demands.get(axis.name, axis.rest) for axis in self.table.axes}
        bit = self.safety.controls_allowed if self.engaged_bit is None else self.engaged_bit
        return self.safety.command(demands, bit, self.now, needs=self.needs, assumed_s=self.assumed_s)

    def wait(self, seconds: float) -> None:
        """Let time pass: truck and controller send, the bridge does not."""
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.now = min(self.now + CYCLE, end)
            self._listen()

    def turn(self, name: str) -> None:
        """Advance to the axis's next turn: exactly one period after its last frame."""
        motion = self.safety._motions[self.axis(name).can_id]
        self.wait(max(motion.time + self.axis(name).period_s - self.now, 0.0))

    def _listen(self) -> None:
        for heard in self.table.heard:
            if self._is_due(f"rx {heard.name}", heard.period_s):
                self.hear(heard.name)
        if self.commanding and self._is_due("command", 0.01):
            self.command()
        self.safety.tick(self.now)

    def cycle(self) -> None:
        """Advance by 5 ms: the truck sends, the controller commands at 100 Hz, the sender sends what
        is due."""
        self.now += CYCLE
        self._listen()
        for axis in self.table.axes:
            if self._is_due(f"tx {axis.name}", axis.period_s):
                demand = self.safety.plan(axis, self.now)
                if demand is not None:
                    assert self.send(axis.name, self.frame(axis.name, demand)), dict(self.safety.refusals)
                    self.left.append((self.now, axis.name, demand))

    def _is_due(self, what: str, period: float) -> bool:
        if self.now + 1e-9 < self.due.get(what, self.now):
            return False
        self.due[what] = self.due.get(what, self.now) + period
        return True

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> Bench:
        for _ in range(round(seconds / CYCLE)):
            self.cycle()
            if until():
                break
        return self

    def run_until(self, state: State, within: float = 10.0) -> float:
        """Seconds until the core is in a state."""
        start = self.now
        self.run(within, lambda: self.safety.state is state)
        assert self.safety.state is state
        return self.now - start

    def arm(self) -> Bench:
        self.safety.arm(self.now)
        self.now += CYCLE
        self.hear()
        self.safety.tick(self.now)
        self.command()
        return self

    def engage(self, **demands: float) -> Bench:
        """Arm, receive, command and engage."""
        self.demands = demands
        self.arm()
        assert self.safety.engage(self.now, person=True, lead_vehicle=True) == ()
        return self

    def hard(self, share: float = HARD) -> Bench:
        """Another bench at 15 m/s, whose signals may jump, that brakes by a share of what only a hazard asks
        for: for one that is known, where the share is above 1."""
        bench = self.that_may_jump()
        bench.signals["speed"] = 15.0
        bench.engage(engine=20.0).run(1.0)
        bench.demands = {"brake": share * bench.axis("brake").holds_beyond}
        bench.needs = bench.demands if share > 1.0 else {}
        bench.slows(1.5)
        assert bench.safety.state is State.ENGAGED
        bench.left.clear()
        return bench

    def slows(self, seconds: float) -> None:
        """Let the truck brake for so long; the other signals follow its speed."""
        for _ in range(round(seconds / 0.1)):
            self.signals["speed"] = max(self.signals["speed"] - 0.1 * BRAKES_M_S2, 0.0)
            self.run(0.1)

    def standing(self) -> Bench:
        """Another bench, which stands behind a standing leader, engaged, with a little brake."""
        bench = self.that_may_jump()
        bench.signals |= {"speed": 0.0, "driveline": 0.0}
        return bench.engage(brake=0.3 * bench.axis("brake").holds_beyond).run(1.0)

    def brake_demands(self) -> list[float]:
        """Those on the wire, absolute, a release counting as none."""
        return [0.0 if math.isnan(d) else abs(d) for _, axis, d in self.left if axis == "brake"]

    def demand(self, name: str) -> float:
        """Last demand on the wire."""
        return [demand for _, axis, demand in self.left if axis == name][-1]


@functools.cache
def table_of(name: str) -> Table:
    return vehicles.load(name).table


def jumping(table: Table) -> Table:
    """The table without limits on the rate of signals, for tests of what follows a jump."""
    heard = [
        replace(one, signals=tuple(replace(s, fastest=math.inf, rises=math.inf) for s in one.signals))
        for one in table.heard
    ]
    return replace(table, heard=tuple(heard))


def bench_of(name: str) -> Bench:
    return Bench(table_of(name), Safety(table_of(name)))


@pytest.fixture(params=os.environ.get("SAFETY_VEHICLES", " ".join(vehicles.NAMES)).split())
def vehicle(request: pytest.FixtureRequest) -> str:
    """Every vehicle of the package inherits every test that asks for a bench."""
    return str(request.param)


@pytest.fixture
def bench(vehicle: str) -> Bench:
    return bench_of(vehicle)


@pytest.fixture
def new_bench() -> Callable[[str], Bench]:
    """For a test that chooses its vehicle, or needs many benches."""
    return bench_of
