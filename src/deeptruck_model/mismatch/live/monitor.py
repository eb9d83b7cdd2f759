"""Monitor while driving: runs a simulator forced along the truck, and reports where its residual is large.

Samples may arrive at any time; the monitor resamples them to the simulator's clock: speed is interpolated,
commands and conditions are held from the step of their stamp. Copies of the simulator run in parallel with
inputs perturbed by their noise; a residual within the spread of the copies is no mismatch.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from deeptruck_core.arrays import Array
from deeptruck_core.signals import ACCELERATION, SPEED
from deeptruck_core.vehicle_kinds import LEAST_SPEED
from deeptruck_model.mismatch.prepare.prepared import fed_back, noise_of, quantum
from deeptruck_model.mismatch.residual.gather import JITTER_RUNS
from deeptruck_model.mismatch.rules import Limits, Rules
from deeptruck_model.recordings.clocks import REORDER_NS
from deeptruck_model.recordings.resample import Received
from deeptruck_model.simulators import Simulator

SMOOTH_S = 5.0
NOISE_S = 20.0  # of the newest inputs, from which their noise is measured
PATIENCE = 5  # steps that may wait for a command stamped at their begin


@dataclass(frozen=True)
class Sample:
    """One step that ended at `time`, s. Accelerations in m/s^2; NaN while the residual is not known.

    `smoothed` is the mean residual of the last SMOOTH_S, `allowed` the tolerance for that mean by the spread
    of the simulator under input noise.
    """

    time: float
    residual: float
    smoothed: float
    allowed: float


@dataclass(frozen=True)
class Located:
    """A time segment, s, in which the smoothed residual exceeded its limit, and its mean missing
    force (N)."""

    start: float
    end: float
    mean_m_s2: float  # force per mass


class Monitor:
    """Compare a running truck with a simulator.

    The limit of the smoothed residual is `threshold` (m/s^2) above the tolerance. After `hold_s` above it,
    `alarm` is the present segment; afterwards the segment stays in `located` for `window_s`.
    """

    def __init__(
        self,
        simulator: Simulator,
        *,
        window_s: float = 120.0,
        threshold: float = 0.05,
        hold_s: float = 3.0,
        seed: int = 0,
        rules: Rules = Rules(),
    ) -> None:
        self._simulator, self._dt = simulator, simulator.dt
        self._window_s, self._threshold, self._hold_s = window_s, threshold, hold_s
        self._rng, self._rules = np.random.default_rng(seed), rules
        self.mass_kg: float | None = simulator.parameters().get("mass")
        self.located: list[Located] = []
        self._commands: deque[tuple[float, Array]] = deque()
        self._conditions: deque[tuple[float, Array]] = deque()
        self._speeds: deque[tuple[float, float]] = deque()  # on the grid, waiting for their commands
        self._inputs: deque[Array] = deque(maxlen=round(NOISE_S / self._dt))
        self._recent: deque[tuple[float, float]] = deque(maxlen=round(SMOOTH_S / self._dt))
        self._last: tuple[float, float] | None = None
        self._due = -math.inf
        self._state: Any = None
        self._settled = -math.inf
        self._standing_out: list[tuple[float, float]] = []

    def goes_on_with(self, simulator: Simulator) -> None:
        """Replace the simulator by another one of the same truck; its state is unknown for `settle_s`."""
        self._simulator = simulator
        self._forget()

    @property
    def alarm(self) -> Located | None:
        """The present segment above the limit, once it is long enough."""
        if not self._standing_out or self._standing_out[-1][0] - self._standing_out[0][0] < self._hold_s:
            return None
        return self._stretch()

    def hear_command(self, time: float, values: Mapping[str, float]) -> list[Sample]:
        """Commands in the interface's units, in force from `time` (s) on; NaN interrupts the comparison."""
        u = np.array([values.get(name, math.nan) for name in self._simulator.interface.u])
        self._commands.append((time, u))
        return self._advance()

    def hear_road(self, time: float, values: Mapping[str, float]) -> None:
        """Conditions (grade as rise over run) in force from `time` (s) on."""
        w = np.array([values.get(name, math.nan) for name in self._simulator.interface.w])
        self._conditions.append((time, w))

    def hear_speed(self, time: float, speed: float) -> list[Sample]:
        """The truck's speed, m/s. Returns the steps that this sample completes."""
        last, self._last = self._last, (time, speed)
        gap = last is None or time <= last[0] or time - last[0] > 2.5 * self._dt
        if gap or not math.isfinite(speed) or not math.isfinite(last[1] if last else math.nan):
            done = self._drain()
            if math.isfinite(speed):
                self._begin(time, speed)
            return done
        assert last is not None
        while self._due <= time + 1e-6:
            share = (self._due - last[0]) / (time - last[0])
            self._speeds.append((self._due, last[1] + share * (speed - last[1])))
            self._due += self._dt
        return self._advance()

    def _begin(self, time: float, speed: float) -> None:
        self._speeds.clear()
        self._speeds.append((time, speed))
        self._due = time + self._dt
        self._forget()

    def _forget(self) -> None:
        """Restart after a gap in the data: the inner state is unknown for `settle_s`."""
        if len(self._standing_out) > 1 and self.alarm is not None:
            self.located.append(self._stretch())
        self._state, self._settled = None, math.inf
        self._recent.clear()
        self._standing_out.clear()

    def _drain(self) -> list[Sample]:
        """Complete the waiting steps with the newest command."""
        out = []
        while len(self._speeds) > 1:
            out.append(self._step())
        self._due = math.inf
        return out

    def _advance(self) -> list[Sample]:
        out = []
        while len(self._speeds) > 1 and (self._heard(self._speeds[0][0]) or len(self._speeds) > PATIENCE):
            out.append(self._step())
        return out

    def _heard(self, time: float) -> bool:
        return bool(self._commands) and self._commands[-1][0] >= time - 0.5 * self._dt

    def _step(self) -> Sample:
        (begin, before), (end, after) = self._speeds[0], self._speeds[1]
        self._speeds.popleft()
        u = self._held(self._commands, begin)
        w = self._held(self._conditions, begin) if self._simulator.interface.w else np.zeros(0)
        if u is None or w is None or not np.isfinite(np.concatenate([u, w])).all():
            self._forget()
            return self._judge(end, math.nan, math.nan)
        if self._state is None:
            self._state = self._simulator.reset(np.tile(self._response(0.0, before), (JITTER_RUNS + 1, 1)))
            self._settled = end + Limits.settle_s
        self._inputs.append(np.array([after, *u]))
        predicted = self._predict(u, w, (after - before) / self._dt, after)
        if end < self._settled or after < LEAST_SPEED:
            return self._judge(end, math.nan, math.nan)
        residual = (after - before) / self._dt - float(predicted[0])
        return self._judge(end, residual, float(predicted[1:].std(ddof=1)))

    def _predict(self, u: Array, w: Array, acceleration: float, speed: float) -> Array:
        """Simulated acceleration (1 + JITTER_RUNS,), with inputs as recorded and perturbed by their noise."""
        noise = self._noise()
        moved = np.tile(u, (JITTER_RUNS + 1, 1))
        moved[1:] += noise[1:] * self._rng.uniform(-0.5, 0.5, (JITTER_RUNS, len(u)))
        self._state, y = self._simulator.step(self._state, moved, np.tile(w, (JITTER_RUNS + 1, 1)))
        response = np.tile(self._response(acceleration, speed), (JITTER_RUNS + 1, 1))
        response[1:, SPEED] += self._rng.normal(0.0, max(noise[0], Limits.speed_noise), JITTER_RUNS)
        response[:, SPEED] = np.maximum(response[:, SPEED], 0.0)
        self._state = self._simulator.force(self._state, fed_back(self._simulator, response))
        return np.asarray(y[:, ACCELERATION])

    def _noise(self) -> Array:
        """The noise of speed and the quantisation step of each command, estimated once there are enough
        inputs."""
        if len(self._inputs) < 30:
            return np.zeros(1 + len(self._simulator.interface.u))
        inputs = np.stack(self._inputs)
        return np.array([noise_of(inputs[:, 0]), *(quantum(x) for x in inputs[:, 1:].T)])

    def _response(self, acceleration: float, speed: float) -> Array:
        y = np.full(len(self._simulator.interface.y), math.nan)
        y[ACCELERATION], y[SPEED] = acceleration, speed
        return y

    def _judge(self, time: float, residual: float, disagreement: float) -> Sample:
        self.located = [s for s in self.located if s.end > time - self._window_s]
        if not math.isfinite(residual):
            return Sample(time, math.nan, math.nan, math.nan)
        self._recent.append((residual, disagreement))
        smoothed, spread = np.mean(self._recent, axis=0)
        allowed = self._rules.tolerance * float(spread)
        enough = len(self._recent) == self._recent.maxlen
        if enough and abs(smoothed) > self._threshold + allowed:
            self._standing_out.append((time, residual))
            self._standing_out = [s for s in self._standing_out if s[0] > time - self._window_s]
        else:
            if self.alarm is not None:
                self.located.append(self._stretch())
            self._standing_out.clear()
        return Sample(time, residual, float(smoothed) if enough else math.nan, allowed)

    def _stretch(self) -> Located:
        mean = float(np.mean([r for _, r in self._standing_out]))
        return Located(self._standing_out[0][0], self._standing_out[-1][0], mean)

    def _held(self, heard: deque[tuple[float, Array]], time: float) -> Array | None:
        """The value in force at `time`: the newest one stamped no later."""
        while len(heard) > 1 and heard[1][0] <= time + 0.5 * self._dt:
            heard.popleft()
        if not heard or heard[0][0] > time + 0.5 * self._dt:
            return None
        return heard[0][1]


