"""The whole chain on the road: what is ahead, what is at fault, and what the truck does then.

`python tests/truck_bridge/fault_road.py --runs 1000` drives radar, controller, bridge and truck in lock-step
(`fault_chain.py`) through scenes that are drawn from the tables of `fault_table.py`: traffic, none to two
faults, slope and load. Every run is drawn from its seed.

A run is broken where the truck hits what is ahead faster than full braking would from the second true reading
after it happened; where it brakes beyond 1 m/s^2 and neither traffic nor the true gap is the cause, until 3 s
after control was handed back; where control is kept for more than 1 s on a speed that another signal
contradicts beyond the vehicle's own tolerances; where the chain does not hand back on a fault that demands
it, or does so on one that is to be bridged or without any; and where a frame leaves that must not
(`fault_judge.py`).
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from fault_chain import NAMES, TIME_GAP_S, Chain, Object, Stop, load
from fault_judge import frames
from fault_table import (
    FAULTS,
    GRADES,
    HARMLESS,
    LOADS,
    MOMENTS,
    TRAFFIC,
    UNSEEN,
    begin,
    draw,
    must_bridge,
    must_end,
    possible,
)

from deeptruck_cacc.controllers.scaling import ActionScale
from deeptruck_model.simulators import Simulator
from deeptruck_model.simulators import load as load_truck
from truck_bridge.emulator.ecus import Actuator

ENGAGED_AT, LENGTH, AFTER_S = 0.6, 12.0, 3.0
KEPT_S = 1.0
BRAKED = -1.0  # m/s^2 beyond the slope
MEAN = 31  # steps over which an acceleration counts, 0.3 s
CLOSING = 0.5  # m/s^2, from which the closing speed asks for braking
CAUSE_S = 4.0  # for which a leader that slowed down explains braking
KNOWN_S = 0.5  # before control is handed back, from which on what happens ahead is not yet the driver's
WORSE = 0.5  # m/s, faster than by full braking, from which a hit is broken
EARLY = ("second", "ours", "nobody")  # half of them before engaging
GRAVITY = 9.81


@dataclass(frozen=True)
class Drawn:
    """A fault of a run: name, size, and when it begins and ends, s."""

    name: str
    size: float
    at: float
    until: float


@dataclass(frozen=True)
class Verdict:
    """One run. Times in s from the first fault, or from what happens ahead; speeds in m/s."""

    scene: str
    traffic: str
    faults: tuple[Drawn, ...]
    ended_s: float  # NaN where control was kept
    false_s: float  # longest that control was kept on a contradicted speed
    gained: float  # by the truck, until control was handed back or the run ended
    braked: float  # hardest mean acceleration without cause, m/s^2, negative
    jerk: float  # largest of it without cause, m/s^3
    hit: float  # m/s; NaN for none
    fully: float  # m/s, likewise by full braking from the second true reading; NaN where there was none
    broken: tuple[str, ...]
    unseen: tuple[str, ...] = ()  # what the truck did on a fault that no receiver can know
    reason: str = ""


@cache
def loaded(name: str, load_factor: float) -> Simulator:
    """A truck with this share of its mass."""
    truck = load_truck(name)
    return truck.with_parameters({"mass": load_factor * truck.parameters()["mass"]})


@cache
def _full_braking(truck: Simulator, grade: float) -> float:
    """m/s^2 from 20 m/s, once it has begun."""
    start = np.zeros((1, len(truck.interface.y)))
    start[0, 1] = 20.0
    state, speeds = truck.reset(start), [20.0]
    u, w = np.array([[0.0, ActionScale.of(truck).brake_high]]), np.full((1, len(truck.interface.w)), grade)
    while speeds[-1] > 5.0 and len(speeds) * truck.dt < 10.0:
        state, y = truck.step(state, u, w)
        speeds.append(float(y[0, 1]))
    first = round(0.5 / truck.dt)
    return max((speeds[first] - speeds[-1]) / ((len(speeds) - 1 - first) * truck.dt), 0.3)


class Witness:
    """What happens on the road, from a moment on."""

    def __init__(self, chain: Chain, braking: float, happens: float, plan: Sequence[Drawn]) -> None:
        self._chain, self._braking, self.happens = chain, braking, happens
        self._brakes = [d for d in plan if FAULTS[d.name].signals == ("brake",)]
        self._speeds, self._leads = deque[float](maxlen=MEAN), deque[tuple[float, float]](maxlen=MEAN)
        self._pulls = deque[float](maxlen=MEAN)
        self._caused_at, self.braked, self.jerk, self.hit = -math.inf, 0.0, 0.0, math.nan
        self._true = 0
        self.fully: Stop | None = None

    def needs(self, speed: float, leader: float) -> float:
        """m, behind a leader that brakes by 6 m/s^2, if full braking begins within 0.8 s."""
        theirs = leader**2 / 12.0 if math.isfinite(leader) else math.inf
        return 2.0 + 0.8 * speed + speed**2 / (2.0 * self._braking) - theirs

    def look(self, judged: bool) -> None:
        """After a step; `judged`: whether braking counts."""
        chain, speed, (gap, leader) = self._chain, self._chain.truck.speed, self._chain.lane.ahead
        self._speeds.append(speed)
        self._leads.append((gap, leader))
        (before, its), moved = self._leads[0], (len(self._leads) - 1) * 0.01
        slows = leader - its < -0.06 or gap - before < (its - self._speeds[0] - 1.0) * moved - 1.0
        closing = max(speed - leader, 0.0) if math.isfinite(leader) else 0.0
        asks = closing**2 / 2.0 > CLOSING * max(gap - 5.0, 1.0)
        if gap - self.needs(speed, leader) < 10.0 or slows or asks:
            self._caused_at = chain.now
        full = len(self._speeds) == MEAN
        moves = (speed - self._speeds[0]) / 0.3 + GRAVITY * max(chain.truck.slope, 0.0) if full else 0.0
        self._pulls.append(moves)
        if judged and full and chain.now - self._caused_at > CAUSE_S:
            self.braked = min(self.braked, moves)
            jerk = (moves - self._pulls[0]) / 0.3 if len(self._pulls) == MEAN and speed > 0.5 else 0.0
            self.jerk = max(self.jerk, jerk, -jerk)
        if math.isnan(self.hit) and gap <= 0.0:
            self.hit = speed - leader
        if self.fully is None and chain.now >= self.happens:
            near = [
                abs(g - gap) < 5.0 and abs(v - leader) < 1.0 and age < 0.3 for g, v, age in chain.readings
            ]
            self._true += any(near)
            self.fully = chain.braking_fully(self._fails) if self._true == 2 else None

    def _fails(self, now: float) -> dict[str, float]:
        sound = Actuator(0.0)
        keys = ((d, FAULTS[d.name].kind) for d in self._brakes)
        return {key: d.size if d.at <= now < d.until else getattr(sound, key) for d, key in keys}


def play(
    seed: int,
    *faults: str,
    traffic: str | None = None,
    policy: str = "baseline:acc",
    length: float = LENGTH,
    names: Sequence[str] = NAMES,
    drawn_from: str | None = None,
) -> Verdict:
    """One run in lock-step, of these faults and this traffic, of faults of one machine, or of all."""
    rng = np.random.default_rng(seed)
    vehicle = load(names[seed % len(names)])
    at, grade, heavy = float(rng.uniform(*MOMENTS)), float(rng.choice(GRADES)), float(rng.choice(LOADS))
    can = [one for one in possible(vehicle) if drawn_from in (None, FAULTS[one].machine)]
    count = int(rng.choice(3, p=[0.15, 0.6, 0.25]))
    chosen = [draw(vehicle, rng, [name]) for name in faults] or [
        draw(vehicle, rng, can) for _ in range(count)
    ]
    early = any(FAULTS[n].kind in EARLY or set(FAULTS[n].signals) & set(EARLY) for n, _, _ in chosen)
    early = early and rng.random() < 0.5
    ahead, speed = traffic or str(rng.choice(list(TRAFFIC))), float(rng.uniform(10.0, 22.0))
    happens = max(at + float(rng.uniform(-3.0, 2.0)), 5.5)
    plan = [Drawn(n, size, at + 1.5 * k, at + 1.5 * k + lasts) for k, (n, size, lasts) in enumerate(chosen)]
    plan = [Drawn(d.name, d.size, 0.3, math.inf) for d in plan] if early else plan
    truck = loaded(vehicle.truck, heavy)
    braking = _full_braking(truck.with_grade_input() if hasattr(truck, "with_grade_input") else truck, grade)
    objects = TRAFFIC[ahead](rng, speed, happens)
    chain = Chain(vehicle, rng, objects, policy, lambda distance: grade, truck=truck)
    witness = Witness(chain, braking, at if ahead in HARMLESS else happens, plan)
    first = objects[0]
    room = max(TIME_GAP_S * speed, witness.needs(speed, speed) + 15.0)  # what it drives with on such a road
    chain.lane.objects = (Object(first.motion, room, first.comes, first.leaves), *objects[1:])
    for one in objects[1:]:
        assert one.gap > 0
    scene = f"{vehicle.name}, {ahead}, {' and '.join(d.name for d in plan) or 'nothing'}"
    scene += f", {100 * grade:+.0f} %" * bool(grade) + f", {heavy:g} of the mass" * (heavy != 1.0)
    begins = min([d.at for d in plan], default=happens)
    ended, false_since, longest, why, reason = math.nan, math.nan, 0.0, ("not asked",), ""
    stood = False  # it may be handed back to a driver who is to drive off
    engaged, start, gained, undo = False, speed, 0.0, dict[Drawn, object]()
    lied = frozenset(
        s for d in plan if FAULTS[d.name].machine in ("bus", "driver") for s in _told(vehicle, d)
    )
    brakes = any(FAULTS[d.name].machine in ("driver", "person") for d in plan)
    end = max(begins, happens if ahead != "steady" else 0.0) + length
    while chain.now < end:
        chain.step()
        for d in plan:
            if d not in undo and chain.now >= d.at:
                undo[d], start = begin(chain, d.name, d.size), chain.truck.speed if not undo else start
            if undo.get(d) and chain.now >= d.until:
                undo[d]()  # type: ignore[operator]
                undo[d] = None
            if FAULTS[d.name].machine == "driver" and chain.now >= d.at + 0.5:
                chain.truck.driver.brake_pedal = d.size
        if not engaged and chain.now >= ENGAGED_AT:
            why = chain.engage()
            engaged = not why
            if why and chain.now > ENGAGED_AT + 0.6:
                break
        holds = chain.state == "engaged"
        if engaged and not holds and math.isnan(ended):
            ended, gained, stood = chain.now, chain.truck.speed - start, chain.truck.speed < 0.1
            reason = chain.following.why or chain.bridge.safety.reason
        false = holds and bool(undo) and chain.contradicted(lied)
        false_since = (chain.now if math.isnan(false_since) else false_since) if false else math.nan
        longest = max(longest, 0.0 if math.isnan(false_since) else chain.now - false_since)
        if not early:
            witness.look(judged=chain.now > 2.0 and not brakes and not chain.now > ended + AFTER_S)
        # what happens ahead after the hand-back is the driver's
        rolls_out = ahead in HARMLESS or ended < witness.happens + KNOWN_S
        over = chain.now > ended + AFTER_S and (chain.truck.speed < 0.1 or rolls_out)
        if over or not math.isnan(witness.hit):
            break
    chain.close()
    broken = [] if early else frames(chain, {d.name for d in plan}, begins)
    gained = chain.truck.speed - start if math.isnan(ended) else gained
    reason = reason if engaged else f"refused: {', '.join(why)}"
    names_of = [d.name for d in plan]
    must = any(must_end(d.name, d.size, d.until - d.at, vehicle) for d in plan)
    bridge = ahead != "leader pulls away" and all(must_bridge(d.name, d.until - d.at) for d in plan)
    unseen = []
    if early and engaged:
        broken.append("engaged")
    if not early and not engaged and braking > 2.5 and "too near" not in reason:
        broken.append("did not engage")
    if not early and engaged and math.isnan(ended) and must and math.isnan(witness.hit):
        broken.append("control was kept")
    if not early and (ended < begins or (not math.isnan(ended) and bridge and not stood)):
        broken.append("handed back")
    if longest > KEPT_S:
        broken.append("control was kept on a false speed")
    known = not set(names_of) & UNSEEN.keys()
    fully = math.nan if witness.fully is None else witness.fully.hit_speed
    blind = witness.fully is None and (ahead not in HARMLESS or not known)
    drives = ended < witness.happens + (0.0 if ahead in HARMLESS else KNOWN_S) or reason.startswith(
        "driver"
    )  # the driver, who has taken over
    if not math.isnan(witness.hit) and not drives and not witness.hit <= fully + WORSE:
        (unseen if blind else broken).append("hit")
    if witness.braked < BRAKED:
        (broken if known and ahead != "adjacent lane" else unseen).append("braked without cause")
    ended = begins if early else ended
    return Verdict(
        scene, ahead, tuple(plan), ended - begins, longest, gained, witness.braked, witness.jerk,
        witness.hit, fully, tuple(broken), tuple(unseen), reason,
    )  # fmt: skip


def _told(vehicle: object, drawn: Drawn) -> tuple[str, ...]:
    signals = FAULTS[drawn.name].signals
    if signals != ("all",):
        return signals
    return tuple(s.name for heard in vehicle.table.heard for s in heard.signals)  # type: ignore[attr-defined]


def _row(name: str, mine: list[Verdict]) -> str:
    """A line of the report."""
    ended = [v.ended_s for v in mine if not math.isnan(v.ended_s)]
    longest = f"{max(ended):.2f}" if ended else "-"
    worst = min(v.braked for v in mine), max(v.jerk for v in mine)
    hits = [v for v in mine if not math.isnan(v.hit)]
    met = [f"{v.hit:.1f} ({v.fully:.1f})" for v in sorted(hits, key=lambda v: -v.hit)[:3]]
    bad = sum(bool(v.broken) for v in mine), sum(bool(v.unseen) for v in mine)
    shown = f"{len(ended)}, {longest} | {max(v.false_s for v in mine):.2f} | {worst[0]:.1f}, {worst[1]:.1f}"
    return f"| {name} | {len(mine)} | {shown} | {len(hits)} | {', '.join(met)} | {bad[0]} | {bad[1]} |"


HEADS = "runs | handed back, at most s | false speed, s | braked, m/s²; jerk, m/s³ | hits"
HEADS += " | hardest, m/s (by full braking) | broken | not prevented |"


def report(verdicts: list[Verdict]) -> Iterator[str]:
    """Tables by traffic and by what became of what."""
    kinds: dict[str, list[Verdict]] = {}
    for v in verdicts:
        for d in v.faults or (Drawn("nothing", math.nan, 0.0, 0.0),):
            fault = FAULTS[d.name]
            several = fault.signals[0] if len(fault.signals) == 1 and fault.machine != "bus" else ""
            kinds.setdefault(f"{several or fault.machine} {fault.kind}".strip(), []).append(v)
    tables = {
        "what is ahead": {name: [v for v in verdicts if v.traffic == name] for name in TRAFFIC},
        "fault": dict(sorted(kinds.items())),
        "faults": {str(n): [v for v in verdicts if len(v.faults) == n] for n in range(3)},
    }
    for head, rows in tables.items():
        yield f"| {head} | {HEADS}\n{'|---' * (HEADS.count('|') + 1)}|"
        yield from (_row(name, mine) for name, mine in rows.items() if mine)
        yield ""
    counts = [sum(bool(v.broken) for v in verdicts), sum(bool(v.unseen) for v in verdicts)]
    yield f"{len(verdicts)} runs, {counts[0]} broken, {counts[1]} not prevented"


def main() -> int:
    """Run many and say what broke."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="seed of the first run")
    parser.add_argument("--fault", action="append", default=[], choices=list(FAULTS), help="only this one")
    parser.add_argument("--traffic", choices=list(TRAFFIC), help="only this")
    machines = sorted({fault.machine for fault in FAULTS.values()})
    parser.add_argument("--machine", choices=machines, help="only its faults")
    parser.add_argument("--vehicle", action="append", help="vehicle file or name; else ours, by turns")
    parser.add_argument("--policy", default="baseline:acc")
    parser.add_argument("--seconds", type=float, default=LENGTH, help="of a run, from the fault on")
    options = parser.parse_args()
    chosen = {"traffic": options.traffic, "policy": options.policy, "length": options.seconds}
    chosen |= {"names": options.vehicle or NAMES, "drawn_from": options.machine}
    verdicts = []
    for seed in range(options.first, options.first + options.runs):
        verdicts.append(play(seed, *options.fault, **chosen))
        if verdicts[-1].broken:
            print(f"seed {seed}: {verdicts[-1]}", file=sys.stderr, flush=True)
    print("\n".join(report(verdicts)))
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    return 1 if any(v.broken for v in verdicts) else 0


if __name__ == "__main__":
    sys.exit(main())
