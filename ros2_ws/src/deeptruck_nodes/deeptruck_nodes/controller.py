"""Controller node: answers each radar sample with the command of a guarded policy."""

from __future__ import annotations

import json
import math
import time
from typing import Any

from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState, Range

from deeptruck_cacc.safety.guard import load_controller
from deeptruck_cacc.safety.truck_limits import STEEPEST, known
from deeptruck_core.signals import TruckInterface
from deeptruck_model import simulators
from deeptruck_nodes import messages
from deeptruck_nodes.following import Following
from deeptruck_nodes.messages import nanoseconds
from deeptruck_nodes.node import IDLE, DeeptruckNode, run, say
from deeptruck_nodes.observation import Alignment, Observation
from deeptruck_nodes.topics import COMMAND, COUNTED, ENGAGED, RADAR_RANGE, RADAR_TWIST, ROAD, TWIST


class Controller(DeeptruckNode):
    """The policy acts every `dt` of stamp time and its command is repeated in between; with stale inputs
    nothing is published.

    In real time the command is also repeated every `repeat_every_s`, because the bridge uses it as a
    heartbeat, which must not depend on the radar's rate. A radar that is silent, or whose readings are
    refused, sees no vehicle: what was followed goes on as for a missed reading, until `lose_lead_after_s` are
    over. Each command carries the engaged bit last received from the bridge or the simulated truck; in
    lock-step it carries the stamp of the observation.
    """

    def __init__(self) -> None:
        super().__init__("controller")
        interface = TruckInterface.from_dict(json.loads(self.p["interface"])) if self.p["interface"] else None
        guard = load_controller(
            self.p["policy"], interface, shield=self.p["shield"], **self._limits(interface),
            brake_limit=self.p["brake_limit"], brake_rate=self.p["brake_rate"],
        )  # fmt: skip
        guard.set_speed = self.p["set_speed"]
        say(f"set speed: {guard.set_speed:g} m/s ({3.6 * guard.set_speed:.0f} km/h)")
        self._following = Following(guard, self.p["target_time_gap"], self.p["lose_lead_after_s"])
        self._samples = Alignment(self.lockstep, self.p["uses_grade"], self.p["stale_after_s"])
        self._sent_at = self._observed_at = -math.inf  # monotonic, s
        self._engaged, self._engaged_at = False, -math.inf  # the engaged bit; monotonic, s
        self._received = {"radar": -math.inf, "speed": -math.inf}  # monotonic, s
        self._said: set[str] = set()  # reasons for which samples were refused
        self._command = self.publish_on(COMMAND)
        self.listen_to(ENGAGED, self._on_engaged)  # first: after a delay it is read before a command is sent
        self.listen_to(ROAD, self._on_road)
        self.listen_to(RADAR_RANGE, self._on_range)
        self.listen_to(RADAR_TWIST, self._on_radar_twist)
        self.listen_to(TWIST, self._on_twist)

    def _limits(self, interface: TruckInterface | None) -> dict[str, Any]:
        """What to measure the truck's limits on, where those that are stored for its name do not hold: it has
        other parameters, or drives steeper descents."""
        if interface is None or interface.brake_unit is None or not self.p["shield"]:
            return {}
        simulator, grade = self.p["limits_of"], min(self.p["limits_grade"], STEEPEST)
        if simulator:
            if known(interface, simulators.load(simulator).parameters(), grade) is not None:
                return {}
            say(f"limits of {interface.name}: measured on {simulator}, on descents to {-100 * grade:g} %")
            return {"limits_of": simulator, "limits_grade": grade}
        own = "'controller: {limits_of: SIM}' in --parameters measures them on a simulator"
        if known(interface) is None:
            say(
                f"note: the limits of {interface.name} were never measured: the shield assumes weak brakes "
                f"and keeps long gaps; {own}"
            )
        else:
            say(
                f"note: the limits of {interface.name} are those of the truck of that name on descents to "
                f"3 %; one of another load needs its own: {own}"
            )
        return {}

    def close(self) -> None:
        counts = self._following.counts
        say(", ".join(f"{says} {counts[name]} x" for name, says in COUNTED.items()))

    def tick(self) -> float:
        return IDLE if self.lockstep else self._repeat()

    def _repeat(self) -> float:
        """Send the newest command again while it may still be obeyed; returns the time until the next
        repetition."""
        if self._following.leads and self._is_old(self._observed_at):
            self._act(self._samples.unseen(self.now()))  # a silent radar sees no vehicle
        silent = [name for name in self._received if self._is_stale(name)]
        if (silent and not self._following.leads) or self._is_old(self._observed_at):
            says = f"no {' and '.join(silent) or 'whole observation'}: no command is sent"
            self.diagnose(self.now(), "error", says, self._counts)
            return IDLE
        wait = self._sent_at + self.p["repeat_every_s"] - time.monotonic()
        if wait > 0.0:
            return float(wait)
        if math.isfinite(sum(self._following.held)):
            self._send(self.now())
        return float(self.p["repeat_every_s"])

    def _send(self, stamp: int) -> None:
        self._sent_at = time.monotonic()
        following = self._following
        hazard = following.hold_brake, following.hold_s, following.needed_braking
        said = (*following.held, float(self._drives), *following.room, *hazard)
        values = dict(zip(COMMAND.fields, said, strict=True))
        self._command.publish(messages.scalars(stamp, COMMAND.fields, values))

    @property
    def _counts(self) -> dict[str, int]:
        refused = {f"refused: {reason}": count for reason, count in self._samples.refused.items()}
        return {**self._following.counts, **refused}

    @property
    def _drives(self) -> bool:
        """Whether the commands drive the truck, as last reported by the bridge or the simulated truck."""
        return self._engaged and (self.lockstep or not self._is_old(self._engaged_at))

    def _is_stale(self, name: str) -> bool:
        return self._is_old(self._received[name])

    def _is_old(self, at: float) -> bool:
        return time.monotonic() - at > self.p["stale_after_s"]

    def _on_engaged(self, message: JointState) -> None:
        """Store whether commands are passed on; a change is answered at once, because the bridge waits for
        the answer."""
        engaged = messages.read_scalars(message).get("engaged") == 1.0
        changed, self._engaged, self._engaged_at = engaged != self._engaged, engaged, time.monotonic()
        if changed and engaged:
            self._following.forget()  # what was summed up while nobody obeyed means nothing
        if self.lockstep:
            self._take("engaged", nanoseconds(message.header.stamp), float(engaged))
        elif changed and not self._is_old(self._observed_at) and math.isfinite(sum(self._following.held)):
            self._send(self.now())

    def _on_road(self, message: JointState) -> None:
        grade = messages.read_scalars(message).get("grade", math.nan)
        self._take("grade", nanoseconds(message.header.stamp), grade)

    def _on_range(self, message: Range) -> None:
        self._take("gap", nanoseconds(message.header.stamp), messages.detected(message))

    def _on_radar_twist(self, message: TwistStamped) -> None:
        self._received["radar"] = time.monotonic()
        self._take("leader_speed", nanoseconds(message.header.stamp), message.twist.linear.x)

    def _on_twist(self, message: TwistStamped) -> None:
        speed = message.twist.linear.x
        if math.isfinite(speed):
            self._received["speed"] = time.monotonic()
            self._take("speed", nanoseconds(message.header.stamp), speed)

    def _take(self, name: str, stamp: int, value: float) -> None:
        self._act(self._samples.put(name, stamp, value, time.monotonic_ns()))
        for reason in self._samples.refused.keys() - self._said:
            self._said.add(reason)
            say(f"{reason}; counted in /diagnostics from now on")

    def _act(self, observation: Observation | None) -> None:
        if observation is None or (not self.lockstep and self._is_stale("speed")):
            return
        self._observed_at = time.monotonic()
        events, led = self._following.events, self._following.leads
        self._following.take(observation, obeyed=self._drives)
        self._send(observation.stamp)
        leads, values = (
            self._following.leads,
            {**self._counts, "gap_m": observation.gap, "set_speed": self.p["set_speed"]},
        )
        level, says = ("ok", "following") if leads else ("warn", f"{self._following.why}: no command")
        if led and not leads and self._drives:
            say(f"handing back: {self._following.why}")
        at_once = self._following.events > events
        self.diagnose(observation.stamp, level, says, values, at_once=at_once)


def main() -> None:
    """Entry point of the process."""
    run(Controller)


if __name__ == "__main__":
    main()
