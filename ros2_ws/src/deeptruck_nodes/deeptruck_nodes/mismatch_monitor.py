"""The monitor: a simulator runs along with the truck and says when and by how much the two part."""

from __future__ import annotations

from collections.abc import Iterable

from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState

from deeptruck_model import simulators
from deeptruck_model.mismatch.monitor import Located, Monitor, Sample
from deeptruck_nodes import messages
from deeptruck_nodes.messages import SECOND, nanoseconds
from deeptruck_nodes.node import DeeptruckNode, run
from deeptruck_nodes.topics import COMMAND, MISMATCH_RESIDUAL, ROAD, TWIST


class MismatchMonitor(DeeptruckNode):
    """One residual for every step of the simulator, stamped with the truck's speed that ended it."""

    lingers_on = True

    def __init__(self) -> None:
        super().__init__("mismatch_monitor")
        limits = {name: self.p[name] for name in ("window_s", "threshold", "hold_s")}
        self._monitor = Monitor(simulators.load(self.p["simulator"]), **limits)
        self._engaged = True  # whether the newest command drives the truck
        self._first: int | None = None
        self._spoken: Located | None = None
        self._residual = self.publish_on(MISMATCH_RESIDUAL)
        self.listen_to(TWIST, self._on_twist)
        self.listen_to(COMMAND, self._on_command)
        self.listen_to(ROAD, self._on_road)

    def _on_twist(self, message: TwistStamped) -> None:
        self.heard += 1
        self._tell(self._monitor.hear_speed(self._seconds(message), message.twist.linear.x))

    def _on_command(self, message: JointState) -> None:
        values = messages.read_scalars(message)
        self._engaged = not self.p["no_load"] and values.get("engaged") != 0.0
        if not self._engaged:  # the driver does, whose demand the simulator is not given
            values = {}
        self._tell(self._monitor.hear_command(self._seconds(message), values))

    def _on_road(self, message: JointState) -> None:
        self._monitor.hear_road(self._seconds(message), messages.read_scalars(message))

    def _seconds(self, message: TwistStamped | JointState) -> float:
        """Seconds since the first stamp: since the epoch they would lose their digits."""
        stamp = nanoseconds(message.header.stamp)
        self._first = stamp if self._first is None else self._first
        return (stamp - self._first) / SECOND

    def _tell(self, samples: Iterable[Sample]) -> None:
        for s in samples:
            stamp = self._stamp(s.time)
            self._residual.publish(messages.accelerations(stamp, s.residual, s.smoothed, s.allowed))
            alarm = self._monitor.alarm
            self._speak(s.time, alarm)
            level, says = ("ok", self._quiet()) if alarm is None else ("warn", self._sentence(alarm))
            self.diagnose(stamp, level, says, self._values(s))

    def _speak(self, time: float, alarm: Located | None) -> None:
        """To whoever sits before the run: when a stretch begins and ends, in s since the first message."""
        if alarm is not None and self._spoken is None:
            print(f"at {time:.0f} s: {self._sentence(alarm)}", flush=True)
        elif alarm is None and self._spoken is not None:
            print(
                f"at {time:.0f} s: {self._quiet(again=True)}; before, {self._sentence(self._spoken)}",
                flush=True,
            )
        self._spoken = alarm

    def _quiet(self, again: bool = False) -> str:
        """While nothing stands out."""
        if not self._engaged:
            return "not engaged"
        return "as simulated again" if again else "as simulated"

    def _sentence(self, alarm: Located) -> str:
        lasts = alarm.end - alarm.start
        mass_kg, mean = self._monitor.mass_kg, alarm.mean_m_s2
        size = f"{mean:+.3f} m/s^2" if mass_kg is None else f"{mean * mass_kg:+.0f} N"
        return f"the truck is not as simulated: {size} for {lasts:.0f} s"

    def _values(self, s: Sample) -> dict[str, object]:
        """The newest stretch located in the window, and how many there are."""
        alarm, located = self._monitor.alarm, self._monitor.located
        stretches = [*located, alarm] if alarm else located
        values: dict[str, object] = {"residual_m_s2": s.smoothed, "segments": len(stretches)}
        values["threshold_m_s2"] = self.p["threshold"]
        if stretches and self._engaged:  # no force is named while the simulator is not compared
            last = stretches[-1]
            start, end = (self._stamp(t) / SECOND for t in (last.start, last.end))
            values |= {"start_s": f"{start:.2f}", "end_s": f"{end:.2f}", "mean_m_s2": last.mean_m_s2}
            if self._monitor.mass_kg is not None:
                values["mean_force_n"] = last.mean_m_s2 * self._monitor.mass_kg
        return values

    def _stamp(self, seconds: float) -> int:
        return (self._first or 0) + round(seconds * SECOND)


def main() -> None:
    """Entry point of the process."""
    run(MismatchMonitor)


if __name__ == "__main__":
    main()
