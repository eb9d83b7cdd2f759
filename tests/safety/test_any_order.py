"""Whatever the world does, in whatever order: invariants of the core, judged on what leaves."""

from __future__ import annotations

import math

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from truck_bridge.safety import State

SETTINGS = settings(
    max_examples=25,
    stateful_step_count=40,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)


class World(RuleBasedStateMachine):
    """The bench, with a person, a driver, a controller, a bus and a clock that may do anything."""

    new_bench = None
    name = "trucksim"

    @initialize()
    def set_up(self):
        self.bench = type(self).new_bench(self.name)
        self.bench.signals["speed"] = 15.0
        self.engagements, self.stopping = 0, False
        self.held = {}
        self.last = {axis.name: (0.0, -math.inf) for axis in self.bench.table.axes}

    def watch(self):
        """On the wire: values in the widest envelope and no step beyond rate or fade."""
        for time, name, demand in self.bench.left:
            axis = self.bench.axis(name)
            before, then = self.last[name]
            if not math.isnan(demand):
                assert min(axis.limits.low) - 1e-9 <= demand <= max(axis.limits.high) + 1e-9
                fastest = max(axis.limits.rate, axis.limits.fade)
                elapsed = min(max(time - then, 0.0), 2 * axis.period_s)
                if time - then < 0.5:
                    assert abs(demand - before) <= fastest * elapsed + 2 * axis.demand.scale
            self.last[name] = (0.0 if math.isnan(demand) else demand, time)
        self.bench.left.clear()

    @rule(seconds=st.sampled_from([0.005, 0.05, 0.2, 0.6, 2.5]))
    def time_passes(self, seconds):
        self.bench.run(seconds)
        self.watch()

    @rule()
    def node_is_activated(self):
        if self.bench.safety.state is State.SILENT:
            self.last = {axis.name: (0.0, -math.inf) for axis in self.bench.table.axes}
        self.bench.arm()

    @rule()
    def node_is_deactivated(self):
        self.bench.safety.disarm()
        assert self.bench.safety.state is State.SILENT

    @rule(person=st.sampled_from([True, True, True, False]), lead=st.sampled_from([True, True, True, False]))
    def somebody_engages(self, person, lead):
        before = self.bench.safety.state
        why = self.bench.safety.engage(self.bench.now, person, lead)
        if not why:
            assert (person, lead) == (True, True) and before in (State.STANDBY, State.HOLDING)
            self.engagements += 1
            if before is State.STANDBY:
                self.last["engine"] = (self.bench.value("engine_percent"), self.bench.now)

    @rule(
        axis=st.sampled_from(["engine", "retarder", "brake"]),
        share=st.sampled_from([0.0, 0.1, 0.5, 1.0, 1.01, -0.5, math.nan, math.inf, -math.inf]),
    )
    def controller_wants(self, axis, share):
        limits = self.bench.axis(axis).limits
        edge = min(limits.low) if max(limits.high) == 0 else max(limits.high)
        self.bench.demands = {axis: share * edge}

    @rule(
        share=st.sampled_from([0.0, 0.1, 0.5, 1.0, 1.01, -0.5, math.nan]),
        seconds=st.sampled_from([0.0, 0.5, 5.0, math.inf]),
    )
    def controller_names_a_hazard(self, share, seconds):
        limits = self.bench.axis("brake").limits
        edge = min(limits.low) if max(limits.high) == 0 else max(limits.high)
        self.bench.needs, self.bench.assumed_s = {"brake": share * edge}, seconds

    @rule()
    def somebody_releases(self):
        before, moves = self.bench.safety.state, self.bench.safety._moves
        self.bench.safety.release(self.bench.now)
        goes_on = before is State.STOPPING and moves
        assert self.bench.safety.state not in (State.ENGAGED, State.FADING)
        assert self.bench.safety.state is State.STOPPING or not goes_on

    @rule(on=st.booleans())
    def controller_lives(self, on):
        self.bench.commanding = on

    @rule(bit=st.sampled_from([None, None, True, False]))
    def controller_takes_for_engaged(self, bit):
        self.bench.engaged_bit = bit

    @rule(
        key=st.sampled_from(["brake_pedal", "accelerator", "cancel", "brake_switch", "parking_brake"]),
        on=st.booleans(),
    )
    def driver_acts(self, key, on):
        self.bench.signals[key] = on * (40.0 if key in ("brake_pedal", "accelerator") else 1.0)

    @rule(number=st.integers(0, 20), gone=st.booleans())
    def message_vanishes(self, number, gone):
        heard = self.bench.table.heard[number % len(self.bench.table.heard)].name
        self.bench.silent = {heard} if gone else set()

    @rule(speed=st.floats(0.0, 45.0))
    def truck_speed(self, speed):
        self.bench.signals["speed"] = speed

    @rule(up=st.booleans())
    def link_changes(self, up):
        self.bench.safety.link(up)

    @rule(seconds=st.sampled_from([-3.0, 0.05, 0.3, 20.0]))
    def clock_jumps(self, seconds):
        self.bench.now += seconds
        if seconds < 0:
            self.last = {name: (value, -math.inf) for name, (value, _) in self.last.items()}

    @rule(can_id=st.integers(0, (1 << 29) - 1), data=st.binary(min_size=0, max_size=9))
    def any_frame_is_heard(self, can_id, data):
        self.bench.safety.rx_hook(can_id, data, self.bench.now)

    @rule(can_id=st.integers(0, (1 << 29) - 1), data=st.binary(min_size=8, max_size=8))
    def any_frame_wants_to_leave(self, can_id, data):
        listed = {axis.can_id for axis in self.bench.table.axes} | set(self.bench.table.always)
        if can_id not in listed:
            assert not self.bench.safety.tx_hook(can_id, data, self.bench.now)

    @rule(axis=st.sampled_from(["engine", "retarder", "brake"]), data=st.binary(min_size=8, max_size=8))
    def a_listed_frame_with_any_bits_wants_to_leave(self, axis, data):
        axis = self.bench.axis(axis)
        masked = int.from_bytes(data, "little") & ((1 << 56) - 1) & ~axis.demand.mask
        form = masked == axis.active or int.from_bytes(data, "little") & ((1 << 56) - 1) == axis.release
        if not form:
            assert not self.bench.safety.tx_hook(axis.can_id, data, self.bench.now)

    @invariant()
    def the_bit_and_the_state_agree(self):
        if not hasattr(self, "bench"):
            return
        safety = self.bench.safety
        outside = (State.SILENT, State.STANDBY, State.RELEASING)
        assert safety.controls_allowed == (safety.state not in outside)
        assert sum(safety.losses.values()) <= self.engagements
        if safety.state not in (State.SILENT, State.STANDBY, State.ENGAGED):
            assert safety.warning
        if safety.state is State.STOPPING:
            assert not safety._moves or safety._hold.knows(self.bench.now) or self.bench.now > safety._now
            least = {axis: abs(demand) for axis, demand in safety._hold.demands.items()}
            assert all(least[axis] >= held - 1e-9 for axis, held in self.held.items() if self.stopping)
        self.stopping, self.held = (
            safety.state is State.STOPPING,
            {axis: abs(demand) for axis, demand in safety._hold.demands.items()},
        )


@pytest.mark.parametrize("name", ["trucksim", "volvo"])
def test_whatever_happens(name, new_bench):
    machine = type(f"World_{name}", (World,), {"name": name, "new_bench": staticmethod(new_bench)})
    case = machine.TestCase
    case.settings = SETTINGS
    case().runTest()
