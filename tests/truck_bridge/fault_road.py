"""The whole chain on the road: what is ahead, what is at fault, and what the truck does then.

`python tests/truck_bridge/fault_road.py --runs 1000` drives radar, controller, bridge and truck in lock-step
(`fault_chain.py`) through scenes that are drawn from the tables of `fault_table.py`: traffic, none to two
faults, slope and load. Every run is drawn from its seed.

A run is broken where the truck hits what is ahead faster than full braking would from the second true reading
after it happened; where it brakes beyond 1 m/s^2 (2.5 for what is read in another lane) and neither traffic
nor the true gap is the cause, until 3 s after control was handed back; where control is kept for
more than 1 s on a speed that another signal contradicts beyond the vehicle's own tolerances; where the chain
does not hand back on a fault that demands it, or does so on one that is to be bridged or without any; and
where a frame leaves that must not (`fault_judge.py`).
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from fault_chain import NAMES, REACH_M, TIME_GAP_S, Chain, Object, Stop, load
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
from deeptruck_cacc.safety.assumptions import Assumptions
from deeptruck_cacc.safety.truck_limits import STEEPEST, known, measure
from deeptruck_core.constants import GRAVITY
from deeptruck_model.simulators import Simulator
from deeptruck_model.simulators import load as load_truck
from truck_bridge.emulator.ecus import Actuator
from truck_bridge.vehicles import Vehicle

ENGAGED_AT, LENGTH, AFTER_S = 0.6, 12.0, 3.0
KEPT_S = 1.0
BRAKED = -1.0  # m/s^2 beyond the slope
YIELDED = -2.5  # m/s^2, where something is read nearer than the leader that is not in the lane
MEAN = 31  # steps over which an acceleration counts, 0.3 s
CLOSING = 0.5  # m/s^2, from which the closing speed asks for braking
SLOWER_M_S, SLOWER_M_S2 = 2.0, 1.0  # what is slower by so much ahead asks for so much, however far it is
CAUSE_S = 4.0  # for which a leader that slowed down explains braking
TAKES_OVER_S = 10.0  # UN R157, 5.4: in which a driver who is asked takes over
WORSE = 0.5  # m/s, faster than by full braking, from which a hit is broken
EARLY = ("second", "ours", "nobody")  # half of them before engaging
UNHEARD = "link lost"  # from then on no frame of ours leaves


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
def limits_of(name: str, load_factor: float, grade: float) -> Assumptions:
    """As a run knows or measures them, of this load and on these descents."""
    truck = loaded(name, load_factor)
    stored = known(truck.interface, truck.parameters(), grade)
    return stored or measure(truck, worst_grade=min(grade, STEEPEST))


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
        self._caused_at, self.braked, self.hit = -math.inf, 0.0, math.nan
        self._true, self.known_at = 0, math.inf  # true readings, and when the second of them came
        self._last: tuple[float, ...] = ()
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
        if judged and full and chain.now - self._caused_at > CAUSE_S:
            self.braked = min(self.braked, moves + (SLOWER_M_S2 if closing > SLOWER_M_S else 0.0))
        if math.isnan(self.hit) and gap <= 0.0:
            self.hit = speed - leader
        if self.fully is None and chain.now >= self.happens:
            new = [one for one in chain.readings if one[:2] != self._last]  # a repeated one shows nothing
            self._true += any(abs(g - gap) < 5.0 and abs(v - leader) < 1.0 and a < 0.3 for g, v, a in new)
            if self._true == 2:
                self.fully, self.known_at = chain.braking_fully(self._fails), chain.now
        self._last = tuple(chain.readings[-1][:2]) if chain.readings else self._last

    def _fails(self, now: float) -> dict[str, float]:
        sound = Actuator(0.0)
        keys = ((d, FAULTS[d.name].kind) for d in self._brakes)
        return {key: d.size if d.at <= now < d.until else getattr(sound, key) for d, key in keys}


@dataclass(frozen=True)
class Scene:
    """What is drawn for a run."""

    vehicle: Vehicle
    traffic: str
    plan: tuple[Drawn, ...]
    speed: float  # m/s, at the start
    happens: float  # s, when something happens ahead
    early: bool  # the fault is there before control is engaged
    grade: float
    load: float  # of the truck's mass

    @property
    def truck(self) -> Simulator:
        return loaded(self.vehicle.truck, self.load)

    @property
    def braking(self) -> float:
        """m/s^2, by the full command on this road."""
        truck = self.truck
        on_road = truck.with_grade_input() if hasattr(truck, "with_grade_input") else truck
        return _full_braking(on_road, self.grade)

    @property
    def begins(self) -> float:
        return min([drawn.at for drawn in self.plan], default=self.happens)

    def __str__(self) -> str:
        faults = " and ".join(drawn.name for drawn in self.plan) or "nothing"
        on = f", {100 * self.grade:+.0f} %" * bool(self.grade) + f", {self.load:g} of the mass" * (
            self.load != 1
        )
        return f"{self.vehicle.name}, {self.traffic}, {faults}{on}"


def draw_scene(
    rng: np.random.Generator,
    vehicle: Vehicle,
    faults: Sequence[str] = (),
    traffic: str | None = None,
    drawn_from: str | None = None,
) -> Scene:
    """A scene of these faults and this traffic, of faults of one machine, or of all."""
    at, grade, heavy = float(rng.uniform(*MOMENTS)), float(rng.choice(GRADES)), float(rng.choice(LOADS))
    can = [one for one in possible(vehicle) if drawn_from in (None, FAULTS[one].machine)]
    count = int(rng.choice(3, p=[0.15, 0.6, 0.25]))
    chosen = [draw(vehicle, rng, [name]) for name in faults]
    chosen = chosen or [draw(vehicle, rng, can) for _ in range(count)]
    early = any(FAULTS[n].kind in EARLY or set(FAULTS[n].signals) & set(EARLY) for n, _, _ in chosen)
    early = early and rng.random() < 0.5
    ahead, speed = traffic or str(rng.choice(list(TRAFFIC))), float(rng.uniform(10.0, 22.0))
    happens = max(at + float(rng.uniform(-3.0, 2.0)), 5.5)
    begun = [0.3 if early else at + 1.5 * k for k in range(len(chosen))]
    ended = [math.inf if early else at + 1.5 * k + lasts for k, (_, _, lasts) in enumerate(chosen)]
    plan = [Drawn(n, size, begun[k], ended[k]) for k, (n, size, _) in enumerate(chosen)]
    return Scene(vehicle, ahead, tuple(plan), speed, happens, early, grade, heavy)


class Run:
    """A scene in lock-step, what became of it, and what of that must not be."""

    def __init__(self, scene: Scene, rng: np.random.Generator, policy: str) -> None:
        self.scene = scene
        objects = TRAFFIC[scene.traffic](rng, scene.speed, scene.happens)
        limits = limits_of(scene.vehicle.truck, scene.load, scene.grade)
        road, truck = (lambda distance: scene.grade), scene.truck
        self.chain = Chain(scene.vehicle, rng, objects, policy, road, truck=truck, limits=limits)
        from_when = scene.begins if scene.traffic in HARMLESS else scene.happens
        self.witness = Witness(self.chain, scene.braking, from_when, scene.plan)
        first = objects[0]  # at what the truck drives with on such a road
        shield = self.chain.guard.shield
        assert shield is not None
        room = max(TIME_GAP_S * scene.speed, float(shield.steady_gap(np.array([scene.speed]))[0]) + 5.0)
        followed = Object(first.motion, room, first.comes, first.leaves)
        self.chain.lane.objects = (followed, *objects[1:])
        self.engaged, self.why = False, ("not asked",)
        self.ended, self.reason, self.stood, self.alone = math.nan, "", False, False
        self.start, self.gained = scene.speed, 0.0
        self.false_since, self.false_s = math.nan, 0.0
        self._undo: dict[Drawn, Callable[[], None] | None] = {}
        self._lied = frozenset(s for d in scene.plan for s in _told(scene.vehicle, d))

    def to_the_end(self, length: float) -> Run:
        """Drive until it is over."""
        scene, chain = self.scene, self.chain
        by_person = any(FAULTS[d.name].machine in ("driver", "person") for d in scene.plan)
        end = max(scene.begins, scene.happens if scene.traffic != "steady" else 0.0) + length
        while chain.now < end and not self._is_over():
            chain.step()
            self._let_faults_act()
            if not self.engaged and chain.now >= ENGAGED_AT:
                self.why = chain.engage()
                self.engaged = not self.why
                if self.why and chain.now > ENGAGED_AT + 0.6:
                    break
            self._note()
            if not scene.early:
                handed_back = chain.now > self.ended + AFTER_S
                self.witness.look(judged=self.engaged and not by_person and not handed_back)
        chain.close()
        if math.isnan(self.ended):
            self.gained = chain.truck.speed - self.start
        return self

    def _is_over(self) -> bool:
        # what happens ahead after the hand-back is the driver's
        rolls_out = self.scene.traffic in HARMLESS or self.ended < self.witness.happens
        stands = self.chain.truck.speed < 0.1
        since = self.chain.now - self.ended
        over = (since > AFTER_S and (stands or rolls_out)) or since > TAKES_OVER_S
        return over or not math.isnan(self.witness.hit)

    def _let_faults_act(self) -> None:
        chain = self.chain
        for d in self.scene.plan:
            if d not in self._undo and chain.now >= d.at:
                self.start = self.start if self._undo else chain.truck.speed
                self._undo[d] = begin(chain, d.name, d.size)
            if (undo := self._undo.get(d)) and chain.now >= d.until:
                undo()
                self._undo[d] = None
            if FAULTS[d.name].machine == "driver" and chain.now >= d.at + 0.5:
                chain.truck.driver.brake_pedal = d.size

    def _note(self) -> None:
        """When and why control is lost, and for how long it is kept on a false speed."""
        chain, holds = self.chain, self.chain.state == "engaged"
        if self.engaged and not holds and math.isnan(self.ended):
            self.ended, self.gained = chain.now, chain.truck.speed - self.start
            self.stood = chain.truck.speed < 0.1  # it may be handed back to a driver who is to drive off
            self.alone = chain.lane.seen[0] > REACH_M  # it cannot follow what the radar does not reach
            self.reason = chain.following.why or chain.bridge.safety.reason
        if not (holds and self._undo and chain.contradicted(self._lied)):
            self.false_since = math.nan
            return
        self.false_since = chain.now if math.isnan(self.false_since) else self.false_since
        self.false_s = max(self.false_s, chain.now - self.false_since)

    def verdict(self) -> Verdict:
        """What is broken of it."""
        scene, witness = self.scene, self.witness
        unseen = list[str]()
        broken = self._control() + ([] if scene.early else self._frames())
        nearer = scene.traffic == "adjacent lane" or any(FAULTS[d.name].kind == "other" for d in scene.plan)
        hit, braked = self._hit(), witness.braked < (YIELDED if nearer else BRAKED)
        if hit:
            (unseen if hit == "not prevented" else broken).append("hit")
        if braked:
            known = self._known and not self._brakes_by_itself
            (broken if known else unseen).append("braked without cause")
        fully = math.nan if witness.fully is None else witness.fully.hit_speed
        ended = scene.begins if scene.early else self.ended
        return Verdict(
            str(scene), scene.traffic, scene.plan, ended - scene.begins, self.false_s, self.gained,
            witness.braked, witness.hit, fully, tuple(broken), tuple(unseen),
            self.reason if self.engaged else f"refused: {', '.join(self.why)}",
        )  # fmt: skip

    @property
    def _known(self) -> bool:
        """A receiver can know of every fault."""
        return not {d.name for d in self.scene.plan} & UNSEEN.keys()

    @property
    def _brakes_by_itself(self) -> bool:
        """A brake that drags, or is stuck."""
        return any(d.name in ("brake drags", "brake stuck") for d in self.scene.plan)

    def _frames(self) -> list[str]:
        return frames(self.chain, {d.name for d in self.scene.plan}, self.scene.begins)

    def _control(self) -> list[str]:
        """What is wrong with when control was given, kept and handed back."""
        scene, kept, broken = self.scene, math.isnan(self.ended), list[str]()
        if self.false_s > KEPT_S:
            broken.append("control was kept on a false speed")
        if scene.early:
            return broken + ["engaged"] * self.engaged
        too_near = "too near" in ", ".join(self.why)
        if not self.engaged and scene.braking > 2.5 and not too_near:
            broken.append("did not engage")
        lasting = ((d.name, d.size, d.until - d.at) for d in scene.plan)
        must = any(must_end(*d, scene.vehicle) for d in lasting)
        if self.engaged and kept and must and math.isnan(self.witness.hit):
            broken.append("control was kept")
        bridge = not self.alone and all(must_bridge(d.name, d.until - d.at) for d in scene.plan)
        if self.ended < scene.begins or (not kept and bridge and not self.stood):
            broken.append("handed back")
        return broken

    def _hit(self) -> str:
        """Whether it hit something harder than by full braking, or only what nobody could prevent."""
        scene, witness = self.scene, self.witness
        harmless, fully = scene.traffic in HARMLESS, witness.fully
        if math.isnan(witness.hit) or (fully is not None and witness.hit <= fully.hit_speed + WORSE):
            return ""
        if self.ended < witness.happens or self.reason.startswith("driver"):
            return ""  # the driver had it
        blind = self.ended < witness.known_at and not (harmless and self._known)
        blind |= fully is None and not (harmless and self._known)
        return "not prevented" if blind or self.reason == UNHEARD else "hit"


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
    scene = draw_scene(rng, load(names[seed % len(names)]), faults, traffic, drawn_from)
    return Run(scene, rng, policy).to_the_end(length).verdict()


def _told(vehicle: Vehicle, drawn: Drawn) -> tuple[str, ...]:
    """Signals of the truck that a fault lies about."""
    machine, _, signals, _ = FAULTS[drawn.name]
    if machine not in ("bus", "driver"):
        return ()
    return signals if signals != ("all",) else tuple(s.name for h in vehicle.table.heard for s in h.signals)


def _row(name: str, mine: list[Verdict]) -> str:
    """A line of the report."""
    ended = [v.ended_s for v in mine if not math.isnan(v.ended_s)]
    longest = f"{max(ended):.2f}" if ended else "-"
    worst = min(v.braked for v in mine)
    hits = [v for v in mine if not math.isnan(v.hit)]
    met = [f"{v.hit:.1f} ({v.fully:.1f})" for v in sorted(hits, key=lambda v: -v.hit)[:3]]
    bad = sum(bool(v.broken) for v in mine), sum(bool(v.unseen) for v in mine)
    shown = f"{len(ended)}, {longest} | {max(v.false_s for v in mine):.2f} | {worst:.1f}"
    return f"| {name} | {len(mine)} | {shown} | {len(hits)} | {', '.join(met)} | {bad[0]} | {bad[1]} |"


HEADS = "runs | handed back, at most s | false speed, s | braked, m/s² | hits"
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