class Window:
    """The newest messages of each topic, of up to `seconds` of stamps and at most `most_hz` per second."""

    def __init__(self, seconds: float, most_hz: float) -> None:
        self._span, self._least = round(seconds * 1e9), round(1e9 / most_hz)
        self._topics: dict[str, deque[tuple[int, Mapping[str, float]]]] = {}
        self._newest = 0

    def hear(self, topic: str, stamp: int, values: Mapping[str, float]) -> None:
        """Add a message stamped at `stamp`, ns, with its numbers by field. If the clock is set back, as in a
        replay that is moved, the window is cleared; of equal stamps the last is used."""
        before = self._topics.get(topic)
        if before and stamp < before[-1][0] - REORDER_NS:
            self._topics.clear()
            self._newest = stamp
        self._newest = max(self._newest, stamp)
        kept = self._topics.setdefault(topic, deque())
        if kept and kept[-1][0] == stamp:
            kept.pop()
        elif kept and abs(stamp - kept[-1][0]) < self._least:
            return
        kept.append((stamp, values))
        while kept and kept[0][0] < self._newest - self._span:
            kept.popleft()

    def copy(self) -> Window:
        """A copy of the present content, which can be converted to columns while more messages arrive."""
        other = copy(self)
        other._topics = {topic: kept.copy() for topic, kept in self._topics.items()}
        return other

    def heard(self) -> dict[str, Received]:
        """All messages by topic, in columns."""
        out = {}
        for topic, kept in self._topics.items():
            stamps = np.array([stamp for stamp, _ in kept], np.int64)
            fields = dict.fromkeys(field for _, values in kept for field in values)
            columns = {f: np.array([values.get(f, np.nan) for _, values in kept], float) for f in fields}
            out[topic] = Received(stamps, columns)
        return out
