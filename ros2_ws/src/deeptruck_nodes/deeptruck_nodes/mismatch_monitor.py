"""Monitor node: runs a simulator along with the truck and reports when and how much the two differ, and the
probable cause.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from geometry_msgs.msg import AccelStamped, TwistStamped
from sensor_msgs.msg import Imu, JointState, Range

from deeptruck_model import simulators
from deeptruck_model.mismatch.live.companion import Companion
from deeptruck_model.mismatch.live.monitor import Located, Monitor, Sample, Window
from deeptruck_model.mismatch.live.questions import UNITS, DriveState, NamesReply, Question, Reply
from deeptruck_model.mismatch.mechanisms.families import ROOT
from deeptruck_model.mismatch.verdict.wording import percent, spoken
from deeptruck_nodes import messages
from deeptruck_nodes.messages import SECOND, nanoseconds
from deeptruck_nodes.node import DeeptruckNode, run
from deeptruck_nodes.topics import (
    ACCEL,
    COMMAND,
    ENGAGED,
    IMU,
    MISMATCH_BUDGET,
    MISMATCH_NAMES,
    MISMATCH_RESIDUAL,
    RADAR_RANGE,
    ROAD,
    STATUS,
    TWIST,
)

FIRST_S, EVERY_S = 90.0, 30.0  # of stamps: when mechanisms are named first, and how often
MOST_A_STEP = 10  # messages of a topic that are kept for each step of the simulator
MARGIN_S = 30.0  # more than adapt_s is kept, while another question is being answered
SHARE = 0.1  # of a core, that naming may take on average in real time
LARGEST = 3  # parts of the budget that are said


class MismatchMonitor(DeeptruckNode):
    """Publishes one residual for every simulator step, with the stamp of the truck speed that ended the step;
    and every EVERY_S the names and the error budget of the last minutes, computed by a companion process."""

    lingers_on = True

    def __init__(self) -> None:
        super().__init__("mismatch_monitor")
        limits = {name: self.p[name] for name in ("window_s", "threshold", "hold_s")}
        self._simulator = simulators.load(self.p["simulator"])
        self._monitor = Monitor(self._simulator, **limits)
        self._engaged = True  # whether the newest command drives the truck
        self._first: int | None = None
        self._spoken: Located | None = None
        self._companion = Companion() if self.lockstep else Companion(SHARE)
        most_hz = MOST_A_STEP / self._simulator.dt
        self._newest = Window(self.p["names_s"], most_hz) if self.p["names_s"] else None
        self._begin: Window | None = None
        if self.p["adapt_s"]:
            self._begin = Window(self.p["adapt_s"] + MARGIN_S, most_hz)
            import deeptruck_model.mismatch.live.adaptation  # noqa: F401 - which takes long, and not while driving
        self._due = FIRST_S
        self._asked_at = 0  # stamp of the last question
        self._drive_state: DriveState | None = None
        self._stated = ROOT
        self._refused: set[str] = set()
        self._said: dict[str, object] = {}
        self._residual = self.publish_on(MISMATCH_RESIDUAL)
        self._names, self._budget = self.publish_on(MISMATCH_NAMES), self.publish_on(MISMATCH_BUDGET)
        self.listen_to(TWIST, self._on_twist)
        self.listen_to(COMMAND, self._on_command)
        self.listen_to(ROAD, self._on_road)
        for topic in (ACCEL, IMU, STATUS, ENGAGED, RADAR_RANGE):
            self.listen_to(topic, partial(self._keep, topic.name))

    def _on_twist(self, message: TwistStamped) -> None:
        self.received += 1
        self._keep(TWIST.name, message)
        seconds = self._seconds(message)
        self._tell(self._monitor.hear_speed(seconds, message.twist.linear.x))
        self._take(waits=False)
        self._ask(seconds, nanoseconds(message.header.stamp))

    def _on_command(self, message: JointState) -> None:
        self._keep(COMMAND.name, message)
        values = messages.read_scalars(message)
        self._engaged = not self.p["no_load"] and values.get("engaged", 1.0) == 1.0
        if not self._engaged:  # the driver does, whose demand the simulator is not given
            values = {}
        self._tell(self._monitor.hear_command(self._seconds(message), values))

    def _on_road(self, message: JointState) -> None:
        self._keep(ROAD.name, message)
        self._monitor.hear_road(self._seconds(message), messages.read_scalars(message))

    def _keep(self, topic: str, message: TwistStamped | AccelStamped | Imu | JointState | Range) -> None:
        """Keep the first and the last minutes of samples, from which questions are answered."""
        for window in (self._newest, self._begin):
            if window is not None:
                window.hear(topic, nanoseconds(message.header.stamp), messages.numbers(message))

    def _seconds(self, message: TwistStamped | JointState) -> float:
        """Seconds since the first stamp, because seconds since the epoch would lose precision."""
        stamp = nanoseconds(message.header.stamp)
        self._first = stamp if self._first is None else self._first
        return (stamp - self._first) / SECOND

    # -- names, and what this drive has of its own ----------------------------------------------

    def _ask(self, seconds: float, stamp: int) -> None:
        """Ask the question that is due, unless another one is being answered. In lock-step, whose clock
        stands still meanwhile, the answer is awaited, so that equal runs give equal bags."""
        if self._companion.busy:
            return
        self._due = min(self._due, seconds + FIRST_S)  # of a replay that was moved back
        if self._begin is not None and seconds > self.p["adapt_s"] + 1.0:
            begin, self._begin = self._begin, None
            self._put(begin, stamp, adapts=self.p["adapt_s"])
        elif self._newest is not None and seconds >= self._due:
            self._due = seconds - seconds % EVERY_S + EVERY_S
            self._put(self._newest.copy(), stamp)

    def _put(self, window: Window, stamp: int, adapts: float = 0.0) -> None:
        of, state, no_load = self.p["simulator"], self._drive_state, self.p["no_load"]
        self._asked_at = stamp
        self._companion.ask(lambda: Question(of, window.heard(), state, adapts, no_load))
        self._take(waits=self.lockstep)

    def _take(self, *, waits: bool) -> None:
        try:
            answer = self._companion.taken(waits=waits)
        except RuntimeError as error:
            self._newest = self._begin = None  # nobody answers any more
            self._refuse(str(error))
            return
        if answer is None:
            return
        if isinstance(answer.found, DriveState):
            self._adapt(answer.found)
        elif isinstance(answer.found, NamesReply):
            self._name(answer.found, answer)
        else:
            self._refuse(answer.refused)

    def _refuse(self, why: str) -> None:
        """Print the reason of a refusal, once."""
        self._said["names"] = why
        if why not in self._refused:
            print(f"no answer from the last minutes: {why}", flush=True)
        self._refused.add(why)

    def _adapt(self, state: DriveState) -> None:
        from deeptruck_model.mismatch.live.adaptation import with_state

        self._drive_state = state
        if state.known:
            self._monitor.goes_on_with(with_state(self._simulator, state))
        for name, quantity in state.each.items():
            self._said[f"own_{name}"] = f"{quantity.state} {state.used(name):+.4g} {UNITS[name]}"
        print(f"this drive's own, from {state.seconds:.0f} s of it: {state}", flush=True)

    def _name(self, found: NamesReply, answer: Reply) -> None:
        stamp = self._asked_at
        probabilities = {n.node: n.probability for n in found.nodes}
        if found.nodes:  # of a name that is not among them nothing speaks
            probabilities = dict.fromkeys(MISMATCH_NAMES.fields, 0.0) | probabilities
        self._names.publish(messages.scalars(stamp, MISMATCH_NAMES.fields, probabilities))
        shares = dict(found.shares or {})
        if shares:
            shares = dict.fromkeys(MISMATCH_BUDGET.fields, 0.0) | shares
        sizes = {"speed_rmse": found.speed_rmse, "horizon_s": found.horizon_s}
        self._budget.publish(messages.scalars(stamp, MISMATCH_BUDGET.fields, shares | sizes))
        largest = sorted((found.shares or {}).items(), key=lambda x: -x[1])[:LARGEST]
        self._said |= {
            "names": found.says,
            "names_at_s": f"{stamp / SECOND:.2f}",
            "budget": ", ".join(f"{spoken(part)} {percent(share)}" for part, share in largest),
        }
        if not self.lockstep:  # whose bags are equal
            self._said["names_cpu_s"] = answer.cpu_s
        if found.stated != self._stated:
            at = (stamp - (self._first or 0)) / SECOND
            last = min(at, self.p["names_s"])
            print(f"at {at:.0f} s, of the last {last:.0f} s: {found.says}", flush=True)
        self._stated = found.stated

    # -- the residual -----------------------------------------------------------------------------

    def _tell(self, samples: Iterable[Sample]) -> None:
        for s in samples:
            stamp = self._stamp(s.time)
            self._residual.publish(messages.accelerations(stamp, s.residual, s.smoothed, s.allowed))
            alarm = self._monitor.alarm
            self._speak(s.time, alarm)
            level, says = ("ok", self._quiet()) if alarm is None else ("warn", self._sentence(alarm))
            self.diagnose(stamp, level, says, self._values(s))

    def _speak(self, time: float, alarm: Located | None) -> None:
        """Print when a segment begins and ends, in s since the first message."""
        if alarm is not None and self._spoken is None:
            print(f"at {time:.0f} s: {self._sentence(alarm)}", flush=True)
        elif alarm is None and self._spoken is not None:
            print(
                f"at {time:.0f} s: {self._quiet(again=True)}; before, {self._sentence(self._spoken)}",
                flush=True,
            )
        self._spoken = alarm

    def _quiet(self, again: bool = False) -> str:
        """The status while no mismatch is detected."""
        if not self._engaged:
            return "not engaged"
        return "as simulated again" if again else "as simulated"

    def _sentence(self, alarm: Located) -> str:
        lasts = alarm.end - alarm.start
        mass_kg, mean = self._monitor.mass_kg, alarm.mean_m_s2
        size = f"{mean:+.3f} m/s^2" if mass_kg is None else f"{mean * mass_kg:+.0f} N"
        return f"the truck is not as simulated: {size} for {lasts:.0f} s"

    def _values(self, s: Sample) -> dict[str, object]:
        """The newest segment located in the window, and how many there are."""
        alarm, located = self._monitor.alarm, self._monitor.located
        segments = [*located, alarm] if alarm else located
        values: dict[str, object] = {"residual_m_s2": s.smoothed, "segments": len(segments)}
        values["threshold_m_s2"] = self.p["threshold"]
        if segments and self._engaged:  # no force is named while the simulator is not compared
            last = segments[-1]
            start, end = (self._stamp(t) / SECOND for t in (last.start, last.end))
            values |= {"start_s": f"{start:.2f}", "end_s": f"{end:.2f}", "mean_m_s2": last.mean_m_s2}
            if self._monitor.mass_kg is not None:
                values["mean_force_n"] = last.mean_m_s2 * self._monitor.mass_kg
        return values | self._said

    def close(self) -> None:
        self._companion.close()

    def _stamp(self, seconds: float) -> int:
        return (self._first or 0) + round(seconds * SECOND)


def main() -> None:
    """Entry point of the process."""
    run(MismatchMonitor)


if __name__ == "__main__":
    main()
