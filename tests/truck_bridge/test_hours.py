"""Hours of the whole chain in lock-step (radar, controller, bridge, bus, truck), with figures by hour.

`python tests/truck_bridge/test_hours.py [--hours 2] [--vehicle trucksim] [DRIVE ...]` prints the table.
`--drawn 100` drives so many hours of sound driving instead, by controller and truck without the bus between
them, each quarter of an hour drawn anew: vehicle, load, traffic with cut-ins and cut-outs, road, tyres that
are worn or new, a noisy radar and its reflections.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from fault_chain import LOST_S, NAMES, RADAR, STEP, Chain, Lane, Object, Reading, controller, load

from deeptruck_core.constants import GRAVITY
from deeptruck_core.signals import SPEED
from deeptruck_model.simulators import load as load_truck
from deeptruck_nodes.following import CONTRADICTED_S
from deeptruck_nodes.leaders import Leader, Random, Sine
from deeptruck_nodes.radar import Radar, RadarErrors
from deeptruck_nodes.roads import parse as road

HOUR_S, SETTLED_S, AGAIN_S, PIECE_H = 3600.0, 20.0, 5.0, 0.25
MEAN = 30  # steps over which an acceleration counts, 0.3 s
MOVING = 5.0  # m/s, of the truck, from which its time gap counts
CRAWLING = 1.0  # m/s, below which a truck that creeps up to a standing leader stops by jolts
NOISY = replace(RADAR, dropout_rate=0.05)
LOST = "the radar sees no vehicle ahead"
CONTRADICTED = "the radar's range and the speeds contradict each other"


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
    changes_s: float = math.inf  # between one leader and the next, in the mean
    reflections_s: float = math.inf  # between reflections of the radar, likewise
    wheels: float = 1.0  # what both wheel speeds read, as a share of the true speed
    load: float = 1.0  # share of the truck's mass


class Reflections:
    """A radar that sees another point of the vehicle for a while, or now and then twice the range."""

    def __init__(self, mean_s: float, rng: np.random.Generator) -> None:
        self._mean_s, self._rng, self._until, self._away = mean_s, rng, -math.inf, 0.0

    def readings(self, now: float, gap: float, speed: float) -> list[Reading]:
        if self._rng.random() < 0.1 / self._mean_s:
            self._until, self._away = now + self._rng.uniform(0.3, 3.0), self._rng.uniform(0.5, 4.0)
        twice = self._rng.random() < 0.1 / self._mean_s
        return [(gap * 2.0 if twice else gap + self._away * (now < self._until), speed, 0.0)]


def drawn(seed: int) -> tuple[Drive, str]:
    """Sound driving, and the vehicle."""
    rng = np.random.default_rng(seed)
    low = float(rng.uniform(8.0, 16.0))
    leaders = (
        Random(low, low + float(rng.uniform(3.0, 8.0)), float(rng.uniform(0.3, 1.0)), seed),
        Sine(float(rng.uniform(14.0, 20.0)), 2.0, float(rng.uniform(30.0, 90.0))),
        StopAndGo(),
    )
    noise = float(rng.uniform(0.05, 0.3))
    radar = RadarErrors(noise, noise / 3.0, float(rng.uniform(0.0, 0.1)))
    slope = float(rng.uniform(0.005, 0.03))
    hills = ("flat", f"sine:grade={slope:.3f},length={rng.uniform(1000, 3000):.0f}")
    plan = Drive(
        leaders[int(rng.choice(3, p=[0.6, 0.25, 0.15]))],
        str(rng.choice(hills)),
        radar,
        hardest=-4.0,  # behind a vehicle that cuts in
        least_time_gap=0.5,
        changes_s=float(rng.uniform(60.0, 300.0)),
        reflections_s=float(rng.uniform(10.0, 60.0)),
        wheels=float(rng.uniform(0.98, 1.03)),
        load=float(rng.uniform(0.75, 1.5)),
    )
    return plan, NAMES[seed % len(NAMES)]


def _ahead(plan: Drive, rng: np.random.Generator, seconds: float) -> list[Object]:
    """One leader after the other, each as fast as the traffic."""
    found, at = [Object(plan.leader)], 0.0
    while (
        at := at + (rng.exponential(plan.changes_s) + 30.0 if plan.changes_s < math.inf else math.inf)
    ) < seconds:
        speed = plan.leader.speed_at(at)
        gap = max(float(rng.uniform(1.2, 4.0)) * speed, 12.0)
        found[-1] = replace(found[-1], leaves=at)
        found.append(Object(plan.leader, gap, at))
    return found


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
    ended: Counter[str] = field(default_factory=Counter)  # how often control was handed back, by cause
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


HEADS = "hardest, m/s² | time gap, s | handed back | driven, min | brake heat, bound, J/kg | memory, KiB"


def drive(
    plan: Drive, vehicle: str, hours: float, say: Callable[[Hour], None] = lambda hour: None, seed: int = 3
) -> list[Hour]:
    """The figures of each hour; a person engages again 5 s after control was handed back."""
    found, memory, rng = list[Hour](), _memory_kib(), np.random.default_rng(seed)
    slope = lru_cache(8)(lambda distance: road(plan.road).at(distance)[0]) if plan.road != "flat" else None
    driven = load(vehicle).driving_off()
    chain = Chain(driven, rng, [Object(plan.leader)], "baseline:acc", slope, plan.radar)
    values, wanted_at, held = chain.truck.parameters, 1.0, False
    per_kelvin = values["brake_heat_capacity"] / values["mass"]
    assert chain.guard.shield is not None
    hour, speeds, since = Hour(), [chain.truck.speed] * MEAN, -math.inf
    for k in range(round(hours * HOUR_S / STEP)):
        chain.step()
        for kept in (chain.ours.sent, chain.trucks.sent, chain.speeds):
            kept.clear()  # what a test may look up, of hours
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
        if held and chain.guard.shield._ahead is not None and k % 100 == 0:
            warmer = chain.truck.inside("brake_temperature") - values["ambient_temperature"]
            heat, bound = warmer * per_kelvin, float(chain.guard.shield._truck.heat[0])
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
    """Each 72 min: memory of the second hour, heat of the brakes."""
    plan = DRIVES[name]
    for hour in drive(plan, vehicle, 1.2):
        assert hour.hardest >= plan.hardest and hour.least_time_gap >= plan.least_time_gap, hour
        assert hour.ended.keys() <= plan.causes and hour.heat_margin > -10.0, hour
        assert hour.grown_kib < 5000.0, hour


@pytest.mark.hours
@pytest.mark.timeout(0)
def test_sound_driving_is_handed_back_once_in_ten_hours_at_most() -> None:
    """100 h of controller and truck, without the bus."""
    for n, vehicle in enumerate(NAMES):
        hours = [hour for _, hour in alone(vehicle, range(n, n + 400, len(NAMES)))]
        ended = sum((hour.ended for hour in hours), Counter[str]())
        assert ended.total() <= 0.1 * PIECE_H * len(hours), ended


def alone(vehicle: str, seeds: Sequence[int]) -> Iterator[tuple[int, Hour]]:
    """The figures of a quarter of an hour of each drive, all at once: the controller's core and the truck.

    Control goes on where it would end; a drive counts again after AGAIN_S.
    """
    rngs, plans = [np.random.default_rng(seed) for seed in seeds], [drawn(seed)[0] for seed in seeds]
    guard, truck = controller(load(vehicle), "baseline:acc"), load_truck(load(vehicle).truck)
    lanes = [Lane(_ahead(plan, rng, PIECE_H * HOUR_S)) for plan, rng in zip(plans, rngs, strict=True)]
    radars = [Radar(plan.radar, int(rng.integers(1 << 31))) for plan, rng in zip(plans, rngs, strict=True)]
    points = [Reflections(plan.reflections_s, rng) for plan, rng in zip(plans, rngs, strict=True)]
    roads = [road(plan.road) for plan in plans]
    wheels, hours = np.array([plan.wheels for plan in plans]), [Hour() for _ in plans]
    sensed, mass = truck.interface.grade, truck.parameters()["mass"]
    truck = truck.with_grade_input().with_batch_parameters({"mass": np.array([mass * p.load for p in plans])})
    y = np.zeros((len(plans), len(truck.interface.y)))
    y[:, SPEED] = [plan.leader.speed_at(0.0) for plan in plans]
    state, places, ended_at = truck.reset(y), np.zeros(len(plans)), np.full(len(plans), -math.inf)
    for k in range(round(PIECE_H * HOUR_S / guard.dt)):
        now, speeds, seen = k * guard.dt, y[:, SPEED], np.full((2, len(plans)), np.nan)
        for n, (lane, radar, point) in enumerate(zip(lanes, radars, points, strict=True)):
            lane.update(now, float(speeds[n]))
            (gap, leader, _) = point.readings(now, *radar.sense(now, *lane.seen))[0]
            seen[:, n] = gap, leader
        slope = np.array([one.at(place)[0] for one, place in zip(roads, places, strict=True)])
        observed = {"gap": seen[0], "leader_speed": seen[1], "speed": speeds * wheels, "grade": slope}
        observed |= {"target_time_gap": np.full(len(plans), 2.0)} | (
            {} if sensed else {"grade": slope * np.nan}
        )
        u = np.column_stack(guard.act(observed))
        ends = {
            CONTRADICTED: guard.contradicted_s > CONTRADICTED_S,
            LOST: guard.unseen_s > LOST_S,
        }
        state, y = truck.step(state, u, slope[:, None])
        places += y[:, SPEED] * guard.dt
        for n, hour in enumerate(hours):
            causes = [cause for cause, flags in ends.items() if flags[n]]
            if causes and now - ended_at[n] > AGAIN_S:
                hour.ended[causes[0]] += 1
            ended_at[n] = now if causes else ended_at[n]
            hour.driven_s += guard.dt
            held = now - max(ended_at[n], 0.0) > SETTLED_S
            if held and y[n, SPEED] > CRAWLING:
                hour.hardest = min(hour.hardest, float(y[n, 0]) + GRAVITY * slope[n])
            if held and y[n, SPEED] > MOVING:
                time_gap = lanes[n].ahead[0] / float(y[n, SPEED])
                hour.least_time_gap = min(hour.least_time_gap, time_gap)
                hour.longest_time_gap = max(hour.longest_time_gap, time_gap)
    yield from zip(seeds, hours, strict=True)


def available(hours: float, first: int) -> None:
    """Print what ended control in so many hours of drawn driving."""
    seeds, begin = range(first, first + round(hours / PIECE_H)), time.process_time()
    by_vehicle: dict[str, list[int]] = {}
    for seed in seeds:
        by_vehicle.setdefault(drawn(seed)[1], []).append(seed)
    found = (one for name, its in by_vehicle.items() for one in alone(name, its))
    ended, driven, hardest = Counter[str](), 0.0, 0.0
    for seed, hour in found:
        driven, hardest = driven + hour.driven_s, min(hardest, hour.hardest)
        ended.update(hour.ended)
        if hour.ended or hour.hardest < -2.0:
            print(f"seed {seed}, {drawn(seed)[1]}: {hour}", file=sys.stderr, flush=True)
    so_far, cpu = driven / HOUR_S, (time.process_time() - begin) / HOUR_S
    print(f"{so_far:.1f} h under control of {hours:g} h, {cpu:.2f} h of CPU; hardest {hardest:.2f} m/s²")
    print("| handed back | times | an hour |\n|---|---|---|")
    for cause, count in [*ended.most_common(), ("in all", ended.total())]:
        print(f"| {cause} | {count} | {count / so_far:.2f} |")


def main() -> None:
    """Print the figures of every hour."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("drives", nargs="*", metavar="DRIVE", help=", ".join(DRIVES))
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--vehicle", default="trucksim")
    parser.add_argument("--drawn", type=float, default=0.0, help="hours of drawn driving instead")
    parser.add_argument("--first", type=int, default=0, help="seed of the first drawn drive")
    options = parser.parse_args()
    if options.drawn:
        available(options.drawn, options.first)
        return
    print(f"| drive | {HEADS} |\n{'|---' * (HEADS.count('|') + 2)}|")
    for name in options.drives or DRIVES:
        begin = f"| {name} on {options.vehicle} |"
        say = partial(_print, begin)
        drive(DRIVES[name], options.vehicle, options.hours, say)


def _print(begin: str, hour: Hour) -> None:
    print(begin, hour, "|", flush=True)


if __name__ == "__main__":
    main()
