"""Lifecycle node around truck_bridge.Bridge: the truck over CAN. It sends nothing while inactive."""

from __future__ import annotations

import math
import threading
import time

import can
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import JointState, Range
from std_srvs.srv import Trigger

from deeptruck_core.signals import FAULTS
from deeptruck_nodes import messages
from deeptruck_nodes.messages import nanoseconds
from deeptruck_nodes.node import DeeptruckNode, run, say
from deeptruck_nodes.topics import ACCEL, COMMAND, ENGAGED, IMU, RADAR_RANGE, ROAD, STATUS, TWIST
from truck_bridge import vehicles
from truck_bridge.bridge import Bridge
from truck_bridge.bus import open_bus

SILENCE = 0.3  # s without a speed on the bus; then NaN is published, so that nobody waits for it
LEAD_FOR = 0.5  # s that a radar echo counts as a vehicle ahead
ASK_EVERY = 0.2  # s between attempts to engage
SAY_EVERY = 5.0  # s between two lines that say why control cannot be given yet
NOBODY_ASKS = "nobody asks: call the service /can_bridge/engage"
ENDS_WITHIN = 7.0  # s, that braking for a hazard may take when the node ends: 25 m/s by 4 m/s^2
ENGAGED_PERIOD_S = 0.05  # s between two engaged bits to the controller; a change is sent at once


