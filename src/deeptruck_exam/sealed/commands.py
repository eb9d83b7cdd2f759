"""Commands that pass checks and valves."""

from __future__ import annotations

import numpy as np

from deeptruck_exam.effects.law import STEP_S, Array, Late, Sizes, State, TorqueFilter
from deeptruck_exam.effects.planting import hidden, sizes


@hidden("n_lower_of_two_tracks", "sealed", "suburban hills", name="command_delay", accepts="clock_offset")
@sizes(quick_s=(0.2, 0.4), later_s=(0.25, 0.6))
class LowerOfTwoTracks(Late):
    """A pedal that opens waits for the slower track, one that closes for the quicker one.
    Source: Standardized E-Gas Monitoring Concept for Gasoline and Diesel Engine Control Units (EGAS working
    group): two tracks of the pedal are compared and the lower one is used; tracks of unlike latency are
    chosen here."""

    length = 200

    def pass_on(self, p: Sizes, s: State, u: Array, time: float, dt: float) -> Array:
        self.put(s, u)
        quick = self.ago(s, round(p.quick_s / STEP_S))
        slow = self.ago(s, round((p.quick_s + p.later_s) / STEP_S))
        return np.stack([np.minimum(quick[:, 0], slow[:, 0]), quick[:, 1]], axis=1)


@hidden("n_flow_through_a_valve", "sealed", "suburban hills", name="command_rate_limit", accepts="turbo_lag")
@sizes(opens_per_s=(0.28, 0.6), closes=(1.3, 2.5))
class FlowThroughAValve(TorqueFilter):
    """The nearer it is, the slower it moves, by the root of what is left.
    Source: Merritt, Hydraulic Control Systems (1967): flow through an orifice goes with the root of the
    pressure drop; a throttle cylinder whose pressure is the error of its lever, sizes are chosen here."""

    def torque(self, p: Sizes, s: State, pedal: Array, time: float, dt: float) -> Array:
        error = (pedal - s.given) / self.full
        rate = np.sqrt(np.abs(error)) * p.opens_per_s * np.where(error < 0.0, p.closes, 1.0)
        return np.asarray(s.given + self.full * np.sign(error) * np.minimum(np.abs(error), rate * dt))
