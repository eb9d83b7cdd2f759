"""The controller without ROS: turns observations into commands, the state of following, and counted
events.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_cacc.safety.guard import Guard
from deeptruck_core.constants import GRAVITY
from deeptruck_nodes.observation import SECOND, Observation

EVENTS = ("drop_outs", "shield_interventions", "full_brakings")
HOLE_S = 0.5  # between two observations, beyond which the past is forgotten; at least three steps
CONTRADICTED_S = 1.0  # for which a radar may contradict itself, or the truck's speed
LEAST_M_S2 = 0.2  # needed braking that noise of the readings may look like
CREEPS_M_S = 2.0  # as fast as an idling engine drives a truck on: rolling out ends at what is slower
GENTLE = 1.5  # m/s^2, for a hazard that is possible and no more
TAKES_OVER_S = 4.0  # for which that goes on after control was handed back
HARDER = 1.2  # than is needed, as no command follows
FULL = 0.95  # of the highest brake command: counted as a full braking


@dataclass
class Event:
    """Counts how often a condition begins."""

    count: int = 0
    holds: bool = False

    def now(self, holds: bool) -> None:
        """Update with whether the condition holds in this step."""
        self.count += holds and not self.holds
        self.holds = holds


class Following:
    """A guarded policy that acts every `dt` of stamp time; its command is held in between.

    Tracker, shield and policy advance in steps of `dt`. If the radar is slower, the steps between two of its
    readings are interpolated linearly.

    The command is NaN, which truck and bridge do not obey, if there is nothing to follow: the radar has lost
    the leader for `lose_lead_after_s` or contradicts the speeds for a second, or the truck's speed is
    missing. Where the leader that was seen last needs braking, `hold_brake` says how much: truck and bridge
    go on braking with it if no command follows.
    """

    def __init__(self, guard: Guard, target_time_gap: float, lose_lead_after_s: float) -> None:
        self._guard, self._time_gap, self._lose_after_s = guard, target_time_gap, lose_lead_after_s
        self._period = round(guard.dt * SECOND)
        self._acted: Observation | None = None  # the newest, its stamp on the grid of `dt`
        self._brake_high = ActionScale.of(guard).brake_high
        self._steps = {"shield_acted": 0, "baseline_drove": 0}
        self._events = {name: Event() for name in EVENTS}
        self.held = (math.nan, math.nan)  # engine and brake command in the interface's units
        self.hold_brake = math.nan  # that the hazard ahead needs; NaN: none
        self.hold_s = math.inf  # for which that is assumed
        self.needed_braking = 0.0  # m/s^2, of that hazard or of the command
        self.room = (math.nan, math.nan)  # m to the shield's limit, and the gap that it needs
        self.leads = False  # there is something to follow
        self.why = ""  # not, in words; "" while it leads
        guard.reset()

    @property
    def counts(self) -> dict[str, int]:
        """Steps in which the shield acted and in which the baseline drove; how often each of EVENTS began."""
        return {**self._steps, **{name: event.count for name, event in self._events.items()}}

    @property
    def events(self) -> int:
        """Total number of events."""
        return sum(event.count for event in self._events.values())

    def forget(self) -> None:
        """Reset the state except the counts and the brake temperature."""
        self._guard.forget()

    def take(self, seen: Observation, *, obeyed: bool = True) -> tuple[float, float]:
        """Engine and brake command for an observation; `obeyed`: whether they will drive the truck."""
        steps = self._steps_to(seen)
        before = self._acted
        for step in range(1, steps + 1):
            self.held = self._act(_between(before or seen, seen, step / steps))
            if not obeyed:
                self._guard.spare()
        if steps:
            stamp = seen.stamp if before is None else before.stamp + steps * self._period
            self._acted = replace(seen, stamp=stamp)
        return self.held

    def _steps_to(self, seen: Observation) -> int:
        """Number of steps of `dt` since the last one; stamps may have a jitter of a tenth of a step."""
        passed = math.inf if self._acted is None else seen.stamp - self._acted.stamp
        if abs(passed) > max(HOLE_S * SECOND, 3 * self._period):
            self.forget()
            self._acted = None
            return 1
        return max(int(passed + self._period // 10) // self._period, 0)

    def _act(self, seen: Observation) -> tuple[float, float]:
        numbers = {
            "leader_speed": seen.leader_speed,
            "speed": seen.speed,
            "gap": seen.gap,
            "target_time_gap": self._time_gap,
            "grade": seen.grade,
        }
        observation = {name: np.array([value]) for name, value in numbers.items()}
        engine, brake = self._guard.act(observation)
        room = float(self._guard.room_m[0])
        self.room = room, seen.gap - room
        led = self.leads
        self.why = self._why_not()
        self.leads = not self.why
        needs = float(self._guard.needed_braking[0])
        self.hold_brake, self.hold_s = math.nan, 0.0
        if led or self.leads:
            self.hold_brake, self.hold_s = (
                self._held_brake(needs, seen),
                self._time_to_stop(needs, seen.speed),
            )
            if math.isnan(self.hold_brake):
                possible = float(self._guard.possible_braking[0])
                self.hold_brake, self.hold_s = self._held_brake(possible, seen, GENTLE), TAKES_OVER_S
        self.needed_braking = max(needs, self._braking_by(float(brake[0])))
        acted, braking = bool(self._guard.acted[0]), brake[0] >= FULL * self._brake_high
        if not self.leads:
            engine = brake = np.array([math.nan])
            acted = braking = False
            self.forget()
        self._steps["shield_acted"] += int(acted)
        self._steps["baseline_drove"] += int(self.leads and self._guard.fallback_drives[0])
        self._events["drop_outs"].now((led or self.leads) and math.isnan(seen.gap))
        self._events["shield_interventions"].now(acted)
        self._events["full_brakings"].now(bool(braking))
        return float(engine[0]), float(brake[0])

    def _braking_by(self, command: float) -> float:
        """The most that a brake command gives on the level, m/s^2; 0 where nothing is known of the brakes, or
        where there is nothing to follow, so that it is not sent."""
        if self._guard.shield is None or not self.leads:
            return 0.0
        p = self._guard.shield.assumed
        share = min(command / self._brake_high, p.limit_share)
        return min(p.brake_gain * max(share - p.bite, 0.0), p.strongest_braking)

    def _time_to_stop(self, needs: float, speed: float) -> float:
        """For how long the braking that is needed, or what there is of it, brakes to a standstill, s."""
        shield = self._guard.shield
        if shield is None:
            return 0.0
        p = shield.assumed
        return HARDER * speed / min(max(needs, LEAST_M_S2), p.braking * p.limit_share) + p.response_s

    def _held_brake(self, needs: float, seen: Observation, most: float = math.inf) -> float:
        """The brake command that stops behind what was seen last, for a deceleration of `most`; NaN where
        rolling out does not hit it."""
        shield = self._guard.shield
        if shield is None:
            return math.nan
        p, slope = shield.assumed, self._acted.grade if self._acted else 0.0
        rolls_out = 0.0 if seen.leader_speed < CREEPS_M_S else p.mild_braking + GRAVITY * slope
        if not needs > max(rolls_out, LEAST_M_S2):
            return math.nan
        share = max(needs / p.braking, float(p.share_of(p.yielding))) * HARDER
        share = min(share, float(p.share_of(most)))
        return min(share, p.limit_share) * self._brake_high

    def _why_not(self) -> str:
        """Why there is nothing to follow; "" if there is."""
        guard = self._guard
        if guard.speed_is_silent[0]:
            return "the truck's speed is missing"
        if guard.contradicted_s[0] > CONTRADICTED_S:
            frozen = "the radar repeats a reading: it is frozen"
            return (
                frozen
                if guard.radar_is_frozen[0]
                else "the radar's range and the speeds contradict each other"
            )
        if guard.brakes_failed[0]:
            return f"the brakes give {guard.brake_gain[0]:.0%} of what the command promises"
        lost = guard.unseen_s[0] > self._lose_after_s + 1e-6
        return "the radar sees no vehicle ahead" if lost else ""


def _between(before: Observation, after: Observation, share: float) -> Observation:
    """The observation interpolated at a share of the interval; NaN if either end is NaN, except at
    the end."""
    if share == 1.0:
        return after
    names = ("speed", "gap", "leader_speed", "grade")
    line = {n: getattr(before, n) + share * (getattr(after, n) - getattr(before, n)) for n in names}
    return replace(after, **line)