class CanBridge(DeeptruckNode, LifecycleNodeMixin):
    """Publishes whenever a new speed is received on the bus, and passes commands to the bridge as they
    arrive.

    Engaging needs a person: the parameter `engage` permits the first engagement, the service ~/engage any
    later one. After control is lost, it is not engaged again until the person requests it.
    """

    def __init__(self) -> None:
        DeeptruckNode.__init__(self, "can_bridge")
        LifecycleNodeMixin.__init__(self)
        vehicle = vehicles.load(self.p["vehicle"])
        self._vehicle = vehicle.driving_off() if self.p["drives_off"] else vehicle
        self._bridge = Bridge(self._vehicle, self._open(), no_load=self.p["no_load"], reopen=self._open)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._signals: dict[str, float] = {}
        self._published_at = self._lead_at = self._asked_at = self._sent_engaged_at = -math.inf
        self._sent_engaged, self._said = 0.0, ""
        self._armed_at = self._counted_at = math.nan  # monotonic, s
        self._in_control = 0.0  # s
        self._say_at = math.inf  # when to say what stands against engaging
        self._wanted: bool = self.p["engage"]
        self._why_not: tuple[str, ...] = ()
        self._twist, self._accel = self.publish_on(TWIST), self.publish_on(ACCEL)
        self._imu = self.publish_on(IMU)
        self._status, self._road = self.publish_on(STATUS), self.publish_on(ROAD)
        self._engaged = self.publish_on(ENGAGED)
        self.listen_to(COMMAND, self._on_command)
        self.listen_to(RADAR_RANGE, self._on_range)
        self.create_service(Trigger, "~/engage", self._on_engage)
        self.create_service(Trigger, "~/release", self._on_release)

    def _open(self) -> can.BusABC:
        self._bus = open_bus(self.p["interface"], self.p["channel"])
        return self._bus

    def begin(self) -> None:
        """Activate without an external request; `ros2 lifecycle set /can_bridge deactivate` makes it silent
        again."""
        self.trigger_configure()
        self.trigger_activate()

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._stop.clear()
        self._published_at = time.monotonic()
        self._say_at = self._published_at + SAY_EVERY
        self._armed_at = self._counted_at = time.monotonic()
        self._in_control = 0.0
        self._bridge.arm(self._armed_at)
        self._thread = threading.Thread(
            target=self._bridge.run,
            args=(self._stop, self._on_signals),
            kwargs={"priority": self.p["priority"]},
            daemon=True,
        )
        self._thread.start()
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Hand control back in order, then stop sending. While the truck brakes for a hazard for longer than
        a node has to end, it stays active."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(ENDS_WITHIN)
            if self._thread.is_alive():
                say("stays active: it brakes for a hazard; deactivate it again when the truck stands")
                return TransitionCallbackReturn.FAILURE
        self._thread = None
        return TransitionCallbackReturn.SUCCESS

    def close(self) -> None:
        if self._thread is not None:
            self.trigger_deactivate()
            if self.p["engage"]:
                say(self._how_it_went(time.monotonic() - self._armed_at))
        self._bus.shutdown()

    def _how_it_went(self, seconds: float) -> str:
        counts = {name: n for name, n in self._bridge.status.losses.items() if name != "stopped"}
        losses = ", ".join(f"{name} ({n})" for name, n in counts.items())
        return f"in control {self._in_control:.0f} s of {seconds:.0f} s" + (losses and f"; lost: {losses}")

    def _on_signals(self, signals: dict[str, float], now: float) -> None:
        self._signals = signals  # in the bridge's thread; replaced as a whole

    def tick(self) -> float:
        if self._thread is None:
            return 0.1
        now = time.monotonic()
        if self._bridge.received_at("speed") > self._published_at or now - self._published_at > SILENCE:
            self._published_at = now
            self._publish(self.now(), self._signals)
        if self._wanted and now - self._asked_at > ASK_EVERY:
            self._ask(now)
        self._tell(now)
        return 0.005

    def _tell(self, now: float) -> None:
        """Send the engaged bit back to the controller, as the bridge's half of the heartbeat."""
        status = self._bridge.status
        engaged = status.engaged
        bit = -1.0 if status.acts_alone else float(engaged)
        self._in_control += (now - self._counted_at) * engaged
        self._counted_at = now
        said, self._said = self._said, status.warning or ("engaged" if engaged else "")
        if self._said and self._said != said:
            say(self._said)
        if bit != self._sent_engaged or now - self._sent_engaged_at > ENGAGED_PERIOD_S:
            self._sent_engaged, self._sent_engaged_at = bit, now
            self._engaged.publish(messages.scalars(self.now(), ENGAGED.fields, {"engaged": bit}))

    def _publish(self, stamp: int, signals: dict[str, float]) -> None:
        self._accel.publish(messages.accel(stamp, signals.get("acceleration", math.nan)))
        self._imu.publish(messages.imu(stamp, signals.get("specific_force", math.nan)))
        inside = [*STATUS.fields, *(name for name in ("brake_switch", *FAULTS) if name in signals)]
        demands = self._vehicle.driver_demands(signals)
        self._status.publish(messages.scalars(stamp, [*inside, *demands], {**signals, **demands}))
        road = [
            *ROAD.fields,
            *(name for name in ("ambient_temperature", "latitude", "longitude") if name in signals),
        ]
        self._road.publish(messages.scalars(stamp, road, signals))
        self._twist.publish(messages.twist(stamp, signals.get("speed", math.nan), "truck"))
        self._report(stamp)

    def _report(self, stamp: int) -> None:
        if not self.diagnosis_is_due(stamp):
            return
        status = self._bridge.status
        urgent = status.state == "stopping" or (status.engaged and status.warning)
        level = "error" if urgent else "warn" if status.warning else "ok"
        says = status.warning or status.reason or status.state
        counters = {f"refused: {name}": count for name, count in status.refusals.items()}
        counters |= {f"lost: {name}": count for name, count in status.losses.items()}
        would = {f"would send {key:08X}": data.hex() for key, data in status.would_send.items()}
        values = {
            "state": status.state,
            "engaged": status.engaged,
            "not_engaged_because": "; ".join(self._stands_against()),
            "address_claimed": status.address_claimed,
            "frames_sent": status.frames_sent,
            "frames_received": status.frames_received,
            "no_load": status.no_load,
            "faults": "; ".join(status.faults),
        }
        self.diagnose(stamp, level, says, {**values, **counters, **would})

    def _stands_against(self) -> tuple[str, ...]:
        """Every reason why control is not given now, requested or not."""
        if self._bridge.engaged:
            return ()
        reasons = self._bridge.obstacles(time.monotonic(), lead_vehicle=self._lead_is_fresh())
        return reasons if self._wanted else (*reasons, NOBODY_ASKS)

    def _lead_is_fresh(self) -> bool:
        return time.monotonic() - self._lead_at < LEAD_FOR

    def _on_command(self, message: JointState) -> None:
        values = messages.read_scalars(message)
        engine, brake = (values.get(name, math.nan) for name in COMMAND.fields[:2])
        room, needed = (values.get(name, math.nan) for name in ("room", "needed_gap"))
        self._bridge.command(
            engine,
            brake,
            time.monotonic(),
            engaged=values.get("engaged") == 1.0,
            gap=(room + needed, needed),
            hold_brake=values.get("hold_brake", math.nan),
            hold_s=values.get("hold_s", math.inf),
            needed_braking=values.get("needed_braking", math.nan),
        )

    def _on_range(self, message: Range) -> None:
        if math.isfinite(message.range) and nanoseconds(message.header.stamp):
            self._lead_at = time.monotonic()

    def _ask(self, now: float) -> None:
        self._asked_at = now
        self._why_not = self._bridge.engage(now, person=True, lead_vehicle=self._lead_is_fresh())
        self._wanted = bool(self._why_not)
        if self._why_not and now > self._say_at:
            self._say_at = now + SAY_EVERY
            say(f"not engaged: {'; '.join(self._why_not)}")

    def _on_engage(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._ask(time.monotonic())
        self._wanted = False
        response.success, response.message = not self._why_not, "; ".join(self._why_not) or "engaged"
        return response

    def _on_release(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._wanted = False
        self._bridge.release(time.monotonic(), "released by service")
        braked = self._bridge.status.state == "stopping"
        response.success, response.message = not braked, self._bridge.status.warning if braked else "released"
        return response


def main() -> None:
    """Entry point of the process."""
    run(CanBridge)


if __name__ == "__main__":
    main()
