"""Eleven hours of the whole chain in lock-step (radar, controller, bridge, bus, truck), with figures by hour.

`python tests/truck_bridge/test_hours.py [--hours 2] [--vehicle trucksim] [DRIVE ...]` prints the table.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from fault_chain import RADAR, STEP, Chain
from fault_world import load

from deeptruck_nodes.leaders import Leader, Random, Sine
from deeptruck_nodes.radar import RadarErrors
from deeptruck_nodes.roads import parse as road

HOUR_S, SETTLED_S, AGAIN_S = 3600.0, 20.0, 5.0
MEAN = 30  # steps over which an acceleration counts, 0.3 s
MOVING = 5.0  # m/s, of the truck, from which its time gap counts
CRAWLING = 1.0  # m/s, below which a truck that creeps up to a standing leader stops by jolts
GRAVITY = 9.81
NOISY = replace(RADAR, dropout_rate=0.05)
LOST = "the radar sees no vehicle ahead"


@dataclass(frozen=True)
class StopAndGo:
    """Every 80 s from standstill to 14 m/s by 0.7 m/s^2, and back; 10 s at either."""

    def speed_at(self, t: float) -> float:
        return float(np.clip(0.7 * (35.0 - abs(t % 80.0 - 35.0)) - 3.5, 0.0, 14.0))


@dataclass(frozen=True)
class Drive:
    """What leader, road and radar do, and what the figures of each hour must keep."""

    leader: Leader
    road: str = "flat"
    radar: RadarErrors = NOISY
    hardest: float = -1.0  # m/s^2, the mean of 0.3 s without the slope
    least_time_gap: float = 1.7  # s, of 2 s
    causes: frozenset[str] = frozenset()  # for which control may end


DRIVES = {
    "following": Drive(Sine(18.0, 2.0, 60.0)),
    "traffic": Drive(Random(12.0, 25.0, 0.5)),
    "waves": Drive(Sine(20.0, 1.2, 15.0), hardest=-1.5),  # whose leader brakes by 0.5 m/s^2
    "hard traffic": Drive(Random(2.0, 22.0, 1.0), hardest=-2.0, least_time_gap=1.2),  # by 1 m/s^2
    "stop and go": Drive(StopAndGo(), hardest=-1.5, least_time_gap=1.2),
    "hills": Drive(Sine(18.0, 2.0, 60.0), "sine:grade=0.03,length=2000"),
    "losses": Drive(
        Sine(18.0, 2.0, 60.0),
        radar=replace(RADAR, dropout_rate=0.02, dropout_s=2.0),
        causes=frozenset({LOST}),
    ),
}


@dataclass
class Hour:
    """Figures of an hour."""

    hardest: float = 0.0  # m/s^2
    least_time_gap: float = math.inf  # s
    longest_time_gap: float = 0.0
    ended: Counter[str] = field(default_factory=Counter)  # how often control ended, by cause
    driven_s: float = 0.0  # under control
    heat: float = 0.0  # J/kg, the most in the brakes
    bound: float = 0.0  # J/kg, the shield's bound of it then
    heat_margin: float = math.inf  # J/kg, least of the bound less the true heat
    grown_kib: float = 0.0  # resident memory of the process

    def __str__(self) -> str:
        causes = ", ".join(f"{cause} {count}" for cause, count in self.ended.items()) or "none"
        gaps = f"{self.least_time_gap:.2f} to {self.longest_time_gap:.2f}"
        return (
            f"{self.hardest:.2f} | {gaps} | {causes} | {self.driven_s / 60:.1f} | "
            f"{self.heat:.0f}, {self.bound:.0f} | {self.grown_kib:+.0f}"
        )


HEADS = "hardest, m/s² | time gap, s | control ended | driven, min | brake heat, bound, J/kg | memory, KiB"


def drive(
    name: str, vehicle: str, hours: float, say: Callable[[Hour], None] = lambda hour: None
) -> list[Hour]:
    """The figures of each hour; a person engages again 5 s after control ended."""
    plan, found, memory = DRIVES[name], list[Hour](), _memory_kib()
    slope = lru_cache(8)(lambda distance: road(plan.road).at(distance)[0]) if plan.road != "flat" else None
    chain = Chain(load(vehicle), np.random.default_rng(3), plan.leader, "baseline:acc", slope, plan.radar)
    values, wanted_at, held = chain.truck.parameters, 1.0, False
    per_kelvin = values["brake_heat_capacity"] / values["mass"]
    assert chain.guard.shield is not None
    hour, speeds, since = Hour(), [chain.truck.speed] * MEAN, -math.inf
    for k in range(round(hours * HOUR_S / STEP)):
        chain.step()
        for wire in (chain.ours, chain.trucks):
            wire.sent.clear()  # what a test may look up, of hours
        if not held and chain.now >= wanted_at:
            held = not chain.engage()
            since = chain.now if held else since
        elif held and chain.state != "engaged":
            cause = chain.following.why or chain.bridge.safety.reason
            held, wanted_at = False, chain.now + AGAIN_S
            hour.ended[cause] += 1
        speed, speeds[k % MEAN] = chain.truck.speed, chain.truck.speed
        if held and chain.now - since > SETTLED_S:
            pull = (speed - speeds[(k + 1) % MEAN]) / (STEP * (MEAN - 1)) + GRAVITY * chain.truck.slope
            if speed > CRAWLING:
                hour.hardest = min(hour.hardest, pull)
            if speed > MOVING:
                hour.least_time_gap = min(hour.least_time_gap, chain.lane.ahead[0] / speed)
                hour.longest_time_gap = max(hour.longest_time_gap, chain.lane.ahead[0] / speed)
        hour.driven_s += STEP * held
        if held and chain.guard.shield._seen is not None and k % 100 == 0:
            warmer = chain.truck.inside("brake_temperature") - values["ambient_temperature"]
            heat, bound = warmer * per_kelvin, float(chain.guard.shield._seen.heat[0])
            hour.heat_margin = min(hour.heat_margin, bound - heat)
            if heat > hour.heat:
                hour.heat, hour.bound = heat, bound
        if k == round(60.0 / STEP):  # everything is loaded and compiled
            memory = _memory_kib()
        if (k + 1) % round(HOUR_S / STEP) == 0 or k + 1 == round(hours * HOUR_S / STEP):
            now = _memory_kib()
            hour.grown_kib, memory = now - memory, now
            found.append(hour)
            say(hour)
            hour = Hour()
    chain.close()
    return found


def _memory_kib() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4.0


@pytest.mark.hours
@pytest.mark.timeout(0)
@pytest.mark.parametrize(
    ("name", "vehicle"),
    [
        ("following", "trucksim"),
        ("traffic", "volvo"),
        ("waves", "volvo"),
        ("hard traffic", "freightliner"),
        ("stop and go", "freightliner"),
        ("hills", "trucksim"),
        ("losses", "volvo"),
    ],
)
def test_hours_of_the_whole_chain(name: str, vehicle: str) -> None:
    """Each 96 min."""
    plan = DRIVES[name]
    for hour in drive(name, vehicle, 1.6):
        assert hour.hardest >= plan.hardest and hour.least_time_gap >= plan.least_time_gap, hour
        assert hour.ended.keys() <= plan.causes and hour.heat_margin > -10.0, hour
        assert hour.grown_kib < 5000.0, hour


def main() -> None:
    """Print the figures of every hour."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("drives", nargs="*", metavar="DRIVE", help=", ".join(DRIVES))
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--vehicle", default="trucksim")
    options = parser.parse_args()
    print(f"| drive | {HEADS} |\n{'|---' * (HEADS.count('|') + 2)}|")
    for name in options.drives or DRIVES:
        begin = f"| {name} on {options.vehicle} |"
        drive(
            name,
            options.vehicle,
            options.hours,
            lambda hour, begin=begin: print(begin, hour, "|", flush=True),
        )  # type: ignore[misc]


if __name__ == "__main__":
    main()
